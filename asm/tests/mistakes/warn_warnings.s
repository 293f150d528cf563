; Nothing but warnings.
.const UNUSED = 3
.const _QUIET = 3
.input  x, y
.output F, G
.reg    a b c _d
.period
period: fadd    a, x, 1e-50
        fadd    b, a, 1
        fadd    F, b, @m3
        fadd    _d, b, 1
        jmp     end
end:

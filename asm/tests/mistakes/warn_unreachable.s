; Code that nothing leads to.
.include "with/law.s"
.input  x
.output y
.reg    a
.once
        wait    period
        nop
.period
        fadd    y, x, x
        wait    period
        fadd    y, x, y
        jmp     lost
lost:   fmul    y, y, y
        wait    period
_spare: fmul    y, y, x
        ret
end:    halt

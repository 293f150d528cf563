; Bundles: on the machine with three slots they issue together, on the one with a single slot in an order that keeps
; their meaning.
.input  x
.output F
.state  a b
.reg    p s k
.once
        mov     a, zero || fadd b, x, 1
        nop
        jmp     period
.period
period: fmul    p, a, b || fadd s, a, b || flt k, a, b
        fadd    b, p, s ||
        ; the bundle continues
        mov     a, s

        fadd    F, a, b || bnz k, other
        wait    period
other:  st      [zero], a || fadd F, a, 0
        rdflags k
        ld      a, 0 || fmul p, k:float, a
        fadd    F, p, a
        wait    period || fadd F, a, p

.reg a b c d
.period
        fmul    a, 1, 2 || fadd b, 1, 2 || fsub c, 1, 2
        mov     c, 1 || ld d, 3 || ilt d, 1, 2
        fmul    a, 1, 2 || fadd b, 1, 2 || mov c, 1 || nop

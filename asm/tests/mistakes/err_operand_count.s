.reg a
.period
        mov     a
        mov     a, 1, 2
        nop     a
        halt
        fadd    a

.reg a b
.period
        fadd    a b, 1
        fadd    a, b 1
        mov     a, 1 mov b, 2

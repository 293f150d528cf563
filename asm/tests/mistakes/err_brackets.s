.reg a
.const X = (1 + 2
.const Y = 1 + 2)
.const Z = sqrt(2
.period
        ld      a, 3[a
        ld      a, 3[]
        ld      a, 3]
        mov     a{1, 2

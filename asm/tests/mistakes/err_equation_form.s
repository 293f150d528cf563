; Equations that are not of the language.
.input  x
.output y
.reg    a b P[2]
.once
        wait    period
.period
period:
        y = P[]
        y + 1 = x
        a, = x
        y = x y
        y := x
        KP = 3                          ; a constant without its directive
        y = 2 x
        y = x # 2
        .rep i, 1, 2 = 3
        .endr
        wait    period

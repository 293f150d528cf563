; Equations that cannot be read.
.input  x
.output y
.reg    a b P[2]
.reg    Q[0] P[3]
.reg    R[2,]
.reg    S[0] @ m3
.reg    P[1] @ m4
.reg    T[1,1,1,1,1,1,1,1,1] U[1e9]
.input  z[3]
.once
        wait    period
.period
period:
        y =
        y = x +
        y = (x + 1
        y = x + 1)
        = x
        y = x ? 1
        y = x ? 1 :
        y == x
        y = x = 2
        y = x || a = b
        fadd a, x, x || b = x
        y = sqrt x
        y = P[1
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

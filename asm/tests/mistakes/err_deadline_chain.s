; A deadline that a long chain misses: of its operations the first and the last are shown.
.input  x
.output y
.reg    t
.schedule on
.period
period: .deadline y = 20
        fmul    t, x, x
        .rep    i, 1, 9
        fmul    t, t, x
        .endr
        fadd    y, t, x
        wait    period

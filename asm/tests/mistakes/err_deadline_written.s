; What stands as it is written is held to its demands, too.
.input  a, b
.output x, y
.reg    t
.period
period: .deadline y = 11
        .order  y, x
        fmul    t, a, b
        fadd    x, a, b
        fadd    y, t, b
        wait    period
.once
        .deadline x = 5         ; no order makes this one
        .deadline y = 6         ; by another order
        fadd    x, a, b
        fadd    y, a, b
        wait    period

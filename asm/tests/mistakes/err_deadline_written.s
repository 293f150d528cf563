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
        .deadline y = 30
        fadd    x, a, b
        fadd    y, a, b
        wait    period

; Deadlines that no schedule meets, and cycles and orders that are not known.
.input  a, b, c
.output chain, crowd, first, second, after
.reg    t u x
.schedule on
.period
period: .deadline chain = 20
        .deadline crowd = 12
        .deadline after = 100
        .order  first, after
        fmul    t, a, b
        fadd    t, t, c
        fmul    u, t, t
        fdiv    chain, u, b
        .rep    i, 1, 9
.reg    v{i}
        fmul    v{i}, a, i
        .endr
        .rep    i, 1, 3
.reg    w{i}
        sel     w{i}, v{i}, v{i + 3}, v{i + 6}
        .endr
        sel     crowd, w1, w2, w3
        fadd    first, a, b
        fadd    second, first, c
        bz      a, skip
        fadd    x, a, b
skip:   fadd    after, x, c
        wait    period
.once
        mov     x, zero
        wait    period

.rep i, 1, 230
.output f{i}
.endr
.rep i, 1, 300
.input p{i}
.endr
.state a
.preset a = 1
.rep i, 1, 230
.state m{i}
.endr
.once
.rep i, 1, 230
        fmul    m{i}, a, a
.endr
.period
period:
.rep i, 1, 230
        fmul    f{i}, m{i}, m{i}
        fadd    a, a, p{i}
.endr
.rep i, 231, 300
        fadd    a, a, p{i}
.endr
        wait    period

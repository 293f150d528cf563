; An order that the program's own contradicts.
.input  a, b
.output first, second
.reg    t
.schedule on
.period
period: .order  second, first
        fadd    first, a, b
        fmul    t, first, b
        fadd    second, t, a
        wait    period

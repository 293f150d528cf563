; Demands on ports that cannot be kept, or mean nothing.
.input  a, b, c
.output sum, quotient, never, late
.reg    t u
.order  sum, quotient           ; `.once` writes neither
.schedule on
.period
period: .deadline quotient = 20
        .deadline sum = 0
        .deadline a = 10
        .order  t, sum
        .order  sum, sum
        .order  nothing, sum
        .late   sum
        .late   a = -1
        .late   b = 1.5
        fmul    t, a, b
        fadd    t, t, c
        fmul    u, t, t
        fdiv    quotient, u, b
        fadd    sum, u, a
        fsqrt   never, t
        fsqrt   late, u
        wait    period

.reg a b
.reg placed @ m3
.state s t
.output F
.once
        fadd    t, zero, zero
.period
period: fadd    F, a, b
        fadd    F, placed, 1
        fadd    t, s, t
        wait    period

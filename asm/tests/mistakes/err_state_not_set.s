.state s
.output F
.period
period: fadd    s, s, 1
        fadd    F, s, 0
        wait    period

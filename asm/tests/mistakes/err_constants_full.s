; More constants than there are registers.
.output F
.period
.rep i, 1, 700
        fadd    F, i, F
.endr

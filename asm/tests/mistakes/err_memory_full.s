; machine f1
.output F
.data
table:  .space 1000
more:   .float 1
        .space 100
.period
.rep i, 1, 2049
        fadd    F, F, F
.endr

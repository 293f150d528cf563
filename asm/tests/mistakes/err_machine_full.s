; machine f3
.machine f3 code=64 data=4096
.output y
.data
table:  .space 4000
more:   .space 20064
.period
p:      ld      y, 4999[zero]
.rep i, 1, 64
        fadd    y, y, 1
.endr
        wait    p

; machine f3
.machine f3 data=24064
.input  x
.output y
.period
.machine f3 data=32768
p:      fadd    y, x, x
        wait    p

; machine f3
.machine f3 date=4096
.output y
.period
p:      fadd    y, 1, 1
        wait    p

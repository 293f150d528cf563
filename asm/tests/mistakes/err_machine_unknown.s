; machine f3
.machine t5 data=4096
.output y
.period
p:      fadd    y, 1, 1
        wait    p

.const AREA = pi*RADIUS^2
.const RADIUS = 2
.rep i, 1, COUNT
.endr
.const COUNT = 3
.once
        double
.macro double
.endm

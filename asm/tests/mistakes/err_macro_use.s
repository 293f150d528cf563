.reg a
.macro double x, by
        fmul    x, x, by
.endm
.macro double y
.endm
.macro mov x
.endm
.macro twice x, x
.endm
.period
        double  a
        double  a, 2 || nop
        double  a, nothing
        double  3, a
        double  [a], 2

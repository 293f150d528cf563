; Mistakes of a body are shown where they stand, with the uses that led there.
.reg a
.macro inner x
        fmul    x, x, gain
.endm
.macro outer y
        inner   y
        fadd    y, 1
.endm
.period
.rep i, 1, 2
        outer   a
.endr

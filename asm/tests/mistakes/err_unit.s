; machine f1
; What f1 has no unit for is refused at its line, in a macro too.
.output angle, other
.macro  turn    d, y, x
        fatan2  d, y, x
.endm
        fsin    angle, 0.5
        turn    angle, 1.0, -1.0
        facos   other, 0.5
        halt

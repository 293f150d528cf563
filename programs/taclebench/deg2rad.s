; The degrees of a circle, 361 values, in radians.

.array  x[361] y[361]
.output done
.schedule on
.contract on
.once
        mov     done, zero
        wait    period
.period
period:
.for i, 1, 361 unroll 8
        y[i] = x[i]*(pi/180)
.endfor
        done = 1
        wait    period

; For `takt accuracy`: the degrees of a circle.
.range  x = 0, 360
.result y
; SPDX-License-Identifier: MIT OR Apache-2.0

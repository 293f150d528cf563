; Cosines of 200 angles.

.array  x[200] y[200]
.output done
.schedule on
.contract on
.once
        mov     done, zero
        wait    period
.period
period:
.for i, 1, 200 unroll 4
        y[i] = cos(x[i])
.endfor
        done = 1
        wait    period

; For `takt accuracy`: angles within 63 turns; the unit takes 64.
.range  x = -126*pi, 126*pi
.result y
; SPDX-License-Identifier: MIT OR Apache-2.0

; The product of two vectors of 256.

.include <arrays.s>
.array  x[256] y[256] d[1]
.output done
.schedule on
.contract on
.once
        mov     done, zero
        wait    period
.period
period:
        array_dot d[1], x, y, 256
        done = 1
        wait    period

; For `takt accuracy`: data in units of their full scale.
.range  x, y = -1, 1
.result d
; SPDX-License-Identifier: MIT OR Apache-2.0

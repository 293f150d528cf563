; A 12×12 matrix times a vector.

.include <arrays.s>
.array  A[12,12] x[12] y[12]
.output done
.schedule on
.contract on
.once
        mov     done, zero
        wait    period
.period
period:
        array_matvec y, A, x, 12, 12
        done = 1
        wait    period

; For `takt accuracy`: data in units of their full scale.
.range  A, x = -1, 1
.result y
; SPDX-License-Identifier: MIT OR Apache-2.0

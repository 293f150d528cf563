; Least squares by reflections: sixteen equations for eight unknowns.

.include <arrays.s>
.array  A[16,8] b[16] x[8]
.output done
.schedule on
.contract on
.once
        mov     done, zero
        wait    period
.period
period:
        array_qr_solve x, A, b, 16, 8
        done = 1
        wait    period

; For `takt accuracy`: a matrix and a right side in units of the largest element.
.range  A, b = -1, 1
.result x
; SPDX-License-Identifier: MIT OR Apache-2.0

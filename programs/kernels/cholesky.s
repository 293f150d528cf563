; Twelve equations with a symmetric and positive definite matrix.

.include <arrays.s>
.array  A[12,12] b[12] x[12]
.output done
.schedule on
.contract on
.once
        mov     done, zero
        wait    period
.period
period:
        array_cholesky_solve x, A, b, 12
        done = 1
        wait    period

; For `takt accuracy`: a matrix and a right side in units of the largest element.
.range  A, b = -1, 1
.result x
; SPDX-License-Identifier: MIT OR Apache-2.0

; Six equations, with pivoting.

.include <matrix.s>
.array  A[6,6] b[6] x[6]
.reg    v[6]
.output done
.schedule on
.contract on
.once
        mov     done, zero
        wait    period
.period
period:
        lu_solve v, A, b, 6
.rep i, 1, 6
        x[i] = v[i]
.endr
        done = 1
        wait    period

; For `takt accuracy`: a matrix and a right side in units of the largest element.
.range  A, b = -1, 1
.result x
; SPDX-License-Identifier: MIT OR Apache-2.0

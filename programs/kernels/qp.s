; A quadratic program with bounds: 20 variables, 20 iterations.

.include <control.s>
.array  M[20,20] q[20] low[20] high[20] z[20] y[20]
.output done
.schedule on
.contract on
.once
        mov     done, zero
        wait    period
.period
period:
        qp_box  z, y, M, q, low, high, 2.0, 20, 20
        done = 1
        wait    period

; For `takt accuracy`: a problem in units of its bounds; M is the inverse of a matrix whose eigenvalues are at least the penalty, 2.
.range  M = -0.5, 0.5
.range  q = -1, 1
.range  low = -1, 0
.range  high = 0, 1
.range  z = -1, 1
.range  y = -20, 20
.result z
; SPDX-License-Identifier: MIT OR Apache-2.0

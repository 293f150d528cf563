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
; SPDX-License-Identifier: MIT OR Apache-2.0

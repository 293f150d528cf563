; Model-predictive control: 12 states, 4 inputs, a horizon of 10, bounds on states and inputs, 10 iterations.

.machine t3 code = 2048
.include <control.s>
.array  A[12,12] B[12,4] K[4,12] C[4,4] M[12,12] x[12] u[9,4] q[10,12] r[9,4] g[10,12] y[9,4]
.output done
.schedule on
.contract on
.once
        mov     done, zero
        wait    period
.period
period:
        mpc_admm u, x, A, B, K, C, M, g, y, q, r, 0.75, 0.25, 2, 12, 4, 10, 10
        done = 1
        wait    period
; SPDX-License-Identifier: MIT OR Apache-2.0

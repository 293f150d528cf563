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

; For `takt accuracy`: a model whose states and inputs are in units of their full scale; duals and costs that remain from the period before
; are within the bounds' sum.
.range  A, B, K, C, M = -1, 1
.range  x = -0.75, 0.75
.range  u = -100, 100
.range  g, y = -100, 100
.range  q, r = -400, 400
.result u
; SPDX-License-Identifier: MIT OR Apache-2.0

; A Kalman filter of 12 states, of which 3 combinations are measured, all matrices dense.

.include <control.s>
.array  F[12,12] H[3,12] Q[12,12] R[3,3] P[12,12] x[12] z[3]
.output done
.schedule on
.contract on
.once
        mov     done, zero
        wait    period
.period
period:
        kalman_step x, P, F, Q, H, R, z, 12, 3
        done = 1
        wait    period

; For `takt accuracy`: a model whose states and measurements are in units of their full scale.
.range  F, H, Q, R = -1, 1
.range  P = -1, 1
.range  x, z = -1, 1
.result x, P
; SPDX-License-Identifier: MIT OR Apache-2.0

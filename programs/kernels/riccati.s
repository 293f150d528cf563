; A step of the Riccati recursion: 12 states, 4 inputs.

.include <control.s>
.array  A[12,12] B[12,4] Q[12,12] R[4,4] P[12,12] K[4,12]
.output done
.schedule on
.contract on
.once
        mov     done, zero
        wait    period
.period
period:
        riccati_step P, K, A, B, Q, R, 12, 4
        done = 1
        wait    period

; For `takt accuracy`: a model whose states and inputs are in units of their full scale.
.range  A, B, Q, R, P = -1, 1
.result P, K
; SPDX-License-Identifier: MIT OR Apache-2.0

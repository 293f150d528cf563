; A policy 48-128-128-12 with ReLU: three layers.

.machine t3 data = 32768
.include <arrays.s>
.array  W1[128,48] b1[128] W2[128,128] b2[128] W3[12,128] b3[12] x[48] y[12] v[128] w[128]
.output done
.schedule on
.contract on
.once
        mov     done, zero
        wait    period
.period
period:
        dense_rows v, W1, b1, x, 128, 48, relu
        dense_rows w, W2, b2, v, 128, 128, relu
        dense   y, W3, b3, w, 12, 128, linear
        done = 1
        wait    period

; For `takt accuracy`: observations and weights of a network whose inputs are normalised.
.range  W1, W2, W3, b1, b2, b3, x = -1, 1
.result y
; SPDX-License-Identifier: MIT OR Apache-2.0

; Two layers, 24-24-12, with ReLU between them.

.include <arrays.s>
.array  W1[24,24] b1[24] W2[12,24] b2[12] x[24] v[24] y[12]
.output done
.schedule on
.contract on
.once
        mov     done, zero
        wait    period
.period
period:
        dense_rows v, W1, b1, x, 24, 24, relu
        dense   y, W2, b2, v, 12, 24, linear
        done = 1
        wait    period

; For `takt accuracy`: observations and weights of a network whose inputs are normalised.
.range  W1, W2, b1, b2, x = -1, 1
.result y
; SPDX-License-Identifier: MIT OR Apache-2.0

; Two layers, 24-24-12, with tanh behind each.

.include <math.s>
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
        dense_rows v, W1, b1, x, 24, 24, linear
        activate v, 24, tanh
        dense   y, W2, b2, v, 12, 24, tanh
        done = 1
        wait    period

; For `takt accuracy`: observations and weights of a network whose inputs are normalised.
.range  W1, W2, b1, b2, x = -1, 1
.result y
; SPDX-License-Identifier: MIT OR Apache-2.0

; Activations of layers, 64 values each.

.include <math.s>
.include <arrays.s>
.array  a[64] b[64] c[64] d[64]
.output done
.schedule on
.contract on
.once
        mov     done, zero
        wait    period
.period
period:
        activate a, 64, tanh
        activate b, 64, tanh_quick
        activate c, 64, sigmoid
        activate d, 64, elu
        done = 1
        wait    period

; For `takt accuracy`: sums of a layer; beyond 8, tanh is 1 to the last digit but one.
.range  a, b, c, d = -8, 8
.result a, b, c, d
; SPDX-License-Identifier: MIT OR Apache-2.0

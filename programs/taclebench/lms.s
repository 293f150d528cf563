; An adaptive filter of 21 coefficients (least mean squares) that predicts the next of 201 values. The first 20 of x are zeros: the past.

.array  x[222] y[201]
.output done
.schedule on
.contract on
.once
        mov     done, zero
        wait    period
.period
period:
.reg    b[21] h[21] e
.rep k, 1, 21
        b[k] = 0
.endr
.for i, 1, 201
.rep k, 1, 21
        h[k] = x[i+21-k]
.endr
        y[i] = sum(g, 1, 3, sum(k, 0, 6, b[3*k+g]*h[3*k+g]))
        e = (0.5*0.02/21)*(x[i+21] - y[i])
.rep k, 1, 21
        b[k] = b[k] + e*h[k]
.endr
.endfor
        done = 1
        wait    period

; For `takt accuracy`: a signal in units of its full scale.
.range  x = -1, 1
.result y
; SPDX-License-Identifier: MIT OR Apache-2.0

; Four sections of second order.

.include <signal.s>
.array  c[4,5] u[1] y[1]
.state  s[4,2]
.rep i, 1, 4
.preset s[i,1] = 0
.preset s[i,2] = 0
.endr
.output done
.schedule on
.contract on
.once
        mov     done, zero
        wait    period
.period
period:
        biquads y[1], u[1], c, s, 4
        done = 1
        wait    period

; For `takt accuracy`: a signal in units of its full scale; coefficients of sections whose poles lie within the unit circle, and states of
; sections that do not resonate.
.range  c = -2, 2
.range  u = -1, 1
.range  s = -8, 8
.result y
; SPDX-License-Identifier: MIT OR Apache-2.0

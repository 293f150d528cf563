; A filter of 64 taps.

.include <signal.s>
.array  h[64] u[1] y[1]
.state  s[63]
.rep i, 1, 63
.preset s[i] = 0
.endr
.output done
.schedule on
.contract on
.once
        mov     done, zero
        wait    period
.period
period:
        fir     y[1], u[1], h, s, 64
        done = 1
        wait    period

; For `takt accuracy`: a signal in units of its full scale; taps up to 1/16, so that the filter's gain is at most 4.
.range  u = -1, 1
.range  h = -1/16, 1/16
.range  s = -4, 4
.result y
; SPDX-License-Identifier: MIT OR Apache-2.0

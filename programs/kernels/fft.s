; The Fourier transform of 256 complex values.

.machine t3 data = 2048
.include <signal.s>
.array  r[256] m[256] u[256] v[256] c[192] s[192]
.output done
.schedule on
.contract on
.once
        fft256_table c, s
        mov     done, zero
        wait    period
.period
period:
        fft256  r, m, u, v, c, s
        done = 1
        wait    period

; For `takt accuracy`: data in units of their full scale.
.range  r, m = -1, 1
.range  c, s = -1, 1
.result r, m
; SPDX-License-Identifier: MIT OR Apache-2.0

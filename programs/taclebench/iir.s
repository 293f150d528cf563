; Four sections of second order in direct form, one value; the states are read only, as in the original.

.array  c[4,5] w[5] x[1] y[1]
.output done
.schedule on
.contract on
.once
        mov     done, zero
        wait    period
.period
period:
.reg    v[5] s[4]
        v[1] = x[1]
.rep f, 1, 4
        s[f] = v[f] - c[f,1]*w[f] - c[f,2]*w[f+1]
        v[f+1] = c[f,3]*s[f] + c[f,4]*w[f] + c[f,5]*w[f+1]
.endr
        y[1] = v[5]
        done = 1
        wait    period

; For `takt accuracy`: data in units of their full scale, coefficients of sections whose poles lie within the unit circle.
.range  c = -2, 2
.range  w, x = -1, 1
.result y
; SPDX-License-Identifier: MIT OR Apache-2.0

; A filter in two dimensions, 3×3, over an image of 4×4 with a border of zeros.

.array  c[3,3] image[4,4] y[4,4] a[6,6]
.output done
.schedule on
.contract on
.once
        mov     done, zero
        wait    period
.period
period:
.rep i, 1, 4
.rep j, 1, 4
        a[i+1,j+1] = image[i,j]
.endr
.endr
.for i, 1, 4 unroll 1
.rep j, 1, 4
        y[i,j] = sum(k, 1, 3, c[k,1]*a[i+k-1,j] + c[k,2]*a[i+k-1,j+1] + c[k,3]*a[i+k-1,j+2])
.endr
.endfor
        done = 1
        wait    period

; For `takt accuracy`: data in units of their full scale; the border is zeros.
.range  c, image = -1, 1
.range  a = -1, 1
.result y
; SPDX-License-Identifier: MIT OR Apache-2.0

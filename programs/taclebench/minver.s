; The inverse and the determinant of a 3×3 matrix, by Gauss and Jordan with pivoting.

.array  A[3,3] B[3,3] determinant[1]
.output done
.schedule on
.contract on
.once
        mov     done, zero
        wait    period
.period
period:
.reg    a[3,6] r d g:int
.rep i, 1, 3
.rep j, 1, 3
        a[i,j] = A[i,j]
        a[i,j+3] = i == j
.endr
.endr
        d = 1
.rep k, 1, 3
.rep i, k + 1, 3
        g = abs(a[k,k]) < abs(a[i,k])
        d = g ? -d : d
.rep j, k, 6
        a[k,j], a[i,j] = g ? a[i,j] : a[k,j], g ? a[k,j] : a[i,j]
.endr
.endr
        d = d*a[k,k]
        r = 1/a[k,k]
.rep j, k + 1, 6
        a[k,j] = a[k,j]*r
.endr
.rep i, 1, 3
.if i != k
.rep j, k + 1, 6
        a[i,j] = a[i,j] - a[i,k]*a[k,j]
.endr
.endif
.endr
.endr
.rep i, 1, 3
.rep j, 1, 3
        B[i,j] = a[i,j+3]
.endr
.endr
        determinant[1] = d
        done = 1
        wait    period

; For `takt accuracy`: a matrix in units of the largest element.
.range  A = -1, 1
.result B, determinant
; SPDX-License-Identifier: MIT OR Apache-2.0

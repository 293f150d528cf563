; Six equations by triangular factors, without pivoting.

.array  A[6,6] b[6] x[6]
.output done
.schedule on
.contract on
.once
        mov     done, zero
        wait    period
.period
period:
.reg    l[6,6] u[6,6] r[6] y[6] z[6]
.rep i, 1, 6
.rep j, i, 6
        u[i,j] = A[i,j] - sum(k, 1, i - 1, l[i,k]*u[k,j])
.endr
        .assume u[i,i] >= 0.1           ; of a matrix that needs no pivoting, in units of its largest element
        r[i] = 1/u[i,i]
.rep j, i + 1, 6
        l[j,i] = (A[j,i] - sum(k, 1, i - 1, l[j,k]*u[k,i]))*r[i]
.endr
        y[i] = b[i] - sum(k, 1, i - 1, l[i,k]*y[k])
.endr
.rep h, 1, 6
        z[7-h] = (y[7-h] - sum(k, 8 - h, 6, u[7-h,k]*z[k]))*r[7-h]
        x[7-h] = z[7-h]
.endr
        done = 1
        wait    period

; For `takt accuracy`: a matrix and a right side in units of the largest element.
.range  A, b = -1, 1
.result x
; SPDX-License-Identifier: MIT OR Apache-2.0

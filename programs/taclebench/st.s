; Statistics of two arrays of 1,000: sums, means, variances, standard deviations, and their correlation.

.machine t3 data = 4096
.array  A[1000] B[1000] result[9]       ; sums; means; variances; deviations; correlation
.output done
.schedule on
.contract on
.once
        mov     done, zero
        wait    period
.period
period:
.reg    s[8] t[8] n[4] v[4] w[4] m[2] q[3] d[2] a[4] b[4]
.rep k, 1, 8
        s[k], t[k] = 0, 0
.endr
.for i, 1, 1000 step 8
.rep k, 1, 8
        s[k], t[k] = s[k] + A[i+k-1], t[k] + B[i+k-1]
.endr
.endfor
        result[1] = ((s[1] + s[2]) + (s[3] + s[4])) + ((s[5] + s[6]) + (s[7] + s[8]))
        result[2] = ((t[1] + t[2]) + (t[3] + t[4])) + ((t[5] + t[6]) + (t[7] + t[8]))
        m[1], m[2] = result[1]*(1/1000), result[2]*(1/1000)
        result[3], result[4] = m[1], m[2]
.rep k, 1, 4
        n[k], v[k], w[k] = 0, 0, 0
.endr
.for i, 1, 1000 step 4
.rep k, 1, 4
        a[k], b[k] = A[i+k-1] - m[1], B[i+k-1] - m[2]
        n[k], v[k], w[k] = n[k] + a[k]*b[k], v[k] + a[k]*a[k], w[k] + b[k]*b[k]
.endr
.endfor
        q[1], q[2], q[3] = (n[1] + n[2]) + (n[3] + n[4]), (v[1] + v[2]) + (v[3] + v[4]), (w[1] + w[2]) + (w[3] + w[4])
        .assume q[2] >= 1               ; of data that vary
        .assume q[3] >= 1
        result[5], result[6] = q[2]*(1/1000), q[3]*(1/1000)
        d[1], d[2] = sqrt(q[2]*(1/1000)), sqrt(q[3]*(1/1000))
        result[7], result[8] = d[1], d[2]
        result[9] = q[1]/(sqrt(q[2])*sqrt(q[3]))
        done = 1
        wait    period

; For `takt accuracy`: data in units of their full scale.
.range  A, B = -1, 1
.result result
; SPDX-License-Identifier: MIT OR Apache-2.0

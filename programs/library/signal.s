; Macros for signals: filters, the Fourier transform, tables. `.include <signal.s>`.

; ---- Filters whose states are registers -----------------------------------------------------------------------------------

; y = h·(u, u one period ago, …): a filter of n taps in transposed form, whose delay line never moves. h is an array of registers, of
; memory, or the name of a macro's constants; s is a `.state` array of n, zero before the first period.
.macro fir y:float, u:float, h:float, s:float, n:number
        y = s[1] + u*h[1]
.rep i, 1, n - 2
        s[i] = s[i+1] + u*h[i+1]
.endr
        s[n-1] = u*h[n]
.endm

; y = u through n sections of second order, (b0 + b1·z⁻¹ + b2·z⁻²)/(1 + a1·z⁻¹ + a2·z⁻²), transposed form. Row i of c has b0, b1, b2, a1, a2
; of section i; s is a `.state` array n×2, zero before the first period.
.macro biquads y:float, u:float, c:float, s:float, n:number
.reg    v[n+1]
        v[1] = u
.rep i, 1, n
        v[i+1] = s[i,1] + c[i,1]*v[i]
        s[i,1] = s[i,2] + c[i,2]*v[i] - c[i,4]*v[i+1]
        s[i,2] = c[i,3]*v[i] - c[i,5]*v[i+1]
.endr
        y = v[n+1]
.endm

; ---- The Fourier transform -------------------------------------------------------------------------------------------------

; c[i], s[i] = cos, sin of 2π·(i - 1)/256: the arrays of 192 that `fft256` takes. For `.once`.
.macro  fft256_table c:float, s:float
.for i, 1, 192
.reg    angle
        angle = (itof(i) - 1)*(2*pi/256)
        c[i], s[i] = cos(angle), sin(angle)
.endfor
.endm

; X = Σ x·e^(-2πi·jk/256), in place: r and m are the real and imaginary parts, u and v arrays of 256 that it overwrites. Radix 4, in the
; order of Stockham, which needs no reversal of digits: from r, m to u, v and back, twice.
.macro  fft256 r:float, m:float, u:float, v:float, c:float, s:float
.reg    k[3,3] l[3,3]
.for p, 1, 64 unroll 4                  ; factors differ from butterfly to butterfly
        fft4    u, v, 4*p - 3, 1, r, m, p, 64, c[p], s[p], c[2*p-1], s[2*p-1], c[3*p-2], s[3*p-2]
.endfor
.for p, 1, 16                           ; four with the same
.reg    a[3] b[3]
.rep i, 1, 3
        a[i], b[i] = c[4*i*p-4*i+1], s[4*i*p-4*i+1]
.endr
.rep q, 1, 4
        fft4    r, m, 16*p - 16 + q, 4, u, v, 4*p - 4 + q, 64, a[1], b[1], a[2], b[2], a[3], b[3]
.endr
.endfor
.rep p, 1, 3                            ; four with factors that stay in registers
.rep i, 1, 3
        k[p,i], l[p,i] = c[16*p*i+1], s[16*p*i+1]
.endr
.endr
.for q, 1, 16
        fft4_plain u, v, q, 16, r, m, q, 64
.rep p, 1, 3
        fft4    u, v, q + 64*p, 16, r, m, q + 16*p, 64, k[p,1], l[p,1], k[p,2], l[p,2], k[p,3], l[p,3]
.endr
.endfor
.for q, 1, 64 unroll 4                  ; no factors
        fft4_plain r, m, q, 64, u, v, q, 64
.endfor
.endm

; A butterfly: from x[i], x[i+e], … to y[j], y[j+d], …, times the factors c - i·s.
.macro  fft4 yr:float, ym:float, j:int, d:number, xr:float, xm:float, i:int, e:number, c1:float, s1:float, c2:float, s2:float, c3:float, s3:float
.reg    tr[4] tm[4]
        fft4_sums tr, tm, xr, xm, i, e
        yr[j], ym[j] = tr[1], tm[1]
        yr[j+d], ym[j+d] = tr[2]*c1 + tm[2]*s1, tm[2]*c1 - tr[2]*s1
        yr[j+2*d], ym[j+2*d] = tr[3]*c2 + tm[3]*s2, tm[3]*c2 - tr[3]*s2
        yr[j+3*d], ym[j+3*d] = tr[4]*c3 + tm[4]*s3, tm[4]*c3 - tr[4]*s3
.endm

.macro  fft4_plain yr:float, ym:float, j:int, d:number, xr:float, xm:float, i:int, e:number
.reg    tr[4] tm[4]
        fft4_sums tr, tm, xr, xm, i, e
.rep h, 0, 3
        yr[j+h*d], ym[j+h*d] = tr[h+1], tm[h+1]
.endr
.endm

.macro  fft4_sums tr:float, tm:float, xr:float, xm:float, i:int, e:number
.reg    ar[2] am[2] br[2] bm[2]
.rep h, 0, 1
        ar[h+1], am[h+1] = xr[i+h*e] + xr[i+h*e+2*e], xm[i+h*e] + xm[i+h*e+2*e]
        br[h+1], bm[h+1] = xr[i+h*e] - xr[i+h*e+2*e], xm[i+h*e] - xm[i+h*e+2*e]
.endr
        tr[1], tm[1] = ar[1] + ar[2], am[1] + am[2]
        tr[2], tm[2] = br[1] + bm[2], bm[1] - br[2]
        tr[3], tm[3] = ar[1] - ar[2], am[1] - am[2]
        tr[4], tm[4] = br[1] - bm[2], bm[1] + br[2]
.endm

; ---- Tables in memory ------------------------------------------------------------------------------------------------------

; y = the table T of n values at x, linear between them: T[1] at x = 0, T[2] at x = 1, … Beyond its ends it stays as it is there.
.macro table1 y:float, T:float, x:float, n:number
.reg    part k:int
        table_place part, k, x, n
        y = T[k+1] + part*(T[k+2] - T[k+1])
.endm

; y = the table T of n×m values at row u and column v, bilinear between them: T[1,1] at u = v = 0. Beyond its ends it stays as it is there.
.macro table2 y:float, T:float, u:float, v:float, n:number, m:number
.reg    part right k:int l:int
        table_place part, k, u, n
        table_place right, l, v, m
.reg    low high
        low = T[k+1,l+1] + right*(T[k+1,l+2] - T[k+1,l+1])
        high = T[k+2,l+1] + right*(T[k+2,l+2] - T[k+2,l+1])
        y = low + part*(high - low)
.endm

; x within 0 to n - 1 as k, 0 to n - 2, and a part of 1. NaN is 0.
.macro table_place part:float, k:int, x:float, n:number
.reg    at
        at = min(max(x, 0), n - 1)
        at = at == at ? at : 0
        k = ftoi(max(at - 0.5, 0))      ; rounds; where two intervals meet, either will do
        k = k < n - 1 ? k : n - 2
        part = at - itof(k)             ; at is between k and k + 1
        .assume part >= 0
        .assume part <= 1
.endm
; SPDX-License-Identifier: MIT OR Apache-2.0

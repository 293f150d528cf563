; Macros for signals: filters, the Fourier transform, tables. `.include <signal.s>`.

; ---- Filters whose states are registers -----------------------------------------------------------------------------------

; y = h·(u, u one period ago, …): a filter of n taps in transposed form, whose delay line never moves. h is an array of registers, of
; memory, or the name of a macro's constants; s is a `.state` array of n, zero before the first period.
.macro fir y, u, h, s, n
        y = s[1] + u*h[1]
.rep i, 1, n - 2
        s[i] = s[i+1] + u*h[i+1]
.endr
        s[n-1] = u*h[n]
.endm

; y = u through n sections of second order, (b0 + b1·z⁻¹ + b2·z⁻²)/(1 + a1·z⁻¹ + a2·z⁻²), transposed form. Row i of c has b0, b1, b2, a1, a2
; of section i; s is a `.state` array n×2, zero before the first period.
.macro biquads y, u, c, s, n
.reg    v[n+1]
        v[1] = u
.rep i, 1, n
        v[i+1] = s[i,1] + c[i,1]*v[i]
        s[i,1] = s[i,2] + c[i,2]*v[i] - c[i,4]*v[i+1]
        s[i,2] = c[i,3]*v[i] - c[i,5]*v[i+1]
.endr
        y = v[n+1]
.endm

; ---- Tables in memory ------------------------------------------------------------------------------------------------------

; y = the table T of n values at x, linear between them: T[1] at x = 0, T[2] at x = 1, … Beyond its ends it stays as it is there.
.macro table1 y, T, x, n
.reg    part k:int
        table_place part, k, x, n
        y = T[k+1] + part*(T[k+2] - T[k+1])
.endm

; y = the table T of n×m values at row u and column v, bilinear between them: T[1,1] at u = v = 0. Beyond its ends it stays as it is there.
.macro table2 y, T, u, v, n, m
.reg    part right k:int l:int
        table_place part, k, u, n
        table_place right, l, v, m
.reg    low high
        low = T[k+1,l+1] + right*(T[k+1,l+2] - T[k+1,l+1])
        high = T[k+2,l+1] + right*(T[k+2,l+2] - T[k+2,l+1])
        y = low + part*(high - low)
.endm

; x within 0 to n - 1 as k, 0 to n - 2, and a part of 1. NaN is 0.
.macro table_place part, k, x, n
.reg    at
        at = min(max(x, 0), n - 1)
        at = at == at ? at : 0
        k = ftoi(max(at - 0.5, 0))      ; rounds; where two intervals meet, either will do
        k = k < n - 1 ? k : n - 2
        part = at - itof(k)
.endm
; SPDX-License-Identifier: MIT OR Apache-2.0

; Model-predictive control by ADMM: 12 states, 4 inputs, a horizon of 10, bounds on states and inputs, 10 iterations, in the form of
; TinyMPC: the gain K, C = (R + Bᵀ·P·B)⁻¹ and M = (A - B·K)ᵀ are those of the infinite horizon.
;
; From the state x: the inputs u. Duals g, y and linear costs q, r remain from period to period: a warm start.

.machine t3 code = 2048
.const  XB  = 0.75                      ; bounds of states and inputs
.const  UB  = 0.25
.const  RHO = 2                         ; penalty

.array  A[12,12] B[12,4] K[4,12] C[4,4] M[12,12] x[12] u[9,4] q[10,12] r[9,4] g[10,12] y[9,4] d[9,4]
.output done
.schedule on
.contract on

; The bounded value, its dual and its linear cost, of a value in one element.
.macro  slack value, dual, cost, bound
.reg    sum within over
        sum = value + dual
        within = sat(sum, bound)
        over = sum - within
        dual = over
        cost = RHO*(over - within)
.endm

.once
        mov     done, zero
        wait    period
.period
period:
; What both passes use stays in registers.
.reg    b[12,4] k[4,12]
.rep j, 1, 4
.rep i, 1, 12
        fadd    b[i,j], B[i,j], zero
        fadd    k[j,i], K[j,i], zero
.endr
.endr
.for n, 1, 10 unroll 1
.reg    p[12] s[12] t[4] h[4]
; Backwards: p from the last row of q, d = C·(Bᵀ·p + r), p = q + M·p - Kᵀ·r.
.rep i, 1, 12
        fadd    p[i], q[10,i], zero
.endr
.for m, 1, 9
.rep j, 1, 4
        h[j] = r[10-m,j]
        t[j] = h[j] + sum(i, 1, 12, b[i,j]*p[i])
.endr
.rep i, 1, 12
        s[i] = sum(l, 1, 12, M[i,l]*p[l])
.endr
.rep j, 1, 4
        d[10-m,j] = sum(l, 1, 4, C[j,l]*t[l])
.endr
.rep i, 1, 12
        p[i] = s[i] + (q[10-m,i] - sum(l, 1, 4, k[l,i]*h[l]))
.endr
.endfor
; Forwards: u = -K·x - d, x = A·x + B·u, each with its slack.
.reg    e[12]
.rep i, 1, 12
        fadd    e[i], x[i], zero
.endr
.for m, 1, 9
.rep j, 1, 4
        t[j] = -(d[m,j] + sum(l, 1, 12, k[j,l]*e[l]))
        u[m,j] = t[j]
        slack   t[j], y[m,j], r[m,j], UB
.endr
.rep i, 1, 12
        slack   e[i], g[m,i], q[m,i], XB
        s[i] = sum(l, 1, 12, A[i,l]*e[l])
.endr
.rep i, 1, 12
        e[i] = s[i] + sum(l, 1, 4, b[i,l]*t[l])
.endr
.endfor
.rep i, 1, 12
        slack   e[i], g[10,i], q[10,i], XB
.endr
.endfor
        done = 1
        wait    period
; SPDX-License-Identifier: MIT OR Apache-2.0

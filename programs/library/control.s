; Macros for estimation and control over arrays in data memory (`.array`), in counted loops: `.include <control.s>`.
;
; Sizes are the last arguments; matrices are dense. What a macro writes must be none of what it reads, unless a comment says so.

; ---- Kalman filters --------------------------------------------------------------------------------------------------------

; One step of a Kalman filter of n states and p measurements: prediction by x' = F·x with noise Q (n×n), correction by z = H·x
; with noise R (p×p). State x and covariance P are read and written.
.macro kalman_step x:float, P:float, F:float, Q:float, H:float, R:float, z:float, n:number, p:number
.array  m[n] N[n,n] G[n,p]
.reg    v[n] w[n,n] h[p,n] f[n] e[p]
.rep j, 1, n
        v[j] = x[j]
.endr
        kalman_keep w, h, F, H, n, p
.for i, 1, n
.rep k, 1, n
        f[k] = F[i,k]
.endr
        m[i] = sum(k, 1, n, f[k]*v[k])
        kalman_row N, G, f, w, h, P, Q, i, n, p
.endfor
.rep r, 1, p
        e[r] = z[r] - sum(k, 1, n, h[r,k]*m[k])
.endr
        kalman_correct x, P, m, N, G, R, h, e, n, p
.endm

; One step of an extended Kalman filter, whose model the program evaluates before: m = f(x) with its derivatives F by the state, and
; e = z - h(m) with its derivatives H by the state, all arrays in memory. State x and covariance P are written, P is read.
.macro ekf_step x:float, P:float, m:float, F:float, Q:float, e:float, H:float, R:float, n:number, p:number
.array  N[n,n] G[n,p]
.reg    w[n,n] h[p,n] f[n] d[p]
        kalman_keep w, h, F, H, n, p
.for i, 1, n
.rep k, 1, n
        f[k] = F[i,k]
.endr
        kalman_row N, G, f, w, h, P, Q, i, n, p
.endfor
.rep r, 1, p
        d[r] = e[r]
.endr
        kalman_correct x, P, m, N, G, R, h, d, n, p
.endm

; F and H in registers.
.macro kalman_keep w:float, h:float, F:float, H:float, n:number, p:number
.rep j, 1, n
.rep r, 1, p
        h[r,j] = H[r,j]
.endr
.rep i, 1, n
        fadd    w[i,j], F[i,j], zero
.endr
.endr
.endm

; Row i of N = F·P·Fᵀ + Q and of G = N·Hᵀ; f is that of F.
.macro kalman_row N:float, G:float, f:float, w:float, h:float, P:float, Q:float, i:int, n:number, p:number
.reg    q[n,n] t[n] u[n]
.rep j, 1, n
.rep k, 1, n
        q[k,j] = P[k,j]
.endr
        t[j] = sum(k, 1, n, f[k]*q[k,j])
.endr
.rep j, 1, n
        u[j] = Q[i,j] + sum(k, 1, n, t[k]*w[j,k])
        N[i,j] = u[j]
.endr
.rep r, 1, p
        G[i,r] = sum(k, 1, n, h[r,k]*u[k])
.endr
.endm

; x = m + K·e, P = N - K·Gᵀ, where K = G·S⁻¹, S = H·G + R = L·D·Lᵀ. With Y = L⁻¹·Gᵀ, K·Gᵀ is Yᵀ·D⁻¹·Y, symmetric.
.macro kalman_correct x:float, P:float, m:float, N:float, G:float, R:float, h:float, e:float, n:number, p:number
.reg    S[p,p] Y[p,n] c[p] L[p,p] inverse[p]
.rep j, 1, n
.rep r, 1, p
        Y[r,j] = G[j,r]
.endr
.endr
.rep r, 1, p
.rep k, 1, r
        S[r,k] = R[r,k] + sum(j, 1, n, Y[r,j]*h[k,j])
.endr
.endr
        array_factors L, inverse, S, p
        array_forward Y, L, p, n
.rep r, 1, p
        c[r] = e[r] - sum(k, 1, r - 1, L[r,k]*c[k])
.endr
.for i, 1, n
.reg    g[p] a[p] b[p]
.rep r, 1, p
        g[r] = G[i,r]
        a[r] = g[r] - sum(k, 1, r - 1, L[r,k]*a[k])
        b[r] = a[r]*inverse[r]
.endr
        x[i] = m[i] + sum(r, 1, p, b[r]*c[r])
.rep j, 1, n
        P[i,j] = N[i,j] - sum(r, 1, p, b[r]*Y[r,j])
.endr
.endfor
.endm

; ---- In registers, for the macros of this file ------------------------------------------------------------------------------

; S = L·D·Lᵀ, p×p, symmetric and positive definite, of which the lower triangle is read; L without its diagonal of ones, D as its inverse.
.macro array_factors L:float, inverse:float, S:float, p:number
.reg    u[p,p]
.rep j, 1, p
.rep i, j, p
        u[i,j] = S[i,j] - sum(k, 1, j - 1, u[i,k]*L[j,k])
.endr
        inverse[j] = 1/u[j,j]
.rep i, j + 1, p
        L[i,j] = u[i,j]*inverse[j]
.endr
.endr
.endm

; Y = L⁻¹·Y, p×n.
.macro array_forward Y:float, L:float, p:number, n:number
.rep r, 2, p
.rep j, 1, n
        Y[r,j] = Y[r,j] - sum(k, 1, r - 1, L[r,k]*Y[k,j])
.endr
.endr
.endm

; ---- The linear-quadratic regulator ------------------------------------------------------------------------------------------

; One step of the Riccati recursion of x' = A·x + B·u with costs xᵀ·Q·x + uᵀ·R·u, n states, m inputs:
; K = (R + Bᵀ·P·B)⁻¹·Bᵀ·P·A, and P = Q + Aᵀ·P·A - Kᵀ·Bᵀ·P·A, in place. The control law of this step is u = -K·x.
.macro riccati_step P:float, K:float, A:float, B:float, Q:float, R:float, n:number, m:number
.array  M[n,n] W[n,m] N[n,n] H[n,m]
.reg    w[n,n] b[n,m] q[n] t[n]
.rep j, 1, n
.rep r, 1, m
        b[j,r] = B[j,r]
.endr
.rep i, 1, n
        fadd    w[i,j], A[i,j], zero
.endr
.endr
.for i, 1, n                            ; by rows: M = P·A, W = P·B
.rep k, 1, n
        q[k] = P[i,k]
.endr
.rep j, 1, n
        M[i,j] = sum(k, 1, n, q[k]*w[k,j])
.endr
.rep r, 1, m
        W[i,r] = sum(k, 1, n, q[k]*b[k,r])
.endr
.endfor
.for j, 1, n                            ; by columns: N = Q + Aᵀ·M, H = Mᵀ·B, the transpose of Bᵀ·P·A
.rep k, 1, n
        t[k] = M[k,j]
.endr
.rep i, 1, n
        N[i,j] = Q[i,j] + sum(k, 1, n, w[k,i]*t[k])
.endr
.rep r, 1, m
        H[j,r] = sum(k, 1, n, b[k,r]*t[k])
.endr
.endfor
.reg    S[m,m] Y[m,n] inverse[m]
.if m > 1                               ; of one input, no part of L is used
.reg    L[m,m]
.endif
.rep r, 1, m
.rep k, 1, r
        S[r,k] = R[r,k] + sum(j, 1, n, b[j,r]*W[j,k])
.endr
.rep j, 1, n
        Y[r,j] = H[j,r]
.endr
.endr
        array_factors L, inverse, S, m
        array_forward Y, L, m, n
.reg    g[m] a[m] c[m] x[m]
.for i, 1, n
.rep r, 1, m
        g[r] = H[i,r]
        a[r] = g[r] - sum(k, 1, r - 1, L[r,k]*a[k])
        c[r] = a[r]*inverse[r]
.endr
.rep j, 1, n
        P[i,j] = N[i,j] - sum(r, 1, m, c[r]*Y[r,j])
.endr
.rep s, 1, m
        x[m+1-s] = c[m+1-s] - sum(k, m + 2 - s, m, L[k,m+1-s]*x[k])
        K[m+1-s,i] = x[m+1-s]
.endr
.endfor
.endm

; ---- Quadratic programs with bounds, by the alternating direction method of multipliers (ADMM) ---------------------------------

; A value within ±bound, its dual, and its linear cost of penalty rho.
.macro  admm_slack value:float, dual:float, cost:float, bound:float, rho:float
.reg    sum within over
        sum = value + dual
        within = sat(sum, bound)
        over = sum - within
        dual = over
        cost = rho*(over - within)
.endm

; z near the least of ½·xᵀ·H·x + qᵀ·x with low ≤ x ≤ high, vectors of n, after so many iterations from z and the dual y (warm start). M is
; (H + rho·1)⁻¹. z keeps the bounds; 4 divides n.
.macro qp_box z:float, y:float, M:float, q:float, low:float, high:float, rho:float, n:number, iterations:number
.array  w[n]
.for i, 1, n
        w[i] = rho*(z[i] - y[i]) - q[i]
.endfor
.reg    v[n] x sum within over
.for h, 1, iterations unroll 1
.rep j, 1, n
        v[j] = w[j]
.endr
.for i, 1, n
        x = sum(g, 1, 4, sum(j, 0, n/4 - 1, M[i,4*j+g]*v[4*j+g]))
        sum = x + y[i]
        within = min(max(sum, low[i]), high[i])
        over = sum - within
        z[i] = within
        y[i] = over
        w[i] = rho*(within - over) - q[i]
.endfor
.endfor
.endm

; Model-predictive control by ADMM in the form of TinyMPC: x' = A·x + B·u, n states, m inputs, a horizon of N states, bounds ±xb and ±ub.
;
; K, C = (R + Bᵀ·P·B)⁻¹ and M = (A - B·K)ᵀ are those of the infinite horizon, with the penalty rho in its costs. u, (N-1)×m, are the inputs;
; u[1,:] goes to the plant. Duals g, N×n, and y, (N-1)×m, and linear costs q, r of the same sizes remain from period to period: a warm start.
.macro mpc_admm u:float, x:float, A:float, B:float, K:float, C:float, M:float, g:float, y:float, q:float, r:float, xb:float, ub:float, rho:float, n:number, m:number, N:number, iterations:number
.array  d[N-1,m]
; What both passes use stays in registers.
.reg    b[n,m] k[m,n] p[n] s[n] t[m] h[m] e[n]
.rep j, 1, m
.rep i, 1, n
        fadd    b[i,j], B[i,j], zero
        fadd    k[j,i], K[j,i], zero
.endr
.endr
.for turn, 1, iterations unroll 1
; Backwards: p from the last row of q, d = C·(Bᵀ·p + r), p = q + M·p - Kᵀ·r.
.rep i, 1, n
        fadd    p[i], q[N,i], zero
.endr
.for l, 1, N - 1
.rep j, 1, m
        h[j] = r[N-l,j]
        t[j] = h[j] + sum(i, 1, n, b[i,j]*p[i])
.endr
.rep i, 1, n
        s[i] = sum(j, 1, n, M[i,j]*p[j])
.endr
.rep j, 1, m
        d[N-l,j] = sum(i, 1, m, C[j,i]*t[i])
.endr
.rep i, 1, n
        p[i] = s[i] + (q[N-l,i] - sum(j, 1, m, k[j,i]*h[j]))
.endr
.endfor
; Forwards: u = -K·x - d, x = A·x + B·u, each with its slack.
.rep i, 1, n
        fadd    e[i], x[i], zero
.endr
.for l, 1, N - 1
.rep j, 1, m
        t[j] = -(d[l,j] + sum(i, 1, n, k[j,i]*e[i]))
        u[l,j] = t[j]
        admm_slack t[j], y[l,j], r[l,j], ub, rho
.endr
.rep i, 1, n
        admm_slack e[i], g[l,i], q[l,i], xb, rho
        s[i] = sum(j, 1, n, A[i,j]*e[j])
.endr
.rep i, 1, n
        e[i] = s[i] + sum(j, 1, m, b[i,j]*t[j])
.endr
.endfor
.rep i, 1, n
        admm_slack e[i], g[N,i], q[N,i], xb, rho
.endr
.endfor
.endm
; SPDX-License-Identifier: MIT OR Apache-2.0

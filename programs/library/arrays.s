; Macros for matrices and vectors that lie in data memory (`.array A[12,12] x[12]`), in counted loops: `.include <arrays.s>`.
;
; Sizes are the last arguments. `<matrix.s>` has those for registers, which it writes out; these take program memory for a row or
; a few. What a macro writes must be none of what it reads, unless a comment allows it.

; d = x·y, vectors of n. Eight sums, added as a tree: the order differs from that of `sum`. 8 divides n.
.macro array_dot d, x, y, n
.reg    s[8]
.rep k, 1, 8
        s[k] = 0
.endr
.for i, 1, n step 8
.rep k, 1, 8
        s[k] = s[k] + x[i+k-1]*y[i+k-1]
.endr
.endfor
        d = ((s[1] + s[2]) + (s[3] + s[4])) + ((s[5] + s[6]) + (s[7] + s[8]))
.endm

; y = A·x, A n×m. x stays in registers; y may be x.
.macro array_matvec y, A, x, n, m
.reg    v[m]
.rep j, 1, m
        v[j] = x[j]
.endr
.for i, 1, n
        y[i] = sum(j, 1, m, A[i,j]*v[j])
.endfor
.endm

; C = A·B, A n×m, B m×p. So many rows of A at a time stay in registers, and share the loads of B: 2, 3 or 4 of those that divide n.
.macro array_matmul C, A, B, n, m, p, rows
.for i, 1, n step rows unroll 1
.reg    a[rows,m] b[m,p]
.rep r, 1, rows
.rep k, 1, m
        a[r,k] = A[i+r-1,k]
.endr
.endr
.rep j, 1, p
.rep k, 1, m
        b[k,j] = B[k,j]
.endr
.rep r, 1, rows
        C[i+r-1,j] = sum(k, 1, m, a[r,k]*b[k,j])
.endr
.endr
.endfor
.endm

; ---- Layers of a network -------------------------------------------------------------------------------------------------

; y = W·x + b, W n×m: a layer with many outputs, by rows. Up to 64 columns at a time, whose part of x stays in registers. A row has four
; sums, so that 4 divides m, and beyond 64 columns 64 does.
.macro dense_rows y, W, b, x, n, m
.if m <= 64
.reg    v[m]
.rep j, 1, m
        v[j] = x[j]
.endr
.for i, 1, n
        y[i] = b[i] + sum(g, 1, 4, sum(j, 0, m/4 - 1, W[i,4*j+g]*v[4*j+g]))
.endfor
.else
.for i, 1, n unroll 4
        y[i] = b[i]
.endfor
.for h, 0, m/64 - 1 unroll 1
.reg    v[64]
.rep j, 1, 64
        fadd    v[j], x[64*h+j], zero
.endr
.for i, 1, n
        y[i] = y[i] + sum(g, 1, 4, sum(j, 0, 15, W[i,64*h+4*j+g]*v[4*j+g]))
.endfor
.endfor
.endif
.endm

; y = max(y, 0), a vector of n: ReLU.
.macro relu y, n
.for i, 1, n unroll 4
        y[i] = max(y[i], 0)
.endfor
.endm

; y = W·x + b, W n×m: a layer with few outputs, by columns. The sums stay in registers; y may be x. 4 divides m.
.macro dense y, W, b, x, n, m
.reg    s[n]
.rep i, 1, n
        fadd    s[i], b[i], zero
.endr
.for j, 1, m step 4
.rep c, 0, 3
.rep i, 1, n
        s[i] = s[i] + W[i,j+c]*x[j+c]
.endr
.endr
.endfor
.rep i, 1, n
        y[i] = s[i]
.endr
.endm

; y = tanh(y), a vector of n. Needs `.include <math.s>`.
.macro array_tanh y, n
.for i, 1, n unroll 4
        y[i] = tanh(y[i])
.endfor
.endm

; ---- Linear equations ------------------------------------------------------------------------------------------------------

; A·x = b, A n×n, symmetric and positive definite, of which the lower triangle is read: A = L·D·Lᵀ without square roots. n is at least 3.
;
; The lower triangle is in registers, and each column shifts what is left of it to their beginning; the loop exists three times, for
; fewer and fewer rows. x may be b.
.macro array_cholesky_solve x, A, b, n
.array  L[2*n,n] y[n]                   ; row n + j: column j of L from its diagonal on. Rows up to n are zeros
.reg    a[n,n] t[n]
.rep i, 1, n
.rep j, 1, i
        fadd    a[i,j], A[i,j], zero
.endr
        fadd    t[i], b[i], zero
.endr
        cholesky_columns a, t, L, y, n, n, 1, int((n+2)/3)
        cholesky_columns a, t, L, y, n, n - int((n+2)/3), int((n+2)/3) + 1, 2*(int((n+2)/3))
        cholesky_columns a, t, L, y, n, n - 2*(int((n+2)/3)), 2*(int((n+2)/3)) + 1, n
.rep i, 1, n
        fadd    t[i], y[n+1-i], zero
.endr
.for j, 1, n unroll 1
.reg    s
        s = t[1]
        x[n+1-j] = s
.rep i, 2, n
        t[i-1] = t[i] - L[2*n+2-i-j,i]*s
.endr
        t[n] = 0
.endfor
.endm

; Columns first to last of L, and elements of y = D⁻¹·L⁻¹·b; a is the m×m matrix that is left, t the right side.
.macro cholesky_columns a, t, L, y, n, m, first, last
.for j, first, last unroll 1
.reg    p q u[m]
        p = 1/a[1,1]
        q = t[1]*p
        y[j] = q
.rep i, 2, m
        u[i] = a[i,1]*p
        L[n+j,i] = u[i]
.endr
.rep i, 2, m
.rep k, 2, i
        a[i-1,k-1] = a[i,k] - a[i,1]*u[k]
.endr
        t[i-1] = t[i] - a[i,1]*q
.endr
.rep k, 1, m
        fadd    a[m,k], zero, zero
.endr
        fadd    t[m], zero, zero
.endfor
.endm
; SPDX-License-Identifier: MIT OR Apache-2.0

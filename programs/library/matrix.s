; Macros for matrices and vectors, which are arrays of registers (`.reg A[3,3] v[3]`): `.include <matrix.s>`.
;
; Sizes are the last arguments. Sums are added up in the order of the index, each operation rounded once (under `.contract on` with
; its product). What a macro writes must be none of what it reads, unless a comment allows it: elements are written as computed.

; ---- Functions: `d = dot(a, b, 3)` or, as an instruction, `dot d, a, b, 3` --------------------------------------------

; d = a·b, vectors of n.
.macro dot d:float, a:float, b:float, n:number
        d = sum(i, 1, n, a[i]*b[i])
.endm

; d = |a|, a vector of n.
.macro norm d:float, a:float, n:number
        d = sqrt(sum(i, 1, n, a[i]*a[i]))
.endm

; d = aᵀ·M·b, a of n, M n×m, b of m.
.macro bilinear d:float, a:float, M:float, b:float, n:number, m:number
        d = sum(i, 1, n, a[i]*sum(j, 1, m, M[i,j]*b[j]))
.endm

; ---- Vectors -------------------------------------------------------------------------------------------------------------

; y = M·x, M n×m.
.macro matvec y:float, M:float, x:float, n:number, m:number
.rep i, 1, n
        y[i] = sum(j, 1, m, M[i,j]*x[j])
.endr
.endm

; y = Mᵀ·x, M n×m: x has n elements, y m.
.macro matvec_t y:float, M:float, x:float, n:number, m:number
.rep j, 1, m
        y[j] = sum(i, 1, n, M[i,j]*x[i])
.endr
.endm

; y = a×b, in three dimensions.
.macro cross y:float, a:float, b:float
        y[1] = a[2]*b[3] - a[3]*b[2]
        y[2] = a[3]*b[1] - a[1]*b[3]
        y[3] = a[1]*b[2] - a[2]*b[1]
.endm

; y = x + s·a, vectors of n. y may be x or a.
.macro axpy y:float, x:float, s:float, a:float, n:number
.rep i, 1, n
        y[i] = x[i] + s*a[i]
.endr
.endm

; ---- Matrices ------------------------------------------------------------------------------------------------------------

; C = A·B, A n×m, B m×p.
.macro matmul C:float, A:float, B:float, n:number, m:number, p:number
.rep i, 1, n
.rep j, 1, p
        C[i,j] = sum(k, 1, m, A[i,k]*B[k,j])
.endr
.endr
.endm

; C = A·Bᵀ, A n×m, B p×m.
.macro matmul_t C:float, A:float, B:float, n:number, m:number, p:number
.rep i, 1, n
.rep j, 1, p
        C[i,j] = sum(k, 1, m, A[i,k]*B[j,k])
.endr
.endr
.endm

; C = A + s·B, n×m. C may be A or B.
.macro matadd C:float, A:float, s:float, B:float, n:number, m:number
.rep i, 1, n
.rep j, 1, m
        C[i,j] = A[i,j] + s*B[i,j]
.endr
.endr
.endm

; C = s·A, n×m. C may be A.
.macro matscale C:float, s:float, A:float, n:number, m:number
.rep i, 1, n
.rep j, 1, m
        C[i,j] = s*A[i,j]
.endr
.endr
.endm

; C = Aᵀ, A n×m.
.macro transpose C:float, A:float, n:number, m:number
.rep i, 1, n
.rep j, 1, m
        C[j,i] = A[i,j]
.endr
.endr
.endm

; C = x·yᵀ, x of n, y of m.
.macro outer C:float, x:float, y:float, n:number, m:number
.rep i, 1, n
.rep j, 1, m
        C[i,j] = x[i]*y[j]
.endr
.endr
.endm

; C = 1, n×n.
.macro identity C:float, n:number
.rep i, 1, n
.rep j, 1, n
        C[i,j] = i == j
.endr
.endr
.endm

; ---- Linear equations ------------------------------------------------------------------------------------------------------

; L·Lᵀ = A, A n×n, symmetric and positive definite: the lower triangle of A is read, that of L written, with 1/L_ii in r.
.macro cholesky L:float, r:float, A:float, n:number
.rep j, 1, n
.if j > 1
        L[j,j] = sqrt(A[j,j] - sum(k, 1, j - 1, L[j,k]*L[j,k]))
.else
        L[j,j] = sqrt(A[j,j])
.endif
        r[j] = 1/L[j,j]
.rep i, j + 1, n
.if j > 1
        L[i,j] = (A[i,j] - sum(k, 1, j - 1, L[i,k]*L[j,k]))*r[j]
.else
        L[i,j] = A[i,j]*r[j]
.endif
.endr
.endr
.endm

; L·Lᵀ·x = b, with what `cholesky` has written. x may be b.
.macro cholesky_solve x:float, L:float, r:float, b:float, n:number
.reg    y[n]
.rep i, 1, n
.if i > 1
        y[i] = (b[i] - sum(k, 1, i - 1, L[i,k]*y[k]))*r[i]
.else
        y[i] = b[i]*r[i]
.endif
.endr
.rep h, 1, n
.if h > 1
        x[n+1-h] = (y[n+1-h] - sum(k, n + 2 - h, n, L[k,n+1-h]*x[k]))*r[n+1-h]
.else
        x[n] = y[n]*r[n]
.endif
.endr
.endm

; A·x = b, A n×n, by elimination with partial pivoting. Rows are exchanged by selection, so that the time is the same whatever the matrix.
; A singular matrix divides by zero. x may be b.
.macro lu_solve x:float, A:float, b:float, n:number
.reg    a[n,n+1] r[n] l g:int
.rep i, 1, n
.rep j, 1, n
        a[i,j] = A[i,j]
.endr
        a[i,n+1] = b[i]
.endr
.rep k, 1, n
.rep i, k + 1, n
        g = abs(a[k,k]) < abs(a[i,k])
.rep j, k, n + 1
        a[k,j], a[i,j] = g ? a[i,j] : a[k,j], g ? a[k,j] : a[i,j]
.endr
.endr
        r[k] = 1/a[k,k]
.rep i, k + 1, n
        l = a[i,k]*r[k]
.rep j, k + 1, n + 1
        a[i,j] = a[i,j] - l*a[k,j]
.endr
.endr
.endr
.rep h, 1, n
.if h > 1
        x[n+1-h] = (a[n+1-h,n+1] - sum(k, n + 2 - h, n, a[n+1-h,k]*x[k]))*r[n+1-h]
.else
        x[n] = a[n,n+1]*r[n]
.endif
.endr
.endm
; SPDX-License-Identifier: MIT OR Apache-2.0

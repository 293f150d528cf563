; Macros for matrices and vectors that lie in data memory (`.array A[12,12] x[12]`), in counted loops: `.include <arrays.s>`.
;
; Sizes are the last arguments. `<matrix.s>` has those for registers, which it writes out; these take program memory for a row or
; a few. What a macro writes must be none of what it reads, unless a comment allows it.

; d = x·y, vectors of n. Eight sums, added as a tree: the order differs from that of `sum`. 8 divides n.
.macro array_dot d:float, x:float, y:float, n:number
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
.macro array_matvec y:float, A:float, x:float, n:number, m:number
.reg    v[m]
.rep j, 1, m
        v[j] = x[j]
.endr
.for i, 1, n
        y[i] = sum(j, 1, m, A[i,j]*v[j])
.endfor
.endm

; C = A·B, A n×m, B m×p. So many rows of A at a time stay in registers, and share the loads of B: 2, 3 or 4 of those that divide n.
.macro array_matmul C:float, A:float, B:float, n:number, m:number, p:number, rows:number
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

; Activations, the last argument of a layer: linear, relu, tanh, tanh_quick, sigmoid, elu; all but the first two need `.include <math.s>`.
; Another one is a macro `layer_NAME d, x` of the program.
.macro layer_linear d:float, x:float
        d = x
.endm
.macro layer_relu d:float, x:float
        d = max(x, 0)
.endm
.macro layer_tanh d:float, x:float
        d = tanh(x)
.endm
.macro layer_tanh_quick d:float, x:float
        d = tanh_quick(x)
.endm
.macro layer_sigmoid d:float, x:float
        d = sigmoid(x)
.endm
.macro layer_elu d:float, x:float
        d = elu(x)
.endm

; y = f(y), a vector of n.
.macro activate y:float, n:number, f:name
.reg    s t
.for i, 1, n unroll 4
        s = y[i]
        layer_{f} t, s
        y[i] = t
.endfor
.endm

; y = f(W·x + b), W n×m: a layer with many outputs, by rows, whose activation overlaps with the next rows. Up to 128 columns at a time,
; whose part of x stays in registers. A row has four sums, so that 4 divides m, and beyond 128 columns 64 does.
.macro dense_rows y:float, W:float, b:float, x:float, n:number, m:number, f:name
.if m <= 128
.reg    v[m]
.rep j, 1, m
        v[j] = x[j]
.endr
.for i, 1, n
.reg    s t
        s = b[i] + sum(g, 1, 4, sum(j, 0, m/4 - 1, W[i,4*j+g]*v[4*j+g]))
        layer_{f} t, s
        y[i] = t
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
        activate y, n, f
.endif
.endm

; y = f(W·x + b), W n×m: a layer with few outputs, by columns. The sums stay in registers; y may be x. 4 divides m.
.macro dense y:float, W:float, b:float, x:float, n:number, m:number, f:name
.reg    s[n] t[n]
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
        layer_{f} t[i], s[i]
        y[i] = t[i]
.endr
.endm

; ---- Linear equations ------------------------------------------------------------------------------------------------------

; A·x = b, A n×n, symmetric and positive definite, of which the lower triangle is read: A = L·D·Lᵀ without square roots. n is at least 3.
;
; The lower triangle is in registers, and each column shifts what is left of it to their beginning; the loop exists three times, for
; fewer and fewer rows. x may be b.
.macro array_cholesky_solve x:float, A:float, b:float, n:number
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
.macro cholesky_columns a:float, t:float, L:float, y:float, n:number, m:number, first:number, last:number
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

; The x that makes |A·x - b| least, A n×m of full rank, n ≥ m ≥ 3; for n = m, A·x = b: A = Q·R by Householder's reflections. x may be b.
;
; As in `array_cholesky_solve`, the matrix is in registers, b as its last column, and each step shifts what is left of it to their
; beginning. So many registers, n·(m + 1), have to be free. A column that depends on those before divides by zero.
.macro array_qr_solve x:float, A:float, b:float, n:number, m:number
.array  R[2*m,m+1]                      ; row m + j: 1/R_jj, then row j of R from there on, and of Qᵀ·b. Rows up to m are zeros
.reg    a[n,m+1] t[m]
.rep i, 1, n
.rep j, 1, m
        qr_move a[i,j], A[i,j]
.endr
        qr_move a[i,m+1], b[i]
.endr
        qr_columns a, R, m, n, m + 1, 1, int((m+2)/3)
        qr_columns a, R, m, n - int((m+2)/3), m + 1 - int((m+2)/3), int((m+2)/3) + 1, 2*(int((m+2)/3))
        qr_columns a, R, m, n - 2*(int((m+2)/3)), m + 1 - 2*(int((m+2)/3)), 2*(int((m+2)/3)) + 1, m
.rep i, 1, m
        fadd    t[i], R[2*m+1-i,i+1], zero
.endr
.for j, 1, m unroll 1
.reg    s
        s = t[1]*R[2*m+1-j,1]
        x[m+1-j] = s
.rep i, 2, m
        t[i-1] = t[i] - R[2*m+2-i-j,i]*s
.endr
        t[m] = 0
.endfor
.endm

; Reflections first to last; a has the rows and columns that are left, b among them.
.macro qr_columns a:float, R:float, m:number, rows:number, columns:number, first:number, last:number
.for j, first, last unroll 1
.reg    square root corner p d[columns] u[rows] v
.rep i, 1, rows
        u[i] = a[i,1]
.endr
        square = sum(g, 1, 4, sum(i, 0, floor((rows-g)/4), u[4*i+g]*u[4*i+g]))
        root = sqrt(square)
        corner = u[1] < 0 ? -root : root
        v = u[1] + corner               ; the reflection's vector has this in place of u[1]
        p = 1/(square + abs(u[1])*root)
        R[m+j,1] = -1/corner
.rep k, 2, columns
        d[k] = (v*a[1,k] + sum(g, 1, 4, sum(i, int((5-g)/4), floor((rows-g)/4), u[4*i+g]*a[4*i+g,k])))*p
        R[m+j,k] = a[1,k] - d[k]*v
.rep i, 2, rows
        qr_less a[i-1,k-1], a[i,k], d[k], u[i]
.endr
.endr
.rep i, 1, rows - 1
        qr_move a[i,columns], zero
.endr
.rep k, 1, columns
        qr_move a[rows,k], zero
.endr
.endfor
.endm

; The matrix's registers are all in one bank, on a machine with fused operations in that of the slot `mul`, the larger one of two.
.macro qr_move d:float, x:float
.if has.fnma.mul
        fmul.mul d, x, 1.0
.else
        fadd    d, x, zero
.endif
.endm

; d = x - p·q.
.macro qr_less d:float, x:float, p:float, q:float
.if has.fnma.mul
        fnma.mul d, p, q, x
.else
        d = x - p*q
.endif
.endm
; SPDX-License-Identifier: MIT OR Apache-2.0

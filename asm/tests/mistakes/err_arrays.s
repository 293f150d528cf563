.array  A[2,3], b[0], c
.array  d[2] = 1, 2, 3
.array  e[2] @ m3
.array  f[2]:real
.reg    r n:int q
.input  z[2]
.output F
.preset A = 1
.period
period: r = A[3,1]
        r = A[1]
        r = A
        r = A[q,1]
        r = d[n*n]
        A = r
        d[1] = n
        fadd    r, d[7], d[1]
        mov     r, A
        ld      r, A[1,4]
        li      n, d[1]
        .const  w = d[1]
        z[3] = r
        r = z[0]
        F = 0
        wait    period

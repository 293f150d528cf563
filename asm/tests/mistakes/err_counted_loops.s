.array  A[4,4], x[4]
.reg    r[4] n:int q t
.output F
.period
period:
        .for    i, 1, 5 unroll 1
        x[i] = 0
        .endfor
        .for    i, 1, 4 unroll 1
        .for    j, 1, i
        A[i,j+1] = 0
        .endfor
        .endfor
        .for    i, 1, n
        x[i] = 0
        .endfor
        .for    i, 1, n max 5
        x[i] = 0
        .endfor
        .for    i, 1, n max 4
        r[i] = 0
        .endfor
        .for    i, 1, q max 4
        x[i] = 0
        .endfor
        .for    i, 1, 4 step 0
        .endfor
        .for    i, 1, 4 turns 2
        .endfor
        .for    i, 1, 4 step 1 step 1
        .endfor
        .for    i, 1, 70000
        t = 0
        .endfor
        .for    i, 1, n max 4 unroll 3
        x[i] = 0
        .endfor
        .for    i, 1, 9
        .for    j, 1, 9
        .for    k, 1, 9
        .for    l, 1, 9
        .for    m, 1, 9
        t = 1
        .endfor
        .endfor
        .endfor
        .endfor
        .endfor
        .for    i, 1, 9
        t = t + 1
        bnz     t, out
within: t = t + 2
        .endfor
        jmp     within
out:    .for    i, 1, 9 unroll 1
        .if i == 2
        .endif
        t = x[i*i]
        .endfor
        .for    i, 1, 4
        li      t, i
        F = t
        .endfor
        wait    period

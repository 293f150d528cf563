.array  a[9,9]
.input  x
.period
period:
        .for    i, 1, 9
        .for    j, 1, 9
        a[i,j] = x
        .endfor
        wait    period

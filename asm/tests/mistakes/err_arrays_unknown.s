.array  table[9] rows[3,3]
.input  x
.output y
.period
period:
        .for    i, 1, 9
        tabel[i] = x
        rows[1,2] = row[i,2]
        y = y + nothing[i]*gone[2*i-1]
        .endfor
        wait    period

; Arrays in data memory, counted loops, slices, arrays of ports.
.array  A[3,4] = 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12
.array  x[4], y[3], k[2]:int = 3, 1
.input  z[2], n:int
.output u[3]
.state  s[3]
.preset s = 0.5
.period
period:
        x[1:2] = z[:]                   ; both are written out: ports are registers
        x[3:4] = 0
        .for    i, 1, 3 unroll 1        ; runs
        y[i] = sum(j, 1, 4, A[i,j]*x[j])
        .endfor
        .for    i, 2, 3 unroll 1        ; a triangle: the sum is a loop, too
        y[i] = y[i] - sum(j, 1, i-1, A[i,j]*y[j])
        .endfor
        .for    i, 1, n max 3
        A[i,:] = 2*A[i,:]
        .endfor
        .for    i, 1, 3                 ; arrays of registers: written out
        s[i] = s[i] + y[i]
        u[i] = s[i]
        .endfor
        wait    period

.array  A[3,3], B[3,2], x[3], y[3]
.reg    t n:int
.output F
.period
period: x[:] = B[1,:]
        A[:,:] = x[:]
        t = x[:]
        x[:] = x[:]/x[1]
        A[:,1] = A[1,:]
        y[:] = x[1:n]
        x[2:3], y[2] = 1, 2
        x[1:2] = x[2:3] + x[1:2] + y[1:2] - later[1:2]
        x[2:3] = x[1:2] + x[3:4]
        A[1,2:3] = A[1,1:2] + A[1,3:4]
.array  later[2]
        F = t
        wait    period

; An integer where a float is meant, and where it is well.
.input  x, n:int
.output y, out, k:int
.reg    one two half count:int index scale z
.period
period: mov     one, 1
        fadd    y, x, one
        sel     two, n, 2, 2.0
        fmul    z, two, x
        fadd    y, y, z
        li      half, 3
        fmul    z, y, half
        fadd    y, y, z
        mov     count, 1
        iadd    k, count, n
        li      index, 7
        ishl    index, index, n
        mov     k, index
        mov     scale, 0
        fadd    y, y, scale
        li      scale, bits(0.5)
        fadd    y, y, scale
        mov     out, -5
        wait    period

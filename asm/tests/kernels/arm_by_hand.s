; arm.s, packed by hand for t3.
.const  R = 0.5
.input  x, y, z, vx, vy, vz, ax, ay, az
.output l, v, a
.reg    rv ry ra  xx yy zz ll k s1 s2  xv yv zv dv  vxx vyy vzz xa ya za b1 b2 b3 w
.period
period: .deadline l, v, a = 64
        fmul    ry, y, 2*R
        fmul    zz, z, z
        fmul    xx, x, x
        fmul    yy, y, y
        fmul    xv, x, vx
        fmul    yv, y, vy       || fsub k, R^2, ry
        fmul    zv, z, vz
        fmul    rv, vy, R
        fmul    vxx, vx, vx     || fadd ll, xx, yy
        fmul    vyy, vy, vy
        fmul    vzz, vz, vz     || fadd k, k, zz
        fmul    xa, x, ax       || fadd s1, xv, yv
        fmul    ya, y, ay       || fsub s2, zv, rv
        fmul    za, z, az
        fmul    ra, ay, R       || fadd b1, vxx, vyy
                                   fadd ll, k, ll
                                   fadd b2, vzz, xa
                                   fadd dv, s1, s2
                                   fadd b3, ya, za
        fsqrt   l, ll
                                   fadd b1, b1, b2
                                   fsub b3, b3, ra
                                   fadd b1, b1, b3
        fdiv    v, dv, l
        fmul    w, v, v
                                   fsub b1, b1, w
        fdiv    a, b1, l
        wait    period

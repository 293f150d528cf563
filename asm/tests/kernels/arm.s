; Inverse kinematics of one arm with derivatives, (7)-(11), in the order of the equations: the pivot lies at (0, R, 0).
.const  R = 0.5
.input  x, y, z, vx, vy, vz, ax, ay, az
.output l, v, a
.reg    rv ry ra  xx yy zz ll  xv yv zv dv s  vxx vyy vzz xa ya za b1 b2 b3 w
.schedule on
.period
period: .deadline l, v, a = 64
        fmul    ry, y, 2*R              ; l² = x² + y² + z² + R² - 2·R·y
        fmul    xx, x, x
        fmul    yy, y, y
        fmul    zz, z, z
        fsub    ll, R^2, ry
        fadd    ll, ll, zz
        fadd    xx, xx, yy
        fadd    ll, ll, xx
        fsqrt   l, ll
        fmul    xv, x, vx               ; v = (x·vx + y·vy + z·vz - R·vy) / l
        fmul    yv, y, vy
        fmul    zv, z, vz
        fmul    rv, vy, R
        fadd    dv, xv, yv
        fsub    s, zv, rv
        fadd    dv, dv, s
        fdiv    v, dv, l
        fmul    vxx, vx, vx             ; a = (vx² + vy² + vz² + x·ax + y·ay + z·az - R·ay - v²) / l
        fmul    vyy, vy, vy
        fmul    vzz, vz, vz
        fmul    xa, x, ax
        fmul    ya, y, ay
        fmul    za, z, az
        fmul    ra, ay, R
        fadd    b1, vxx, vyy
        fadd    b2, vzz, xa
        fadd    b3, ya, za
        fadd    b1, b1, b2
        fsub    b3, b3, ra
        fadd    b1, b1, b3
        fmul    w, v, v
        fsub    b1, b1, w
        fdiv    a, b1, l
        wait    period

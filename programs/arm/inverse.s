; Inverse kinematics of the six-axis arm, (2.22)-(2.39) of the second founding paper: tool position and orientation, tool point and
; configuration to joint angles. All eight solutions.
;
; The sine and cosine of an angle that has been found are taken algebraically, not through the angle: √(cx² + cy²) for
; cx·cos θ1 + cy·sin θ1, a product of complex numbers for θ2 + θ3. So the angles' arctangents lie beside the chain, and
; |cos| > 1 is a negative radicand.

.include "arm.s"
.schedule on

.input  x, y, z                         ; mm
.input  roll, pitch, yaw                ; degrees, up to ±23040
.input  tx, ty, tz                      ; mm, tool point in frame 6
.input  config0:int, config1:int, config2:int ; 0, or else the other branch: θ1 + π; elbow; wrist

.output th1, th2, th3, th4, th5, th6    ; degrees, in [-180, 180]
.output status:int                      ; 0 good; else the joints keep their last values:
                                        ; 1 out of reach, or an input that is no number; 2 wrist singularity; 3 the wrist's centre is on joint 1's axis

.const  straight = 0.5^20               ; of sin²(θ5): status 2 within 0.056° of θ5 = 0 or 180
.const  onaxis   = 1                    ; mm², of the distance squared: status 3

.once
        .rep i, 1, 6
        mov     th{i}, zero
        .endr
        wait    period

.period
period:

; ---- Orientation. With e = ∂w/∂pitch and f = ∂w/∂yaw/cos(pitch): u = -cos(roll)·e + sin(roll)·f, v = sin(roll)·e + cos(roll)·f. ----
.reg    rr rp ry  sr cr sp cp sy cy
        fmul    rr, roll, rad
        fmul    rp, pitch, rad
        fmul    ry, yaw, rad
.macro  sincos  s, c, r
        fsin    s, r
        fcos    c, r
.endm
        sincos  sr, cr, rr
        sincos  sp, cp, rp
        sincos  sy, cy, ry

; ---- Wrist's centre c = end - tx·u - ty·v - (tz + d6)·w -------------------------------------------------------------------
.reg    e ee f ff tl  h hh  up  wx wxx wy wyy wz wzz
        fmul    ee, tx, cr
        fmul    e, ty, sr
        fsub    e, e, ee                ; of the tool point along e
        fmul    f, tx, sr
        fmul    ff, ty, cr
        fadd    f, f, ff                ; and along f
        fadd    tl, tz, d6
        fmul    h, e, sp
        fmul    hh, tl, cp
        fsub    h, h, hh
        fmul    wx, h, cy
        fmul    wxx, f, sy
        fadd    wx, wx, wxx
        fadd    wx, x, wx
        fmul    wy, h, sy
        fmul    wyy, f, cy
        fsub    wy, wy, wyy
        fadd    wy, y, wy
        fmul    wz, e, cp
        fmul    wzz, tl, sp
        fadd    wz, wz, wzz
        fsub    up, z, d1
        fsub    wz, up, wz              ; above joint 2

; ---- θ1, (2.22): its cosine and sine are cx/r and cy/r, or their opposites ------------------------------------------------------
.reg    sgn1  r2 r2y r ri  c1 s1  sx sy1 t1
        sel     sgn1, config0, -1.0, 1.0
        fmul    r2, wx, wx
        fmul    r2y, wy, wy
        fadd    r2, r2, r2y
        fsqrt   r, r2
        fdiv    ri, sgn1, r
        fmul    c1, wx, ri
        fmul    s1, wy, ri
        fmul    sx, wx, sgn1
        fmul    sy1, wy, sgn1
        fatan2  t1, sy1, sx
        fmul    t1, t1, 1/rad

; ---- The triangle of upper arm and forearm: X radially, Z upward. The elbow's angle ψ has cosine K/(2·a2·L) and sine ±S/(2·a2·L), where
;      S² = (2·a2·L)² - K² = ((a2 + L)² - D)·(D - (a2 - L)²), D = X² + Z².
.reg    a1s X X2 Z2 D K  P1 P2 PP S
        sel     a1s, config0, -float(a1), float(a1)
        fsub    X, r, a1s               ; or its opposite
        fmul    X2, X, X
        fmul    Z2, wz, wz
        fadd    D, X2, Z2
        fsub    P1, (a2 + sqrt(L2))^2, Z2
        fsub    P1, P1, X2
        fsub    P2, Z2, (a2 - sqrt(L2))^2
        fadd    P2, P2, X2
        fmul    PP, P1, P2
        fsqrt   S, PP
        fsub    K, Z2, a2^2 + L2
        fadd    K, K, X2

; θ3 = α ∓ acos(K/(2·a2·L)), (2.29).
.reg    elbow ps t3 t3a far:int
        sel     elbow, config1, 1/rad, -1/rad
        fatan2  ps, S, K
        fmul    ps, ps, elbow
        fadd    t3, ps, alpha/rad
        fsub    t3a, t3, 360
        flt     far, 180, t3
        sel     t3, far, t3a, t3

; θ2: with A = 2·a2·(a2 + L·cos ψ) and B = 2·a2·L·sin ψ, the direction of (X + iZ)·(A - iB). (2.32)-(2.33), solved.
.reg    A  sd sda Xs ZA XB XA ZB t2
        sel     sd, config1, 1.0, -1.0
        fadd    A, K, 2*a2^2
        fmul    Xs, X, sgn1
        fmul    sda, S, sd              ; B
        fmul    ZA, wz, A
        fmul    XB, Xs, sda
        fsub    ZA, ZA, XB
        fmul    XA, Xs, A
        fmul    ZB, wz, sda
        fadd    XA, XA, ZB
        fatan2  t2, ZA, XA
        fmul    t2, t2, 1/rad

; cos and sin of θ2 + θ3: (X + iZ)/D · (a3 + i·d4)·(1 + (K ± iS)/(2·L²)).
.reg    Di Xd Zd  kx ky sa3 sd4  Gx Gxx Gy Gyy  c23 c23z s23 s23z
        fdiv    Di, 1.0, D
        fmul    Xd, Xs, Di
        fmul    Zd, wz, Di
        fmul    kx, K, a3/(2*L2)
        fadd    kx, kx, a3
        fmul    ky, K, d4/(2*L2)
        fadd    ky, ky, d4
        sel     sd4, config1, d4/(2*L2), -d4/(2*L2)
        sel     sa3, config1, a3/(2*L2), -a3/(2*L2)
        fmul    Gxx, S, sd4
        fsub    Gx, kx, Gxx
        fmul    Gyy, S, sa3
        fadd    Gy, ky, Gyy
        fmul    c23, Xd, Gx
        fmul    c23z, Zd, Gy
        fsub    c23, c23, c23z
        fmul    s23, Xd, Gy
        fmul    s23z, Zd, Gx
        fadd    s23, s23, s23z

; ---- Orientation seen from frame 1: cd, sd of yaw - θ1; radial parts of w, u, v; what crosses the arm -----------------------------
.reg    cd cdd sn snn  p q pu puu pv pvv uz vz  crsp srsp
        fmul    cd, c1, cy
        fmul    cdd, s1, sy
        fadd    cd, cd, cdd
        fmul    sn, c1, sy
        fmul    snn, s1, cy
        fsub    sn, sn, snn
        fmul    p, cp, cd
        fmul    q, cp, sn               ; the opposite of s1·w_x - c1·w_y
        fmul    crsp, cr, sp
        fmul    srsp, sr, sp
        fmul    pu, crsp, cd
        fmul    puu, sr, sn
        fsub    pu, pu, puu             ; c1·u_x + s1·u_y
        fmul    pv, srsp, cd
        fmul    pvv, cr, sn
        fadd    pv, pv, pvv             ; the opposite of c1·v_x + s1·v_y
        fmul    uz, cr, cp              ; -u_z
        fmul    vz, sr, cp              ; v_z

; ---- The wrist, (2.34)-(2.39). sin θ5 = ±√(…) divides both parts of θ4 and of θ6: only its sign matters ------------------------------
.reg    c5 c5z n nz n2 q2 s52 s5  side5 wrist qs t5 t4 t6  m mz k kz
        sel     side5, config2, 1.0, -1.0
        sel     wrist, config2, 1/rad, -1/rad
        fmul    c5, s23, p
        fmul    c5z, c23, sp
        fsub    c5, c5, c5z
        fmul    n, c23, p
        fmul    nz, s23, sp
        fadd    n, n, nz                ; cos θ4·sin θ5
        fmul    n2, n, n
        fmul    q2, q, q
        fadd    s52, n2, q2
        fsqrt   s5, s52
        fatan2  t5, s5, c5
        fmul    t5, t5, wrist
.reg    nn
        fmul    nn, n, side5
        fmul    qs, q, side5
        fneg    qs, qs
        fatan2  t4, qs, nn
        fmul    t4, t4, 1/rad
        fmul    pu, pu, side5
        fmul    pv, pv, side5
        fmul    uz, uz, side5
        fmul    vz, vz, side5
        fmul    m, s23, pu
        fmul    mz, c23, uz
        fadd    m, m, mz
        fneg    m, m                    ; cos θ6, times |sin θ5|
        fmul    k, s23, pv
        fmul    kz, c23, vz
        fadd    k, k, kz
        fneg    k, k                    ; sin θ6
        fatan2  t6, k, m
        fmul    t6, t6, 1/rad

; ---- Status --------------------------------------------------------------------------------------------------------------------
.reg    reached:int clear:int bent:int  bad:int good:int
        fle     reached, zero, PP       ; 0 if it is no number
        fle     clear, onaxis, r2
        fle     bent, straight, s52
        sel     bad, bent, 0, 2
        sel     bad, clear, bad, 3
        sel     bad, reached, bad, 1
        mov     status, bad
        ieq     good, bad, zero
        .rep i, 1, 6
        sel     th{i}, good, t{i}, th{i}
        .endr

        wait    period

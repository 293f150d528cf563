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

.const  straight = 0.5^10               ; of |sin θ5|: status 2 within 0.056° of θ5 = 0 or 180
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
.macro  sincos  s, c, r, angle
        fmul    r, angle, rad
        fsin    s, r
        fcos    c, r
.endm
        sincos  sr, cr, rr, roll
        sincos  sp, cp, rp, pitch
        sincos  sy, cy, ry, yaw

; ---- Wrist's centre c = end - tx·u - ty·v - (tz + d6)·w ---------------------------------------------------------------------------------
.reg    e ee f ff tl  tlcp spcy spsy  wx wxt wxe wxf  wy wyt wye wyf  wz wzt wze
        fmul    ee, tx, cr
        fmul    e, ty, sr
        fsub    e, e, ee                ; of the tool point along e
        fmul    f, tx, sr
        fmul    ff, ty, cr
        fadd    f, f, ff                ; and along f
        fadd    tl, tz, d6
        fmul    tlcp, tl, cp
        fmul    spcy, sp, cy
        fmul    spsy, sp, sy
        fmul    wxt, tlcp, cy
        fsub    wxt, x, wxt
        fmul    wxe, e, spcy
        fmul    wxf, f, sy
        fadd    wx, wxe, wxf
        fadd    wx, wxt, wx
        fmul    wyt, tlcp, sy
        fsub    wyt, y, wyt
        fmul    wye, e, spsy
        fmul    wyf, f, cy
        fsub    wy, wye, wyf
        fadd    wy, wyt, wy
        fmul    wzt, tl, sp
        fmul    wze, e, cp
        fadd    wze, wze, wzt
        fsub    wz, z, d1
        fsub    wz, wz, wze             ; above joint 2

; ---- θ1, (2.22): its cosine and sine are wx/r and wy/r, or their opposites ------------------------------------------------------
.reg    sgn1  r2 r2y r  sx sy1 t1
        sel     sgn1, config0, -1.0, 1.0
        fmul    r2, wx, wx
        fmul    r2y, wy, wy
        fadd    r2, r2, r2y
        fsqrt   r, r2
        fmul    sx, wx, sgn1
        fmul    sy1, wy, sgn1
        fatan2  t1, sy1, sx
        fmul    t1, t1, 1/rad

; ---- The triangle of upper arm and forearm: X = ±r - a1 radially, Z upward. The elbow's angle ψ has cosine K/(2·a2·L) and sine ±S/(2·a2·L),
;      S² = (2·a2·L)² - K² = ((a2 + L)² - D)·(D - (a2 - L)²), D = X² + Z² = r² + Z² + a1² - 2·a1·(±r). r is a root and late: it
;      enters S² with one product and one sum, S² = P1·P2 - (2·a1·r)² + (±r)·F. -----------------------------------------------------
.const  far  = (a2 + sqrt(L2))^2 - a1^2
.const  near = (a2 - sqrt(L2))^2 - a1^2
.reg    a1s a1t a1f  Z2 P1 P2 PP PPr F S  K Kr
        sel     a1s, config0, -float(a1), float(a1)
        sel     a1t, config0, -float(2*a1), float(2*a1)
        sel     a1f, config0, -float(4*a1), float(4*a1)
        fmul    Z2, wz, wz
        fsub    P1, far, Z2
        fsub    P1, P1, r2
        fsub    P2, Z2, near
        fadd    P2, P2, r2
        fmul    PP, P1, P2
        fmul    PPr, r2, (2*a1)^2
        fsub    PP, PP, PPr
        fsub    F, Z2, (far + near)/2
        fadd    F, F, r2
        fmul    F, F, a1f
        fmul    F, F, r
        fadd    PP, PP, F
        fsqrt   S, PP
        fadd    K, Z2, a1^2 - a2^2 - L2
        fadd    K, K, r2
        fmul    Kr, a1t, r
        fsub    K, K, Kr

; θ3 = α ∓ acos(K/(2·a2·L)), (2.29).
.reg    elbow ps t3 t3a beyond:int
        sel     elbow, config1, 1/rad, -1/rad
        fatan2  ps, S, K
        fmul    ps, ps, elbow
        fadd    t3, ps, alpha/rad
        fsub    t3a, t3, 360
        flt     beyond, 180, t3
        sel     t3, beyond, t3a, t3

; θ2: with A = 2·a2·(a2 + L·cos ψ) and B = 2·a2·L·sin ψ, the direction of (X + iZ)·(A - iB). (2.32)-(2.33), solved.
.reg    A  sd B X Xs ZA XB XA ZB t2
        sel     sd, config1, 1.0, -1.0
        fsub    X, r, a1s               ; or its opposite
        fmul    Xs, X, sgn1
        fadd    A, K, 2*a2^2
        fmul    B, S, sd
        fmul    ZA, wz, A
        fmul    XB, Xs, B
        fsub    ZA, ZA, XB
        fmul    XA, Xs, A
        fmul    ZB, wz, B
        fadd    XA, XA, ZB
        fatan2  t2, ZA, XA
        fmul    t2, t2, 1/rad

; cos and sin of θ2 + θ3, times D: (X + iZ)·(a3 + i·d4)·(1 + (K ± iS)/(2·L²)).
.reg    G  Tx Txx Ty Tyy  c23 c23z s23 s23z
        fadd    G, K, 2*L2
        fmul    Tx, Xs, a3/(2*L2)
        fmul    Txx, wz, d4/(2*L2)
        fsub    Tx, Tx, Txx
        fmul    Ty, Xs, d4/(2*L2)
        fmul    Tyy, wz, a3/(2*L2)
        fadd    Ty, Ty, Tyy
        fmul    c23, Tx, G
        fmul    c23z, Ty, B
        fsub    c23, c23, c23z
        fmul    s23, Ty, G
        fmul    s23z, Tx, B
        fadd    s23, s23, s23z

; ---- Orientation seen from frame 1, times ±r: radial parts of w, u, v; what crosses the arm. `al` and `ac` are ±r times cos and sin of θ1 - yaw --
.reg    rs  al all ac acc p q pu puu pv pvv wzr uz vz  crsp srsp
        fmul    rs, r, sgn1
        fmul    al, wx, cy
        fmul    all, wy, sy
        fadd    al, al, all
        fmul    ac, wy, cy
        fmul    acc, wx, sy
        fsub    ac, ac, acc
        fmul    p, cp, al
        fmul    q, cp, ac               ; s1·w_x - c1·w_y
        fmul    crsp, cr, sp
        fmul    srsp, sr, sp
        fmul    pu, crsp, al
        fmul    puu, sr, ac
        fadd    pu, pu, puu             ; c1·u_x + s1·u_y
        fmul    pv, srsp, al
        fmul    pvv, cr, ac
        fsub    pv, pv, pvv             ; the opposite of c1·v_x + s1·v_y
        fmul    wzr, sp, rs
        fmul    uz, cr, cp
        fmul    uz, uz, rs              ; -u_z
        fmul    vz, sr, cp
        fmul    vz, vz, rs              ; v_z

; ---- The wrist, (2.34)-(2.39), times ±r·D: sin θ5 = ±√(…) divides both parts of θ4 and of θ6: only its sign matters ---------------------
.reg    X2 D  c5 c5z n nz n2 q2 s52 s5  side side4 side6 wrist qs t5 t4 t6  m mz k kz
        fmul    X2, X, X
        fadd    D, X2, Z2
        sel     side, config2, 1.0, -1.0 ; of sin θ5
        sel     wrist, config2, 1/rad, -1/rad
        fmul    side4, side, sgn1       ; with the sign of ±r
        fneg    side6, side4
        fmul    c5, s23, p
        fmul    c5z, c23, wzr
        fsub    c5, c5, c5z
        fmul    c5, c5, sgn1
        fmul    n, c23, p
        fmul    nz, s23, wzr
        fadd    n, n, nz                ; cos θ4
        fmul    q, q, D                 ; sin θ4
        fmul    n2, n, n
        fmul    q2, q, q
        fadd    s52, n2, q2
        fsqrt   s5, s52
        fatan2  t5, s5, c5
        fmul    t5, t5, wrist
.reg    nn
        fmul    nn, n, side4
        fmul    qs, q, side4
        fatan2  t4, qs, nn
        fmul    t4, t4, 1/rad
        fmul    m, s23, pu
        fmul    mz, c23, uz
        fadd    m, m, mz
        fmul    m, m, side6             ; cos θ6
        fmul    k, s23, pv
        fmul    kz, c23, vz
        fadd    k, k, kz
        fmul    k, k, side6             ; sin θ6
        fatan2  t6, k, m
        fmul    t6, t6, 1/rad

; ---- Status --------------------------------------------------------------------------------------------------------------------
.reg    limit  reached:int clear:int bent:int  bad:int good:int
        fmul    limit, r, D
        fmul    limit, limit, straight
        fle     reached, zero, PP       ; 0 if it is no number
        fle     clear, onaxis, r2
        fle     bent, limit, s5
        sel     bad, bent, 0, 2
        sel     bad, clear, bad, 3
        sel     bad, reached, bad, 1
        mov     status, bad
        ieq     good, bad, zero
        .rep i, 1, 6
        sel     th{i}, good, t{i}, th{i}
        .endr

        wait    period

; For `takt accuracy`: a tool within the arm's reach, 1.5 m; 63 turns; a tool point of up to 0.5 m. An output keeps its value where there is no
; solution.
.range  x, y, z = -1500, 1500
.range  roll, pitch, yaw = -22680, 22680
.range  tx, ty, tz = -500, 500
.range  config0, config1, config2 = 0, 1
        .rep i, 1, 6
.range  th{i} = -360, 360
        .endr
; SPDX-License-Identifier: MIT OR Apache-2.0

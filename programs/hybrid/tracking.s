; One period of the hybrid robot's tracking algorithm, (7)-(37) of the
; founding paper, with shared work done once.
;
; Written in the order of the equations; the assembler packs the bundles
; (docs/scheduling.md). Where a formula differs from the printed one,
; the identity that leads from one to the other stands beside it.

.include "robot.s"
.schedule on

.const  gain = Ts*KI                    ; of the integrator, without boost
.const  J    = J0 + ms*c^2              ; kg·m², an arm about its pivot, with its slider
.const  Rc   = R/lcount                 ; R in counts

; ---- State, kept between periods -------------------------------------
.rep i, 1, 5
.state  np{i}:int                       ; counts one period ago
.state  s{i}                            ; integrator, times KI
.state  boost{i}                        ; (φ_t + 1)·Ts·KI as tc alone gives it, for the second half of the boost
.state  sg{i}                           ; sign of the reference velocity one period ago
.endr

.once
        .rep i, 1, 5
        mov     s{i}, zero
        mov     boost{i}, gain          ; the specification starts tc at 1 s, beyond Tc: no boost at power-on
        mov     sg{i}, zero
        .endr
        wait    first
first:                                  ; before the first period: previous position = first position
        .rep i, 1, 5
        mov     np{i}, n{i}
        .endr

.period
period:
        .late   n1, n2, n3, n4, n5 = 1  ; what needs no measurement goes before the sample, for up to a cycle

; ---- 1. Inverse kinematics with derivatives, (7)-(11) ----------------
; With |p_i| = R: l² = |d|² = x² + y² + z² + R² - 2·(x·xp + y·yp), and
; likewise d·v = x·vx + y·vy + z·vz - (xp·vx + yp·vy). The sum is taken
; about 1/2, as (small terms + (z² - 1/2)) + (R² + 1/2): z² - 1/2 is
; exact for 1/4 ≤ z² ≤ 1, so that only the last addition rounds at the
; size of the sum.
.const  xp = sqrt(3)/2*R                ; xp_2 = -xp_3; yp_1 = R, yp_2 = yp_3 = -R/2
; Of three like terms the sum's is added first, but in the lengths: from
; these leads the longest chain, and of its sum xy is late.
.macro  arms    s, f, px, py, sum       ; s_i = sum - f·(px·xp_i + py·yp_i), i = 1, 2, 3
.reg    px2 py2 py1 side
        fmul    px2, px, f*xp
        fmul    py2, py, f*R/2
        fmul    py1, py, f*R            ; yp_1 = -2·yp_2
        fadd    side, sum, py2
        fsub    {s}2, side, px2
        fadd    {s}3, side, px2
        fsub    {s}1, sum, py1
.endm
.reg    xx yy zz xy  px2 py2 py1 e2 e3  ll1 ll2 ll3
        fmul    xx, x, x
        fmul    yy, y, y
        fmul    zz, z, z
        fadd    xy, xx, yy
        fsub    zz, zz, 0.5
        fadd    xy, xy, zz
        fmul    px2, x, 2*xp
        fmul    py2, y, R
        fadd    py1, py2, py2           ; here not by a product: slot mul is full enough
        fsub    e2, py2, px2
        fadd    e3, py2, px2
        fsub    ll1, xy, py1
        fadd    ll2, xy, e2
        fadd    ll3, xy, e3
        .rep i, 1, 3
        fadd    ll{i}, ll{i}, R^2 + 0.5
        fsqrt   l{i}d, ll{i}            ; l = |d|
        .endr

; v = (d·(vx,vy,vz)) / l
.reg    xv yv zv dv  dv1 dv2 dv3
        fmul    xv, x, vx
        fmul    yv, y, vy
        fmul    zv, z, vz
        fadd    dv, xv, yv
        fadd    dv, dv, zv
        arms    dv, 1, vx, vy, dv
        .rep i, 1, 3
        fdiv    v{i}d, dv{i}, l{i}d
        .endr

; a = (vx² + vy² + vz² + d·(ax,ay,az) - v²) / l, with v² = (d·v)² / l²:
; no quotient waits for another.
.reg    vxx vyy vzz vv  xa ya za da  da1 da2 da3  w1 w2 w3
        fmul    vxx, vx, vx
        fmul    vyy, vy, vy
        fmul    vzz, vz, vz
        fmul    xa, x, ax
        fmul    ya, y, ay
        fmul    za, z, az
        fadd    vv, vxx, vyy
        fadd    vv, vv, vzz
        fadd    da, xa, ya
        fadd    da, da, za
        fadd    da, da, vv
        arms    da, 1, ax, ay, da
        .rep i, 1, 3
        fmul    w{i}, dv{i}, dv{i}
        fdiv    w{i}, w{i}, ll{i}
        .endr
        .rep i, 1, 3
        fsub    da{i}, da{i}, w{i}
        fdiv    a{i}d, da{i}, l{i}d
        .endr

; Table, (18)-(20).
        mov     th4d, alpha
        mov     th5d, gamma
        mov     om4d, omega_alpha
        mov     om5d, omega_gamma
        mov     ep4d, eps_alpha
        mov     ep5d, eps_gamma

; ---- 2. Encoders to positions and velocities; the difference of counts is exact ----
; Of the velocity only KV·v is wanted, and lengths are wanted in counts,
; too: exact up to 2^24, 4 m.
.rep i, 1, 5
.reg    p{i} c{i} dn{i}:int vel{i}
        itof    c{i}, n{i}
        fmul    p{i}, c{i}, count{i}
        isub    dn{i}, n{i}, np{i}
        mov     np{i}, n{i}
        itof    vel{i}, dn{i}
        fmul    vel{i}, vel{i}, KV*count{i}/Ts
.endr

; ---- 3. Forward kinematics, (14)-(15), in counts ---------------------
; With u = l1² - l2², w = l1² - l3²: y = -(u + w)/(6R), x = -(w - u)/(2√3R).
.reg    q1 q2 q3  u w uw  wu fx fxx fy fyy fzz fz
        .rep i, 1, 3
        fmul    q{i}, c{i}, c{i}
        .endr
        fsub    u, q1, q2
        fsub    w, q1, q3
        fadd    uw, u, w
        fsub    wu, w, u
        fmul    fx, wu, 1/(2*sqrt(3)*Rc) ; -x
        fmul    fxx, fx, fx
        fmul    fy, uw, 1/(6*Rc)
        fadd    fy, fy, Rc              ; R - y
        fmul    fyy, fy, fy
        fsub    fzz, q1, fxx
        fsub    fzz, fzz, fyy
        fsqrt   fz, fzz                 ; z = √(l1² - x² - (y - R)²)

; ---- 4. Reduced masses, (23), in kg ----------------------------------
; With b_i = kb/l_i: 2·kb²·c_ij = (l_i² + l_j² - 3R²)·b_i·b_j, and
;   M_ii = m_s + m_p + Σ_j [m_s·c_ij² + κ_j·(1 - c_ij²)]
;        = 3·m_s + m_p - Σ_j (m_s - κ_j)·(1 - c_ij²),
;   m_s - κ_j = 2·m_s·c/l_j - J/l_j² = J/kb²·b_j·(2·kb·m_s·c/J - b_j).
; kb is such that the factors J/kb² and 1/(2·kb²)² cancel.
.const  kb = (J/4/lcount^2)^(1/6)       ; counts; in the formula m
.reg    b1 b2 b3  t12 t13 t23 qm  s12 s13 s23  k1 k2 k3  M1 M2 M3
        .rep i, 1, 3
        fdiv    b{i}, kb, c{i}
        .endr
        fsub    qm, q1, 3*Rc^2
        fadd    t12, qm, q2
        fadd    t13, qm, q3
        fsub    t23, t12, w
        .rep i, 1, 3
        fsub    k{i}, 2*kb*ms*c/J*lcount, b{i}
        fmul    k{i}, k{i}, b{i}
        .endr
.macro  sine2   i, j                    ; s_ij = (2·kb²)²·(1 - c_ij²)
.reg    bb
        fmul    bb, b{i}, b{j}
        fmul    bb, bb, t{i}{j}
        fmul    bb, bb, bb
        fsub    s{i}{j}, 4*kb^4, bb
.endm
        sine2   1, 2
        sine2   1, 3
        sine2   2, 3
.macro  mass    i, j, sij, k, sik       ; M_i = 3·m_s + m_p - k_j·s_ij - k_k·s_ik
.reg    mj mk
        fmul    mj, k{j}, sij
        fmul    mk, k{k}, sik
        fadd    mj, mj, mk
        fsub    M{i}, 3*ms + mp, mj
.endm
        mass    1, 2, s12, 3, s13
        mass    2, 1, s12, 3, s23
        mass    3, 1, s13, 2, s23

; ---- 5. Gravity, (24)-(25), in closed form ---------------------------
; G_i = l_i·λ_i·m_z·g/z; 3R²·λ1 = R² - (u + w)/3, 3R²·λ2 = 3R²·λ1 + u,
; 3R²·λ3 = 3R²·λ1 + w; m_z = m_p + 3·m_s + q·Σ 1/l_i.
.reg    la1 la2 la3 third sb mg  G1 G2 G3
        fmul    third, uw, 1/3
        fsub    la1, Rc^2, third
        fadd    la2, la1, u
        fadd    la3, la1, w
        fadd    sb, b1, b2
        fadd    sb, sb, b3
        fmul    mg, sb, q/(kb*lcount)*g/(3*Rc^2)
        fadd    mg, mg, (mp + 3*ms)*g/(3*Rc^2)
        fdiv    mg, mg, fz
        .rep i, 1, 3
        fmul    G{i}, c{i}, la{i}
        fmul    G{i}, G{i}, mg
        .endr

; ---- 6. Table dynamics, (27) -----------------------------------------
.reg    G4
        fsin    G4, p4
        fmul    G4, G4, rm4*g

; ---- 7, 8. Control law, (28), (36), with the nonlinear integrator, (29)-(35), (37) ----
; The integrator is kept times KI, so its gain is (φ_t + 1)·Ts·KI. In
; place of tc the gain itself is kept: it starts at 2ξc - 1 times Ts·KI
; when the sign changes (tc = 0), and falls by the same amount every
; period, to ξc times at tc = Tc/2 and to 1 at tc = Tc. It is compared
; half a step off, where rounding does not matter.
.const  fall = 2*(xc - 1)*Ts/Tc*gain
.macro  integrator i, sign, e           ; s_i = sat(s_i + (φ_t + 1)·Ts·KI·e)
.reg    sg same:int later held eabs large:int early:int ramp step
        fsign   sg, sign
        feq     same, sg, sg{i}
        mov     sg{i}, sg
        fsub    later, boost{i}, fall
        fmax    later, later, gain
        sel     boost{i}, same, later, (2*xc - 1)*gain
        sel     held, same, later, gain ; tc ≤ 0: no boost in the period of the reversal itself
        fle     early, xc*gain - fall/2, held ; tc ≤ Tc/2
        fabs    eabs, e
        fle     large, ec{i}, eabs      ; φ_e
        sel     ramp, large, held, gain
        sel     ramp, early, xc*gain, ramp
        fmul    step, ramp, e
        fadd    step, s{i}, step
        fsat    s{i}, step, smax{i}*KI
.endm
.macro  control i, qd, vd, ad, sign     ; acc_i = KV·v_d - KV·v + KP·e + a_d + KI·s: what is late is added last. sign: of v_d
.reg    ff e
        fmul    ff, vd, KV
        .if i > 3                       ; the table's a_d is an input
        fadd    ff, ff, ad
        .endif
        fsub    e, qd, p{i}
        integrator i, sign, e
        fsub    ff, ff, vel{i}
        fmul    e, e, KP
        fadd    ff, ff, e
        .if i <= 3                      ; an arm's has been computed
        fadd    ff, ff, ad
        .endif
        fadd    acc{i}, ff, s{i}
.endm
.reg    acc1 acc2 acc3 acc4 acc5
        .if macro.feedforward           ; the variant tracking_friction.s: for the arms ff_i in place of M·a_d, for the table beyond it
.reg    ff1 ff2 ff3 ff4 ff5
        feedforward
        .rep i, 1, 3
        control i, l{i}d, v{i}d, zero, dv{i} ; d·v has v's sign
        fmul    acc{i}, acc{i}, M{i}
        fadd    ff{i}, ff{i}, G{i}
        fadd    F{i}, acc{i}, ff{i}
        .endr
        control 4, alpha, omega_alpha, eps_alpha, omega_alpha
        fmul    acc4, acc4, J44
        fadd    ff4, ff4, G4
        fadd    tau4, acc4, ff4
        control 5, gamma, omega_gamma, eps_gamma, omega_gamma
        fmul    acc5, acc5, J55
        fadd    tau5, acc5, ff5
        .else
        .rep i, 1, 3
        control i, l{i}d, v{i}d, a{i}d, dv{i} ; d·v has v's sign
        fmul    acc{i}, acc{i}, M{i}
        fadd    F{i}, acc{i}, G{i}
        .endr
        control 4, alpha, omega_alpha, eps_alpha, omega_alpha
        fmul    acc4, acc4, J44
        fadd    tau4, acc4, G4
        control 5, gamma, omega_gamma, eps_gamma, omega_gamma
        fmul    tau5, acc5, J55
        .endif

        wait    period

; ---- Ranges, on which `takt accuracy` rests; robot.s has those of the inputs ----
.rep i, 1, 3
.range  np{i} = 3160000, 3800000
.endr
.range  np4 = -131072, 131072
.range  np5 = -262144, 262144
.rep i, 1, 5
.range  s{i} = -smax{i}*KI, smax{i}*KI
.range  boost{i} = gain, (2*xc - 1)*gain
.range  sg{i} = -1, 1
.endr
; SPDX-License-Identifier: MIT OR Apache-2.0

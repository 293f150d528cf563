; One period of the hybrid robot's tracking algorithm with every equation evaluated as the founding paper prints it:
; nothing is shared between equations, v and a stand in the printed form, the 3x3 system of the gravity terms is solved in
; general form (Cramer's rule), velocities are differences of binary32 positions. For comparing cycles on the same work.

.include "robot.s"
.schedule on

.const  xp1 = 0
.const  yp1 = R
.const  xp2 = sqrt(3)/2*R
.const  yp2 = -R/2
.const  xp3 = -sqrt(3)/2*R
.const  yp3 = -R/2

.rep i, 1, 5
.state  pp{i}                           ; position one period ago
.state  s{i}                            ; integrator
.state  tc{i}                           ; s, boost time
.state  sg{i}                           ; sign of the reference velocity one period ago
.endr

.once
        .rep i, 1, 5
        mov     s{i}, zero
        mov     tc{i}, 1.0
        mov     sg{i}, zero
        .endr
        wait    first
first:                                  ; before the first period: previous position = first position
        .rep i, 1, 5
.reg    f{i}
        itof    f{i}, n{i}
        fmul    f{i}, f{i}, count{i}
        mov     pp{i}, f{i}
        .endr

.period
period:

; ---- 1. Inverse kinematics, (7)-(11) ---------------------------------------------------------------------------------
.macro  squared S, i                    ; S = (x - xp)² + (y - yp)² + z²
.reg    dx dy xx yy zz
        fsub    dx, x, xp{i}
        fsub    dy, y, yp{i}
        fmul    xx, dx, dx
        fmul    yy, dy, dy
        fmul    zz, z, z
        fadd    xx, xx, yy
        fadd    S, xx, zz
.endm
.macro  dot2    d, i, px, py, pz        ; d = 2·(x - xp)·px + 2·(y - yp)·py + 2·z·pz
.reg    dx dy xx yy zz
        fsub    dx, x, xp{i}
        fsub    dy, y, yp{i}
        fmul    xx, 2.0, dx
        fmul    xx, xx, px
        fmul    yy, 2.0, dy
        fmul    yy, yy, py
        fmul    zz, 2.0, z
        fmul    zz, zz, pz
        fadd    xx, xx, yy
        fadd    d, xx, zz
.endm
.macro  inverse i
.reg    S1 S2 S3 root2 root3 d2 half d3 dd v2 vx2 vy2 vz2 first power second
        squared S1, i                   ; l = √S
        fsqrt   l{i}d, S1

        squared S2, i                   ; v = ½·d/√S, d = 2·Σ d_k·v_k
        fsqrt   root2, S2
        dot2    d2, i, vx, vy, vz
        fmul    half, 0.5, d2
        fdiv    v{i}d, half, root2

        squared S3, i                   ; a = ½·(2·Σ v_k² + 2·Σ d_k·a_k)/√S - ¼·d²/S^(3/2)
        fsqrt   root3, S3
        dot2    d3, i, ax, ay, az
        fmul    vx2, 2.0, vx
        fmul    vx2, vx2, vx
        fmul    vy2, 2.0, vy
        fmul    vy2, vy2, vy
        fmul    vz2, 2.0, vz
        fmul    vz2, vz2, vz
        fadd    v2, vx2, vy2
        fadd    v2, v2, vz2
        fadd    v2, v2, d3
        fmul    v2, 0.5, v2
        fdiv    first, v2, root3
        dot2    dd, i, vx, vy, vz
        fmul    dd, dd, dd
        fmul    dd, 0.25, dd
        fmul    power, S3, S3
        fmul    power, power, S3
        fsqrt   power, power
        fdiv    second, dd, power
        fsub    a{i}d, first, second
.endm
        inverse 1
        inverse 2
        inverse 3
        mov     th4d, alpha             ; (18)-(20)
        mov     th5d, gamma
        mov     om4d, omega_alpha
        mov     om5d, omega_gamma
        mov     ep4d, eps_alpha
        mov     ep5d, eps_gamma

; ---- 2. Encoders to positions -------------------------------------------------------------------------------------------
.rep i, 1, 5
.reg    p{i}
        itof    p{i}, n{i}
        fmul    p{i}, p{i}, count{i}
.endr

; ---- 3. Forward kinematics, (14)-(15) --------------------------------------------------------------------------------------
.reg    fx fy fz x2 x3 y1 y2 y3 z1 z2 z3
        fmul    x2, p2, p2              ; x = -√3·(l2² - l3²)/(6R)
        fmul    x3, p3, p3
        fsub    x2, x2, x3
        fmul    x2, -sqrt(3), x2
        fdiv    fx, x2, 6*R
        fmul    y1, p1, p1              ; y = -(2·l1² - l2² - l3²)/(6R)
        fmul    y1, 2.0, y1
        fmul    y2, p2, p2
        fmul    y3, p3, p3
        fsub    y1, y1, y2
        fsub    y1, y1, y3
        fdiv    fy, y1, -6*R
        fmul    z1, p1, p1              ; z = √(l1² - x² - (y - R)²)
        fmul    z2, fx, fx
        fsub    z3, fy, R
        fmul    z3, z3, z3
        fsub    z1, z1, z2
        fsub    z1, z1, z3
        fsqrt   fz, z1

; ---- 4. Reduced masses, (23) --------------------------------------------------------------------------------------------------
.macro  cosine  i, j                    ; c_ij = (l_i² + l_j² - 3R²)/(2·l_i·l_j)
.reg    li lj
        fmul    li, p{i}, p{i}
        fmul    lj, p{j}, p{j}
        fadd    li, li, lj
        fsub    li, li, 3*R^2
        fmul    lj, 2.0, p{i}
        fmul    lj, lj, p{j}
        fdiv    c{i}{j}, li, lj
.endm
.macro  kappa   j                       ; κ_j = (J0 + m_s·(l_j - c)²)/l_j²
.reg    lc ll
        fsub    lc, p{j}, c
        fmul    lc, lc, lc
        fmul    lc, ms, lc
        fadd    lc, J0, lc
        fmul    ll, p{j}, p{j}
        fdiv    kappa{j}, lc, ll
.endm
.macro  pair    M, cij, j               ; M += mr_ij + mJ_ij = m_s·c_ij² + κ_j·(1 - c_ij²)
.reg    mr mJ
        fmul    mr, cij, cij
        fmul    mr, ms, mr
        fmul    mJ, cij, cij
        fsub    mJ, 1.0, mJ
        fmul    mJ, kappa{j}, mJ
        fadd    M, M, mr
        fadd    M, M, mJ
.endm
.reg    c12 c13 c23 kappa1 kappa2 kappa3 M1 M2 M3
        cosine  1, 2
        cosine  1, 3
        cosine  2, 3
        kappa   1
        kappa   2
        kappa   3
        .rep i, 1, 3
        fadd    M{i}, ms, mp
        .endr
        pair    M1, c12, 2
        pair    M1, c13, 3
        pair    M2, c12, 1
        pair    M2, c23, 3
        pair    M3, c13, 1
        pair    M3, c23, 2

; ---- 5. Gravity, (24)-(25): Σ_i u_i·G_i = (0, 0, m_z·g), m_z = m_p + Σ_i mz_i, mz_i = m_s + q/l_i --------------------------------
.rep i, 1, 3
.reg    mz{i} ux{i} uy{i} uz{i}
        fdiv    mz{i}, q, p{i}
        fadd    mz{i}, ms, mz{i}
        fsub    ux{i}, fx, xp{i}        ; u_i = (x - xp_i, y - yp_i, z)/l_i
        fdiv    ux{i}, ux{i}, p{i}
        fsub    uy{i}, fy, yp{i}
        fdiv    uy{i}, uy{i}, p{i}
        fdiv    uz{i}, fz, p{i}
.endr
.reg    mzs bz
        fadd    mzs, mp, mz1
        fadd    mzs, mzs, mz2
        fadd    mzs, mzs, mz3
        fmul    bz, mzs, g
.macro  det     D, a1, a2, a3, b1, b2, b3, c1, c2, c3   ; determinant, rows a, b, c
.reg    p1 q1 p2 q2 p3 q3
        fmul    p1, b2, c3
        fmul    q1, b3, c2
        fsub    p1, p1, q1
        fmul    p1, a1, p1
        fmul    p2, b1, c3
        fmul    q2, b3, c1
        fsub    p2, p2, q2
        fmul    p2, a2, p2
        fmul    p3, b1, c2
        fmul    q3, b2, c1
        fsub    p3, p3, q3
        fmul    p3, a3, p3
        fsub    p1, p1, p2
        fadd    D, p1, p3
.endm
.reg    D D1 D2 D3 G1 G2 G3
        det     D,  ux1, ux2, ux3,    uy1, uy2, uy3,    uz1, uz2, uz3
        det     D1, zero, ux2, ux3,   zero, uy2, uy3,   bz, uz2, uz3
        det     D2, ux1, zero, ux3,   uy1, zero, uy3,   uz1, bz, uz3
        det     D3, ux1, ux2, zero,   uy1, uy2, zero,   uz1, uz2, bz
        .rep i, 1, 3
        fdiv    G{i}, D{i}, D
        .endr

; ---- 6. Table dynamics, (27) --------------------------------------------------------------------------------------------------------
.reg    G4
        fsin    G4, p4
        fmul    G4, rm4*g, G4

; ---- 7. Control law, (28), (36), and 8. nonlinear integrator, (29)-(35), (37) -----------------------------------------------------------
.macro  control i, qd, vd, ad           ; acc_i = a_d + KP·e + KV·e_v + KI·s
.reg    e vel ev sg same:int tc eabs phie:bits fall phit positive:int early:int ended:int step ke ks
        fsub    e, qd, p{i}
        fsub    vel, p{i}, pp{i}        ; v = (q(t) - q(t-1))/Ts
        fdiv    vel, vel, Ts
        mov     pp{i}, p{i}
        fsub    ev, vd, vel

        fsign   sg, vd                  ; sg ≠ sg(t-1): tc = 0, else tc += Ts
        feq     same, sg, sg{i}
        mov     sg{i}, sg
        fadd    tc, tc{i}, Ts
        sel     tc{i}, same, tc, zero
        fabs    eabs, e                 ; φ_e
        fle     phie, ec{i}, eabs
        sel     phie, phie, 1.0, zero
        fdiv    fall, tc{i}, Tc         ; φ_t
        fsub    fall, 1.0, fall
        fmul    fall, 2*(xc - 1), fall
        fmul    fall, fall, phie
        fle     ended, Tc, tc{i}
        sel     phit, ended, zero, fall
        fle     early, tc{i}, Tc/2
        sel     phit, early, xc - 1.0, phit
        flt     positive, zero, tc{i}
        sel     phit, positive, phit, zero
        fadd    phit, phit, 1.0         ; s = sat(s + (φ_t + 1)·e·Ts)
        fmul    step, phit, e
        fmul    step, step, Ts
        fadd    step, s{i}, step
        fsat    s{i}, step, smax{i}

        fmul    ke, KP, e
        fmul    ev, KV, ev
        fmul    ks, KI, s{i}
        fadd    acc{i}, ad, ke
        fadd    acc{i}, acc{i}, ev
        fadd    acc{i}, acc{i}, ks
.endm
.reg    acc1 acc2 acc3 acc4 acc5
        .rep i, 1, 3
        control i, l{i}d, v{i}d, a{i}d
        fmul    acc{i}, M{i}, acc{i}
        fadd    F{i}, acc{i}, G{i}
        .endr
        control 4, alpha, omega_alpha, eps_alpha
        fmul    acc4, J44, acc4
        fadd    tau4, acc4, G4
        control 5, gamma, omega_gamma, eps_gamma
        fmul    acc5, J55, acc5
        fadd    tau5, acc5, zero        ; G_5 = 0

        wait    period

; For `takt accuracy`; robot.s has the inputs' ranges.
.rep i, 1, 3
.range  pp{i} = 3160000*lcount, 3800000*lcount
.endr
.range  pp4 = -pi, pi
.range  pp5 = -2*pi, 2*pi
.rep i, 1, 5
.range  s{i} = -smax{i}, smax{i}
.range  tc{i} = 0, 1
.range  sg{i} = -1, 1
.endr
; SPDX-License-Identifier: MIT OR Apache-2.0

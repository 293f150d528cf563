; One period of the hybrid robot's tracking algorithm, (7)-(37) of the founding paper, in equations: the same bits as tracking.s, and as
; many cycles, give or take a few. tracking.s says where a formula differs from the printed one, and why. The mission flies tracking.s.

.include "robot.s"
.schedule on

.const  gain = Ts*KI                    ; of the integrator, without boost
.const  J    = J0 + ms*c^2              ; kg·m², an arm about its pivot, with its slider
.const  Rc   = R/lcount                 ; R in counts
.const  xp   = sqrt(3)/2*R              ; xp_2 = -xp_3; yp_1 = R, yp_2 = yp_3 = -R/2
.const  kb   = (J/4/lcount^2)^(1/6)     ; counts; in the formula m
.const  fall = 2*(xc - 1)*Ts/Tc*gain    ; of the boost, in a period

.state  np[5]:int s[5] boost[5] sg[5]   ; counts one period ago; KI·∫e; boosts; signs of the reference velocities

.once
        .rep i, 1, 5
        s[i], boost[i], sg[i] = 0, gain, 0
        .endr
        wait    first
first:  .rep i, 1, 5
        np[i] = n{i}
        .endr

.period
period: .late n1, n2, n3, n4, n5 = 1

; ---- 1. Inverse kinematics with derivatives, (7)-(11), and the table, (18)-(20) --------------------------------------
.reg    xy L[3] dv D[3] da A[3]
.macro  arms    to, f, px, py, sum      ; to_i = sum - f·(px·xp_i + py·yp_i)
.reg    px2 py2
        px2, py2 = px*(f*xp), py*(f*R/2)
        to[2], to[3], to[1] = sum + py2 - px2, sum + py2 + px2, sum - py*(f*R)
.endm
.reg    px2 py2
        xy = x*x + y*y + (z*z - 0.5)
        px2, py2 = x*(2*xp), y*R
        L[2], L[3], L[1] = xy + (py2 - px2), xy + (py2 + px2), xy - (py2 + py2)
        dv = x*vx + y*vy + z*vz
        arms    D, 1, vx, vy, dv
        da = x*ax + y*ay + z*az + (vx*vx + vy*vy + vz*vz)
        arms    A, 1, ax, ay, da
        .rep i, 1, 3
        L[i] = L[i] + (R^2 + 0.5)
        l{i}d = sqrt(L[i])
        v{i}d = D[i]/l{i}d
        a{i}d = (A[i] - D[i]*D[i]/L[i])/l{i}d
        .endr
        th4d, th5d, om4d, om5d, ep4d, ep5d = alpha, gamma, omega_alpha, omega_gamma, eps_alpha, eps_gamma

; ---- 2. Encoders to positions and velocities -------------------------------------------------------------------------
.reg    cc[5] p[5] vel[5]
        .rep i, 1, 5
        cc[i] = itof(n{i})
        p[i] = cc[i]*count{i}
        vel[i] = itof(n{i} - np[i])*(KV*count{i}/Ts)
        np[i] = n{i}
        .endr

; ---- 3. Forward kinematics, (14)-(15), in counts ---------------------------------------------------------------------
.reg    qq[3] u w fx fy fz
        .rep i, 1, 3
        qq[i] = cc[i]*cc[i]
        .endr
        u, w = qq[1] - qq[2], qq[1] - qq[3]
        fx, fy = (w - u)*(1/(2*sqrt(3)*Rc)), (u + w)*(1/(6*Rc)) + Rc
        fz = sqrt(qq[1] - fx*fx - fy*fy)

; ---- 4. Reduced masses, (23), in kg ----------------------------------------------------------------------------------
.reg    b[3] k[3] t12 t13 t23 s12 s13 s23 M[3]
        .rep i, 1, 3
        b[i] = kb/cc[i]
        k[i] = (2*kb*ms*c/J*lcount - b[i])*b[i]
        .endr
        t12, t13 = qq[1] - 3*Rc^2 + qq[2], qq[1] - 3*Rc^2 + qq[3]
        t23 = t12 - w
        .rep i, 1, 2
        .rep j, i + 1, 3
        s{i}{j} = 4*kb^4 - b[i]*b[j]*t{i}{j}*(b[i]*b[j]*t{i}{j})
        .endr
        .endr
        M[1] = 3*ms + mp - (k[2]*s12 + k[3]*s13)
        M[2] = 3*ms + mp - (k[1]*s12 + k[3]*s23)
        M[3] = 3*ms + mp - (k[1]*s13 + k[2]*s23)

; ---- 5, 6. Gravity, (24)-(25), and the table, (27) --------------------------------------------------------------------
.reg    la[3] mg G[4]
        la[1] = Rc^2 - (u + w)*(1/3)
        la[2], la[3] = la[1] + u, la[1] + w
        mg = ((b[1] + b[2] + b[3])*(q/(kb*lcount)*g/(3*Rc^2)) + (mp + 3*ms)*g/(3*Rc^2))/fz
        .rep i, 1, 3
        G[i] = cc[i]*la[i]*mg
        .endr
        G[4] = sin(p[4])*(rm4*g)

; ---- 7, 8. Control law, (28), (36), with the nonlinear integrator, (29)-(35), (37) -----------------------------------------
.reg    acc[5]
.macro  control i, qd, vd, ad, sd       ; sd: of v_d's sign
.reg    e same:int later held ramp
        e = qd - p[i]
        same, sg[i] = sign(sd) == sg[i], sign(sd)
        later = max(boost[i] - fall, gain)
        boost[i], held = same ? later : (2*xc - 1)*gain, same ? later : gain
        ramp = xc*gain - fall/2 <= held ? xc*gain : ec{i} <= abs(e) ? held : gain
        s[i] = sat(s[i] + ramp*e, smax{i}*KI)
        .if i > 3
        acc[i] = vd*KV + ad - vel[i] + e*KP + s[i]
        .else
        acc[i] = vd*KV - vel[i] + e*KP + ad + s[i]
        .endif
.endm
        .rep i, 1, 3
        control i, l{i}d, v{i}d, a{i}d, D[i]
        F{i} = acc[i]*M[i] + G[i]
        .endr
        control 4, alpha, omega_alpha, eps_alpha, omega_alpha
        tau4 = acc[4]*J44 + G[4]
        control 5, gamma, omega_gamma, eps_gamma, omega_gamma
        tau5 = acc[5]*J55

        wait    period

; For `takt accuracy`; robot.s has the inputs' ranges.
.rep i, 1, 5
.range  s[i] = -smax{i}*KI, smax{i}*KI
.range  boost[i] = gain, (2*xc - 1)*gain
.range  sg[i] = -1, 1
.endr
.rep i, 1, 3
.range  np[i] = 3160000, 3800000
.endr
.range  np[4] = -131072, 131072
.range  np[5] = -262144, 262144
; SPDX-License-Identifier: MIT OR Apache-2.0

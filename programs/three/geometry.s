; Geometry and nominal dynamics of the arm, as subroutines of the kinematic and the communication core: angles to frame and pose, pose to
; angles, motion of the tool to motion of the joints, motion of the joints to torques. docs/controller.md.
;
; Vectors stand in the arm's frame: radially, across (against the axes of joints 2 and 3), upward.

; ---- Between the subroutines --------------------------------------------------------------------------------------------------
.reg    th[6]:float rv[6]:float         ; joints, rad, with their derivatives; before `twist` and `inverse`: those of a pose
.reg    s1 c1_ s2 c2_ s23 c23 s4 c4_ s5 c5_ s6 c6_ s3
.reg    X[3] Y[3] W[3]                  ; axes of the tool before joint 6 turns it: u, v; and w
.reg    o[3]                            ; from the wrist's centre to the tool's point
.reg    px pz reach                     ; forearm radially and upward; the wrist's centre, radially
.reg    back:int elbow_up:int wrist_up:int ; branch of the solution: configurations 0, 1, 2 of programs/arm
.reg    space:int status:int            ; of `solve`: whether its way is a pose's; 0 or a cause
.reg    lin[3] ang[3]                   ; velocity of the tool's point, turning rate
.reg    fk[6]                           ; pose: x, y, z, roll, pitch, yaw

.const  BENT = 0.05                     ; of |sin θ5|: below, the wrist is singular
.const  OFF_AXIS = 0.02                 ; m: nearer to joint 1's axis, the wrist's centre is
.const  FOLDED = 0.002                  ; m²: elbow stretched or folded

; `way` and `way1` to joints, of a pose if `space`. Leaves them in registers, and the frame.
solve:  call    fetch
        status = 0
        bz      space, frame            ; and back to who called
        call    twist
        call    inverse
        bnz     status, nowhere         ; the angles are no numbers
        call    frame
        call    turn
        call    rates
nowhere:
        ret

fetch:  .rep i, 1, 6
        ld      th[i], way + i - 1
        ld      rv[i], way1 + i - 1
        .endr
        ret

; What the joints ask of the drives by the nominal dynamics: H·rv, H·ra, weight.
weigh:
.reg    h11 h22 h23 h44
        h11 = C0 + (c2_*C1 + s23*C2)*c2_ + s23*s23*C3
        h22, h23 = C4 + s3*C2, C3 + s3*C5
        h44 = s5*s5*C7 + c5_*c5_*C8
        .macro  H_times to, a
.reg    P1 P2 P3 P4 P5 P6
        P1, P2, P3 = h11*a[1], h22*a[2] + h23*a[3], h23*a[2] + a[3]*C3
        P4, P5, P6 = h44*a[4], a[5]*C7, a[6]*C8
        st      to, P1
        st      to + 1, P2
        st      to + 2, P3
        st      to + 3, P4
        st      to + 4, P5
        st      to + 5, P6
        .endm
        H_times forces1, rv
.reg    g4 g5
        g4, g5 = s4*s5*s23*C6, (c4_*c5_*s23 + s5*c23)*(-C6)
        st      weights + 3, g4
        st      weights + 4, g5
        .rep i, 1, 6
        st      joints + i - 1, th[i]
        st      joints1 + i - 1, rv[i]
        .endr
        .if macro.weigh_more
        weigh_more
        .endif
        ret

; Angles `th` to frame and inertia.
frame:  .rep i, 4, 6
        s{i} = sin(th[i])
        c{i}_ = cos(th[i])
        .endr
.reg    th23
        th23 = th[2] + th[3]
        s1, c1_, s2, c2_, s23, c23, s3 = sin(th[1]), cos(th[1]), sin(th[2]), cos(th[2]), sin(th23), cos(th23), sin(th[3])
        X[1], X[2], X[3] = c23*(c4_*c5_) - s23*s5, -(s4*c5_), s23*(c4_*c5_) + c23*s5
        Y[1], Y[2], Y[3] = -(c23*s4), -c4_, -(s23*s4)
        W[1], W[2], W[3] = c23*(c4_*s5) + s23*c5_, -(s4*s5), s23*(c4_*s5) - c23*c5_
.reg    ox oy oz
        ox, oy, oz = tool[1]*c6_ - tool[2]*s6, tool[1]*s6 + tool[2]*c6_, tool[3] + d6
        .rep i, 1, 3
        o[i] = ox*X[i] + oy*Y[i] + oz*W[i]
        .endr
        px, pz = c23*a3 + s23*d4, s23*a3 - c23*d4
        reach = a1 + c2_*a2 + px
        ret

; Frame to pose, `fk`.
forward:
.reg    fr wx wy uz vz
        fr = reach + o[1]
        fk[1], fk[2], fk[3] = c1_*fr - s1*o[2], s1*fr + c1_*o[2], d1 + s2*a2 + pz + o[3]
        wx, wy = c1_*W[1] - s1*W[2], s1*W[1] + c1_*W[2]
        uz, vz = c6_*X[3] + s6*Y[3], c6_*Y[3] - s6*X[3]
        fk[4], fk[5], fk[6] = atan2(vz, -uz), atan2(W[3], sqrt(W[1]*W[1] + W[2]*W[2])), atan2(wy, wx)
        ret

; Which branch the angles in `th`, whose frame is known, lie on.
branch: back = reach < 0
        elbow_up = sin(th[3] - elbow) > 0
        wrist_up = s5 > 0
        ret

; The pose in `th` to angles there, on the branch: programs/arm/inverse.s, in metres and radians.
inverse:
.reg    sr cr sp cp sy cy ee f h cx cy_ cz tl
        sr, cr, sp, cp, sy, cy = sin(th[4]), cos(th[4]), sin(th[5]), cos(th[5]), sin(th[6]), cos(th[6])
        ee, f, tl = tool[2]*sr - tool[1]*cr, tool[1]*sr + tool[2]*cr, tool[3] + d6
        h = ee*sp - tl*cp
        cx, cy_ = th[1] + (h*cy + f*sy), th[2] + (h*sy - f*cy)
        cz = th[3] - d1 - (ee*cp + tl*sp)
; The wrist's centre, seen from joint 1 and from joint 2.
.reg    side r2 dist ri k1 m1_ Xr D2 PP S K es A B ZA XA
        side = back ? -1.0 : 1.0
        r2 = cx*cx + cy_*cy_
        dist = sqrt(r2)
        ri = side/dist
        k1, m1_ = cx*ri, cy_*ri
        th[1] = atan2(cy_*side, cx*side)
        Xr = dist*side - a1
        D2 = Xr*Xr + cz*cz
; The elbow's angle has cosine K/(2·a2·√L2) and sine ±S/(2·a2·√L2).
        PP = ((a2 + sqrt(L2))^2 - D2)*(D2 - (a2 - sqrt(L2))^2)
        S = sqrt(PP)
        K = D2 - (a2^2 + L2)
        es = elbow_up ? 1.0 : -1.0
.reg    te tew
        te = elbow + atan2(S, K)*es
        tew = te - 2*pi
        th[3] = te > pi ? tew : te
        A, B = K + 2*a2^2, S*es
        ZA, XA = cz*A - Xr*B, Xr*A + cz*B
        th[2] = atan2(ZA, XA)
; cos and sin of θ2 + θ3: (X + iZ)/D · (a3 + i·d4)·(1 + (K ± iS)/(2·L2)).
.reg    Di xd zd gx gy q23 n23
        Di = 1/D2
        xd, zd = Xr*Di, cz*Di
        gx = K*(a3/(2*L2)) + a3 - B*(d4/(2*L2))
        gy = K*(d4/(2*L2)) + d4 + B*(a3/(2*L2))
        q23, n23 = xd*gx - zd*gy, xd*gy + zd*gx
; The orientation seen from the arm; sin θ5 = ±√…: only its sign matters for θ4 and θ6.
.reg    cd sn pc qx pu pv ws c5x n4 s52 j6 k6
        cd, sn = k1*cy + m1_*sy, k1*sy - m1_*cy
        pc, qx = cp*cd, cp*sn
        pu, pv = cr*sp*cd - sr*sn, sr*sp*cd + cr*sn
        ws = wrist_up ? 1.0 : -1.0
        c5x, n4 = n23*pc - q23*sp, q23*pc + n23*sp
        s52 = n4*n4 + qx*qx
        th[5] = atan2(sqrt(s52), c5x)*ws
        th[4] = atan2(-(qx*ws), n4*ws)
        j6, k6 = -((n23*pu + q23*(cr*cp))*ws), -((n23*pv + q23*(sr*cp))*ws)
        th[6] = atan2(k6, j6)
.reg    reached:int aside:int bent:int
        reached, aside, bent = PP >= 0, r2 >= OFF_AXIS^2, s52 >= BENT^2
        status = reached ? (aside & bent ? 0 : CAUSE_SINGULAR) : CAUSE_UNREACHABLE
        ret

; The tool's velocity in the world, from a pose and its derivative.
twist:
.reg    sa ca sb cb
        sa, ca, sb, cb = sin(th[5]), cos(th[5]), sin(th[6]), cos(th[6])
        .rep i, 1, 3
        lin[i] = rv[i]
        .endr
        ang[1] = rv[5]*sb + rv[4]*(ca*cb)
        ang[2] = rv[4]*(ca*sb) - rv[5]*cb
        ang[3] = rv[6] + rv[4]*sa
        ret

; World to the arm's frame.
turn:
        .macro  turned v
.reg    radial across
        radial, across = c1_*v[1] + s1*v[2], c1_*v[2] - s1*v[1]
        v[1], v[2] = radial, across
        .endm
        turned  lin
        turned  ang
        ret

; The tool's velocity, in the arm's frame, to the joints'.
rates:
.reg    vc[3] det deti v2 v23 v1 m[3] dw[3] v6
        vc[1] = lin[1] - (ang[2]*o[3] - ang[3]*o[2]) ; of the wrist's centre
        vc[2] = lin[2] - (ang[3]*o[1] - ang[1]*o[3])
        vc[3] = lin[3] - (ang[1]*o[2] - ang[2]*o[1])
        det = (c2_*pz - s2*px)*a2
        deti = 1/det
        v1 = vc[2]/reach
        v2, v23 = (vc[1]*px + vc[3]*pz)*deti, (vc[3]*s2 + vc[1]*c2_)*(-a2)*deti
; What is left for the wrist. m: how w moves with θ5.
        dw[1], dw[2], dw[3] = ang[1], ang[2] + v23, ang[3] - v1
        m[1], m[2], m[3] = c23*c4_, -s4, s23*c4_
        v6 = (dw[1]*m[1] + dw[2]*m[2] + dw[3]*m[3])/s5
        rv[1], rv[2], rv[3] = v1, v2, v23 - v2
        rv[4], rv[5], rv[6] = dw[1]*s23 - dw[3]*c23 - c5_*v6, dw[1]*Y[1] + dw[2]*Y[2] + dw[3]*Y[3], v6
.reg    free:int open:int straight:int
        free, open, straight = abs(reach) >= OFF_AXIS, abs(det) >= FOLDED, abs(s5) >= BENT
        status = free & open & straight ? 0 : CAUSE_SINGULAR
        ret
; SPDX-License-Identifier: MIT OR Apache-2.0

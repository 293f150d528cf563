; Forward kinematics of the six-axis arm, (2.3)-(2.18) of the second founding paper: joint angles and tool point to the tool's
; position and orientation, and the configuration that leads the inverse back to these joints.
;
; Written in the plane of the arm (radial, upward) and across it; joint 1 turns it last. Where a formula differs from the printed
; one, the identity that leads from one to the other stands beside it.

.include "arm.s"
.schedule on

.input  th1, th2, th3, th4, th5, th6    ; degrees, up to ±23040 (64 turns); their sum th2 + th3 too
.input  tx, ty, tz                      ; mm, tool point in frame 6

.output x, y, z                         ; mm
.output roll, pitch, yaw                ; degrees, in [-180, 180]
.output config0:int, config1:int, config2:int
.output status:int                      ; 0 good; 1 the tool points up or down (pitch ±90): roll and yaw are of little worth;
                                        ; 2 an input is out of range or no number: the other outputs keep their last values

.const  steep = 0.5^14                  ; of cos²(pitch): status 1 within 0.45° of ±90

.once
        .rep i, 0, 2
        mov     config{i}, zero
        .endr
        mov     x, zero
        mov     y, zero
        mov     z, zero
        mov     roll, zero
        mov     pitch, zero
        mov     yaw, zero
        wait    period

.period
period:

; ---- Sines and cosines ------------------------------------------------------------------------------------------------
.reg    th23 r1 r2 r23 r4 r5 r6  s1 c1 s2 c2 s23 c23 s4 c4 s5 c5 s6 c6
        fadd    th23, th2, th3
.macro  sincos  s, c, r, angle
        fmul    r, angle, rad
        fsin    s, r
        fcos    c, r
.endm
        sincos  s6, c6, r6, th6
        sincos  s5, c5, r5, th5
        sincos  s4, c4, r4, th4
        sincos  s23, c23, r23, th23
        sincos  s2, c2, r2, th2
        sincos  s1, c1, r1, th1

; ---- Tool's axis w in the plane: radially (2.9), upward, and across ------------------------------------------------------
.reg    a b  wr wrr wz wzz
        fmul    a, c4, s5
        fmul    b, s4, s5               ; across: -b
        fmul    wr, c23, a
        fmul    wrr, s23, c5
        fadd    wr, wr, wrr             ; t6
        fmul    wz, s23, a
        fmul    wzz, c23, c5
        fsub    wz, wz, wzz

; yaw = atan2(w_y, w_x): θ1, less whole turns, - atan2(b, t6). A sum with `integers` has no room for a fraction.
.const  integers = 1.5*2^23
.reg    whole home yw size turn other  back:int beyond:int
        fmul    whole, th1, 1/360
        fadd    whole, whole, integers
        fsub    whole, whole, integers
        fmul    whole, whole, 360
        fsub    home, th1, whole        ; θ1 within half a turn
        fatan2  yw, b, wr
        fmul    yw, yw, 1/rad
        fsub    yw, home, yw            ; within a whole one
        flt     back, yw, zero
        sel     turn, back, -360.0, 360.0
        fsub    other, yw, turn
        fabs    size, yw
        flt     beyond, 180, size
        sel     yw, beyond, other, yw

; pitch = 90° - acos(w_z), w_z = sin(pitch). Within 10° of the vertical, where w_z says little, ±(90° - asin(flat)) with the arcsine's
; series: flat = √(w_x² + w_y²) = cos(pitch), which joint 1 does not change. So the arctangents' unit has yaw and roll only.
.const  upright = 0.5^5                 ; of flat²
.reg    wr2 b2 flat2 flat4 flat  as asn upper lower sine pt  down:int steeply:int
        fmul    wr2, wr, wr
        fmul    b2, b, b
        fadd    flat2, wr2, b2
        fsqrt   flat, flat2
        fmul    as, flat2, 1/(6*rad)
        fadd    as, as, 1/rad
        fmul    flat4, flat2, flat2
        fmul    asn, flat4, 3/(40*rad)
        fadd    as, as, asn
        fmul    as, as, flat
        fsub    upper, 90.0, as
        fneg    lower, upper
        flt     down, wz, zero
        sel     upper, down, lower, upper
        fsat    sine, wz, 1.0           ; beyond 1 by a rounding
        facos   pt, sine
        fmul    pt, pt, 1/rad
        fsub    pt, 90.0, pt
        flt     steeply, flat2, upright
        sel     pt, steeply, upper, pt

; roll = atan2(v_z, -u_z); u_z = c6·P - s6·Q, v_z = -s6·P - c6·Q.
.reg    cc P Pr Q uz uzz vz vzz rl
        fmul    cc, c4, c5
        fmul    P, s23, cc
        fmul    Pr, c23, s5
        fadd    P, P, Pr
        fmul    Q, s23, s4
        fmul    uz, s6, Q
        fmul    uzz, c6, P
        fsub    uz, uz, uzz             ; -u_z
        fmul    vz, s6, P
        fmul    vzz, c6, Q
        fadd    vz, vz, vzz             ; -v_z
        fneg    vz, vz
        fatan2  rl, vz, uz
        fmul    rl, rl, 1/rad

; ---- Tool point: turned about joint 6, tilted by joint 5, turned by joint 4, (2.14)-(2.18) -----------------------------------
.reg    ex exx ey eyy tl  m mm  h hh  g gg  n nn
        fmul    ex, tx, c6
        fmul    exx, ty, s6
        fsub    ex, ex, exx
        fmul    ey, tx, s6
        fmul    eyy, ty, c6
        fadd    ey, ey, eyy
        fadd    tl, tz, d6
        fmul    m, c5, ex
        fmul    mm, s5, tl
        fadd    m, m, mm
        fmul    h, c5, tl
        fmul    hh, s5, ex
        fsub    h, h, hh
        fadd    h, h, d4                ; along the forearm
        fmul    g, c4, m
        fmul    gg, s4, ey
        fsub    g, g, gg
        fadd    g, g, a3                ; in the plane, square to it
        fmul    n, s4, m
        fmul    nn, c4, ey
        fadd    n, n, nn                ; across: -n

; ---- The arm: radially and upward; then about joint 1 ----------------------------------------------------------------------
.reg    R Ra Rb Rc Z Za Zb Zc  xx xs yy ys
        fmul    Ra, c2, a2
        fadd    Ra, Ra, a1
        fmul    Rb, c23, g
        fmul    Rc, s23, h
        fadd    R, Rb, Rc
        fadd    R, R, Ra
        fmul    Za, s2, a2
        fadd    Za, Za, d1
        fmul    Zb, s23, g
        fmul    Zc, c23, h
        fsub    Z, Zb, Zc
        fadd    Z, Z, Za
        fmul    xx, c1, R
        fmul    xs, s1, n
        fadd    xx, xx, xs
        fmul    yy, s1, R
        fmul    ys, c1, n
        fsub    yy, yy, ys

; ---- Configuration: on which branch of (2.22), (2.29), (2.34) the joints lie -------------------------------------------------
.reg    wc wcc  s3a r3a  k0:int k1:int k2:int
        fmul    wc, c23, a3
        fmul    wcc, s23, d4
        fadd    wc, wc, wcc
        fadd    wc, wc, Ra              ; the wrist's centre, radially: behind joint 1's axis?
        flt     k0, wc, zero
        fsub    r3a, r23, r2
        fsub    r3a, r3a, alpha
        fsin    s3a, r3a
        flt     k1, zero, s3a
        flt     k2, zero, s5

; ---- Status. A sine of what is no angle is no number, and 0 times an infinite length is none. --------------------------------
.reg    all alls  good:int level:int
        fadd    all, s1, s23
        fadd    alls, s4, s5
        fadd    all, all, alls
        fadd    alls, s6, s3a
        fadd    all, all, alls
        fadd    all, all, s2
        fadd    alls, tx, ty
        fadd    alls, alls, tz
        fadd    all, all, alls
        fabs    all, all
        flt     good, all, inf
        fle     level, flat2, steep
        sel     status, good, level, 2
        sel     x, good, xx, x
        sel     y, good, yy, y
        sel     z, good, Z, z
        sel     roll, good, rl, roll
        sel     pitch, good, pt, pitch
        sel     yaw, good, yw, yaw
        sel     config0, good, k0, config0
        sel     config1, good, k1, config1
        sel     config2, good, k2, config2

        wait    period

; For `takt accuracy`: 63 turns of every joint, the sum of the second and the third too; a tool of up to 0.5 m. An output keeps its value where
; an input is no number.
.range  th1, th4, th5, th6 = -22680, 22680
.range  th2, th3 = -11340, 11340
.range  tx, ty, tz = -500, 500
.range  x, y, z = -3000, 3000
.range  roll, pitch, yaw = -180, 180
.range  config0, config1, config2 = 0, 1
; SPDX-License-Identifier: MIT OR Apache-2.0

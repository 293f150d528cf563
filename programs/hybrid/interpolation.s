; SPDX-License-Identifier: MIT OR Apache-2.0
; Points of a path from a host that plans it in coarser steps (LinuxCNC, docs/linuxcnc.md): every N periods a knot, positions with
; their velocities, and between two knots the cubic that has both. Out comes the reference of each period with its derivatives.
;
; Knots wait in a FIFO. The first one says where the robot stands; motion begins once BEGIN more are there, so that the host may
; be late by as many of its steps. If a knot is missing all the same, the robot brakes along the tangent and stands, until it is
; started again: `starved` says so.

.schedule on

.const  Ts    = 1e-4                    ; s, sampling period
.const  N     = 10                      ; periods from knot to knot
.const  T     = N*Ts                    ; s
.const  um    = 2^-30                   ; m, of an integer that is a position
.const  ua    = 2^-26                   ; rad, of one that is an angle
.macro  isar.of d, n, by
        isar    d, n, by
.endm

.const  BEGIN = 3                       ; knots that wait before the motion begins
.const  BRAKE = 8                       ; m/s², deceleration where knots are missing
.const  RADIUS = 0.2                    ; m/rad, what a rotation counts as, where it is the faster

; ---- The head of the FIFO -----------------------------------------------------------------------------------------------
.input  empty:int, count:int
.input  to_1:int, to_2:int, to_3:int    ; um: x, y, z
.input  to_4:int, to_5:int              ; ua: tilt, rotation
.input  speed_1, speed_2, speed_3       ; m/s
.input  speed_4, speed_5                ; rad/s
.output pop:int                         ; takes the head out; the number of knots taken so far

; ---- Encoders, which the host is shown with the point that they belong to -------------------------------------------------
.input  n1:int, n2:int, n3:int, n4:int, n5:int

; ---- The point ----------------------------------------------------------------------------------------------------------
.output x, y, z, vx, vy, vz, ax, ay, az ; m, s
.output alpha, gamma, omega_alpha, omega_gamma, eps_alpha, eps_gamma ; rad, s

; ---- To the host ----------------------------------------------------------------------------------------------------------
.output m1:int, m2:int, m3:int, m4:int, m5:int ; the encoders at this period's tick
.output knot:int                        ; knots taken, so that the point lies between the last two of them,
.output phase:int                       ; so many periods after the first of the two; 0 where it stands
.output starved:int                     ; periods of N without a knot since the start
.output standing:int                    ; 1: it does not move

; ---- State ----------------------------------------------------------------------------------------------------------------
.state  k:int                           ; period after the last knot
.state  p[5]:int                        ; where the cubic begins: um, ua
.state  e[5]:int                        ; where it ends
.state  u[5] w[5]                       ; velocities there
.state  taken:int lacks:int moves:int

.once
        k, taken, lacks, moves = 0, 0, 0, 0
first:                                  ; the knot that says where the robot stands
        bnz     empty, first
        .rep i, 1, 5
        p[i], e[i] = to_{i}, to_{i}
        u[i], w[i] = 0, 0
        .endr
        taken = 1
        pop = taken
        .rep i, 1, 5
.order  to_{i}, pop
        .endr
        x, y, z, vx, vy, vz, ax, ay, az = 0, 0, 0, 0, 0, 0, 0, 0, 0
        alpha, gamma, omega_alpha, omega_gamma, eps_alpha, eps_gamma = 0, 0, 0, 0, 0, 0
        m1, m2, m3, m4, m5 = 0, 0, 0, 0, 0
        knot, phase, starved, standing = 1, 0, 0, 1
        wait    period

.period
period:
.reg    idle:int enough:int
        enough = count >= BEGIN
        moves = moves | enough
        idle = moves == 0
        ior     idle, idle, k           ; or between two knots
        bnz     idle, onward

; ---- The next knot: the FIFO's head, or one on the tangent ------------------------------------------------------------------
.reg    speed factor turned have:int none:int
        none = empty | lacks            ; once it brakes it goes on braking
        have = none == 0
        speed = sqrt(w[1]*w[1] + w[2]*w[2] + w[3]*w[3])
        turned = max(abs(w[4]), abs(w[5]))*RADIUS
        speed = max(max(speed, turned), 1e-9)
        factor = max(1 - BRAKE*T/speed, 0)
        .rep i, 1, 5
        p[i], u[i] = e[i], w[i]
        w[i] = have ? speed_{i} : u[i]*factor
        e[i] = have ? to_{i} : p[i] + ftoi((u[i] + w[i])*(i <= 3 ? T/um/2 : T/ua/2))
        .endr
        lacks = lacks + (have ? 0 : 1)
        taken = taken + have
        bz      have, onward
        pop = taken                     ; in a run of its own, so that all of the head has been read
onward:

; ---- The point: with the way d, h(s) = T·u·s + (3d - 2T·u - T·w)·s² + (T·u + T·w - 2d)·s³ ---------------------------------------
.reg    s d b c pos[5] vel[5] acc[5]
        s = itof(k)*(1/N)
        .rep i, 1, 5
.const  unit{i} = i <= 3 ? um : ua
        d = itof(e[i] - p[i])*unit{i}
        b = d*3 - (u[i]*2 + w[i])*T
        c = (u[i] + w[i])*T - d*2
        pos[i] = itof(isar.of(p[i], 8))*(unit{i}*256) + (itof(p[i] & 255)*unit{i} + ((c*s + b)*s + u[i]*T)*s)
        vel[i] = ((c*3*s + b*2)*s)*(1/T) + u[i]
        acc[i] = (c*6*s + b*2)*(1/T^2)
        .endr
        x, y, z, alpha, gamma = pos[1], pos[2], pos[3], pos[4], pos[5]
        vx, vy, vz, omega_alpha, omega_gamma = vel[1], vel[2], vel[3], vel[4], vel[5]
        ax, ay, az, eps_alpha, eps_gamma = acc[1], acc[2], acc[3], acc[4], acc[5]

        .rep i, 1, 5
        m{i} = n{i}
        .endr
        knot, phase, starved = taken, k, lacks
        standing = moves == 0
.reg    next:int
        next = k == N - 1 ? 0 : k + 1
        k = moves == 0 ? 0 : next
        wait    period

; For `takt accuracy`: knots within 1 m of the origin and 16 turns, speeds of 1 m/s and 20 rad/s; encoders as in robot.s.
.range  empty = 0, 1
.range  count = 0, 255
        .rep i, 1, 3
.range  to_{i}, p[i], e[i] = -1/um, 1/um
.range  speed_{i}, u[i], w[i] = -1, 1
.range  n{i} = 3160000, 3800000
        .endr
        .rep i, 4, 5
.range  to_{i}, p[i], e[i] = -31, 31
.range  speed_{i}, u[i], w[i] = -20, 20
        .endr
.range  n4 = -131072, 131072
.range  n5 = -262144, 262144
.range  k = 0, N - 1
.range  taken, lacks = 0, 0x7ffffffe
.range  moves = 0, 1

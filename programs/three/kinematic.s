; The kinematic core: motion of the reference. Segments come ahead of time and run without a pause between them; points in joint space with
; nominal controls go to the dynamic core, four of its periods apart. docs/controller.md.

.include "packets.s"
.include "ums7.s"
.schedule on

; ---- Ports -------------------------------------------------------------------------------------------------------------------
.input  item:int, item_sequence:int, item_epoch:int, c1, c2, c3, c4, c5, c6, profile:int, periods:int, ramp_periods:int, flags:int
.input  item_empty:int, item_count:int
.output item_pop:int
.input  epoch:int, stop_cause:int, stop_sequence:int, reset:int
.output reply:int, reply_sequence:int, reply_cause:int, reply_value, reply_epoch:int, reply_push:int
.input  m1, m2, m3, m4, m5, m6, ready:int, lost:int
.output point_q, point_v, point_a, point_u, point_i, point_push:int ; a joint of a point
.output q1, q2, q3, q4, q5, q6, x, y, z, roll, pitch, yaw, mode:int, segment:int, queued:int
.output beat:int

; ---- State -------------------------------------------------------------------------------------------------------------------
.const  STAND = 0
.const  MOVE  = 1
.const  JOG   = 2
.const  SLOWEST_STOP = 2                ; 1/s: a stop lasts 0.5 s at most
.const  PATIENCE = 8                    ; periods
.const  MARGIN = 0.95                   ; of a torque, for a stop
.const  LINE_RAMP = 1                   ; m/s², of a jog in the world
.const  TURN_RAMP = 3                   ; rad/s²
.state  motion:int on:int beats:int pushes:int pops:int points:int ; motion: one of the above
.state  known:int resets:int            ; stops and resets that have been dealt with
.state  error:int stopping:int halt_number:int ; after an error; on the way to standstill, and the order to answer then
.state  strayed:int patience:int        ; a joint did not follow: reset takes the measured angles, which the servo needs some periods for
.state  tool[3]                         ; m
; Two segments overlap at a point that is passed: the one that comes in, in its first half, and the one that goes out, in its second. Where they meet
; is `anchor`; coordinates are joints, or those of the pose.
.state  world:int
.state  in_on:int in_N:int in_M:int in_k:int in_shape:int in_V in_via:int in_number:int
.state  out_on:int out_N:int out_M:int out_k:int out_shape:int out_V out_via:int out_number:int
.state  pace pacedot brake part         ; speed of the motion's clock, 1 or falling; its derivative; how fast it may fall, 1/s; part of a period beyond k
.state  jog_mode:int jog_number:int jog_held:int

        .preset motion = STAND
        .preset on = 0
        .preset beats = 0
        .preset pushes = 0
        .preset pops = 0
        .preset points = 0
        .preset known = 0
        .preset resets = 0
        .preset error = 0
        .preset stopping = 0
        .preset halt_number = 0
        .preset strayed = 0
        .preset patience = 0
        .preset world = 0
        .preset jog_mode = 0
        .preset jog_number = 0
        .preset jog_held = 0
        .preset pace = 1
        .preset pacedot = 0
        .preset brake = SLOWEST_STOP
        .preset part = 0
        .preset back = 0
        .preset elbow_up = 0
        .preset wrist_up = 0
        .macro  at_rest which
        .preset {which}_on = 0
        .preset {which}_N = 2
        .preset {which}_M = 1
        .preset {which}_k = 0
        .preset {which}_shape = 0
        .preset {which}_V = 0
        .preset {which}_via = 0
        .preset {which}_number = 0
        .endm
        at_rest in
        at_rest out

.data
        .macro  floats count
        .rep    i, 1, count
        .float  0
        .endr
        .endm
; Six words each, of the joints.
reference:  floats 6                    ; rad, as it was given to the dynamic core last
reference1: floats 6
here:       floats 6                    ; its pose
way:        floats 6                    ; what `solve` is to solve: joints, or a pose; and derivatives
way1:       floats 6
way2:       floats 6
joints:     floats 6                    ; what it has found, with the derivative for the clock's full pace
joints1:    floats 6
joints2:    floats 6                    ; rad/s², as the clock goes
forces1:    floats 6                    ; H·joints1, H·joints2
forces2:    floats 6
weights:    floats 6                    ; N·m
inertias:   .float 0, 0, C3, 0, C7, C8  ; H's diagonal, kg·m²
rows:       .float 0, 0, 0, 0, C7, C8   ; and sums of its rows' magnitudes
anchor:     floats 6
in_D:       floats 6                    ; ways of the segments, and where the one ends that comes in
in_T:       floats 6
out_D:      floats 6
jog_rates:  floats 6                    ; as they are and as they are asked for
jog_asked:  floats 6
jog_turned: floats 6                    ; and in the world
admissible: floats 6                    ; rad/s², of one joint by itself: half of what its torque allows
fastest:    .float fast1, fast2, fast3, fast4, fast5, fast6
strongest:  .float torque1, torque2, torque3, torque4, torque5, torque6
lowest:     .float low1, low2, low3, low4, low5, low6
highest:    .float high1, high2, high3, high4, high5, high6

; What this core weighs beside geometry.s.
.macro  weigh_more
.reg    row2 row3
        H_times forces2, ra
        st      inertias, h11
        st      inertias + 1, h22
        st      inertias + 3, h44
        row2, row3 = h22 + abs(h23), abs(h23) + C3
        st      rows, h11
        st      rows + 1, row2
        st      rows + 2, row3
        st      rows + 3, h44
        .rep i, 1, 6
        st      joints2 + i - 1, ra[i]
        .endr
.endm
.reg    ra[6]:float                     ; rad/s², of the joints
.reg    j:int jn:int                    ; joint in a loop, from 0
.macro  each_joint label                ; ends a loop over the joints
        j = j + 1
        jn = j < 6
        bnz     jn, label
.endm

.once
        tool[1], tool[2], tool[3] = 0, 0, 0
        wait    period

; ---- A period ------------------------------------------------------------------------------------------------------------------
.period
period: bz      ready, idle
        beats = beats + 1
        beat = beats
        bnz     on, running
        call    measure
        on = 1
running:
.reg    rk:int rn:int rc:int rx:float ; a reply
.reg    fc:int fx                       ; an error

; ---- Orders ---------------------------------------------------------------------------------------------------------------------
.reg    new:int bad:int
        new = epoch != known
        bz      new, ordered
        known = epoch
        stopping = 1
        brake = SLOWEST_STOP
        error = stop_cause == 0 ? error : 1
        halt_number = stop_sequence
        new = reset != resets
        bz      new, ordered
        resets = reset
        error = 0
        bz      strayed, ordered
        strayed = 0
        patience = PATIENCE
        call    measure
ordered:
        bad = (lost != 0) & (error == 0) & (patience == 0)
        patience = patience == 0 ? 0 : patience - 1
        bz      bad, followed
        strayed = 1
        fc, fx = CAUSE_TRACKING, itof(lost)
        call    fail
followed:
        bz      motion, standing
.reg    jogs:int
        jogs = motion == JOG
        bnz     jogs, standing

; ---- The motion's clock: a period, or less while the robot stops ---------------------------------------------------------------------
.reg    paced stride over1:int
        paced = stopping ? max(pace - brake*Tk, 0) : 1
        pacedot = stopping ? (paced - pace)*(1/Tk) : 0
        stride = part + (pace + paced)*(1/2)
        over1 = stride >= 1
        part = stride - (over1 ? 1.0 : 0)
        pace = paced
        in_k, out_k = in_k + over1, out_k + over1

; A segment ends.
.reg    ended:int
        ended = out_on & (out_k >= out_N)
        bz      ended, not_ended
        out_on = 0
        rk, rn, rc, rx = REPORT_FINISHED | REPLY_DONE, out_number, 0, 0
        call    send
        bad = out_via & item_empty & !in_on
        bz      bad, not_ended
        rk, rc = REPORT_STOPPED, CAUSE_RANDRY
        call    send
not_ended:
; One has come to its half.
.reg    d1_:float d2_:float d3_:float d4_:float d5_:float d6_:float
        ended = in_on & !out_on & (in_k + in_k >= in_N)
        bz      ended, standing
        in_on, out_on = 0, 1
        out_N, out_M, out_k, out_shape, out_V, out_via, out_number = in_N, in_M, in_k, in_shape, in_V, in_via, in_number
        j = 0
        .loop_bound 6
hand:   ld      d1_, in_T[j]
        ld      d2_, in_D[j]
        st      anchor[j], d1_
        st      out_D[j], d2_
        each_joint hand

; ---- The next item -------------------------------------------------------------------------------------------------------------------------
standing:
.reg    left:int ready_to:int sets:int wide:int
        bnz     item_empty, begun
        bad = item_epoch < known
        bnz     bad, take               ; it was there before a stop
        bad = stopping | error | (item_epoch > known)
        bnz     bad, begun
        rn = item_sequence
        bad = item == KIND_JOG
        bnz     bad, begin_jog
        bad = item == KIND_TOOL
        bnz     bad, set_tool
        bad = (item == KIND_LIMITS) | (item == KIND_TORQUES)
        bnz     bad, set_limits
        sets = (item == KIND_OUTPUT) | (item == KIND_LEVEL)
        wide = item == KIND_MOVEL
        left = out_N - out_k
        ready_to = out_on ? out_via & (sets ? left <= out_M + 4 : (wide == world) & (left <= out_M) & (left <= ramp_periods)) : 1
        ready_to = ready_to & !in_on
        bz      ready_to, begun
        bz      sets, begin
        rk = item | (REPLY_SET | REPLY_DONE)
        mov     rc, c1:int
        mov     rx, c2
        call    send
        jmp     take

; A segment begins: from where the one before ends, or from where the robot stands.
begin:
.reg    full angular:int
        .rep i, 1, 6
        st      in_T + i - 1, c{i}
        .endr
        j = 0
        .loop_bound 6
bring:  ld      d1_, anchor[j]
        ld      d2_, reference[j]
        ld      d3_, here[j]
        ld      d4_, in_T[j]
        d1_ = out_on ? d1_ : wide ? d3_ : d2_
        d5_ = d4_ - d1_
        angular = wide & (j >= 3)       ; angles of the tool go the shorter way round
        full = itof(ftoi(d5_*(1/(2*pi))))*(2*pi)
        d5_ = angular ? d5_ - full : d5_
        d4_ = angular ? d4_ - full : d4_
        st      in_D[j], d5_
        st      in_T[j], d4_
        st      anchor[j], d1_
        each_joint bring
        in_N, in_M, in_shape, in_via, in_number = periods, ramp_periods, profile, flags & FLAG_VIA, rn
        in_V = 1/(itof(in_N - in_M)*Tk)
        in_on, in_k = 1, 0
        world = wide
        part = out_on ? part : 0
        pace, pacedot = 1, 0
        rk, rc, rx = REPORT_STARTED, 0, 0
        call    send
        bnz     motion, take
        motion = MOVE
; The branch of the solution is that of the joints where the robot stands.
        call    stay
        call    fetch
        call    frame
        call    branch
        jmp     take
set_tool:
        tool[1], tool[2], tool[3] = c1, c2, c3
        jmp     take
set_limits:
.reg    base:int
        base = item == KIND_TORQUES ? strongest - fastest : 0
        .rep i, 1, 6
        st      fastest + i - 1[base], c{i}
        .endr
        jmp     take
begin_jog:
        jogs = motion == JOG
        bnz     jogs, jog_on
        .rep i, 1, 6
        st      jog_rates + i - 1, zero
        .endr
jog_on: bnz     jog_held, take          ; it is being stopped
        .rep i, 1, 6
        st      jog_asked + i - 1, c{i}
        .endr
        jog_mode, jog_number, motion = profile, rn, JOG
take:   pops = pops + 1
        item_pop = pops
begun:
        jogs = motion == JOG
        bnz     jogs, jogging
        bz      motion, resting
        motion = in_on | out_on ? MOVE : STAND ; of a motion that has ended, this is the last point
        jmp     moving
resting:
        call    stay
        space, pace, pacedot = 0, 0, 0
        jmp     solved

; ---- Where it is on its way --------------------------------------------------------------------------------------------------------------
moving:
.reg    g0 g1 g2
        at = (itof(in_k) + part)*Tk
        ramp = itof(in_M)*Tk
        speed, shape = in_V, in_shape
        call    profile_at
        g0, g1, g2 = in_on ? f0 : 0, in_on ? f1 : 0, in_on ? f2 : 0
        at = max((itof(out_N - out_k) - part)*Tk, 0)
        ramp = itof(out_M)*Tk
        speed, shape = out_V, out_shape
        call    profile_at
        f0, f1, f2 = out_on ? f0 : 0, out_on ? f1 : 0, out_on ? f2 : 0
        j = 0
        .loop_bound 6
along:  ld      d1_, anchor[j]
        ld      d2_, in_D[j]
        ld      d3_, out_D[j]
        d4_ = d1_ + (d2_*g0 - d3_*f0)
        d5_ = d2_*g1 + d3_*f1
        d6_ = (d2_*g2 - d3_*f2)*(pace*pace) + d5_*pacedot
        st      way[j], d4_
        st      way1[j], d5_
        st      way2[j], d6_
        each_joint along
        space = world
        jmp     solved

; ---- Jog: rates that grow as the torques allow -------------------------------------------------------------------------------------------
jogging:
.reg    limit jerk jr:float jt:float near:int runs:int any:int asked:int
        asked = jog_asked - way
        jogs = jog_mode == JOG_GRIPPER
        bz      jogs, jog_asks
; The rates that are asked for turn with the gripper, which is where the last period left it.
.reg    U[3] V[3] R[6]:float L[3] N[3] sj cj
        .rep i, 1, 6
        ld      R[i], jog_asked + i - 1
        .endr
        .rep i, 1, 3
        U[i], V[i] = c6_*X[i] + s6*Y[i], c6_*Y[i] - s6*X[i]
        L[i], N[i] = R[1]*U[i] + R[2]*V[i] + R[3]*W[i], R[4]*U[i] + R[5]*V[i] + R[6]*W[i]
        .endr
        sj, cj = s1, c1_
        .macro  outward to, v
.reg    ox_ oy_
        ox_, oy_ = cj*v[1] - sj*v[2], sj*v[1] + cj*v[2]
        st      to, ox_
        st      to + 1, oy_
        st      to + 2, v[3]
        .endm
        outward jog_turned, L
        outward jog_turned + 3, N
        asked = jog_turned - way
jog_asks:
        mov     any, zero
        j = 0
        .loop_bound 6
jog:    ld      jr, jog_rates[j]
        ld      jt, way[asked]
        ld      d1_, admissible[j]
        ld      d2_, reference[j]
        ld      d3_, reference1[j]
        jt = stopping | jog_held ? 0 : jt
        limit = jog_mode == JOG_JOINTS ? d1_ : j < 3 ? LINE_RAMP : TURN_RAMP
        jerk = sat((jt - jr)*(1/Tk), limit)
        near = abs(jt - jr) <= limit*Tk
        d4_ = near ? jt : jr + jerk*Tk
        d5_ = jog_mode == JOG_JOINTS ? (jr + d4_)*(Tk/2) : d3_*Tk
        d2_ = d2_ + d5_
        runs = (d4_ != 0) | (jt != 0)
        any = any | runs
        st      jog_rates[j], d4_
        st      way[j], d2_
        st      way1[j], d4_
        st      way2[j], jerk
        asked = asked + 1
        each_joint jog
        pace, pacedot, space = 1, 0, 0
        bnz     any, jogs_on
        call    halted
        bad = stopping | jog_held
        rk = bad ? REPLY_JOGGED : REPORT_FINISHED | REPLY_JOGGED
        rn, rc, rx = jog_number, 0, 0
        call    send
        jog_held = 0
        jmp     solved
jogs_on:
        bz      jog_mode, solved
        call    fetch
        call    frame
        .rep i, 1, 3
        lin[i], ang[i] = rv[i], rv[i+3]
        .endr
        call    turn
        call    rates
        world = 1
        jmp     have_rates

; ---- Joints, and accelerations: of a way in the world the difference of the velocities ----------------------------------------------------------
solved: call    solve
        .rep i, 1, 6
        ld      ra[i], way2 + i - 1
        .endr
        bz      space, have_accelerations
have_rates:
        bnz     status, astray
        .rep i, 1, 6
        ld      d1_, reference1 + i - 1
        ra[i] = (rv[i]*pace - d1_)*(1/Tk)
        .endr
        jmp     have_accelerations
; No way on: the joints stop, each by itself.
astray: fc, fx = status, 0
        call    give_up
        call    coast
        space, pace, pacedot = 0, 1, 0
        call    solve
        .rep i, 1, 6
        ld      ra[i], way2 + i - 1
        .endr
have_accelerations:
        call    weigh

; ---- The point -------------------------------------------------------------------------------------------------------------------------------
.reg    v:float F1:float F2:float weight:float strong:float T fall off:int over:int low:float high:float fast:float ahead adm row:float
.reg    inertia:float beyond:int ju:int
        fall, off, over = 1/Tk, 0, 0
        j = 0
        .loop_bound 6
each:   ld      F1, forces1[j]
        ld      F2, forces2[j]
        ld      weight, weights[j]
        ld      strong, strongest[j]
        ld      row, rows[j]
        ld      inertia, inertias[j]
        ld      d1_, joints[j]
        ld      d2_, joints1[j]
        ld      d3_, joints2[j]
        ld      low, lowest[j]
        ld      high, highest[j]
        ld      fast, fastest[j]
        v = d2_*pace
        T = sat(F2 + weight, strong)
; How fast the pace may fall: what the torque allows in the direction of the path.
        fall = min(fall, (strong*MARGIN + sign(F1)*(F2 - F1*pacedot + weight))/max(abs(F1), 1e-4))
        adm = max(strong - abs(weight), 0.1)*0.5/row
; A joint that jogs must be able to stop before its range ends.
        ahead = motion == JOG ? v*(abs(v)*0.5/adm + 2*Tk) : 0
        beyond = (d1_ + ahead > high) & (v > 0) | (d1_ + ahead < low) & (v < 0)
        ju = j + 1
        off = beyond ? ju : off
        over = abs(v) > fast*1.05 ? ju : over
        st      reference[j], d1_
        st      reference1[j], v
        st      admissible[j], adm
        point_q, point_v, point_a = d1_, v, d3_
        point_u = T*Da + v*Db + d3_*Dc
        point_i = inertia*Da + Dc
written:
        points = points + 1
        point_push = points
        each_joint each
        brake = max(fall, SLOWEST_STOP)
        q1, q2, q3, q4, q5, q6 = th[1], th[2], th[3], th[4], th[5], th[6]
; Checked while it moves: a corner that is rounded was not on the lines that were planned.
        bad = (motion != STAND) & !jog_held & ((off != 0) | (over != 0))
        bz      bad, within
        fc, fx = off ? CAUSE_JOINTLIMIT : CAUSE_VELOCITYLIMIT, off ? itof(off) : itof(over)
        call    give_up
        call    coast
within:
        call    forward
        .rep i, 1, 6
        st      here + i - 1, fk[i]
        .endr
        x, y, z, roll, pitch, yaw = fk[1], fk[2], fk[3], fk[4], fk[5], fk[6]

; ---- Standstill after an order -------------------------------------------------------------------------------------------------------------
        ended = stopping & ((motion == STAND) | ((motion == MOVE) & (pace == 0)))
        bz      ended, on_its_way
        call    halted
        stopping, part = 0, 0
        rk = halt_number ? REPORT_STOPPED | REPLY_HALTED : REPLY_HALTED
        rn, rc, rx = halt_number, 0, 0
        halt_number = 0
        call    send
on_its_way:
        mode = stopping ? MODE_STOPPING : motion == MOVE ? MODE_MOVING : motion == JOG ? MODE_JOGGING : error ? MODE_ERROR : MODE_STANDING
        segment = in_on ? in_number : out_on ? out_number : 0
        queued = item_count
idle:   wait    period

; ---- Subroutines ------------------------------------------------------------------------------------------------------------------------------
; A reply to the communication core.
send:   reply = rk
        reply_sequence = rn
        reply_cause = rc
        reply_value = rx
        reply_epoch = known
        pushes = pushes + 1
        reply_push = pushes
        .order  reply, reply_sequence, reply_cause, reply_value, reply_epoch, reply_push
        ret

; It cannot go on, for cause `fc` with value `fx`: an error, said once; of a jog only a report.
give_up:
        jogs = motion == JOG
        bz      jogs, fail
        bnz     jog_held, failed
        rk, rn, rc, rx = REPORT_STOPPED, jog_number, fc, fx
        jmp     send
fail:   stopping = 1
        bnz     error, failed
        error = 1
        brake = SLOWEST_STOP
        rk, rn, rc, rx = REPORT_STOPPED | REPLY_LOCK, in_on ? in_number : out_on ? out_number : 0, fc, fx
        jmp     send
failed: ret

; The reference is what is measured.
measure:
        .rep i, 1, 6
        mov     d1_, m{i}
        st      reference + i - 1, d1_
        .endr
        ret

; A way that stays where the reference is.
stay:   j = 0
        .loop_bound 6
stays:  ld      d1_, reference[j]
        st      way[j], d1_
        st      way1[j], zero
        st      way2[j], zero
        each_joint stays
        ret

; From any motion to joints that come to rest each by itself.
coast:  motion, jog_mode, jog_held, in_on, out_on, world = JOG, JOG_JOINTS, 1, 0, 0, 0
        j = 0
        .loop_bound 6
coasts: ld      d1_, reference[j]
        ld      d2_, reference1[j]
        st      jog_rates[j], d2_
        st      jog_asked[j], zero
        d1_ = d1_ + d2_*Tk
        st      way[j], d1_
        st      way1[j], d2_
        st      way2[j], zero
        each_joint coasts
        ret

halted: motion, in_on, out_on, world = STAND, 0, 0, 0
        ret

.include "geometry.s"
.include "profile.s"
; SPDX-License-Identifier: MIT OR Apache-2.0

; Planning, a part of the communication core: whether a motion is possible, and how long it takes. docs/controller.md.
;
; The way is sampled; at each sample, joints, what a speed of 1 along the way (1/s: the whole way in a second) asks of velocities, what an acceleration
; of 1 asks of torques, and what the speed's square does. From the largest of each follow the largest speed and acceleration along the way.

.const  SAMPLES = 32                    ; of a way

; Where it begins and where it ends. What is NaN stays as it is.
plan_motion:
.reg    origin:float begin:float begin_pose:float goal:float away full angular:int d1_:float d2_:float d3_:float
.reg    plan_space:int plan_i:int least_v least_a least_c joint_v:int joint_a:int
        plan_space = kind == KIND_MOVEL
        j = 0
        .loop_bound 6
complete:
        ld      begin, planned[j]
        ld      begin_pose, planned_pose[j]
        ld      goal, payload[j]
        origin = plan_space ? begin_pose : begin
        goal = goal == goal ? goal : origin
        away = goal - origin
        angular = plan_space & (j >= 3) ; angles of the tool go the shorter way round
        full = itof(ftoi(away*(1/(2*pi))))*(2*pi)
        away = angular ? away - full : away
        st      plan_S[j], origin
        st      plan_T[j], goal
        st      plan_D[j], away
        st      way[j], begin
        each_joint complete
        call    fetch
        call    frame
        call    branch
        plan_i, joint_v, joint_a = 0, 0, 0
        least_v, least_a, least_c = 0, 0, 0

        .loop_bound SAMPLES + 1
sample:
.reg    sigma whole:int plan_cause:int plan_value share ask force beyond:int
.reg    F1:float F0:float weight:float strong:float fast:float low:float high:float
        sigma = itof(plan_i)*(1/SAMPLES)
        whole = plan_i == SAMPLES
        j = 0
        .loop_bound 6
between:
        ld      d1_, plan_S[j]
        ld      d2_, plan_D[j]
        ld      d3_, plan_T[j]
        d1_ = whole ? d3_ : d1_ + d2_*sigma
        st      way[j], d1_
        st      way1[j], d2_
        each_joint between
        space = plan_space
        call    solve
        plan_cause, plan_value = status, 0
        bnz     plan_cause, plan_refused
        call    weigh
        mov     beyond, zero
        j = 0
        .loop_bound 6
demand: ld      F1, forces1[j]
        ld      F0, forces0[j]
        ld      weight, weights[j]
        ld      strong, strongest[j]
        ld      fast, fastest[j]
        ld      low, lowest[j]
        ld      high, highest[j]
        ld      d1_, joints[j]
        ld      d2_, joints1[j]
        ju = j + 1
        beyond = (d1_ < low) | (d1_ > high) ? ju : beyond
        share = 1/max(strong - abs(weight), 1e-3)
        ask = abs(d2_)/fast
        force = abs(F1)*share
        joint_v = ask > least_v ? ju : joint_v
        least_v = max(least_v, ask)
        joint_a = force > least_a ? ju : joint_a
        least_a = max(least_a, force)
        F0 = plan_space & (plan_i > 0) ? F1 - F0 : 0
        least_c = max(least_c, abs(F0)*(SAMPLES*share))
        st      forces0[j], F1
        each_joint demand
        plan_cause, plan_value = CAUSE_JOINTLIMIT, itof(beyond)
        bnz     beyond, plan_refused
        plan_i = plan_i + 1
        bz      whole, sample

; The whole way is known.
; Along the way from 0 to 1: the largest speed Vm and the largest acceleration Am.
.reg    Vm Am Vr sum2 long Tr wanted root least fits:int slow:int impossible:int timed:int asked_speed:int
        call    forward
.reg    D[6]:float
        .rep i, 1, 6
        ld      D[i], plan_D + i - 1
        .endr
        sum2 = sqrt(D[1]*D[1] + D[2]*D[2] + D[3]*D[3])
        long = max(abs(D[4]), abs(D[5]), abs(D[6]))
        long = plan_space ? (sum2 >= 1e-6 ? sum2 : long) : max(long, abs(D[1]), abs(D[2]), abs(D[3]))
        Vm = 0.999/max(least_v, 1e-6)
        Vm = plan_space ? min(Vm, sqrt(0.5/max(least_c, 1e-12))) : Vm
        Am = (plan_space ? 0.475 : 0.95)/max(least_a, 1e-6)
.reg    passes:int pulse_top
        passes = (fl & FLAG_VIA) | via_before
        Am = passes ? Am*0.5 : Am       ; two of them may overlap
        pulse_top = pr == PROFILE_RECTANGULAR ? 1.0 : pr == PROFILE_TRAPEZOIDAL ? TOP : pr == PROFILE_PARABOLIC ? 1.5 : 2.0
        root = pulse_top/Am
        timed = ho == HOW_TIME
        bnz     timed, given_time
; As fast as may be, or with a given speed, if the way is long enough to reach it.
        asked_speed = (ho == HOW_SPEED) & (long >= 1e-6)
        Vr = asked_speed ? am/max(long, 1e-6) : Vm
        impossible = Vr > Vm*1.001
        plan_cause = impossible ? CAUSE_VELOCITYLIMIT : 0
        plan_value = itof(joint_v)
        bnz     plan_cause, plan_refused
        fits = Vr*Vr*root <= 1
        Vr = fits ? Vr : sqrt(1/root)
        Tr = Vr*root
        wanted = 1/Vr
        jmp     periods_of
; In a given time: ramps of a quarter of it, longer if torques demand it, shorter if velocities do.
given_time:
.reg    discriminant
        wanted = itof(ftoi(am*(1/Tk)))*Tk
        discriminant = wanted*wanted - root*4
        impossible = discriminant < 0
        least = (wanted - sqrt(max(discriminant, 0)))*(1/2)
        slow = wanted - least < 1/Vm
        plan_cause = impossible ? CAUSE_TORQUELIMIT : slow ? CAUSE_VELOCITYLIMIT : 0
        plan_value = impossible ? itof(joint_a) : itof(joint_v)
        bnz     plan_cause, plan_refused
        Tr = max(least, min(wanted*(1/4), wanted - 1/Vm))
        wanted = wanted - Tr
; In whole periods: M of a ramp, N in all; `wanted` is all but one ramp.
periods_of:
.reg    rest_of:int M:int N:int
        M = ftoi(Tr*(1/Tk))
        M = itof(M) < Tr*(0.999999/Tk) ? M + 1 : M
        M = M < 1 ? 1 : M
        rest_of = ftoi(wanted*(1/Tk))
        rest_of = itof(rest_of) < wanted*(0.999999/Tk) ? rest_of + 1 : rest_of
        rest_of = rest_of < M ? M : rest_of
        N = timed ? ftoi(am*(1/Tk)) : rest_of + M
        M = M + M > N ? N >> 1 : M
        N = N < 2 ? 2 : N
        M = M < 1 ? 1 : M
.reg    check:int duration
        duration = itof(N)*Tk
        mov     rw, duration
        rc = 0
        check = fl & FLAG_CHECK
        rk = check ? REPORT_CHECKED : REPORT_ACCEPTED
        call    say
        bnz     check, no_plan
        via_before = fl & FLAG_VIA
        pending, motions = pending + 1, motions + 1
        profile, periods, ramp_periods, flags = pr, N, M, fl
        j = 0
        .loop_bound 6
shelve: ld      d2_, plan_T[j]
        ld      d3_, joints[j]
        st      planned[j], d3_
        st      planned_pose[j], d2_
        each_joint shelve
        .rep    i, 1, 6
        ld      c{i}, plan_T + i - 1
        .endr
        mov     rk, kind
        call    put
        bnz     plan_space, no_plan
        .rep i, 1, 6
        st      planned_pose + i - 1, fk[i]
        .endr
        jmp     no_plan
plan_refused:
        mov     rc, plan_cause
        mov     rw, plan_value
        li      rk, REPORT_REFUSED
        call    say
; SPDX-License-Identifier: MIT OR Apache-2.0

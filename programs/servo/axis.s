; SPDX-License-Identifier: MIT OR Apache-2.0
; An axis of a servo drive: `current_loop` in every period, `motion` every tenth. `servo.s` has one axis, `six.s` six on one core.
;
; The program that includes this states `FULL`, the output for a duty of 1.
; The motor is that of `examples/foc.s`: four pole pairs, 48 V, encoder of 17 bits with turns. Positions are in turns, speeds in turns/s.
.include <motor.s>

.const  T     = 10e-6                   ; s, period of the current loop (100 kHz)
.const  EVERY = 10                      ; periods to one of the motion loop
.const  TM    = EVERY*T                 ; s (10 kHz)

.const  PAIRS = 4                       ; pole pairs
.const  DIGITS = 17                     ; of a turn's counts
.const  R     = 0.35                    ; Ω, of a phase
.const  Ld    = 0.9e-3                  ; H
.const  Lq    = 1.1e-3
.const  psi   = 0.012                   ; V·s, flux of the magnets
.const  J     = 6e-5                    ; kg·m², rotor and load
.const  IMAX  = 20                      ; A, most current asked for
.const  ITRIP = 30                      ; A, in any phase: fault
.const  UMIN  = 18                      ; V, of the bridge: fault below
.const  UMAX  = 56                      ; V, fault above

.const  wc    = 2*pi*1500               ; rad/s, bandwidth of the current loops
.const  KB    = wc*T                    ; of the voltage that is cut off, taken from the integrators each period
.const  DSHARE = 0.95                   ; of the longest voltage, for d; q keeps a third of it
.const  LOSS  = 0.5e-6/T                ; share of the carrier that dead time takes
.const  BAND  = 0.5                     ; A, within which its sign is not certain

.const  KT    = 1.5*PAIRS*psi           ; N·m/A
.const  ws    = 2*pi*100                ; rad/s, bandwidth of the speed loop
.const  KS    = 2*pi*J*ws/KT            ; A/(turn/s)
.const  KSI   = KS*ws/4*TM              ; A/(turn/s) in a period of the motion loop
.const  KX    = ws/4                    ; 1/s, of the position loop
.const  KA    = 2*pi*J/KT               ; A/(turn/s²), feed-forward of the acceleration
.const  wo    = 2*pi*400                ; rad/s, bandwidth of the observer of speed
.const  WN    = 2*pi*830                ; rad/s, resonance of the coupling, cut out of the torque
.const  ZN    = 0.3
.const  VMAX  = 40                      ; turns/s
.const  AMAX  = 2000                    ; turns/s²
.const  FOLLOW = 0.2                    ; turns, following error: fault
.const  RING  = 16                      ; cogging table: values over a turn

; Faults, latched, as bits.
.const  OVERCURRENT = 1
.const  VOLTAGE     = 2
.const  FOLLOWING   = 4
.const  ENCODER     = 8

; The bridge's voltage udc for the current loops, and its inverse.
.macro bridge_of bridge:float, inverse:float, udc:float
        bridge = max(udc, UMIN)         ; below, the drive is off: duties stay numbers
        inverse = 1/bridge
.endm

; Phases to duties in one period. w is the electrical speed in rad/s, drive 1 or 0; sd and sq are the integrators, in V, cleared while drive is 0.
.macro current_loop da:float, db:float, dc:float, ia:float, ib:float, el:float, w:float, id_ref:float, iq_ref:float, bridge:float, inverse:float, sd:float, sq:float, drive:int
.reg    sn cs ibe d q ed eq vd vq rd rq ud uq al be a b c
        turn_sincos sn, cs, el
        ibe = ia*(1/sqrt(3)) + ib*(2/sqrt(3))           ; Clarke without its copy: iα is ia, six cycles less for six axes on t3
        park d, q, ia, ibe, sn, cs
        ed, eq = id_ref - d, iq_ref - q
        vd = ed*(wc*Ld) + sd - q*Lq*w
        vq = eq*(wc*Lq) + sq + (d*Ld + psi)*w
        rd, rq = vd*inverse, vq*inverse         ; in parts of the bridge's voltage
        circle_d_first ud, uq, rd, rq, 1/sqrt(3), DSHARE
        sd = drive ? sd + (ed*(wc*R*T) + (ud*bridge - vd)*KB) : 0
        sq = drive ? sq + (eq*(wc*R*T) + (uq*bridge - vq)*KB) : 0
        inverse_park al, be, ud, uq, sn, cs
        space_vectors_of_parts a, b, c, al, be
        dead_time a, ia, LOSS, BAND
        dead_time b, ib, LOSS, BAND
        al = -(ia + ib)
        dead_time c, al, LOSS, BAND
        .if FULL == 1
        da, db, dc = a, b, c
        .else
        da, db, dc = a*FULL, b*FULL, c*FULL
        .endif
.endm

; The faults of one period, added to those latched.
.macro watch faults:int, ia:float, ib:float, udc:float, error:int
.reg    most over:int beyond:int
        most = max(abs(ia), abs(ib), abs(ia + ib))
        over = most > ITRIP
        beyond = xor((udc > UMIN) & (udc < UMAX), 1)
        faults = faults | over | (beyond << 1) | ((error & 1) << 3)
.endm

; Profile, position, speed and torque of one axis, every EVERY periods: iq is the current asked for, w the electrical speed.
; The reference rt + rp and the profile's speed v, the observer's x and speed, the integrator s and the notch's n are the axis' memory.
.macro motion iq:float, w:float, faults:int, count:int, gt:int, gp:float, vmax:float, on:int, rt:int, rp:float, v:float, x:float, speed:float, s:float, n:float, C:float
.reg    mt:int mp far left vv vb step e want ew torque away:int sp xx kt:int kp smooth sv tq
        position mt, mp, count, DIGITS
        xx, sp = x, speed
        pll xx, sp, mp, 2*wo, wo*wo, TM
        x, speed = xx, sp
        ; While the drive is off, the reference moves as the axis does, so that it starts without a jerk.
        kt, kp = on ? rt : mt, on ? rp : mp
        vb = on ? v : sp
        between far, kt, kp, gt, gp
        left, vv = far, vb
        trapezoid left, vv, 0.0, vmax, AMAX, TM
        step = left - far
        advance kt, kp, step
        rt, rp, v = kt, kp, vv
        between e, kt, kp, mt, mp
        away = abs(e) > FOLLOW
        faults = faults | (away << 2)
        want = vv + KX*e
        ew = want - sp
        sv = on ? s : 0
        pi_limited torque, sv, ew, KS, KSI, IMAX, 1.0
        s = sv
        tq = torque + KA*((vv - vb)*(1/TM)) + cogging(C, mp, RING)
        smooth = notch(tq, n, WN, ZN, TM)
        iq = sat(smooth, IMAX)
        w = sp*(2*pi*PAIRS)
.endm

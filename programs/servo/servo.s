; SPDX-License-Identifier: MIT OR Apache-2.0
; A servo axis: current loop at 100 kHz, profile, position and speed at 10 kHz, homing, latched faults.
.const  FULL  = 1                       ; duties are parts of the carrier
.include "axis.s"
.schedule on

.input  ia, ib                          ; A, phase currents out of the bridge
.input  count:int                       ; of the encoder, 2¹⁷ a turn, negative ones too
.input  error:int                       ; of the encoder: 1 if its frame was wrong or late
.input  udc                             ; V, of the bridge
.input  enable:int                      ; 1: drive
.input  home:int                        ; 1: look for the switch before anything else, at HOMING turns/s backwards
.input  at_switch:int                   ; 1: the axis is at its switch
.input  goal                            ; turns from the switch, ±64
.input  id_ref                          ; A
.output da, db, dc                      ; duties of the three half bridges
.output drive:int                       ; 1: the bridge is to switch
.output mode:int                        ; 0 off, 1 homing, 2 homed, 3 fault
.output faults:int                      ; OVERCURRENT, VOLTAGE, FOLLOWING, ENCODER, until `enable` is 0
.output position                        ; turns from the switch
.output velocity                        ; turns/s, of the observer
.output current                         ; A, asked for on the q axis

.const  HOMING = 0.5

.state  turn:int origin:int homed:int bad:int runs:int
.state  iq w sd sq  rt:int rp v x speed s n[2]
.state  seen:int at                     ; mode and position of the last motion loop, shown with the next duties
.array  C[RING+1]                       ; A over a turn: cogging, as measured; none here

.preset turn = 0
.preset origin = 0
.preset homed = 0
.preset bad = 0
.preset runs = 0
.preset iq = 0
.preset w = 0
.preset sd = 0
.preset sq = 0
.preset rt = 0
.preset rp = 0
.preset v = 0
.preset x = 0
.preset speed = 0
.preset s = 0
.preset n = 0
.preset seen = 0
.preset at = 0

.once
        da, db, dc = 0.5, 0.5, 0.5
        drive, mode, faults = 0, 0, 0
        position, velocity, current = 0, 0, 0
        wait    period

.period
period:
.reg    el bridge inverse
        electrical el, count, PAIRS, DIGITS
        bridge_of bridge, inverse, udc
        current_loop da, db, dc, ia, ib, el, w, id_ref, iq, bridge, inverse, sd, sq, runs
        watch   bad, ia, ib, udc, error
        bad = enable ? bad : 0
        runs = enable & (bad == 0)
        drive, faults, mode = runs, bad, seen
        position, velocity, current = at, speed, iq
        publish                         ; in every period after the same cycles
        turn = turn + 1
.reg    due:int
        due = turn == EVERY
        bnz     due, slow
        wait    period

; ---- Every tenth period, behind the outputs ---------------------------------------------------------------------------------
slow:
.reg    here:int seeks:int gt:int gp whole:int speedlimit found:int
        turn = 0
        ; Homing: the origin is where the switch closes; until then the goal runs ahead of the axis.
        seeks = runs & home & xor(homed, 1)
        found = seeks & at_switch
        origin = found ? count : origin
        homed = (homed | found) & enable
        seeks = seeks & xor(found, 1)
        here = count - origin
        whole = ftoi(goal)                      ; the nearest turn
        gt, gp = seeks ? (here >> DIGITS) - 1 : whole, seeks ? 0.0 : goal - itof(whole)
        speedlimit = seeks ? HOMING : VMAX
.reg    on:int
        ; The reference starts anew where the origin moves.
        on = runs & xor(found, 1)
        motion  iq, w, bad, here, gt, gp, speedlimit, on, rt, rp, v, x, speed, s, n, C
        iq = runs ? iq : 0
.reg    mt:int mp
        position mt, mp, here, DIGITS
        at = itof(mt) + mp
        seen = bad == 0 ? (runs ? (seeks ? 1 : 2) : 0) : 3
        wait    period

; For `takt accuracy`: a motor of 30 A at 56 V, a drive within 64 turns.
.range  ia, ib = -ITRIP, ITRIP
.range  count, origin = -(64 << DIGITS), 64 << DIGITS
.range  error, enable, home, at_switch, homed, runs = 0, 1
.range  turn = 0, EVERY
.range  bad = 0, 15
.range  seen = 0, 3
.range  at = -128, 128
.range  udc = 0, UMAX
.range  goal = -64, 64
.range  id_ref, iq = -IMAX, IMAX
.range  w = -2*pi*PAIRS*2*VMAX, 2*pi*PAIRS*2*VMAX
.range  sd, sq = -UMAX, UMAX
.range  rt = -128, 128
.range  rp, x = 0, 1
.range  v, speed = -2*VMAX, 2*VMAX
.range  s = -IMAX, IMAX
.range  n = -4*IMAX, 4*IMAX

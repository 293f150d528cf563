; SPDX-License-Identifier: MIT OR Apache-2.0
; The periods of six servo axes, of `six.s` and `six_pins.s`: in each period six current loops, and, behind the outputs, the motion loop of one
; axis. The program that includes this declares `ia`, `ib`, `count`, `goal`, `udc`, `error` and `enable`, and has the macros `measure`, the
; first in each period, and `give`, for further outputs.
.output da[AXES], db[AXES], dc[AXES]    ; duties of the half bridges
.output drive:int                       ; a bit for each axis: its bridge is to switch
.output faults[AXES]:int                ; OVERCURRENT, VOLTAGE, FOLLOWING, ENCODER, until the bit in `enable` is 0

.state  turn:int bad[AXES]:int runs[AXES]:int
.state  iq[AXES] w[AXES] sd[AXES] sq[AXES]
.preset turn = 0
.preset bad = 0
.preset runs = 0
.preset iq = 0
.preset w = 0
.preset sd = 0
.preset sq = 0
; The motion loops' memory, by axis.
.array  rt[AXES]:int, rp[AXES], v[AXES], x[AXES], speed[AXES], s[AXES], n1[AXES], n2[AXES]
.array  C[RING+1]                       ; A over a turn: cogging, as measured; none here

.once
        .rep    i, 1, AXES
        da[i], db[i], dc[i], faults[i] = 0.5*FULL, 0.5*FULL, 0.5*FULL, 0
        .endr
        drive = 0
        wait    period

.period
period:
        measure
.reg    el bridge inverse
        bridge_of bridge, inverse, udc
        .rep    i, 1, AXES
        electrical el, count[i], PAIRS, DIGITS
        current_loop da[i], db[i], dc[i], ia[i], ib[i], el, w[i], 0.0, iq[i], bridge, inverse, sd[i], sq[i], runs[i]
        .endr
.reg    flaw:int
        .rep    i, 1, AXES
        flaw = error >> (i - 1)
        watch   bad[i], ia[i], ib[i], udc, flaw
        bad[i] = (enable >> (i - 1)) & 1 ? bad[i] : 0
        runs[i] = (enable >> (i - 1)) & (bad[i] == 0) & 1
        faults[i] = bad[i]
        .endr
        give
        drive = runs[1] | (runs[2] << 1) | (runs[3] << 2) | (runs[4] << 3) | (runs[5] << 4) | (runs[6] << 5)
        publish                         ; in every period after the same cycles
        turn = turn == EVERY ? 1 : turn + 1
.reg    due:int
        due = turn <= AXES
        bnz     due, slow
        wait    period

; ---- The motion loop of axis `turn` -----------------------------------------------------------------------------------------
slow:
.reg    k:int at:float c:int on:int f:int gt:int gp whole:int q we n[2]
        k = turn
        at, c, on, f = goal[1], count[1], runs[1], bad[1]
        .rep    i, 2, AXES
        at, c, on, f = k == i ? goal[i] : at, k == i ? count[i] : c, k == i ? runs[i] : on, k == i ? bad[i] : f
        .endr
        whole = ftoi(at)                        ; the nearest turn
        gt, gp = whole, at - itof(whole)
        n[1], n[2] = n1[k], n2[k]
        motion  q, we, f, c, gt, gp, VMAX, on, rt[k], rp[k], v[k], x[k], speed[k], s[k], n, C
        n1[k], n2[k] = n[1], n[2]
        .rep    i, 1, AXES
        iq[i], w[i], bad[i] = k == i ? (on ? q : 0) : iq[i], k == i ? we : w[i], k == i ? f : bad[i]
        .endr
        wait    period

; For `takt accuracy`: as in servo.s.
.range  turn = 0, EVERY
.range  bad = 0, 15
.range  runs = 0, 1
.range  iq = -IMAX, IMAX
.range  w = -2*pi*PAIRS*2*VMAX, 2*pi*PAIRS*2*VMAX
.range  sd, sq = -UMAX, UMAX
.range  rt = -128, 128
.range  rp, x = 0, 1
.range  v, speed = -2*VMAX, 2*VMAX
.range  s = -IMAX, IMAX
.range  n1, n2 = -4*IMAX, 4*IMAX

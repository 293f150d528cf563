; Field-oriented control of a permanent-magnet synchronous motor:
; Clarke, Park, two PI controllers with decoupling and a voltage limit,
; inverse Park, and space-vector modulation by the middle of the phases.
; In this folder: takt run foc.s --plant plant/pmsm.toml --periods 320
; An integrator follows what the bridge gives its axis beyond the
; decoupling: s' = s + KI·(u - f - s). Within the limits, u - f - s is
; KP·e, so that the gain of the integral is KP·KI/T = wc·R; at the
; limits it does not wind up.

.schedule on

.const  T   = 50e-6                     ; s, one PWM period (20 kHz)
.const  R   = 0.35                      ; Ω, of a phase
.const  Ld  = 0.9e-3                    ; H
.const  Lq  = 1.1e-3                    ; H
.const  psi = 0.012                     ; V·s, flux of the magnets
.const  wc  = 2*pi*800                  ; rad/s, bandwidth of the current loops
.const  KPd = wc*Ld                     ; V/A: the plant's pole is cancelled
.const  KPq = wc*Lq
.const  KId = R*T/Ld                    ; of the way that an integrator goes in a period
.const  KIq = R*T/Lq
; The longest vector is 1/√3 of the bridge's voltage: q keeps a third of it.
.const  DMAX = 0.95/sqrt(3)             ; of the bridge's voltage, for d

.input  ia, ib                          ; A, measured phase currents; the third is the rest
.input  theta                           ; rad, electrical, of a turn or two
.input  we                              ; rad/s, electrical
.input  udc                             ; V, of the bridge
.input  id_ref, iq_ref                  ; A
.output da, db, dc                      ; duties of the three half bridges, 0 to 1
.output id, iq                          ; A, for the outer loop

.state  sd sq                           ; V, the integrators

.once
        mov     sd, zero
        mov     sq, zero
        mov     id, zero
        mov     iq, zero
        mov     da, zero
        mov     db, zero
        mov     dc, zero
        wait    period

.period
period:

; ---- Clarke and Park: phases to the rotor's axes ---------------------
.reg    sn cs  ibe ibb  idd idq iqd iqq  d q
        fsin    sn, theta
        fcos    cs, theta
        fmul    ibe, ia, 1/sqrt(3)
        fmul    ibb, ib, 2/sqrt(3)
        fadd    ibe, ibe, ibb           ; iβ; iα is ia
        fmul    idd, ia, cs
        fmul    idq, ibe, sn
        fadd    d, idd, idq
        fmul    iqq, ibe, cs
        fmul    iqd, ia, sn
        fsub    q, iqq, iqd
        mov     id, d
        mov     iq, q

; ---- PI in each axis, and what the other axis and the magnets induce ----
.reg    ed eq  pd pq  fd fq  vd vq
        fsub    ed, id_ref, d
        fsub    eq, iq_ref, q
        fmul    pd, ed, KPd
        fmul    pq, eq, KPq
        fmul    fd, q, Lq
        fmul    fd, fd, we              ; against vd
        fmul    fq, d, Ld
        fadd    fq, fq, psi
        fmul    fq, fq, we
        fadd    vd, pd, sd
        fsub    vd, vd, fd
        fadd    vq, pq, sq
        fadd    vq, vq, fq

; ---- In parts of the bridge's voltage, the longest vector is 1/√3: d first, q takes what is left ----
.reg    gain  rd rq  d2 left ud uq
        fdiv    gain, 1.0, udc
        fmul    rd, vd, gain
        fmul    rq, vq, gain
        fsat    ud, rd, DMAX
        fmul    d2, ud, ud
        fsub    left, 1/3, d2
        fsqrt   left, left
        fsat    uq, rq, left

; ---- Inverse Park and Clarke; the phases' middle goes to the bridge's middle ----
.reg    al all be bee  h hb  vb vc  low high mid
        fmul    al, ud, cs
        fmul    all, uq, sn
        fsub    al, al, all             ; va
        fmul    be, ud, sn
        fmul    bee, uq, cs
        fadd    be, be, bee
        fmul    h, al, -0.5
        fmul    hb, be, sqrt(3)/2
        fadd    vb, h, hb
        fsub    vc, h, hb
        fmin    low, vb, vc
        fmax    high, vb, vc
        fmin    mid, high, al
        fmax    mid, mid, low           ; the middle one of three that add up to zero
        fmul    mid, mid, 0.5
        fadd    al, al, mid
        fadd    vb, vb, mid
        fadd    vc, vc, mid
        fsat    al, al, 0.5             ; they are within it but for rounding
        fsat    vb, vb, 0.5
        fsat    vc, vc, 0.5
        fadd    da, al, 0.5
        fadd    db, vb, 0.5
        fadd    dc, vc, 0.5

; ---- The integrators follow what the bridge gives beyond the decoupling ----
.reg    gd gq
        fmul    gd, ud, udc
        fmul    gq, uq, udc
        fadd    gd, gd, fd
        fsub    gq, gq, fq
        fsub    gd, gd, sd
        fsub    gq, gq, sq
        fmul    gd, gd, KId
        fmul    gq, gq, KIq
        fadd    sd, sd, gd
        fadd    sq, sq, gq
        wait    period

; For `takt accuracy`: sensors of ±20 A, a bridge between 18 V and 32 V,
; two turns, at most 10,000 rpm of four pole pairs. The integrators hold
; what the bridge gives, and what the decoupling of these asks for.
.range  ia, ib, id_ref, iq_ref = -20, 20
.range  theta = -4*pi, 4*pi
.range  we = -4200, 4200
.range  udc = 18, 32
.range  sd, sq = -280, 280
; SPDX-License-Identifier: MIT OR Apache-2.0

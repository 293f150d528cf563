; Field-oriented control of a permanent-magnet synchronous motor: Clarke, Park, two PI controllers with decoupling and a voltage
; limit, inverse Park, and space-vector modulation by the middle of the phases.

.schedule on

.const  T   = 50e-6                     ; s, one PWM period (20 kHz)
.const  R   = 0.35                      ; Ω, of a phase
.const  Ld  = 0.9e-3                    ; H
.const  Lq  = 1.1e-3                    ; H
.const  psi = 0.012                     ; V·s, flux of the magnets
.const  wc  = 2*pi*800                  ; rad/s, bandwidth of the current loops
.const  KPd = wc*Ld                     ; V/A: the plant's pole is cancelled
.const  KPq = wc*Lq
.const  KIT = wc*R*T                    ; V/A in a period, of both axes
.const  AW  = 0.2                       ; of the voltage that is cut off, taken from the integrators each period

.input  ia, ib                          ; A, measured phase currents; the third is the rest
.input  theta                           ; rad, electrical, up to 64 turns
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

; ---- Clarke and Park: phases to the rotor's axes ---------------------------------------------------------------------------
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

; ---- PI in each axis, and what the other axis and the magnets induce ----------------------------------------------------------
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

; ---- The bridge gives a vector of length udc/√3: d first, q takes what is left -------------------------------------------------
.reg    vmax v2 vd2 left ud uq
        fmul    vmax, udc, 1/sqrt(3)
        fsat    ud, vd, vmax
        fmul    v2, vmax, vmax
        fmul    vd2, ud, ud
        fsub    left, v2, vd2
        fmax    left, left, 0           ; rounding may leave less than nothing
        fsqrt   left, left
        fsat    uq, vq, left

.reg    xd xq  gd gq
        fsub    xd, ud, vd
        fsub    xq, uq, vq
        fmul    xd, xd, AW
        fmul    xq, xq, AW
        fmul    gd, ed, KIT
        fmul    gq, eq, KIT
        fadd    gd, gd, xd
        fadd    gq, gq, xq
        fadd    sd, sd, gd
        fadd    sq, sq, gq

; ---- Inverse Park and Clarke; the phases' middle goes to the bridge's middle --------------------------------------------------------
.reg    al all be bee  h hb  vb vc  top low mid  gain
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
        fmax    top, vb, vc
        fmax    top, top, al
        fmin    low, vb, vc
        fmin    low, low, al
        fadd    mid, top, low
        fmul    mid, mid, 0.5
        fdiv    gain, 1.0, udc
        fsub    al, al, mid
        fsub    vb, vb, mid
        fsub    vc, vc, mid
        fmul    al, al, gain
        fmul    vb, vb, gain
        fmul    vc, vc, gain
        fadd    da, al, 0.5
        fadd    db, vb, 0.5
        fadd    dc, vc, 0.5
        wait    period

; For `takt accuracy`: sensors of ±40 A, a bridge between 12 V and 60 V, 63 turns, at most 10,000 rpm of four pole pairs. The integrators hold
; what the decoupling of these asks for beyond the bridge.
.range  ia, ib, id_ref, iq_ref = -40, 40
.range  theta = -126*pi, 126*pi
.range  we = -4200, 4200
.range  udc = 12, 60
.range  sd, sq = -1000, 1000
; SPDX-License-Identifier: MIT OR Apache-2.0

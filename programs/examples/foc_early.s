; Field-oriented control as in foc.s, with the duties published as early
; as the currents allow: what needs neither current (the rotor's
; direction, the bridge's limits, the decoupling) is computed for the
; next period once the duties are published.
;
; In this folder: takt run foc_early.s --plant plant/pmsm.toml --periods 320

.schedule on
.ports  latched

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
.const  U   = 24.0                      ; V, of the bridge before the first period

.input  ia, ib                          ; A, measured phase currents; the third is the rest
.input  theta                           ; rad, electrical, of a turn or two
.input  we                              ; rad/s, electrical
.input  udc                             ; V, of the bridge
.input  id_ref, iq_ref                  ; A
.output da, db, dc                      ; duties of the three half bridges, 0 to 1
.output id, iq                          ; A, for the outer loop

.state  sd sq                           ; V, the integrators
.state  d_a d_b q_a q_b                 ; the currents' parts in d and q, at the angle that the last period predicted
.state  ad aq bd bq cd cq               ; 1/V, the parts of d's and q's voltage in the phases, at that angle and the last voltage
.state  wd wq we_psi                    ; Ω, Ω, V: the axes' coupling at the last speed
.state  dmax v2                         ; V, V²: the limits of d and of the vector at the bridge's last voltage

.once
        mov     sd, zero
        mov     sq, zero
        mov     id, zero
        mov     iq, zero
        mov     da, zero
        mov     db, zero
        mov     dc, zero
        li      d_a, 1.0                ; angle 0
        mov     d_b, zero
        li      q_a, 1/sqrt(3)
        li      q_b, 2/sqrt(3)
        li      ad, 1/U
        mov     aq, zero
        li      bd, -0.5/U
        li      bq, -sqrt(3)/2/U
        li      cd, -0.5/U
        li      cq, sqrt(3)/2/U
        mov     wd, zero
        mov     wq, zero
        mov     we_psi, zero
        li      dmax, U*DMAX
        li      v2, U*U/3
        wait    period

.period
period:

; ---- Clarke and Park in one: phases to the rotor's axes --------------
.reg    da_a da_b qa_a qa_b  d q
        fmul    da_a, ia, d_a
        fmul    da_b, ib, d_b
        fadd    d, da_a, da_b
        fmul    qa_a, ia, q_a
        fmul    qa_b, ib, q_b
        fadd    q, qa_a, qa_b
        mov     id, d
        mov     iq, q

; ---- PI in each axis, and what the other axis and the magnets induce. What is known before the currents stands first. ----
.reg    rd rq  pd pq  fd fq  vd vq
        fmul    rd, id_ref, KPd
        fmul    rq, iq_ref, KPq
        fadd    rd, rd, sd
        fadd    rq, rq, sq
        fadd    rq, rq, we_psi
        fmul    pd, d, KPd
        fmul    pq, q, KPq
        fmul    fd, q, wq
        fmul    fq, d, wd
        fsub    vd, rd, pd
        fsub    vd, vd, fd
        fsub    vq, rq, pq
        fadd    vq, vq, fq

; ---- The bridge gives a vector of length udc/√3: d first, q takes what is left ----
.reg    vd2 left ud uq
        fsat    ud, vd, dmax
        fmul    vd2, ud, ud
        fsub    left, v2, vd2
        fmax    left, left, 1           ; V², for `takt accuracy`: a tenth of v2 is always left
        fsqrt   left, left
        fsat    uq, vq, left

; ---- Inverse Park and Clarke in one; the phases' middle goes to the bridge's middle ----
.reg    va vaq vb vbq vc vcq  low high mid  ha hb hc
        fmul    va, ud, ad
        fmul    vaq, uq, aq
        fsub    va, va, vaq
        fmul    vb, ud, bd
        fmul    vbq, uq, bq
        fsub    vb, vb, vbq
        fmul    vc, ud, cd
        fmul    vcq, uq, cq
        fsub    vc, vc, vcq
        fmin    low, vb, vc
        fmax    high, vb, vc
        fmin    mid, high, va
        fmax    mid, mid, low           ; the middle one of three that add up to zero
        fmul    mid, mid, 0.5
        fadd    ha, va, 0.5
        fadd    hb, vb, 0.5
        fadd    hc, vc, 0.5
        fadd    da, ha, mid
        fadd    db, hb, mid
        fadd    dc, hc, mid
        publish

; ---- The integrators -------------------------------------------------
.reg    gd gq
        fadd    gd, ud, fd
        fsub    gq, uq, fq
        fsub    gq, gq, we_psi
        fsub    gd, gd, sd
        fsub    gq, gq, sq
        fmul    gd, gd, KId
        fmul    gq, gq, KIq
        fadd    sd, sd, gd
        fadd    sq, sq, gq

; ---- For the next period ---------------------------------------------
.reg    turned ahead  sn cs  snr csr  gain  sh ch
        fmul    turned, we, T
        fadd    ahead, theta, turned
        fsin    sn, ahead
        fcos    cs, ahead
        fmul    snr, sn, 1/sqrt(3)
        fmul    csr, cs, 1/sqrt(3)
        fadd    d_a, cs, snr
        fadd    d_b, snr, snr
        fsub    q_a, csr, sn
        fadd    q_b, csr, csr
        fdiv    gain, 1.0, udc
        fmul    ad, cs, gain
        fmul    aq, sn, gain
        fmul    ch, ad, 0.5
        fmul    sh, aq, 0.5
.reg    sr cr  vmax
        fmul    sr, aq, sqrt(3)/2
        fmul    cr, ad, sqrt(3)/2
        fsub    bd, sr, ch              ; a third of a turn behind
        fadd    bq, sh, cr
        fneg    bq, bq
        fadd    cd, sr, ch              ; a third of a turn ahead
        fneg    cd, cd
        fsub    cq, cr, sh
        fmul    wd, we, Ld
        fmul    wq, we, Lq
        fmul    we_psi, we, psi
        fmul    dmax, udc, DMAX
        fmul    vmax, udc, 1/sqrt(3)
        fmul    v2, vmax, vmax
        wait    period

; For `takt accuracy`: as for foc.s. A state lies within what the inputs
; of a period make of it.
.range  ia, ib, id_ref, iq_ref = -20, 20
.range  theta = -4*pi, 4*pi
.range  we = -4200, 4200
.range  udc = 18, 32
.range  sd, sq = -340, 340
.range  d_a, d_b, q_a, q_b = -1.6, 1.6
.range  ad, aq, bd, bq, cd, cq = -0.08, 0.08
.range  wd = -4, 4
.range  wq = -5, 5
.range  we_psi = -51, 51
.range  dmax = 9.8, 17.6
.range  v2 = 107, 342
; SPDX-License-Identifier: MIT OR Apache-2.0

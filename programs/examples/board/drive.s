; A three-phase drive on a board: two phase currents and an encoder in, three duties out, a trip that the program sees. What is at which
; pin, and the carrier that samples and switches: drive.toml; docs/power-stage.md.
;
;   takt bound drive.s --pins --wiring drive.toml
;   takt board sim --wiring drive.toml --program drive.s --set driver=1

.schedule on

.const  T    = 50e-6                    ; s, a period of the carrier
.const  TURN = 4096                     ; counts in an electrical turn: 16384 in one of the shaft, four pole pairs
.const  RAD  = 2*pi/TURN
.const  UDC  = 24.0                     ; V, of the bridge
.const  R    = 0.35                     ; Ω, of a phase
.const  L    = 1.0e-3                   ; H
.const  KP   = 2*pi*500*L               ; V/A: 500 Hz of bandwidth
.const  KI   = 2*pi*500*R*T

.if !macro.amperes                      ; isolated.s brings its own
.macro  amperes i:float, steps:int      ; A from steps of a converter for 20 A, whose middle is 2048
        i = itof(steps - 2048)*(20.0/2048)
.endm
.const  LEAST = 0
.const  GREATEST = 4095
.endif

.if !macro.sine_cosine                  ; small.s has a table, and another clock
.const  FULL = 3000.0/2048              ; a period of the carrier in steps of the duties' scale
.macro  sine_cosine sn:float, cs:float, at:int  ; of an angle in counts of an electrical turn
.reg    theta
        theta = itof(at)*RAD
        sn = sin(theta)
        cs = cos(theta)
.endm
.endif

.input  ca:int, cb:int                  ; of the currents' converters; the third current is the rest
.input  n:int                           ; counts of the encoder, at the time of the currents
.input  tripped:int                     ; the register `state` of a trip
.if !macro.wanted                       ; small.s has no host
.input  id_ref, iq_ref                  ; A, from the host
.range  id_ref, iq_ref = -20, 20
.range  n = -0x80000000, 0x7fffffff
.endif
.output da, db, dc                      ; duties, 0 to FULL
.output id, iq                          ; A
.output trip:int

.state  sd sq                           ; V, the integrators

.once
        mov     sd, zero
        mov     sq, zero
        mov     id, zero
        mov     iq, zero
        mov     trip, zero
        mov     da, 0.5*FULL
        mov     db, 0.5*FULL
        mov     dc, 0.5*FULL
.if macro.first
        first
.endif
        wait    period

.period
period:
.reg    at:int ia ib ibe sn cs d q
        at = n & (TURN - 1)
        sine_cosine sn, cs, at
        amperes ia, ca
        amperes ib, cb
        ibe = (ia + 2*ib)*(1/sqrt(3))
        d = ia*cs + ibe*sn
        q = ibe*cs - ia*sn
        id = d
        iq = q
        trip = tripped

.if macro.wanted
.reg    id_ref iq_ref
        wanted  id_ref, iq_ref
.endif

; ---- PI in each axis; the bridge gives a vector of length UDC/√3, and what is cut off stays out of the integrators ----------------
.reg    ed eq ud uq
.const  MOST = UDC/sqrt(3)*0.7          ; both axes at their limit stay within it
        ed = id_ref - d
        eq = iq_ref - q
        ud = max(min(ed*KP + sd, MOST), -MOST)
        uq = max(min(eq*KP + sq, MOST), -MOST)
        sd = max(min(sd + ed*KI, MOST), -MOST)
        sq = max(min(sq + eq*KI, MOST), -MOST)

; ---- Inverse Park and Clarke; the phases' middle goes to the bridge's middle -------------------------------------------------------
.reg    al be vb vc mid
        al = ud*cs - uq*sn
        be = (ud*sn + uq*cs)*(sqrt(3)/2)
        vb = be - 0.5*al
        vc = -0.5*al - be
        mid = max(min(max(vb, vc), al), min(vb, vc))*0.5        ; half of the middle one: the three add up to zero
        da = (al + mid)*(FULL/UDC) + 0.5*FULL
        db = (vb + mid)*(FULL/UDC) + 0.5*FULL
        dc = (vc + mid)*(FULL/UDC) + 0.5*FULL
        wait    period

; For `takt accuracy`: what the converters give; counts of any number of turns; as much current as the converters measure; integrators
; within their limit.
.range  ca, cb = LEAST, GREATEST
.range  tripped = 0, 1
.range  sd, sq = -MOST, MOST
; SPDX-License-Identifier: MIT OR Apache-2.0

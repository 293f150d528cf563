; The drive of drive.s with an absolute encoder, whose angle needs no reference: currents and angle are of the same valley. Three
; periods without a valid frame make the duties NaN, and so the outputs safe. What is at which pin: absolute.toml; docs/power-stage.md.
;
;   takt bound absolute.s --pins --wiring absolute.toml
;   takt board sim --wiring absolute.toml --program absolute.s --set driver=1 --set angle.data=1

.schedule on

.const  T    = 50e-6                    ; s, a period of the carrier
.const  AMP  = 20.0/2048                ; A for a step of the converters, whose middle is 2048
.const  TURN = 2048                     ; steps in an electrical turn: 8192 in one of the shaft, four pole pairs
.const  RAD  = 2*pi/TURN
.const  UDC  = 24.0                     ; V, of the bridge
.const  R    = 0.35                     ; Ω, of a phase
.const  L    = 1.0e-3                   ; H
.const  KP   = 2*pi*500*L               ; V/A: 500 Hz of bandwidth
.const  KI   = 2*pi*500*R*T
.const  FULL = 3000.0/2048              ; a period of the carrier in steps of the duties' scale

.input  ca:int, cb:int                  ; steps of the converters; the third current is the rest
.input  n:int, turns:int, seen:int      ; the encoder's position and turns at the time of the currents, and its valid frames
.input  tripped:int                     ; the register `state` of a trip
.input  id_ref, iq_ref                  ; A, from the host
.output da, db, dc                      ; duties, 0 to FULL
.output id, iq                          ; A
.output trip:int, turned:int

.state  sd sq                           ; V, the integrators
.state  last:int missing:int            ; frames at the period before, and periods without a new one
.state  none                            ; NaN

.once
        mov     sd, zero
        mov     sq, zero
        mov     id, zero
        mov     iq, zero
        mov     trip, zero
        mov     turned, zero
        mov     last, seen
        mov     missing, zero
        fdiv    none, zero, zero
        mov     da, 0.5*FULL
        mov     db, 0.5*FULL
        mov     dc, 0.5*FULL
        wait    period

.period
period:
.reg    at:int ia ib ibe theta sn cs d q
        at = n & (TURN - 1)
        theta = itof(at)*RAD
        sn = sin(theta)
        cs = cos(theta)
        ia = itof(ca - 2048)*AMP
        ib = itof(cb - 2048)*AMP
        ibe = (ia + 2*ib)*(1/sqrt(3))
        d = ia*cs + ibe*sn
        q = ibe*cs - ia*sn
        id = d
        iq = q
        trip = tripped
        turned = turns

; ---- the encoder must have answered in one of three periods -------------------------------------------------------------------------
.reg    same:int scale
        ieq     same, seen, last
        mov     last, seen
        missing = (missing + same) & -same
        scale = missing < 3 ? FULL/UDC : none

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
        da = (al + mid)*scale + 0.5*FULL
        db = (vb + mid)*scale + 0.5*FULL
        dc = (vc + mid)*scale + 0.5*FULL
        wait    period

; For `takt accuracy`: converters of 12 bits; an encoder of 13 bits with as many turns as frames hold; integrators within their limit.
.range  ca, cb = 0, 4095
.range  n = 0, 8191
.range  turns = -2048, 2047
.range  seen, last = 0, 0x7fffffff
.range  missing = 0, 0x7ffffffe
.range  tripped = 0, 1
.range  id_ref, iq_ref = -20, 20
.range  sd, sq = -MOST, MOST
; SPDX-License-Identifier: MIT OR Apache-2.0

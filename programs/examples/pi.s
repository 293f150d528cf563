; A PI controller of a motor's speed, whose integrator does not wind up:
; what the actuator cannot do is fed back into it.
;
;   v = KP·e + s,  u = v within ±UMAX,  s' = s + T·(KI·e + (u - v)/TT)
; In this folder: takt run pi.s --plant plant/dc_motor.toml --periods 400
.schedule on

.const  T    = 1e-3                     ; s, sampling period
.const  KP   = 0.8                      ; V·s/rad
.const  KI   = 12                       ; V/rad
.const  UMAX = 24                       ; V, what the amplifier gives
.const  TT   = 0.05                     ; s, time constant of the anti-windup

.input  w_ref, w                        ; rad/s: wanted, measured
.output u                               ; V

.state  s                               ; V, the integrator

.once
        mov     s, zero
        mov     u, zero
        wait    period

.period
period:
.reg    e p v sat  di back
        fsub    e, w_ref, w
        fmul    p, e, KP
        fadd    v, p, s
        fsat    sat, v, UMAX
        mov     u, sat
        ; The output is out; the rest is for the next period.
        fsub    back, sat, v
        fmul    back, back, T/TT
        fmul    di, e, KI*T
        fadd    di, di, back
        fadd    s, s, di
        wait    period

; For `takt accuracy`: what the encoder and the reference can say, and
; what the integrator can hold.
.range  w_ref, w = -1000, 1000
.range  s = -2*UMAX, 2*UMAX
; SPDX-License-Identifier: MIT OR Apache-2.0

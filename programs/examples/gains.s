; A motor's speed controller in four equations, whose gains a host sets
; while it runs: a slider here, `takt live param` on a board.
;
; In this folder: takt run gains.s --plant plant/dc_motor.toml --periods 400

.schedule on

.const  T    = 1e-3                     ; s, sampling period
.const  UMAX = 24                       ; V, what the amplifier gives
.const  TT   = 0.05                     ; s, time constant of the anti-windup

.param  kp = 0.3 range 0..4             ; V·s/rad
.param  ki = 4.0 range 0..60            ; V/rad

.input  w_ref, w                        ; rad/s: wanted, measured
.output u                               ; V
.state  s                               ; V, the integrator

.once
        s = 0
        u = 0
        wait    period

.period
period:
.reg    e v
        e = w_ref - w
        v = kp*e + s
        u = sat(v, UMAX)
        s = s + T*ki*e + T/TT*(u - v)
        wait    period

.range  w_ref, w = -1000, 1000
.range  s = -2*UMAX, 2*UMAX
; SPDX-License-Identifier: MIT OR Apache-2.0

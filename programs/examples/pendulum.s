; A pendulum on a cart, kept upright by feedback of the state and of the
; integral of the cart's position; the gains are those of a
; linear-quadratic regulator for the parameters of cart_pendulum.toml.
;
; In this folder:
;   takt run pendulum.s --plant plant/cart_pendulum.toml --periods 6000

.schedule on

.const  T    = 1e-3                     ; s, sampling period
.const  KX   = 6.32                     ; N/m
.const  KV   = 5.65                     ; N·s/m
.const  KA   = 29.18                    ; N/rad
.const  KR   = 4.87                     ; N·s/rad
.const  KI   = 2                        ; N/(m·s)
.const  FMAX = 20                       ; N

.input  angle, rate                     ; rad, rad/s: the pendulum; 0 is upright
.input  x, v                            ; m, m/s: the cart
.input  x_ref                           ; m
.output force                           ; N

.state  s                               ; N, the integral

.once
        mov     force, zero
        mov     s, zero
        wait    period

.period
period: force = max(min(KX*(x - x_ref) + KV*v + KA*angle + KR*rate + s, FMAX), -FMAX)
        s = s + (x - x_ref)*(KI*T)
        wait    period

; For `takt accuracy`: a track of 2 m, a cart of at most 5 m/s, and a
; pendulum that turns within 20 rad/s.
.range  x = -1, 1
.range  v = -5, 5
.range  angle = -pi, pi
.range  rate = -20, 20
.range  x_ref = -1, 1
.range  s = -20, 20                     ; more than FMAX does nothing
; SPDX-License-Identifier: MIT OR Apache-2.0

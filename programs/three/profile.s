; Profiles of a motion, a subroutine of the kinematic core: the first half of a way from 0 to 1; the second is its mirror image. docs/controller.md.
;
; The speed grows over `ramp` to `speed` and stays. `f0`, `f1`, `f2`: the way after `at` seconds and its derivatives. Over the ramp, y from 0 to 1, the
; acceleration is a pulse of mean 1, g, with the integrals G, 1 at the end, and W, 1/2 at the end.
.reg    at ramp speed shape:int f0 f1 f2
profile_at:
.reg    rampi yr zr y2 inside:int half:int early:int g G Wy gt Gt Wt gp Gp Wp gc Gc Wc sn2 cs2 yy z3
        rampi = 1/ramp
        yy = at*rampi
        inside = yy < 1
        yr = min(yy, 1)
        y2 = yr*yr
; Trapezoid: rise, level, fall (as the rise, from the end).
        half = yr > 0.5
        zr = half ? 1 - yr : yr
        early = zr < RISE
        z3 = zr*zr*zr*(TOP/(6*RISE))
        gt = early ? zr*(TOP/RISE) : TOP
        Gt = early ? zr*zr*(TOP/(2*RISE)) : (zr - RISE/2)*TOP
        Wt = early ? z3 : ((zr*zr)*(1/2) - zr*(RISE/2) + RISE^2/6)*TOP
        Gt = half ? 1 - Gt : Gt
        Wt = half ? 0.5 - zr + Wt : Wt
; Parabola, cosine.
        gp, Gp, Wp = (yr - y2)*6, y2*(3 - yr*2), y2*yr*(1 - yr*(1/2))
        sn2, cs2 = sin(yr*(2*pi)), cos(yr*(2*pi))
        gc, Gc, Wc = 1 - cs2, yr - sn2*(1/(2*pi)), y2*(1/2) + (cs2 - 1)*(1/(4*pi^2))
.reg    isr:int ist:int isp:int
        isr, ist, isp = shape == PROFILE_RECTANGULAR, shape == PROFILE_TRAPEZOIDAL, shape == PROFILE_PARABOLIC
        g = isr ? 1.0 : ist ? gt : isp ? gp : gc
        G = isr ? yr : ist ? Gt : isp ? Gp : Gc
        Wy = isr ? y2*(1/2) : ist ? Wt : isp ? Wp : Wc
        f0 = speed*(ramp*Wy + max(at - ramp, 0))
        f1 = speed*G
        f2 = inside ? speed*rampi*g : 0
        ret
; SPDX-License-Identifier: MIT OR Apache-2.0

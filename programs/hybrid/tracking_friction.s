; The tracking program with two models that its spare time is spent on: the friction of every axis, and the inertia of the arms
; coupled as it is (docs/friction.md). Both are fed forward, for the reference; the rest is tracking.s.

.include <math.s>
.schedule on

; ---- Coupled inertia of the arms --------------------------------------------------------------------------------------
; The platform's inertia about its reference acceleration a = (ax, ay, az), carried by the arms:
;   Σ_i u_i·ff_i = (m_p + Σ_j κ_j)·a + Σ_j (m_s - κ_j)·u_j·(u_j·a),
; of which each term of the second sum is a force along its own arm, and the first is solved as gravity is, in closed form: with h = az/z and
; (hx, hy) = h·(x, y) - (ax, ay) it is (m_p + Σκ)·l_i·(h/3 + 2/(3R²)·(xp_i·hx + yp_i·hy)). As in step 4, m_s - κ_j = J/kb²·k_j, and kb·b_j = 1/l_j.
; d_j·a is what step 1 has, less the centripetal terms that it adds.
.macro  coupled
.reg    h hx hy h3 ex ey half e1 e2 e3 iner less
        fdiv    h, az, z
        fmul    hx, h, x
        fsub    hx, hx, ax
        fmul    hy, h, y
        fsub    hy, hy, ay
        fmul    h3, h, 1/3
        fmul    ex, hx, 1/(sqrt(3)*R)
        fmul    ey, hy, 2/(3*R)
        fmul    half, ey, 1/2
        fadd    e1, h3, ey
        fsub    h3, h3, half
        fadd    e2, h3, ex
        fsub    e3, h3, ex
        fadd    iner, k1, k2
        fadd    iner, iner, k3
        fmul    iner, iner, J/(kb*lcount)^2
        fsub    iner, 3*ms + mp, iner
        .rep i, 1, 3
.reg    along{i}
        fmul    e{i}, e{i}, l{i}d
        fmul    e{i}, e{i}, iner
        fsub    less, w{i}, vv          ; d·a = (|v|² + d·a - v²) + (v² - |v|²)
        fadd    along{i}, da{i}, less
        fmul    along{i}, along{i}, k{i}
        fmul    along{i}, along{i}, b{i}
        fmul    along{i}, along{i}, J/(kb*lcount)^3
        fadd    ff{i}, along{i}, e{i}
        .endr
.endm

; ---- Friction of an axis: f(v) = (Fc + Fs/(1 + (v/vs)²))·tanh(v/v0) + Fv·v ---------------------------------------------
; Coulomb friction Fc; what sticks beyond it at low speed, Fs (Stribeck's effect, in the form of Hess and Soom); both change sign over the
; speed v0; viscous friction Fv.
.macro  friction f, v, Fc, Fs, vs, v0, Fv
.reg    sign slide
        fmul    sign, v, 1/(v0)
        tanh    sign, sign
        .if (Fs) == 0
        fmul    slide, sign, Fc
        .else
.reg    slow stick
        fmul    slow, v, 1/(vs)
        fmul    slow, slow, slow
        fadd    slow, slow, 1
        fdiv    stick, Fs, slow
        fadd    stick, stick, Fc
        fmul    slide, sign, stick
        .endif
.reg    viscous
        fmul    viscous, v, Fv
        fadd    f, slide, viscous
.endm

; The parameters, as `takt track --fit-friction` identifies them from a run: N, m/s and N·s/m for the arms, N·m, rad/s and N·m·s for the table.
.macro  feedforward
.reg    f1 f2 f3
;                    velocity     Fc      Fs  vs  v0        Fv
        friction f1,  v1d,         8.018,  0,  1,  2.11e-4,  19.04
        friction f2,  v2d,         8.018,  0,  1,  2.11e-4,  19.03
        friction f3,  v3d,         8.018,  0,  1,  2.11e-4,  19.03
        friction ff4, omega_alpha, 0.3057, 0,  1,  5.622e-3, 0
        friction ff5, omega_gamma, 0.2031, 0,  1,  5.533e-3, 0
        coupled
        .rep i, 1, 3
        fadd    ff{i}, ff{i}, f{i}
        .endr
.endm

.include "tracking.s"
; SPDX-License-Identifier: MIT OR Apache-2.0

; The five-axis hybrid robot: parameters, ports and units, shared by its programs.
; Source: Przegląd Elektrotechniczny 98, 7/2022, and the values fixed in docs/robot.md. SI units.

.const  Ts   = 1e-4                     ; s, sampling period
.const  R    = 0.5                      ; m, radius of the arms' pivots
.const  ms   = 12                       ; kg, slider
.const  mp   = 15                       ; kg, platform
.const  J0   = 1.5                      ; kg·m², an arm about its pivot, without the slider
.const  c    = 0.35                     ; m, the slider's centre of mass lies l - c from the pivot
.const  q    = -3.9                     ; kg·m, guide and counterweight
.const  g    = 9.80665                  ; m/s²
.const  J44  = 1.8                      ; kg·m², tilt
.const  J55  = 0.6                      ; kg·m², rotation
.const  rm4  = 4.0                      ; kg·m, r4·m4
.const  w0   = 2*pi*80                  ; rad/s
.const  KP   = w0^2                     ; 1/s²
.const  KV   = 1.4*w0                   ; 1/s
.const  KI   = 0.15*w0^3                ; 1/s³
.const  xc   = 3                        ; boost of the integrator after a reversal
.const  Tc   = 0.05                     ; s, its duration
.const  lcount = 0.25e-6                ; m per count, linear encoders
.const  tcount = 2*pi/262144            ; rad per count, rotary encoders

; Per axis: encoder resolution, error below which the boost fades to nothing, bound of the integrator.
.rep i, 1, 3
.const  count{i} = lcount
.const  ec{i}    = 2e-6                 ; m
.const  smax{i}  = 1e-4                 ; m·s
.endr
.rep i, 4, 5
.const  count{i} = tcount
.const  ec{i}    = 3e-5                 ; rad
.const  smax{i}  = 1e-3                 ; rad·s
.endr

.input  n1:int, n2:int, n3:int          ; counts of 0.25 µm
.input  n4:int, n5:int                  ; counts of 2π/2^18 rad
.input  x, y, z                         ; m, reference of the tool
.input  vx, vy, vz                      ; m/s
.input  ax, ay, az                      ; m/s²
.input  alpha, gamma                    ; rad, reference of tilt and rotation
.input  omega_alpha, omega_gamma        ; rad/s
.input  eps_alpha, eps_gamma            ; rad/s²

.output F1, F2, F3                      ; N
.output tau4, tau5                      ; N·m
.output l1d, l2d, l3d                   ; m
.output v1d, v2d, v3d                   ; m/s
.output a1d, a2d, a3d                   ; m/s²
.output th4d, th5d                      ; rad
.output om4d, om5d                      ; rad/s
.output ep4d, ep5d                      ; rad/s²

; Ranges, on which `takt accuracy` rests: the workspace of the letters with room to spare.
.range  x, y = -0.1, 0.1
.range  z = 0.65, 0.75
.range  vx, vy, vz = -0.3, 0.3
.range  ax, ay, az = -10, 10
.range  alpha = -pi, pi
.range  gamma = -2*pi, 2*pi
.range  omega_alpha, omega_gamma = -20, 20
.range  eps_alpha, eps_gamma = -1000, 1000
.range  n1, n2, n3 = 3160000, 3800000   ; 0.79 m to 0.95 m
.range  n4 = -131072, 131072            ; half a turn either way
.range  n5 = -262144, 262144            ; a turn
; SPDX-License-Identifier: MIT OR Apache-2.0

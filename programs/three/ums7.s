; UMS-7, the six-joint arm of the third founding paper: constants, shared by the programs of its cores. docs/controller.md.
; `programs/src/three/` has the same in binary64, and a test compares them. SI units.

.const  Td = 1e-4                       ; s, period of the dynamic core
.const  STEPS = 4                       ; of its periods to one of the kinematic core
.const  Tk = STEPS*Td                   ; s

; ---- Geometry: that of programs/arm, in metres --------------------------------------------------------------------------------
.const  a1 = 0.075                      ; Denavit-Hartenberg
.const  a2 = 0.27
.const  a3 = 0.09
.const  d1 = 0.345
.const  d4 = 0.295
.const  d6 = 0.102
.const  L2 = a3^2 + d4^2                ; m², from the elbow to the wrist's centre, squared
.const  elbow = atan2(d4, a3)           ; rad, that line against joint 3's zero

; ---- Nominal dynamics -----------------------------------------------------------------------------------------------------------
.const  C0 = 4.2                        ; kg·m², but C6: N·m
.const  C1 = 6.1
.const  C2 = 3.4
.const  C3 = 2.3
.const  C4 = 7.9
.const  C5 = 1.7
.const  C6 = 4.9
.const  C7 = 0.12
.const  C8 = 0.05
.const  Da = 1/60                       ; control per N·m
.const  Db = 0.8                        ; control per rad/s
.const  Dc = 0.02                       ; control per rad/s²

; ---- Limits, joint by joint: range, rad; velocity, rad/s; torque, N·m --------------------------------------------------------------
; Torques: 1.3 times the largest of the move that programs/src/three/dynamics.rs describes, rounded.
.const  low1 = -170*pi/180
.const  low2 = -60*pi/180
.const  low3 = -100*pi/180
.const  low4 = -175*pi/180
.const  low5 = -120*pi/180
.const  low6 = -175*pi/180
.const  high1 = 170*pi/180
.const  high2 = 170*pi/180
.const  high3 = 170*pi/180
.const  high4 = 175*pi/180
.const  high5 = 120*pi/180
.const  high6 = 175*pi/180
.rep    i, 1, 3
.const  fast{i} = 3
.endr
.rep    i, 4, 6
.const  fast{i} = 6
.endr
.const  torque1 = 230
.const  torque2 = 340
.const  torque3 = 140
.const  torque4 = 6.5
.const  torque5 = 12
.const  torque6 = 2.6
.rep    i, 1, 6
.const  control{i} = 2*(Da*torque{i} + Db*fast{i}) ; limit of the control: twice what the limits ask for
.endr

; ---- A trapezoidal pulse of acceleration --------------------------------------------------------------------------------------------
.const  RISE = 0.25                     ; of its time; then it falls as long
.const  TOP  = 1/(1 - RISE)             ; its largest value, where its mean is 1
; SPDX-License-Identifier: MIT OR Apache-2.0

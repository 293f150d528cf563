; The seven axes of a Panda at 1 kHz: encoder, filter, PD with inverse dynamics, friction, saturation (docs/model.md#a-body-in-a-law).
; The equations of the dynamics in dynamics.s were made by
;   takt model panda.urdf -f inverse-dynamics --body --prefix id_ -o dynamics.s

.const  RATE  = 1000                    ; periods in a second
.const  COUNT = 2*pi/2^20               ; rad in a count
.const  ALPHA = 1 - exp(-2*pi*80/RATE)  ; filter of first order, corner at 80 Hz
.const  KP    = 20^2                    ; 1/s²: both poles of the error at 20 rad/s
.const  KD    = 2*20                    ; 1/s
.const  JUMP  = ceil(2*2.61/RATE/COUNT)    ; counts in a period: a joint at twice its highest speed, or a faulty encoder
.const  STICK = 1/0.02                  ; s/rad: below 0.02 rad/s, Coulomb friction is proportional to the velocity

.input  n[7]:int                        ; counts of the encoders
.input  qr[7] qdr[7] qddr[7]            ; reference: rad, rad/s, rad/s²
.output tau[7]                          ; N m
.ports  latched
.state  before[7]:int v[7]              ; counts of the period before, filtered velocity
.reg    q[7] raw[7] dry[7] friction[7]
        .preset v = 0
.schedule on

.once
        .rep i, 1, 7
        before[i] = n[i]
        .endr
        wait    period

.period
period:
        .rep i, 1, 7
        q[i] = itof(n[i])*COUNT
        raw[i] = sat(itof(n[i] - before[i]), JUMP)*(COUNT*RATE)
        before[i] = n[i]
        v[i] = v[i] + ALPHA*(raw[i] - v[i])
        id_q[i] = q[i]
        id_qd[i] = v[i]
        id_qdd[i] = qddr[i] + KD*(qdr[i] - v[i]) + KP*(qr[i] - q[i])
        dry[i] = sat(STICK*qdr[i], 1)
        .endr
        friction[1] = 0.8*qdr[1] + 0.6*dry[1]      ; viscous, N m s, and Coulomb, N m
        friction[2] = 1.0*qdr[2] + 0.9*dry[2]
        friction[3] = 0.6*qdr[3] + 0.5*dry[3]
        friction[4] = 0.7*qdr[4] + 0.9*dry[4]
        friction[5] = 0.3*qdr[5] + 0.7*dry[5]
        friction[6] = 0.2*qdr[6] + 0.3*dry[6]
        friction[7] = 0.2*qdr[7] + 0.4*dry[7]
        .include "dynamics.s"
        .rep i, 1, 7
        tau[i] = sat(id_tau[i] + friction[i], i <= 4 ? 87 : 12)
        .endr
        wait    period

; For `takt accuracy`: joints and speeds within the limits of panda.urdf, accelerations within those of the maker's data sheet.
.const  lower1 = -2.8973
.const  upper1 = 2.8973
.const  lower2 = -1.7628
.const  upper2 = 1.7628
.const  lower3 = -2.8973
.const  upper3 = 2.8973
.const  lower4 = -3.0718
.const  upper4 = -0.0698
.const  lower5 = -2.8973
.const  upper5 = 2.8973
.const  lower6 = -0.0175
.const  upper6 = 3.7525
.const  lower7 = -2.8973
.const  upper7 = 2.8973
.rep i, 1, 7
.const  fastest{i} = i <= 4 ? 2.175 : 2.61
.range  n[i], before[i] = floor(lower{i}/COUNT), ceil(upper{i}/COUNT)
.range  qr[i] = lower{i}, upper{i}
.range  qdr[i] = -fastest{i}, fastest{i}
.range  v[i] = -1.2*fastest{i}, 1.2*fastest{i}
.range  qddr[i] = -20, 20
.endr
; SPDX-License-Identifier: MIT OR Apache-2.0

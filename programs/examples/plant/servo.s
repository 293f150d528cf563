; Position of a motor's shaft, by a PI controller with velocity feedback and anti-windup, every millisecond.
; The plant is a program of its own: plant.py.

.schedule on
.const  T       = 1e-3                  ; s, from tick to tick
.const  COUNT   = 2*pi/4096             ; rad, one count of the encoder
.const  KP      = 1.44                  ; A/rad
.const  KI      = 14.4                  ; A/(rad s)
.const  KD      = 0.04                  ; A s/rad
.const  KB      = 0.2                   ; of what the limit cuts off, what the integral gives back
.const  FILTER  = 0.3                   ; of the measured velocity, what is new
.const  LIMIT   = 2.0                   ; A

.input  n:int, ref                      ; encoder, counts; wanted angle, rad
.output current                         ; A

.reg    q e dn:int v dv u p d cut step give change
.state  last:int w integral

.once
        isub    last, n, zero           ; no jump of velocity in the first period
        fadd    w, zero, zero
        fadd    integral, zero, zero
        wait    period

.period
period: itof    q, n
        fmul    q, q, COUNT
        isub    dn, n, last
        isub    last, n, zero
        itof    v, dn
        fmul    v, v, COUNT/T
        fsub    dv, v, w
        fmul    change, dv, FILTER
        fadd    w, w, change            ; low-pass: a count a period is already 1.5 rad/s

        fsub    e, ref, q
        fmul    p, e, KP
        fmul    d, w, KD
        fadd    u, p, integral
        fsub    u, u, d
        fsat    current, u, LIMIT

        fsub    cut, current, u         ; not zero while the limit is in force
        fmul    step, e, KI*T
        fmul    give, cut, KB
        fadd    integral, integral, step
        fadd    integral, integral, give
        wait    period

; For `takt accuracy`: 64 turns of an encoder of 4096 counts, at most 12,000 rpm.
.range  n, last = -64*4096, 64*4096
.range  ref = -128*pi, 128*pi
.range  w = -1300, 1300
.range  integral = -2000, 2000
; SPDX-License-Identifier: MIT OR Apache-2.0

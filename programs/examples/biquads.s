; A low-pass filter of eighth order (Butterworth), as a cascade of four
; biquads in transposed direct form II.
;
; Coefficients are computed by the assembler from the corner frequency;
; the state is in registers, so that nothing is loaded or stored, and a
; section's output waits for two operations of its input only.
;
; In this folder: takt run biquads.s --inputs biquads.csv

.schedule on

.const  FS = 10000                      ; Hz, sampling rate
.const  FC = 400                        ; Hz, corner
.const  N  = 4                          ; sections

.input  x                               ; V, measured
.output y                               ; V, filtered

; Bilinear transform, prewarped; the pole pairs of a Butterworth filter
; of order 2N lie at angles of (2i - 1)·90°/2N.
.const  w0 = 2*pi*FC/FS
.rep    i, 1, N
.const  al{i} = sin(w0)*cos(pi*(2*i - 1)/(4*N))
.const  b{i}  = (1 - cos(w0))/2/(1 + al{i})     ; b0 = b2, b1 = 2·b0
.const  a1{i} = 2*cos(w0)/(1 + al{i})           ; of what is fed back, added
.const  a2{i} = (al{i} - 1)/(1 + al{i})
.state  p{i} q{i}
.endr

.once
        .rep    i, 1, N
        mov     p{i}, zero
        mov     q{i}, zero
        .endr
        mov     y, zero
        wait    period

.period
period:
.reg    v0
        mov     v0, x
        .rep    i, 1, N
.reg    u{i} w{i} v{i} c{i} d{i}
        fmul    u{i}, v{i-1}, b{i}
        fadd    v{i}, u{i}, p{i}        ; the section's output
        fmul    c{i}, v{i}, a1{i}
        fadd    w{i}, u{i}, u{i}
        fadd    w{i}, w{i}, q{i}
        fadd    p{i}, w{i}, c{i}
        fmul    d{i}, v{i}, a2{i}
        fadd    q{i}, u{i}, d{i}
        .endr
        mov     y, v{N}
        wait    period

; For `takt accuracy`: a signal of full scale. Every such signal leaves
; the states within 5.5 (the sum of the magnitudes of their responses to
; an impulse), with a little room.
.range  x = -1, 1
        .rep    i, 1, N
.range  p{i}, q{i} = -6, 6
        .endr
; SPDX-License-Identifier: MIT OR Apache-2.0

; A Kalman filter of four states: position and velocity in two
; directions, of which the two positions are measured.
; In this folder: takt run kalman.s --inputs kalman.csv
; Model x' = F·x + noise Q, z = H·x + noise R. Every matrix is written
; out by repetitions, of a symmetric one its upper half; what is zero or
; one in F and H costs nothing, because it is not there: F adds T times
; the velocity to the position.

.schedule on

.const  T  = 0.01                       ; s, sampling period
.const  QA = 4.0                        ; m²/s⁴, of the acceleration that is not known
.const  RX = 0.04                       ; m², of the measurement
.const  P0 = 10.0                       ; of the first covariance

.input  z1, z2                          ; m, measured positions
.output x1, x2, x3, x4                  ; m, m, m/s, m/s: position, velocity
.output p11, p33                        ; their variances

; State i (1, 2) is a position, i + 2 its velocity.
.state  s1 s2 s3 s4
.rep    i, 1, 4
.rep    j, i, 4
.state  P{i}{j}
.endr
.endr
.const  q11 = QA*T^4/4
.const  q13 = QA*T^3/2
.const  q33 = QA*T^2

.once
        .rep    i, 1, 4
        mov     s{i}, zero
        mov     x{i}, zero
        .rep    j, i, 4
        .if     i == j
        mov     P{i}{j}, P0
        .else
        mov     P{i}{j}, zero
        .endif
        .endr
        .endr
        mov     p11, zero
        mov     p33, zero
        wait    period

.period
period:

; ---- Prediction: m = F·s, M = F·P·Fᵀ + Q -----------------------------
.reg    m1 m2
.reg    M11 M12 M13 M14 M22 M23 M24 M33 M44
        .rep    i, 1, 2
.reg    d{i}
        fmul    d{i}, s{i+2}, T
        fadd    m{i}, s{i}, d{i}
        .endr
        .rep    i, 1, 2
        .rep    j, 1, 2
.reg    V{i}{j}
        fmul    V{i}{j}, P{min(i,j)+2}{max(i,j)+2}, T
        fadd    M{i}{j+2}, P{i}{j+2}, V{i}{j}   ; position and velocity, without Q
        .endr
        .endr
        ; positions: P + T·(Pᵢ,ⱼ₊₂ + Pⱼ,ᵢ₊₂) + T²·Pᵢ₊₂,ⱼ₊₂
        .rep    i, 1, 2
        .rep    j, i, 2
.reg    a{i}{j}
        fadd    a{i}{j}, M{i}{j+2}, P{j}{i+2}
        fmul    a{i}{j}, a{i}{j}, T
        fadd    M{i}{j}, P{i}{j}, a{i}{j}
        .endr
        .endr
        .rep    i, 1, 2
        fadd    M{i}{i}, M{i}{i}, q11
        fadd    M{i}{i+2}, M{i}{i+2}, q13
        fadd    M{i+2}{i+2}, P{i+2}{i+2}, q33
        .endr

; ---- Gain: K = M·Hᵀ·S⁻¹, S = the positions' block of M, and R --------
.reg    S11 S22 det dd inv I11 I22 I12
        fadd    S11, M11, RX
        fadd    S22, M22, RX
        fmul    det, S11, S22
        fmul    dd, M12, M12
        fsub    det, det, dd
        fdiv    inv, 1.0, det
        fmul    I11, S22, inv
        fmul    I22, S11, inv
        fmul    I12, M12, inv           ; the inverse's element is its opposite
        ; (an element of a symmetric matrix has the smaller index first: M{10*min(i,j)+max(i,j)})
        .rep    i, 1, 4
.reg    K{i}1 K{i}2 k{i}1 k{i}2
        fmul    K{i}1, M{10*min(i,1)+max(i,1)}, I11
        fmul    k{i}1, M{10*min(i,2)+max(i,2)}, I12
        fsub    K{i}1, K{i}1, k{i}1
        .assume K{i}1 <= (i <= 2 ? 1 : 8) ; of a position M/(M + RX); of a speed at most √(P0/RX)/2
        fmul    K{i}2, M{10*min(i,2)+max(i,2)}, I22
        fmul    k{i}2, M{10*min(i,1)+max(i,1)}, I12
        fsub    K{i}2, K{i}2, k{i}2
        .assume K{i}2 <= (i <= 2 ? 1 : 8)
        .endr

; ---- Correction: s = m + K·(z - H·m), P = M - K·H·M ------------------
.reg    e1 e2
        fsub    e1, z1, m1
        fsub    e2, z2, m2
        .rep    i, 1, 4
.reg    c{i} cc{i} n{i}
        fmul    c{i}, K{i}1, e1
        fmul    cc{i}, K{i}2, e2
        fadd    c{i}, c{i}, cc{i}
        .if     i <= 2
        fadd    n{i}, m{i}, c{i}
        .else
        fadd    n{i}, s{i}, c{i}
        .endif
        mov     s{i}, n{i}
        mov     x{i}, n{i}
        .rep    j, i, 4
.reg    t{i}{j} tt{i}{j}
        fmul    t{i}{j}, K{i}1, M{10*min(j,1)+max(j,1)}
        fmul    tt{i}{j}, K{i}2, M{10*min(j,2)+max(j,2)}
        fadd    t{i}{j}, t{i}{j}, tt{i}{j}
        .if     (i == 3) & (j == 4)
        fsub    P34, P34, t34           ; which the prediction leaves as it is
        .else
        fsub    P{i}{j}, M{i}{j}, t{i}{j}
        .endif
        .endr
        .endr
        mov     p11, P11
        mov     p33, P33
        wait    period

; For `takt accuracy`: positions within 100 m, speeds within 50 m/s. A
; variance begins at P0 and ends below it; the two directions have
; nothing to do with one another, so that what they have in common stays
; zero.
.range  z1, z2, s1, s2 = -100, 100
.range  s3, s4 = -50, 50
.range  P11, P22, P33, P44 = 0, P0
.range  P13, P24 = 0, 1
.range  P12, P14, P23, P34 = 0, 0
; SPDX-License-Identifier: MIT OR Apache-2.0

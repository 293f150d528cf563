; A vehicle's pose by an extended Kalman filter: place, heading, speed and rate of turn; measured are distance and bearing of a beacon.

.include <control.s>
.const  T = 0.05                        ; s
.array  Q[5,5] R[2,2] P[5,5] x[5] z[2] beacon[2] m[5] F[5,5] e[2] H[2,5]
.output done
.schedule on
.contract on
.once
        mov     done, zero
        wait    period
.period
period:
.reg    c s dx dy square distance
; m = f(x): what the model predicts; F its derivatives.
        c, s = cos(x[3]), sin(x[3])
        m[1], m[2], m[3] = x[1] + T*(x[4]*c), x[2] + T*(x[4]*s), x[3] + T*x[5]
        m[4], m[5] = x[4], x[5]
.rep i, 1, 5
        F[i,i] = 1
.endr
        F[1,3], F[1,4] = -T*(x[4]*s), T*c
        F[2,3], F[2,4] = T*(x[4]*c), T*s
        F[3,5] = T
; e = z - h(m); H its derivatives.
        dx, dy = beacon[1] - m[1], beacon[2] - m[2]
        square = dx*dx + dy*dy
        .assume square >= 1             ; m²: the vehicle does not reach the beacon
        distance = sqrt(square)
        e[1], e[2] = z[1] - distance, z[2] - (atan2(dy, dx) - m[3])
        H[1,1], H[1,2] = -dx/distance, -dy/distance
        H[2,1], H[2,2], H[2,3] = dy/square, -dx/square, -1
        ekf_step x, P, m, F, Q, e, H, R, 5, 2
        done = 1
        wait    period

; For `takt accuracy`: places within 100 m and a heading, speeds within 20 m/s, rates within 3 rad/s: 100 covers them all.
.range  x, beacon, z = -100, 100
.range  P = -10, 10
.range  F = -1, 1
.range  Q, R = 0, 1
.range  H = -1, 1
.result x, P
; SPDX-License-Identifier: MIT OR Apache-2.0

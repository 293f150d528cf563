; A Kalman filter of 12 states, of which 3 combinations are measured: x' = F·x + noise Q, z = H·x + noise R, all matrices dense.

.array F[12,12] H[3,12] Q[12,12] R[3,3] P[12,12] N[12,12] G[12,3] x[12] m[12] z[3]
.output done
.schedule on
.contract on
.once
        wait    period
.period
period:
.reg v[12] w[12,12] h[3,12]
; prediction by rows: m = F*x, N = F*P*F' + Q, G = N*H'
.rep j, 1, 12
        v[j] = x[j]
.rep r, 1, 3
        h[r,j] = H[r,j]
.endr
.rep i, 1, 12
        fadd    w[i,j], F[i,j], zero
.endr
.endr
.for i, 1, 12
.reg f[12] p[12,12] t[12] n[12]
.rep k, 1, 12
        f[k] = F[i,k]
.endr
        m[i] = sum(k, 1, 12, f[k]*v[k])
.rep j, 1, 12
.rep k, 1, 12
        p[k,j] = P[k,j]
.endr
        t[j] = sum(k, 1, 12, f[k]*p[k,j])
.endr
.rep j, 1, 12
        n[j] = Q[i,j] + sum(k, 1, 12, t[k]*w[j,k])
        N[i,j] = n[j]
.endr
.rep r, 1, 3
        G[i,r] = sum(k, 1, 12, h[r,k]*n[k])
.endr
.endfor
.reg S[3,3] V[3,3] e[3] d K[3] HP[3,12]
.rep j, 1, 12
.rep r, 1, 3
        HP[r,j] = G[j,r]
.endr
.endr
.rep r, 1, 3
.rep c, 1, r
        S[r,c] = R[r,c] + sum(k, 1, 12, HP[r,k]*h[c,k])
.endr
        e[r] = z[r] - sum(k, 1, 12, h[r,k]*m[k])
.endr
        V[1,1] = S[2,2]*S[3,3] - S[3,2]*S[3,2]
        V[2,1] = S[3,1]*S[3,2] - S[2,1]*S[3,3]
        V[3,1] = S[2,1]*S[3,2] - S[3,1]*S[2,2]
        V[2,2] = S[1,1]*S[3,3] - S[3,1]*S[3,1]
        V[3,2] = S[2,1]*S[3,1] - S[1,1]*S[3,2]
        V[3,3] = S[1,1]*S[2,2] - S[2,1]*S[2,1]
        d = 1/(S[1,1]*V[1,1] + S[2,1]*V[2,1] + S[3,1]*V[3,1])
.rep r, 1, 3
.rep c, 1, r
        V[r,c] = V[r,c]*d
.endr
.endr
        V[1,2] = V[2,1]
        V[1,3] = V[3,1]
        V[2,3] = V[3,2]
; correction
.for i, 1, 12
.reg q[3]
.rep r, 1, 3
        q[r] = G[i,r]
.endr
.rep r, 1, 3
        K[r] = q[1]*V[1,r] + q[2]*V[2,r] + q[3]*V[3,r]
.endr
        x[i] = m[i] + (K[1]*e[1] + K[2]*e[2] + K[3]*e[3])
.rep j, 1, 12
        P[i,j] = N[i,j] - (K[1]*HP[1,j] + K[2]*HP[2,j] + K[3]*HP[3,j])
.endr
.endfor
        done = 1
        wait    period
; SPDX-License-Identifier: MIT OR Apache-2.0

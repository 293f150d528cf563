; The dynamic core: the servo of six joints. Points of the motion come from the kinematic core, one for four periods; what lies between is
; interpolated, and each joint is led along it by feed-forward, PID with gains that follow the inertia, and a limited control. docs/controller.md.

.include "ums7.s"
.schedule on

.const  count = 2*pi/2^18               ; rad, of an encoder
.const  w0    = 2*pi*15                 ; rad/s, bandwidth
.const  zeta  = 0.8
.const  KI    = 0.1                     ; of w0³
.const  SPAN  = 8                       ; periods, over which the error's derivative is taken: a power of two
.const  LAG   = 0.05                    ; rad, of an error: the joint does not follow

.input  n1:int, n2:int, n3:int, n4:int, n5:int, n6:int ; encoders
.input  point_q, point_v, point_a, point_u, point_i    ; of a joint: rad, s; nominal control; Da·H + Dc
.input  points:int                      ; entries that wait
.output point_pop:int
.output u1, u2, u3, u4, u5, u6
.output enable:int                      ; 1: drives on
.output m1, m2, m3, m4, m5, m6          ; rad, as measured
.output r1, r2, r3, r4, r5, r6          ; rad, the reference of this period
.output ready:int                       ; 1: they are
.output lost:int                        ; number of a joint that does not follow; 0: none

.state  qa[6] va[6] aa[6] ua[6]         ; the point where the interpolation begins
.state  qb[6] vb[6] ab[6] ub[6] inertia[6] ; and ends
.state  E[6]                            ; rad·s, integral of the error
.state  phase:int                       ; periods since the last point came
.state  head:int pops:int on:int

.data
past:                                   ; errors, joint by joint
        .rep    i, 1, 6*SPAN
        .float  0
        .endr
; How the ends weigh at s = 1/4 … 1: quintic for the angle (of qb - qa, va·Tk, vb·Tk, aa·Tk², ab·Tk²), linear for the nominal control.
; The velocity's error is the derivative of the angle's, so that reference and measurement are late by the same.
weights:
        .rep    j, 1, STEPS
.const  s{j} = j/STEPS
        .float  10*s{j}^3 - 15*s{j}^4 + 6*s{j}^5
        .float  (s{j} - 6*s{j}^3 + 8*s{j}^4 - 3*s{j}^5)*Tk
        .float  (-4*s{j}^3 + 7*s{j}^4 - 3*s{j}^5)*Tk
        .float  (s{j}^2 - 3*s{j}^3 + 3*s{j}^4 - s{j}^5)*Tk^2/2
        .float  (s{j}^3 - 2*s{j}^4 + s{j}^5)*Tk^2/2
        .float  s{j}
        .endr

.once
        .rep i, 1, 6
        qa[i], va[i], aa[i], ua[i] = 0, 0, 0, 0
        qb[i], vb[i], ab[i], ub[i], inertia[i] = 0, 0, 0, 0, 0
        E[i] = 0
        u{i}, m{i}, r{i} = 0, 0, 0
        .endr
        phase, head, pops, on = 1, 0, 0, 0
        enable, ready, lost = 0, 0, 0
        wait    period

.period
period:
; ---- A new point: six entries -------------------------------------------------------------------------------------------------
.reg    few:int
        phase = phase < STEPS ? phase + 1 : STEPS ; without a new point the reference stands at the last one
        few = points < 6
        bnz     few, interpolate
        .rep i, 1, 6
.reg    pq{i} pv{i} pa{i} pu{i} pi{i}
        mov     pq{i}, point_q
        mov     pv{i}, point_v
        mov     pa{i}, point_a
        mov     pu{i}, point_u
        mov     pi{i}, point_i
entry{i}:                               ; read: it may go
        pops = pops + 1
        point_pop = pops
        call    rest                    ; the next head is on the ports only some cycles later
        .endr
        .rep i, 1, 6
        qa[i], va[i], aa[i], ua[i] = qb[i], vb[i], ab[i], ub[i]
        qb[i], vb[i], ab[i], ub[i], inertia[i] = pq{i}, pv{i}, pa{i}, pu{i}, pi{i}
        .endr
        phase = 1
        bnz     on, interpolate
; The first one: the drives go on, and the reference stands there.
        .rep i, 1, 6
        qa[i], va[i], aa[i], ua[i] = qb[i], vb[i], ab[i], ub[i]
.reg    start{i}
        start{i} = qb[i] - itof(n{i})*count
        .rep j, 0, SPAN - 1
        st      past + (i - 1)*SPAN + j, start{i}
        .endr
        .endr
        on = 1

; ---- Between the points -----------------------------------------------------------------------------------------------------------
interpolate:
.reg    p:int row:int
.reg    wq:float wva:float wvb:float waa:float wab:float ws:float
        p = phase - 1
        row = (p << 2) + (p << 1)
        ld      wq, weights[row]
        ld      wva, weights + 1[row]
        ld      wvb, weights + 2[row]
        ld      waa, weights + 3[row]
        ld      wab, weights + 4[row]
        ld      ws, weights + 5[row]

; ---- The joints -----------------------------------------------------------------------------------------------------------------------
.reg    behind[6]:int
        .rep i, 1, 6
.reg    q{i} q0{i} u0{i} e{i} old{i}:float de{i} u{i}f us{i} free{i}:int out{i}:int
        q{i} = itof(n{i})*count
        q0{i} = qa[i] + ((qb[i] - qa[i])*wq + ((va[i]*wva + vb[i]*wvb) + (aa[i]*waa + ab[i]*wab)))
        u0{i} = ua[i] + (ub[i] - ua[i])*ws
        e{i} = q0{i} - q{i}
        ld      old{i}, past + (i - 1)*SPAN[head]
        st      past + (i - 1)*SPAN[head], e{i}
        de{i} = (e{i} - old{i})*(1/(SPAN*Td))
        u{i}f = u0{i} + inertia[i]*((e{i}*w0^2 + de{i}*(2*zeta*w0)) + E[i]*(KI*w0^3))
        us{i} = sat(u{i}f, control{i})
        out{i} = e{i}*u{i}f < 0         ; the error's integral goes on where that leads out of saturation
        free{i} = (us{i} == u{i}f) | out{i}
        E[i] = free{i} & on ? E[i] + e{i}*Td : E[i]
        u{i} = on ? us{i} : 0
        m{i}, r{i} = q{i}, q0{i}
        behind[i] = (abs(e{i}) > LAG) & on
        .endr
        lost = behind[1] ? 1 : behind[2] ? 2 : behind[3] ? 3 : behind[4] ? 4 : behind[5] ? 5 : behind[6] ? 6 : 0
        head = (head + 1) & (SPAN - 1)
        enable, ready = on, 1
        wait    period

rest:   call    more
        ret
more:   ret
; SPDX-License-Identifier: MIT OR Apache-2.0

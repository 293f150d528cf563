; SPDX-License-Identifier: MIT OR Apache-2.0
; Macros for motors and drives: `.include <motor.s>`.
;
; Currents and voltages are vectors whose length is a phase's amplitude. A position is a whole number of turns and a fraction in [0, 1), so that
; binary32 resolves 2⁻²⁴ turn however far the axis has gone. Gains and limits may be constants or registers.
.include <math.s>
.include <signal.s>

; ---- Transforms -----------------------------------------------------------------------------------------------------------

; Clarke: phases a and b of three that add up to zero, to the stator's axes.
.macro clarke al:float, be:float, a:float, b:float
        al = a
        be = (a + 2*b)*(1/sqrt(3))
.endm

; Clarke: three measured phases; a part common to all three drops out.
.macro clarke3 al:float, be:float, a:float, b:float, c:float
        al = (2*a - (b + c))*(1/3)
        be = (b - c)*(1/sqrt(3))
.endm

; Inverse Clarke: the stator's axes to the three phases.
.macro inverse_clarke a:float, b:float, c:float, al:float, be:float
.reg    half side
        half = -0.5*al
        side = (sqrt(3)/2)*be
        a, b, c = al, half + side, half - side
.endm

; Park: the stator's axes to the rotor's, whose angle has sine sn and cosine cs.
.macro park d:float, q:float, al:float, be:float, sn:float, cs:float
        d, q = al*cs + be*sn, be*cs - al*sn
.endm

; Inverse Park: the rotor's axes to the stator's.
.macro inverse_park al:float, be:float, d:float, q:float, sn:float, cs:float
        al, be = d*cs - q*sn, d*sn + q*cs
.endm

; ---- Controllers ------------------------------------------------------------------------------------------------------------

; PI controller with back-calculation: u = kp·e + s within ±limit; the integrator s, a `.state`, takes ki·e and kb times the part of u that the
; limit cuts off. ki is the integral gain times the period; kb in [0, 1], 1 leaves at the limit the value that just reaches it.
.macro pi_limited u:float, s:float, e:float, kp:float, ki:float, limit:float, kb:float
.reg    wish
        wish = kp*e + s
        u = sat(wish, limit)
        s = s + (ki*e + kb*(u - wish))
.endm

; Voltage circle, direct axis first: d keeps as much as its share of the radius allows, q the rest. The share is below 1: at 1 nothing would
; be left, and a root of nearly nothing loses half of the digits.
.macro circle_d_first ud:float, uq:float, d:float, q:float, radius:float, share:float
.reg    left
        ud = sat(d, share*radius)
        left = sqrt(radius*radius - ud*ud)
        uq = sat(q, left)
.endm

; Voltage circle that keeps the vector's direction: a longer one is scaled to the radius, which is positive.
.macro circle_scaled ud:float, uq:float, d:float, q:float, radius:float
.reg    gain
        gain = radius/sqrt(max(d*d + q*q, radius*radius))
        ud, uq = d*gain, q*gain
.endm

; Field weakening: an integrator s ≤ 0, a `.state`, of the direct current. It follows the voltage that is left, radius - |u|, with
; the gain ki (A/V in a period), and stays within [-most, 0].
.macro field_weakening id:float, s:float, ud:float, uq:float, radius:float, ki:float, most:float
        s = min(max(s + ki*(radius - sqrt(ud*ud + uq*uq)), -most), 0)
        id = s
.endm

; ---- Modulation -------------------------------------------------------------------------------------------------------------

; Space vectors: duties in [0, 1] of three half bridges for a voltage of at most udc/√3; the phases' middle goes to the bridge's middle.
.macro space_vectors da:float, db:float, dc:float, al:float, be:float, udc:float
.reg    b c shift gain
        b, c = (sqrt(3)/2)*be - 0.5*al, -0.5*al - (sqrt(3)/2)*be
        shift = 0.5*max(min(max(b, c), al), min(b, c))          ; half of the middle one: the three add up to zero
        gain = 1/udc
        da, db, dc = (al + shift)*gain + 0.5, (b + shift)*gain + 0.5, (c + shift)*gain + 0.5
.endm

; Space vectors of a voltage in parts of the bridge's, at most 1/√3.
.macro space_vectors_of_parts da:float, db:float, dc:float, al:float, be:float
.reg    b c shift
        b, c = (sqrt(3)/2)*be - 0.5*al, -0.5*al - (sqrt(3)/2)*be
        shift = 0.5*max(min(max(b, c), al), min(b, c)) + 0.5
        da, db, dc = al + shift, b + shift, c + shift
.endm

; Dead time: adds to the duty d, in place, the share of the carrier's period that dead time takes from a current i out of the half bridge.
; Within ±band (A) the share goes linearly through zero. share = dead time times carrier frequency.
.macro dead_time d:float, i:float, share:float, band:float
        d = min(max(d + share*sat(i/band, 1), 0), 1)
.endm

; ---- Positions --------------------------------------------------------------------------------------------------------------

; An encoder's counts, 2^digits a turn, to whole turns and fraction: exact for up to 24 digits.
.macro position turns:int, part:float, count:int, digits:number
        turns = count >> digits
        part = itof(count & ((1 << digits) - 1))*(1/(1 << digits))
.endm

; The electrical angle as a fraction of its turn, of a motor with this number of pole pairs: integers, therefore exact.
.macro electrical part:float, count:int, pairs:number, digits:number
        part = itof(count*pairs & ((1 << digits) - 1))*(1/(1 << digits))
.endm

; Sine and cosine of a fraction of a turn.
.macro turn_sincos sn:float, cs:float, part:float
.reg    angle
        angle = part*(2*pi)
        sn, cs = sin(angle), cos(angle)
.endm

; A sum in (-1, 2) as a fraction of a turn, and the whole turn that it carries. The fraction stays below 1 when a sum rounds up to it.
.macro motor.carried part:float, carry:int, sum:float
        carry = (sum >= 1) - (sum < 0)
        part = min(sum - itof(carry), 1 - 0x1p-24)
.endm

; Advances a position, in place, by less than a turn.
.macro advance turns:int, part:float, by:float
.reg    sum carry:int
        sum = part + by
        motor.carried part, carry, sum
        turns = turns + carry
.endm

; d = position 1 - position 2 in turns, exact to a rounding as long as both are near one another.
.macro between d:float, turns1:int, part1:float, turns2:int, part2:float
        d = itof(turns1 - turns2) + (part1 - part2)
.endm

; Observer of speed by a phase-locked loop: part and speed, `.state`s, follow the measured fraction. T is the period; a bandwidth of w rad/s,
; critically damped, has kp = 2·w and ki = w². Speed is in turns/s, less than a turn in a period.
.macro pll part:float, speed:float, measured:float, kp:float, ki:float, T:float
.reg    far e next carry:int
        far = measured - part
        e = far + itof((far < -0.5) - (far > 0.5))      ; the shorter way round
        next = part + T*(speed + kp*e)
        motor.carried part, carry, next
        speed = speed + T*ki*e
.endm

; Speed of an incremental encoder in counts/s by the times of its edges, as fine at low speed as at high: count and since are the registers
; of a board's `quadrature`, last and before those of the period before (`.state`s, as is v), T and f a period in cycles and the clock in
; Hz. In periods without an edge, v falls as far as the next edge is late.
.macro edge_speed v:float, last:int, before:int, count:int, since:int, T:float, f:float
.reg    turned:int apart most
        turned = count - last
        apart = T + (itof(before) - itof(since))        ; cycles from the last edge of then to that of now
        most = f/itof(since)
        v = turned == 0 ? sat(v, most) : f*itof(turned)/apart
        last = count
        before = since
.endm

; ---- Profiles ---------------------------------------------------------------------------------------------------------------

; Trapezoidal profile: moves p with speed v, both `.state`s, one period T towards goal, within speed vmax and acceleration amax. The speed from
; which the axis still stops in time solves d = v²/(2·a) + v·T/2. Arrives exactly, and takes a new goal at any time.
.macro trapezoid p:float, v:float, goal:float, vmax:float, amax:float, T:float
.reg    d stop want
        d = goal - p
        stop = sqrt((0.5*T*amax)*(0.5*T*amax) + 2*amax*abs(d)) - 0.5*T*amax
        want = sat(d/T, min(stop, vmax))
        v = v + sat(want - v, T*amax)
        p = v == d/T ? goal : p + T*v
.endm

; S-curve: the mean of a profile's last n positions, n a power of two, so that acceleration changes over n periods. ring is an `.array` of n and k an
; int `.state`, both set to the first position and to 1 before. The sum is of distances from p, so that it ends exactly where the profile ends.
.macro s_curve y:float, ring:float, k:int, p:float, n:number
        ring[k] = p
        k = k == n ? 1 : k + 1
        y = p + sum(j, 1, n, ring[j] - p)*(1/n)
.endm

; ---- Compensation -----------------------------------------------------------------------------------------------------------

; Cogging torque: the table T of n + 1 values over a turn, linear between them, at a fraction of a turn. T[n+1] repeats T[1].
.macro cogging y:float, T:float, part:float, n:number
.reg    place
        place = part*n
        table1  y, T, place, n + 1
.endm

; Notch filter at w rad/s with damping zeta (half of its relative width), sampled with period T, prewarped; s is a `.state` of 2.
.macro notch y:float, u:float, s:float, w:number, zeta:number, T:number
.const  k = tan(w*T/2)
.const  norm = 1/(1 + 2*zeta*k + k*k)
        y = u*((1 + k*k)*norm) + s[1]
        s[1] = s[2] + (u - y)*(2*(k*k - 1)*norm)
        s[2] = u*((1 + k*k)*norm) - y*((1 - 2*zeta*k + k*k)*norm)
.endm

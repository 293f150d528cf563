; A motor's position by step and direction, without a host: a P loop of
; the position, a PI loop of the speed, on a machine for small FPGAs.
; What is at which pin: icebreaker.toml, tang-nano-9k.toml; docs/board.md.
;
;   takt board sim --wiring icebreaker.toml --program servo.s \
;     --axis motor,encoder,20000 --script steps.txt
;
; gives it 40 steps, and prints how far the motor has come.

.machine "machine.toml"
.schedule on

.const  HALF = 600                      ; cycles, full duty
.const  VMAX = 8                        ; counts per period, fastest
.const  KP = 0.05                       ; counts per period, per count
.const  KV = 0.08                       ; of full duty, per count per period
.const  KI = 0.01                       ; of full duty, per count

.input  n:int                           ; counts, from the encoder
.input  steps:int                       ; wanted counts, a step each
.output duty:int                        ; cycles, -HALF to HALF

.state  s                               ; of full duty, the integrator
.state  last:int                        ; counts, n a period ago

.once
        s, last, duty = 0, n, 0
        wait    period

.period
.reg    moved:int far:int v e u sat
period: moved = n - last
        last = n
        v = max(min(itof(moved), 4*VMAX), -4*VMAX)
        far = steps - n
        e = max(min(KP*itof(far), VMAX), -VMAX) - v
        u = KV*e + s
        sat = max(min(u, 1), -1)
        duty = ftoi(sat*HALF)
        ; The integrator follows what the bridge can give.
        s = sat - (KV - KI)*e
        wait    period

; For `takt accuracy`: counts whose difference is one.
.range  n, steps, last = -0x20000000, 0x1fffffff
.range  s = -4, 4
; SPDX-License-Identifier: MIT OR Apache-2.0

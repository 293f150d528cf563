; A speed command becomes a ramp. Commands come through a FIFO: the head stays until its target is reached, so that the
; next one begins in the period after.

.schedule on

.input  target, rate                    ; rad/s, rad/s per period: the command at the FIFO's head
.input  empty:int                       ; 1: there is none
.output w_ref                           ; rad/s
.output done:int                        ; a write takes the command

.state  x                               ; rad/s, where the ramp stands

.once
        mov     x, zero
        mov     w_ref, zero
        wait    period

.period
period:
.reg    d step
        bnz     empty, idle
        fsub    d, target, x
        fsat    step, d, rate
        fadd    x, x, step
        mov     w_ref, x
        fsub    d, target, x
        bnz     d, idle
        mov     done, zero
idle:
        wait    period

; For `takt accuracy`: speeds of a motor of 10,000 rpm.
.range  target, x, w_ref = -1000, 1000
.range  rate = 0, 1000
.range  empty = 0, 1
; SPDX-License-Identifier: MIT OR Apache-2.0

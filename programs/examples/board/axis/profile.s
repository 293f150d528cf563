; Moves become a ramp. The head of the FIFO stays until its target is reached, so that the next move begins in the period after.

.schedule on

.input  target, rate                    ; counts, counts per period: the move at the FIFO's head
.input  empty:int                       ; 1: there is none
.output wanted                          ; counts
.output there                           ; counts: a write tells the host that a move has ended
.output done:int                        ; a write takes the move

.state  x                               ; counts, where the ramp stands

.once
        mov     x, zero
        mov     wanted, zero
        wait    period

.period
period:
.reg    d step
        bnz     empty, idle
        fsub    d, target, x
        fsat    step, d, rate
        fadd    x, x, step
        mov     wanted, x
        fsub    d, target, x
        bnz     d, idle
        mov     there, x
        mov     done, zero
idle:
        wait    period

; For `takt accuracy`: positions that binary32 holds to a count; the whole way in one period at most.
.range  target, x, wanted = -0x1000000, 0x1000000
.range  rate = 0, 0x1000000
.range  empty = 0, 1
; SPDX-License-Identifier: MIT OR Apache-2.0

; A lamp that blinks: SECONDS on, SECONDS off. A counter of periods and
; an output.
;
;   takt run programs/examples/blink.s --periods 2000

.schedule on

.const  T       = 1e-3                  ; s, from period to period
.const  SECONDS = 0.5                   ; s, of one side
.const  LAST    = SECONDS/T - 1         ; periods of one side, counted from 0

.output lamp:int                        ; 1: on
.state  count:int                       ; periods since the lamp changed

.once
        mov     lamp, zero
        mov     count, zero
        wait    period

.period
period:
.reg    full:int                        ; local names: what a period computes and forgets
        ieq     full, count, LAST
        ixor    lamp, lamp, full
        iadd    count, count, 1
        sel     count, full, 0, count
        wait    period

; For `takt accuracy`: the lamp is on or off, and its counter is cleared
; at LAST.
.range  lamp = 0, 1
.range  count = 0, LAST
; SPDX-License-Identifier: MIT OR Apache-2.0

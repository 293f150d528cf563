; A motor's position on a board: an encoder's counts in, a PWM's duty out. What is at which pin: position.toml; docs/board.md.
;
;   takt board sim --board ulx3s-85f --wiring position.toml --program position.s --axis motor,encoder,20000
;   takt live PORT --baud 1000000 --program position.s set wanted=40

.schedule on
.const  gain = 0.02                     ; of full duty, per count

.input  n:int                           ; counts, from the encoder
.input  wanted:int                      ; counts, from the host
.output duty                            ; -1 to 1
.output error:int                       ; counts

.once
        duty, error = 0, 0
        wait    period

.period
period: error = wanted - n
        duty = max(min(itof(error)*gain, 1), -1)
        wait    period

; For `takt accuracy`: counts whose difference is one.
.range  n, wanted = -0x40000000, 0x3fffffff
; SPDX-License-Identifier: MIT OR Apache-2.0

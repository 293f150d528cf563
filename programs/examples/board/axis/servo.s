; An axis: an encoder's counts in, a PWM's duty out, proportional to the error.

.schedule on
.const  gain = 0.02                     ; of full duty, per count

.input  wanted                          ; counts, from the ramp
.input  n:int                           ; counts, from the encoder
.output duty                            ; -1 to 1
.output error                           ; counts

.once
        duty, error = 0, 0
        wait    period

.period
period: error = wanted - itof(n)
        duty = max(min(error*gain, 1), -1)
        wait    period

; For `takt accuracy`: positions that binary32 holds to a count.
.range  wanted = -0x1000000, 0x1000000
.range  n = -0x1000000, 0x1000000
; SPDX-License-Identifier: MIT OR Apache-2.0

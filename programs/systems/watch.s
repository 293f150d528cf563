; Watches an actuator: the largest magnitude that it was given, and how many values there were.

.schedule on

.input  u                               ; V
.output peak                            ; V
.output values:int

.once
        mov     peak, zero
        mov     values, zero
        wait    period

.period
period:
.reg    a
        fabs    a, u
        fmax    peak, peak, a
        iadd    values, values, 1
        wait    period

; For `takt accuracy`: the amplifier of pi.s. The number of values wraps after 2³² periods.
.range  u = -24, 24
.range  peak = 0, 24
.range  values = 0, 0x7ffffffe
; SPDX-License-Identifier: MIT OR Apache-2.0

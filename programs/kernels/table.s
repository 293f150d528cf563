; A table of 33 values, interpolated.

.include <signal.s>
.array  T[33] x[1] y[1]
.output done
.schedule on
.contract on
.once
        mov     done, zero
        wait    period
.period
period:
        table1  y[1], T, x[1], 33
        done = 1
        wait    period

; For `takt accuracy`: values in units of the largest; a place on the table, and as far beyond either end.
.range  T = -1, 1
.range  x = -32, 64
.result y
; SPDX-License-Identifier: MIT OR Apache-2.0

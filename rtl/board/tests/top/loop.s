; SPDX-License-Identifier: MIT OR Apache-2.0
; A proportional controller with a set point that the host sets; force is a quarter of the difference, and the lamp is lit at odd counts.
.schedule on
.input n:int wanted:int
.output force lit:int
.once
        mov     force, zero
        mov     lit, zero
        wait    period
.period
period:
.reg    e:int f
        isub    e, wanted, n
        itof    f, e
        fmul    force, f, 0.25
        iand    lit, n, 1
        wait    period

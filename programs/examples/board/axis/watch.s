; Watches an error: the largest magnitude so far, how many were seen, and a lamp while it is above a limit.

.schedule on

.input  error, limit                    ; counts
.output peak                            ; counts
.output values:int
.output lit:int                         ; 0 or 1

.once
        mov     peak, zero
        mov     values, zero
        mov     lit, zero
        wait    period

.period
period:
.reg    a
        fabs    a, error
        fmax    peak, peak, a
        iadd    values, values, 1
        flt     lit, limit, a
        wait    period

; For `takt accuracy`: errors of positions that binary32 holds to a count. The number of values wraps after 2³² periods.
.range  error = -0x2000000, 0x2000000
.range  limit, peak = 0, 0x2000000
.range  values = 0, 0x7ffffffe
; SPDX-License-Identifier: MIT OR Apache-2.0

; A thermistor read through a divider: voltage to temperature by a table
; in data memory, interpolated. Memory is right here: the entry depends
; on a measurement, which no register's name can.
;
; In this folder: takt run table.s --inputs table.csv

.include <math.s>
.schedule on

.const  T    = 0.1                      ; s, from one reading to the next
.const  UREF = 3.3                      ; V, of the divider above the thermistor
.const  RPULL = 10e3                    ; Ω
.const  R25  = 10e3                     ; Ω, at 25 °C
.const  B    = 3950                     ; K
.const  LOW  = 0.1                      ; V, of the table's first entry
.const  HIGH = 3.2                      ; V, and of its last
.const  N    = 64                       ; intervals
.const  STEP = (HIGH - LOW)/N           ; V

.input  u                               ; V
.output temp                            ; °C; outside of the table its ends

.data
table:
        .rep    i, 0, N
.const  u{i} = LOW + i*STEP
.const  r{i} = RPULL*u{i}/(UREF - u{i})
        .float  1/(1/298.15 + log(r{i}/R25)/B) - 273.15
        .endr
        .float  0                       ; read, and weighted with zero, at the very end

.once
        mov     temp, zero
        wait    period

.period
period:
.reg    pos safe below  known:int k:int whole part  t0 t1 dt
        fsub    pos, u, LOW
        fmul    pos, pos, 1/STEP
        clamp   pos, pos, 0, N
        feq     known, u, u             ; no number becomes an address
        sel     safe, known, pos, zero
        fsub    below, safe, 0.5        ; ftoi rounds; at a boundary either will do
        ftoi    k, below
        itof    whole, k
        fsub    part, pos, whole
        ld      t0, table[k]
        ld      t1, table+1[k]
        fsub    dt, t1, t0
        fmul    dt, dt, part
        fadd    temp, t0, dt
        wait    period

; For `takt accuracy`: what a converter of 5 V can say, beyond the
; divider's supply.
.range  u = -1, 5
; SPDX-License-Identifier: MIT OR Apache-2.0

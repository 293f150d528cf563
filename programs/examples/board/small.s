; A servo drive without a host, on a small FPGA: position by step and direction, speed, and the currents of drive.s, whose sines come from
; a table in data memory here, interpolated. What is at which pin: small.toml; docs/board.md.
;
;   takt bound small.s --pins --wiring small.toml
;   takt board sim --wiring small.toml --program small.s --plant plant/small.toml --periods 2000 --plot loop.svg

.machine "machine/foc.toml"

.const  FULL  = 2400.0/2048             ; a period of the carrier in steps of the duties' scale
.const  STEPS = 256                     ; of the table, in an electrical turn
.const  EACH  = 16                      ; counts of a step: an electrical turn has 4096
.const  GIVEN = 64                      ; counts that a step of the input is
.const  VMAX  = 10                      ; counts per period, fastest
.const  IMAX  = 8                       ; A
.const  KX    = 0.003                   ; counts per period, per count
.const  KV    = 5.0                     ; A, per count per period
.const  KS    = 0.01                    ; A, per count per period, in each period
.const  MEAN  = 0.1                     ; of the speed: a filter of ten periods

.data
sine:                                   ; a quarter of a turn more than one: the cosine is read further on
        .rep    i, 0, STEPS + STEPS/4
        .float  sin(2*pi*i/STEPS)
        .endr

.input  steps:int                       ; of step and direction
.state  last:int                        ; counts, n a period ago
.state  v                               ; counts per period, the filtered speed
.state  si                              ; A, the integrator of the speed

.macro  sine_cosine sn:float, cs:float, at:int
.reg    step:int part  s0 s1 c0 c1
        step = at >> 4
        part = itof(at & (EACH - 1))*(1.0/EACH)
        ld      s0, sine[step]
        ld      s1, sine + 1[step]
        ld      c0, sine + STEPS/4[step]
        ld      c1, sine + STEPS/4 + 1[step]
        sn = s0 + part*(s1 - s0)
        cs = c0 + part*(c1 - c0)
.endm

.macro  first
        last, v, si = n, 0, 0
.endm

.macro  wanted id:float, iq:float       ; A: P of the position, PI of the speed
.reg    moved:int far:int e u
        moved = n - last
        last = n
        v = (1 - MEAN)*v + MEAN*max(min(itof(moved), 4*VMAX), -4*VMAX)
        far = steps*GIVEN - n
        e = max(min(KX*itof(far), VMAX), -VMAX) - v
        u = KV*e + si
        iq = max(min(u, IMAX), -IMAX)
        si = max(min(si + KS*e, IMAX), -IMAX)
        id = 0
.endm
.include "drive.s"

; For `takt accuracy`: a thousand turns in either direction, so that a distance has at most 24 bits and is a float without rounding.
.range  n, last = -0x400000, 0x3fffff
.range  steps = -0x10000, 0xffff
.range  v = -4*VMAX, 4*VMAX
.range  si = -IMAX, IMAX
; SPDX-License-Identifier: MIT OR Apache-2.0

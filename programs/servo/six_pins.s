; SPDX-License-Identifier: MIT OR Apache-2.0
; `six.s` at the pins of a board (six_pins.toml): currents and voltage as codes of converters, encoders by BiSS C, all of the carrier's valley.
.const  FULL  = 750/512                 ; duties in 512 cycles: the wiring scales by powers of two, and its carrier has 750
.include "axis.s"
.schedule on

.const  AXES = 6
.const  AMPERES = 50                    ; A at the ends of a converter of 12 bits, 2048 at 0 A
.const  VOLTS = 66                      ; V at its end

.input  ca[AXES]:int, cb[AXES]:int      ; codes of the phase currents
.input  cu:int                          ; code of the bridges' voltage
.input  count[AXES]:int                 ; of the encoders, 2¹⁷ a turn
.input  alarm[AXES]:int                  ; 1: the encoder reports an error
.input  frames[AXES]:int                ; frames of the encoder so far: without a new one `count` is old
.input  tripped:int                     ; not 0: a trip is held, and the bridges are off
.input  goal[AXES]                      ; turns, ±64
.input  enable:int                      ; a bit for each axis

.state  seen[AXES]:int
.preset seen = -1
.reg    ia[AXES] ib[AXES] udc error:int wrong:int

.macro measure
        udc = itof(cu)*(VOLTS/4096)
        error = 0
        .rep    i, 1, AXES
        ia[i], ib[i] = itof(ca[i] - 2048)*(AMPERES/2048), itof(cb[i] - 2048)*(AMPERES/2048)
        wrong = (frames[i] == seen[i]) | alarm[i] | (tripped != 0)
        error = error | (wrong << (i - 1))
        seen[i] = frames[i]
        .endr
.endm

.output stop[AXES]:int                  ; 1: the bridge is at rest
.macro give
        .rep    i, 1, AXES
        stop[i] = xor(runs[i], 1)
        .endr
.endm

.include "six_axes.s"

; For `takt accuracy`: as in servo.s.
.range  ca, cb, cu = 0, 4095
.range  count = -(64 << DIGITS), 64 << DIGITS
.range  alarm = 0, 1
.range  frames, seen = -2147483648, 2147483647
.range  tripped = 0, 3
.range  goal = -64, 64
.range  enable = 0, (1 << AXES) - 1

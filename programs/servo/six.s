; SPDX-License-Identifier: MIT OR Apache-2.0
; Six servo axes on one core: six current loops at 100 kHz; in each period, behind the outputs, the motion loop of one axis, at 10 kHz each.
.const  FULL  = 1                       ; duties are parts of the carrier
.include "axis.s"
.schedule on

.const  AXES = 6

.input  ia[AXES], ib[AXES]              ; A, phase currents out of the bridges
.input  count[AXES]:int                 ; of the encoders, 2¹⁷ a turn
.input  goal[AXES]                      ; turns, ±64
.input  udc                             ; V, of all bridges
.input  error:int                       ; of the encoders, a bit for each axis
.input  enable:int                      ; a bit for each axis

.macro measure
.endm
.macro give
.endm

.include "six_axes.s"

; For `takt accuracy`: as in servo.s.
.range  ia, ib = -ITRIP, ITRIP
.range  count = -(64 << DIGITS), 64 << DIGITS
.range  goal = -64, 64
.range  udc = 0, UMAX
.range  error, enable = 0, (1 << AXES) - 1

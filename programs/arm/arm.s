; The six-axis articulated arm: geometry and units, shared by its programs.
; Source: the second founding paper, Table 1; docs/arm.md. Lengths in mm, angles in degrees at the ports.

.const  a1 = 75                         ; mm, Denavit-Hartenberg
.const  a2 = 270
.const  a3 = 90
.const  d1 = 345
.const  d4 = 295
.const  d6 = 102
.const  L2    = a3^2 + d4^2             ; mm², from the elbow to the wrist's centre, squared
.const  alpha = atan2(d4, a3)           ; rad, that line against joint 3's zero
.const  rad   = pi/180                  ; rad per degree
; SPDX-License-Identifier: MIT OR Apache-2.0

; drive.s with isolated currents: delta-sigma modulators at the phases, whose sinc³ filters also trip. What is at which pin:
; isolated.toml; docs/power-stage.md.
;
;   takt bound isolated.s --pins --wiring isolated.toml
;   takt board sim --wiring isolated.toml --program isolated.s --plant plant/isolated.toml --periods 200 --outputs loop.csv --plot loop.svg

.macro  amperes i:float, value:int      ; A from a filter's value: 20 A are 50³
        i = itof(value)*(20.0/125000)
.endm
.const  LEAST = -125000
.const  GREATEST = 125000
.include "drive.s"
; SPDX-License-Identifier: MIT OR Apache-2.0

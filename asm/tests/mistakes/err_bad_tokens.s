.reg a
.const X = 0x
.const Y = 5metres
.const Z = 99999999999999999999
.const Q = 'c'
# no comment
.include "open
.period
        mov     a, $1
        mov     a, b²
        mov     a, ≠≠≠ 1

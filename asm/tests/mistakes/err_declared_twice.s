.reg a b a
.const b = 3
.input a
.period
zero:   nop
loop:   nop
loop:   nop
.reg pi
.reg zero
        mov     a, pi

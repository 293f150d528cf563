.const K = 3
.input x
.reg a
.period
period: mov     K, 1
        mov     x, 1
        mov     zero, 1
        mov     3, a
        mov     period, a
        mov     a+1, a
        mov     @i3, a
        mov     [a], a

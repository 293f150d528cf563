.reg a @ m12
.reg b @ i3
.reg c @ m240
.reg d @ m999
.reg e @ zero
.reg f @ m12
.input x @ m3
.output y @ i3
.output z @ m3
.period
        fadd    a, 1, 2
        fadd    @x3, 1, 2
        mov     @m300, 1

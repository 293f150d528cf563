.reg a
.period
.rep i, 1, 3
label:  nop
.reg q
        fadd    q{i}, a, 1
.endr
.rep i, 1, 10000000
.endr
.rep i, 0.5, 2
.endr
.rep i, 1
.endr
.rep i, -1, 1
        mov     a, l{i}
.endr

.reg a @ m1
.const K = 3
.preset m1 = 1.5
.preset a = 2
.preset zero = 1
.preset m999 = 1
.preset K = 1
.preset @m2
.preset m3 = m4
.period
        fadd    @a3, a, 1

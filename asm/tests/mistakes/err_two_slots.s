; A value that several slots compute is copied to one place, if there is a way.
.input x, n:int
.output F, G
.state placed @ a3, tested
.once
        fadd    placed, x, 1
        fadd    tested, x, 1
        wait    period
.period
period: ld      placed, [n]
        fadd    tested, tested, x || bz tested, over
        ld      tested, [n]
over:   mov     @x7, n
        fadd    @x7, x, 1
        fadd    F, placed, tested
        fadd    G, x, 1 || mov G, n
        fadd    F, @x7, 1
        wait    period

.input  a:int, b:int, c:int, d:int, n:int
.output y:int, z:int, w:int
.period
period: y = n == 1 & a < b
        z = n & 1 == 0
        w = a < b < c < d
.if 1 < 2 & 3 < 4
.endif
        wait    period

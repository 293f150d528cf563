.input  x, v, n:int, m:int
.output y:int, z:int, w:int
.period
period: ieq     y, x, v
        ilt     z, n, x
        iltu    w, x, m
        wait    period

; Comparisons of floats, and conditions on them.
.input  x, v, n:int, m:int
.output y:int
.period
period: y = x == n
        y = x < v & v < x
        y = n & v
        y = !x
        y = n + x
        y = x << 2
        wait    period

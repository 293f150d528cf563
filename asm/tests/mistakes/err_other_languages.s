; Statements and operators that other languages have.
.input  x, v, n:int
.output y, k:int
.reg    u s
.state  P[2,2]
.const  K = 2**3
.const  L = 1 < 2 && 3 < 4
.period
period: for i in 1..3
        for j in 0..=n
        for i in range(3):
        for i = 1, 3
        while x > 0:
        if x > 0:
        if x > 0
        elif x < 0:
        int n2 = 3
        float u
        u += 1
        u -= x*v + 1
        u *= 2
        P[1,2] /= v
        s ^= u
        k <<= 2
        u++
        u--
        u := 1
        y = x**2 + v**0.5
        y = v/x**3
        k = x > 0 && v < 1
        k = x > 0 || v < 1 && n == 3
        k = (x > 0 || v < 1) && n == 3
        k = x > 0 and v < 1
        k = not x
        y = x if n else v
        y = max(x > 0 && v, 1)
.if K > 1 || K < 0
.endif
.if K > 1 && L
.endif
        wait    period

; Equations: operators, types, constants, equal parts, macros as functions, arrays, sums.
.schedule off
.input  x, y, n:int, m:int
.output a, b, c, k:int
.const  G = 9.81
.const  two = 2
.reg    t u j:int w
.state  s P[2,2] v[3]
.macro  half d, of                      ; a function: writes its first parameter
        d = of/2
.endm
.macro  scale to, from, by
.rep    i, 1, 3
        to[i] = from[i]*by
.endr
.endm
.once
        s, P[1,1], P[1,2], P[2,1], P[2,2] = 0, 1, 0, 0, 1
        .rep i, 1, 3
        v[i] = i
        .endr
        wait    period
.period
period: t = x*x + y*y                   ; a label and an equation
        u = t*(2*pi) + t*(2*pi)         ; a constant part, and equal parts
        t = t/3                         ; a division is one
        u = u + t*(2*pi)                ; t has changed
        a = sqrt(x*x + y*y) - G*-half(x - y)
        j = n + 3 << two & m            ; integers
        k = !(j > 3) ? n : -j
        w = n != m ? 1 : -1             ; a float, as w is
        b = n <= m ? min(t, u, w) : abs(t)
        s = sat(s + itof(n)*0.5, 10)
        c = half(x)
        t, u = u, t                     ; swapped
        fadd    w, P[1,2], v[2]         ; an element where a register may stand
        scale   v, v, w
        P[1,2] = sum(i, 1, 3, v[i]*i) + sum(i, 1, 0, v[i]) + s + t*u + w
        P[2,1] = has.fsin ? sin(P[1,1]) : tan(P[2,2])
        P[2,2] = P[1,2] > P[2,1] ? x : y
        wait    period

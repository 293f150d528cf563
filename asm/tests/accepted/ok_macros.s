; Macros, repetition, templates, conditionals.
.const  AXES = 3
.const  COUPLED = 1
.macro  limit value, bound
.reg    low
        fsat    value, value, bound
        flt     low, value, 0
        bz      low, done
        mov     value, bound
done:
.endm
.macro  pair x, y
        limit   x, 2.0
        limit   y, 1.0/4
.endm
.macro  axis n, gain
        fmul    f{n}, e{n}, gain*n
.if COUPLED & (n > 1)
        fmul    c{n}{n-1}, e{n}, e{n-1}
.elif n == 1
        fmul    c{n}0, e{n}, e{n}
.else
.error "never"
.endif
.endm
.rep i, 1, AXES
.input  e{i}
.output f{i}
.output c{i}{i-1}
.endr
.reg    p q
.period
period:
.rep i, 1, AXES
        axis    i, 10
l{i}:   nop
.endr
.rep i, 1, 3
.rep j, i, i%3+1
        fmul    f1, e{i}, e{j}
.endr
.endr
.rep i, 3, 1
        frobnicate
.endr
        fadd    p, e1, e2
        fsub    q, e1, e2
        mov     x1, p || fadd y1, q, 0
.reg    x1 x2 y1
        mov     x2, q
        pair    x1, x2
        fadd    @a100, x1, x2
        fadd    @a100, @a100, y1
        fadd    @a101, @a100, 1
        wait    period

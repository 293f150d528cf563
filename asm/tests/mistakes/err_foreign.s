// What other languages and processors write.
.input  x, n:int
.output y, k:int
.reg    a
.period                         // it's a comment with 5mistakes "and a text
period: fma     y, x, x, x
        fmadd   a, x, x, x
        imul    k, n, n
        fgt     k, x, 1
        beq     n, period
        ile     k, n, 3
        fadd    y, x, 7 // 2
        ld      y, tab[n]
        ld      y, tab+1
        st      room, y
        fadd    y, x, tab[n]
        wait    period

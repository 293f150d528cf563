; machine f1
; An integer where a float is meant, and where it is well.
.input  x, n:int
.output y, out, k:int
.reg    one two half count:int index scale z
.period
period: mov     one, 1
        fadd    y, x, one
        sel     two, n, 2, 2.0
        fmul    z, two, x
        fadd    y, y, z
        li      half, 3
        fmul    z, y, half
        fadd    y, y, z
        mov     count, 1
        iadd    k, count, n
        li      index, 7
        ishl    index, index, n
        mov     k, index
        mov     scale, 0
        fadd    y, y, scale
        li      scale, bits(0.5)
        fadd    y, y, scale
        mov     out, -5
; Declared types, results, literals, tables and addresses that are read as another type.
.reg    a f p w s moved:float twisted copy:bits
.state  steps kept
.output flag
        fadd    y, x, n
        iadd    a, x, 1
        fmul    y, y, a
        li      a, 1.5
        isub    k, a, 1
        li      p, table
        fadd    y, y, p
        fadd    y, y, table
        ld      w, table[n]
        isub    k, w, 1
        ld      w, words
        fadd    y, y, w
        ld      w, table[x]
        mov     s, n
        sel     s, k, s, n
        fadd    y, y, s
        ilt     moved, n, 4
        fadd    y, y, moved
        feq     flag, x, y
        iadd    steps, steps, 1
        itof    k, n
        fadd    kept, kept, 1
; Well: bits, casts, distances, registers that hold the one and then the other.
        ishl    f, x, n
        fadd    y, y, f
        mov     copy, x
        iadd    k, copy, 1
        iadd    k, x:bits, 1
        fadd    y, y, n:float
        iadd    twisted:float, x:bits, 4096
        fadd    y, y, twisted
        fadd    y, y, words - table
        fadd    y, y, float(words)
        ixor    f, x, y
        ilt     k, f, zero
        ld      w, table[n:bits]
        fadd    y, y, w
        ilt     f, n, 5
        bz      f, over
        fadd    f, x, x
        fadd    y, y, f
over:   ld      w, room[n]
        isub    k, w, 1
        fadd    y, y, w
        st      room[n], k
        wait    period
.once
        mov     steps, zero
        mov     kept, zero
        wait    period
.data
        .float  9
table:  .float  1, 2
words:  .word   3
room:   .space  4

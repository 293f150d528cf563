; Data memory, labels as addresses, memory operands.
.const  N = 3
.input  i:int
.output F, k:int, b:bits
.data
table:  .float 1, -2.5, 2*pi, inf, nan
count:  .word 5, -1, 0xffff_ffff
room:   .space 20
end:
.once
        li      k, end - table
        li      b, table
        li      k, period
        li      b, 1.5
        li      b, bits(1.5)
.period
period: ld      F, table[i]
        ld      F, table+1[i]
        ld      F:bits, count
        ld      F, [i]
        ld      k, N*2[zero]
        st      room[i], F
        st      room+3, 1.5
        iadd    k, k, count
        iadd    k, k, 0
        iand    b, b, 3
        iand    b, b, 3.0
        jmp     period
.data
more:   .word N, more

.reg a
.data
table:  .float 1, 2
.period
period: ld      a, 5000[zero]
        ld      a, -1[zero]
        ld      a, table+0.5
        ld      a, a
        ld      a, period
        mov     a, table[a]
        jmp     70000
        jmp     -1
        jmp     0.5
        ld      a, 2000
        ld      a, table[1024]
        st      4[-5], a
        ld      a, table+2
        ld      a, table[2]
        ld      a, table-0+1
        wait    period

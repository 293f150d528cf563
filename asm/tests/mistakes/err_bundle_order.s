; machine f1
.reg a b c
.period
period: mov     a, b || mov b, a
        mov     a, 1 || mov a, 2
        jmp     period || wait period
        bz      a, period || mov a, 1
        mov     a, b || mov b, c || mov c, a
        .raw    one 0x123 || mov a, 1

.reg a
.period
        .loc "x.s" 0
        .loc somewhere
        .loc "x.s" 1 || "x.s" 2
        mov     a, 1
        .loc none
        .raw    mul 0x1000000000000
        .raw    fpu 0
        .raw    mul
        mov     a, a || .raw aux 0x020000000000
        .period || nop
        nop     ||

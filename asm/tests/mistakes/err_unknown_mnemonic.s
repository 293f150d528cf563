; A mnemonic with a letter missing, one of another assembler, and one far from any.
.reg a b
.period
        mov     a, 1
        fad     b, a, a
        add     b, a, a
        frobnicate a
        reg     c

        .float 1
.data
        nop
        .word 1
.space 3
.period
        .space 3
.once 3

; A register that lies in one bank cannot be written from two; within a straight run the assembler splits the name.
.reg total
.state kept
.output F
.once
        mov     kept, 0
.period
period: fmul    total, kept, 2
        bz      total, over
        fadd    total, kept, 2
over:   fadd    kept, total, 1
        fadd    F, total, 0
        fmul    F, total, 0
        wait    period

; A period without an end.
.input  x
.output y
.once
        wait    period
.period
period: fadd    y, x, 1
        call    twice
        jmp     period
twice:  fadd    y, x, x
        ret

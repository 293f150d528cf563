; A generated file, with a period of its own and a subroutine that a program may call.
.input  q
.output f
.period
period: fadd    f, q, q
        call    used
        wait    period
used:   fadd    f, f, q
        ret
spare:  fmul    f, f, q
        ret

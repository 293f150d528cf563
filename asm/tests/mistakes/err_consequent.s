; Only the mistakes themselves: what they leave unused is not reported.
.input  x
.output y
.reg    spede speed heavy twice
.const  UNUSED = 1
.once
        wait    period
.period
period: fadd    spede, x, 1
        fadd    y, speed, 1
        fmul    twice, x, x
        wait    period

; An output whose register another operation names.
.input  a
.output F @ 9
.once
        fmul    F, a, a
        fmul    @m233, a, a

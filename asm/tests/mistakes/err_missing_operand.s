.reg a b
.period
        fadd    a, , b
        fadd    a, b,
        fadd    , a, b
        .float  1, 2,
.const  X =
.const  Y
.const  = 3
X = 3

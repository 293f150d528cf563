.reg a k
.data
        .float  1e39
        .word   4294967296, -2147483649, 0.5
.period
        fadd    a, 1e39, -1e39
        iadd    k, k, 2.5
        iadd    k, k, 5e9
        li      k, 8589934592
        fadd    a, 1e-60, a

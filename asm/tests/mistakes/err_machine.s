; machine f1
.reg a @ m3
.reg b @ r3
.period
        fadd    b, @x3, 1
        .raw    add 0

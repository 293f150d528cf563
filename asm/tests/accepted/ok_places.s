; Everything with its place given.
.input  x @ i7, n:int
.output F @ a230, G
.reg    p @ m12, q:bits @ m13
.reg    r
.state  s:int @ x5
.preset s = 3
.preset p = 2
.preset @m40 = 2
.preset m41 = 0x3f800000
.once
        .loc    "elsewhere.s" 12
        fmul    q, p, @m40
        .loc    "other \"file\".s" 3 || none || "elsewhere.s" 4
        fmul    p, p, x || fadd F, p, x || iadd s, s, n
        .loc    none
        fadd    G, q, @m41
        .raw    aux 0xffffffffffff
        .raw    mul 0x000000000000 || fadd r, p, q || .raw aux 0x020000000001
.period
period: wait    period
.schedule off

; Bounds of loops: before their first bundle, wherever that comes to lie.
.const  N = 4
.input  x
.output y, k:int
.reg    sum n:int i:int more:int

.macro  count turns
        li      i, turns
        .loop_bound turns
again:  isub    i, i, 1
        bnz     i, again
.endm

.schedule on
.once
        count   3
        count   N + 1
        wait    period
.period
period: fadd    sum, zero, zero
        mov     n, N
.loop_bound N                           ; the scheduler moves nothing across it
turn:   fadd    sum, sum, x || isub n, n, 1
        fmul    y, sum, x
        bnz     n, turn
.schedule off
        nop
.loop_bound 0x7fff_ffff
busy:   ilt     more, n, 3 || fadd sum, sum, 1.0
        bnz     more, busy
        mov     k, n
        wait    period

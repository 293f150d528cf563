; Registers that operations of several slots write.
.input  x, reset:int
.output y, z
.state  sum, held, kept
.data
start:  .float  2.5
.once
        mov     sum, zero               ; loaded with the program
        ld      held, start
        fadd    kept, x, 1
        wait    period
.period
period: bz      reset, run
        mov     sum, zero               ; becomes an operation of the adder's slot
run:    fadd    sum, sum, x
        fadd    held, held, sum         ; lies where `ld` writes: copied in a free slot
        fmul    y, held, 2
        fmul    y, y, y
        fmul    z, held, sum
        fsub    kept, z, kept
        wait    next
next:   ld      kept, start
        wait    period

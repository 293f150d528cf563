; One axis of a PD controller.
.const  KP = (2*pi*80)^2            ; 1/s²
.const  KD = 2*0.7*(2*pi*80)
.input  n:int, qd, vd               ; counts, m, m/s
.output F                           ; N
.reg    q e qprev v ev u            ; registers, placed by the assembler

.macro limit x, m
        fsat x, x, m
        flt k, x, m
        bz k, done
        mov x, 0
done:
.reg k
.endm
.once
        mov     qprev, zero
        wait    period
.period
period: itof    q, n
        fmul    q, q, 0.25e-6       ; a constant where a register is read
        fsub    e, qd, q   || mov qprev, q
        fmul    u, e, KP
        fsub    v, q, qprev
        fmul    v, v, 5000
        fsub    ev, vd, v
        fmul    ev, ev, KD
        .rep i, 1, 3
        fadd    ev, ev, i*0.5
        .endr
        fadd    F, u, ev            ; an output is written by any instruction that has a destination
        ld q, table[n]
        limit q, 3.0
        wait    period
.data
table: .float 1, 2.5, KP
 .word 3, -1, 0xffffffff

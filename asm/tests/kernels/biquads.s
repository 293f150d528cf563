; A cascade of six biquads in transposed direct form II; coefficients and states lie in data memory.
.schedule on
.const  N = 6
.input  x
.output y
.reg    b0 b1 b2 a1 a2 z1 z2 p q
.rep i, 1, N-1
.reg    u{i}                            ; what a section passes on
.endr

.data
coefficients:                           ; b0 b1 b2 a1 a2 of each section
        .rep i, 1, N
        .float  0.25, 0.5*i/N, 0.125, -0.375, 0.0625*i
        .endr
states: .space  2*N

.period
        .macro  section i, u, v
        ld      b0, coefficients+5*i
        ld      b1, coefficients+5*i+1
        ld      b2, coefficients+5*i+2
        ld      a1, coefficients+5*i+3
        ld      a2, coefficients+5*i+4
        ld      z1, states+2*i
        ld      z2, states+2*i+1
        fmul    p, b0, u
        fadd    v, p, z1
        fmul    p, b1, u
        fmul    q, a1, v
        fsub    p, p, q
        fadd    p, p, z2
        st      states+2*i, p
        fmul    p, b2, u
        fmul    q, a2, v
        fsub    p, p, q
        st      states+2*i+1, p
        .endm
period: section 0, x, u1
        .rep i, 1, N-2
        section i, u{i}, u{i+1}
        .endr
        section N-1, u{N-1}, y
        wait    period

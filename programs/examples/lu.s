; Four linear equations, A·x = b, by elimination with partial pivoting:
; no branches, rows are exchanged by selection, so that the time is the
; same whatever the matrix, and the scheduler sees one straight line.
; In this folder: takt run lu.s --inputs lu.csv
; Each period has equations of its own. Period 30 of lu.csv has none to
; solve: its matrix has no inverse, which divides by zero, raises the
; flags `invalid` and `divide-by-zero`, and sets `singular`.

.schedule on

.const  N = 4

.rep    i, 1, N
.rep    j, 1, N
.input  A{i}{j}
.endr
.input  b{i}
.endr
.rep    i, 1, N
.output x{i}
.endr
.output singular:int                    ; 1: no solution; x keeps its values

.once
        .rep    i, 1, N
        mov     x{i}, zero
        .endr
        mov     singular, zero
        wait    period

.period
period:

; Row i of the matrix before step k is a{k}i1 … a{k}i5; the right-hand
; side is column N + 1. Names are never written twice, so that an
; exchange needs no copy: what would be one is another name.
.rep    i, 1, N
.rep    j, 1, N
.reg    a1{i}{j}
        mov     a1{i}{j}, A{i}{j}
.endr
.reg    a1{i}{N+1}
        mov     a1{i}{N+1}, b{i}
.endr

; larger, smaller: of two rows' elements by the comparison g.
.macro  exchange larger, smaller, g, a, b
        sel     larger, g, b, a
        sel     smaller, g, a, b
.endm

.rep    k, 1, N
; ---- The row with the largest element of column k -------------------
; One row after the other is compared: p{k}{i} is the largest of rows k
; to i, o{k}{i} what is left in row i.
.rep    i, k+1, N
.reg    u{k}{i} v{k}{i} g{k}{i}:int
.rep    j, k, N+1
.reg    p{k}{i}{j} o{k}{i}{j}
.endr
        .if     i == k+1
        fabs    u{k}{i}, a{k}{k}{k}
        .else
        fabs    u{k}{i}, p{k}{i-1}{k}
        .endif
        fabs    v{k}{i}, a{k}{i}{k}
        flt     g{k}{i}, u{k}{i}, v{k}{i}
.rep    j, k, N+1
        .if     i == k+1
        exchange p{k}{i}{j}, o{k}{i}{j}, g{k}{i}, a{k}{k}{j}, a{k}{i}{j}
        .else
        exchange p{k}{i}{j}, o{k}{i}{j}, g{k}{i}, p{k}{i-1}{j}, a{k}{i}{j}
        .endif
.endr
.endr
; ---- Elimination below the pivot, whose inverse is kept --------------
.reg    r{k}
        .if     k < N
        fdiv    r{k}, 1.0, p{k}{N}{k}
        .else
        fdiv    r{k}, 1.0, a{k}{k}{k}
        .endif
.rep    i, k+1, N
.reg    f{k}{i}
        fmul    f{k}{i}, o{k}{i}{k}, r{k}
.rep    j, k+1, N+1
.reg    t{k}{i}{j} a{k+1}{i}{j}
        fmul    t{k}{i}{j}, f{k}{i}, p{k}{N}{j}
        fsub    a{k+1}{i}{j}, o{k}{i}{j}, t{k}{i}{j}
.endr
.endr
.endr

; ---- From the last row back ------------------------------------------
.reg    y{N}
        fmul    y{N}, a{N}{N}{N+1}, r{N}
.rep    m, 1, N-1
.const  row{m} = N - m
.reg    c{m} y{row{m}}
        mov     c{m}, p{row{m}}{N}{N+1}
.rep    j, row{m} + 1, N
.reg    s{m}{j}
        fmul    s{m}{j}, p{row{m}}{N}{j}, y{j}
        fsub    c{m}, c{m}, s{m}{j}
.endr
        fmul    y{row{m}}, c{m}, r{row{m}}
.endr

; A number times zero is zero; an infinity or a NaN times zero is none.
.reg    sum bad:int good:int
        fmul    sum, y1, zero
.rep    i, 2, N
.reg    z{i}
        fmul    z{i}, y{i}, zero
        fadd    sum, sum, z{i}
.endr
        feq     good, sum, zero
        ixor    bad, good, 1
        mov     singular, bad
.rep    i, 1, N
        sel     x{i}, good, y{i}, x{i}
.endr
        wait    period

; For `takt accuracy`: elements up to 20, right-hand sides up to 10, as
; in lu.csv. Outputs keep their values where the matrix is singular.
.rep i, 1, N
.rep j, 1, N
.range  A{i}{j} = -20, 20
.endr
.range  b{i} = -10, 10
.range  x{i} = -1e6, 1e6
.endr
; SPDX-License-Identifier: MIT OR Apache-2.0

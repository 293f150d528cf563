; What equations get wrong, one mistake each.
.input  x, n:int, m:int
.output y, k:int
.reg    t, b:bits, q:int, P[2,3] V[4]
.const  C = 3
.data
table:  .float 1
.once
        wait    period
.macro  thrice d, of
        d = of*3
.endm
.macro  nothing
        y = 1
.endm
.period
period:
        unknown = x + 1                 ; no such register
        y = x + missing                 ; no such operand
        y = x + n                       ; an integer and a float
        y = n                           ; an integer where a float goes
        k = x                           ; the other way
        q = n/m                         ; integers are not divided
        y = n*2.5                       ; nor with reals
        q = n + 0.5                     ; a real number with an integer
        y = x ? 1 : 2                   ; a float is no condition
        y = n > 0 ? x : m               ; a choice between the two
        k = x & 1                       ; bits of a float
        y = x^2                         ; no instruction
        y = x % 2
        y = ~n
        y = sqr(x)                      ; misspelt
        y = exp(x)                      ; in the library
        y = frobnicate(x)
        y = sqrt(x, x)                  ; the number of arguments
        y = atan2(x)
        y = thrice(x, x)
        y = nothing()
        y = later(x)                    ; a macro of below
        x = 1                           ; an input
        C = 4                           ; a constant
        zero = x
        y, t = x                        ; one value too few
        y, y = x, x                     ; written twice
        y = x + 1/0                     ; a constant part without a value
        y = 1e30*1e30 + x               ; or beyond binary32
        y = x + table[1]                ; memory
        y = P[1]                        ; the number of indices
        y = P[0,1]                      ; out of range
        y = P[3,1] + V[5]
        y = P                           ; an array as such
        y = x[1]                        ; no array
        y = V[n]                        ; an index that is no constant
        y = V[1.5]
        y = Q[1]                        ; no such array
        y = sum(i, 1, 4)                ; a sum without what to add
        y = sum(2, 1, 4, x)
        y = sum(i, 1, n, x)
        y = sum(i, 1, 4, thrice(V[i]))  ; a macro in a sum
        y = sum(i, 1, 4, V[i+1])
        y = period + x                  ; a code label
        fadd    y, P[1,4], x            ; in an instruction, too
.reg    rest:int
        .for    i, -3, -1 unroll 2
        rest = i % 4
        rest = i / 4
        .endfor
        wait    period
.macro  later d, of
        d = of
.endm

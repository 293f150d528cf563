; A constant address by the name of one table that is in another.
.macro  get     d, what, n
        ld      d, what+n
.endm
.output F
.reg    a
.data
gains:  .float  1, 2
_half:  .float  3, 4                    ; a part of `gains`
rows:   .space  4
tail:   .space  2
.period
period: ld      a, gains+3
        ld      F, _half+1
        ld      F, gains+4
        ld      F, rows[5]
        ld      F, tail-1
        ld      F, tail-rows+8          ; a number: it names no table
        get     F, gains, 2*2
        st      rows-1[a], a            ; where this leads is not known
        wait    period

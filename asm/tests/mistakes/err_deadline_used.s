; Demands on ports that their section does not use, or uses in a bundle.
.input  a, b, c
.output sum, never
.order  sum, c                  ; `.once` reads and writes neither
        wait    period
.schedule on
.period
period: .deadline never = 20
        .order  b, a
        fadd    sum, a, b
        wait    period

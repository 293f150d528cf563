; Numbers of ports, and latched ports.
.input  a @ 255, b @ 4, c @ i4, d @ -1
.output F @ 32, G @ 3, H @ 3, I @ x227, J @ 6, K @ a230, L @ 0.5
.reg    r @ 3, s @ nowhere
.ports  latched
.ports  direct
.ports  held
.once
        fadd    F, a, b || mov H, c
.period
.deadline F = 20
.order  a, F
.late   a = 3
period: fadd    F, a, b
        wait    period

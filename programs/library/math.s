; Macros that any program may use: `.include <math.s>`.

; y = x, held between low and high.
.macro clamp y, x, low, high
        fmax    y, x, low
        fmin    y, y, high
.endm

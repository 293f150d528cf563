.rep i, 1, 3
.if i
.endr
.endif
.endr
.endm
.else
.elif 1
.if 1
.else
.elif 1
.else
.endif
.rep j, 1, 2
.macro inner
.endm
.endr
.macro open
        nop

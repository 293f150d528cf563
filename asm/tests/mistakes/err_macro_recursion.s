.macro forever
        forever
.endm
.period
        forever

.const N = 3
.if N > 2
.error "N must be at most 2"
.elif UNKNOWN
.else
.error "never seen"
.endif
.if
.endif
.if 1
.error 5
.error
.endif

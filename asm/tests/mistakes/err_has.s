; machine f1
.const A = has.fatan
.const B = has.multiply_accumulate
.if has.fatan2
        nonsense
.endif
        halt

.const STIFFNESS = 3
.const DAMPING = 2*STIFNESS
.const GAIN = sqr(2)
.const SUM = total + 1
.const ANGLE = frob(1)

; Included by what it includes.
.include "../cycle.s"

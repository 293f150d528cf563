.include "missing.s"
.include "../outside.s"
.include "/etc/passwd"
.include "cycle.s"
.include latin.s
.include "latin1.s"

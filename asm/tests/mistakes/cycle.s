.include "with/cycle.s"

"""`python -m takt._unit CASE RESULT`: a process of `takt.distribute`."""

import sys

from takt._distribute import unit

unit(*sys.argv[1:])

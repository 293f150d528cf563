"""Programs from CasADi functions.

    import casadi as ca, takt.casadi

    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    f = ca.Function("f", [x, u], [ca.vertcat(x[1], u - ca.sin(x[0]))], ["x", "u"], ["dx"])
    takt.casadi.program(f).run({"x": states, "u": 0.5}).outputs["dx"]    # states and dx of shape (periods, 2)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import takt_expressions
from takt import _takt
from takt._errors import ModelError
from takt._program import DEFAULT_MACHINE, Program, modelled


def program(
    function: Any,
    machine: str = DEFAULT_MACHINE,
    *,
    exact: bool = False,
    without: Sequence[str] = (),
    effort: int | None = None,
) -> Program:
    """A CasADi function as a program whose inputs and outputs have its names and shapes.

    Args:
        function: A `casadi.Function` of CasADi 3.6 to 3.8. MX is expanded to scalars. A column or a row of n is an array of
            shape (n,), a matrix one of shape (rows, columns).
        machine: The machine's name.
        exact: Only rewrites that keep every operation's rounding.
        without: Rewrites to switch off, as `factor`; docs/model.md lists them.
        effort: How long the scheduler searches; 0 is one pass.

    Raises:
        ModelError: an operation has no meaning on the machine, or the function has more inputs or outputs than it.
        AssemblyError: the program does not fit the machine.
    """
    if not hasattr(function, "n_instructions"):
        raise TypeError(f"a casadi.Function is needed, not {type(function).__name__}")
    name = str(function.name())
    try:
        text = takt_expressions.casadi_text(function)
    except ValueError as error:
        raise ModelError(f"{name}: {error}") from None
    model = _takt.expressions(text, name, exact, list(without), machine)
    return modelled(model, f"{name}.s", machine, effort)

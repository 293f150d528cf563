"""Programs from SymPy expressions.

    import sympy as sp, takt.sympy

    a, b = sp.symbols("a b")
    takt.sympy.program({"q": [a, b]}, {"y": sp.sin(a + b), "z": [a * b, a - b]}).run({"q": angles}).outputs["z"]
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import takt_expressions
from takt import _takt
from takt._program import DEFAULT_MACHINE, Program, modelled


def program(
    inputs: Mapping[str, Any],
    outputs: Mapping[str, Any],
    machine: str = DEFAULT_MACHINE,
    *,
    name: str = "f",
    exact: bool = False,
    without: Sequence[str] = (),
    effort: int | None = None,
) -> Program:
    """Expressions as a program.

    Args:
        inputs: By name a symbol, or a list or Matrix of symbols.
        outputs: By name an expression, or a list or Matrix of expressions. A list of n is an array of shape (n,).
        machine: The machine's name.
        name: The program's.
        exact: Only rewrites that keep every operation's rounding. (SymPy has its own order of sums and products.)
        without: Rewrites to switch off, as `factor`; docs/model.md lists them.
        effort: How long the scheduler searches; 0 is one pass.

    Raises:
        ModelError: an operation has no meaning on the machine, or there are more inputs or outputs than it has.
        ValueError: a symbol is not an input.
        AssemblyError: the program does not fit the machine.
    """
    model = _takt.expressions(takt_expressions.sympy_text(name, inputs, outputs), name, exact, list(without), machine)
    return modelled(model, f"{name}.s", machine, effort)

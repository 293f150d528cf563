"""Model-predictive control of a linear system with limits, in a fixed number of cycles.

    import takt.mpc

    problem = takt.mpc.problem(A, B, Q=[10, 1], R=[1], u_min=-1, u_max=1, horizon=10)
    controller = takt.mpc.program(problem)
    controller.run({"x": states}).outputs["u"]      # with "primal" and "dual", the residuals
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from takt import _takt
from takt._program import DEFAULT_MACHINE, Program, modelled

FORMAT = "takt-mpc 1"


class Worst(NamedTuple):
    """The largest value that a search found, and the state that gives it."""

    value: float
    state: NDArray[np.float64]


def problem(
    A: ArrayLike,
    B: ArrayLike,
    Q: ArrayLike,
    R: ArrayLike,
    *,
    horizon: int,
    x_min: ArrayLike | None = None,
    x_max: ArrayLike | None = None,
    u_min: ArrayLike | None = None,
    u_max: ArrayLike | None = None,
    rho: float | None = None,
    iterations: int = 10,
    references: str = "none",
    warm_start: bool = True,
    x_range: ArrayLike | None = None,
    relinearise: int = 0,
    name: str = "mpc",
) -> dict[str, Any]:
    """A control problem as `takt model` reads it; `json.dump` makes a file of it.

    Args:
        A, B: x' = A x + B u in discrete time.
        Q, R: Weights of ½ xᵀQx + ½ uᵀRu: a number, a diagonal or a symmetric matrix. The last state's weight is the cost-to-go (`terminal_weight`).
        horizon: States of the plan, the given one among them.
        x_min, x_max, u_min, u_max: Limits, one or one for each; an infinite one is none.
        rho: The penalty of ADMM; without, one that suits `R`.
        iterations: Iterations in each period.
        references: "none", "constant" (inputs `xr` and `ur`) or "horizon" (a row for each step).
        warm_start: Begins where the period before ended.
        x_range: The states that `worst` searches and `Program.enclose` assumes: rows of lowest and highest.
        relinearise: If not 0, `A` and `B` are inputs of the program, and so many steps of the Riccati recursion a period follow them.
        name: The problem's name.

    Raises:
        ValueError: a number is NaN, or one that is no limit is infinite.
    """
    found: dict[str, Any] = {"format": FORMAT, "name": name}
    for key, value in {"A": A, "B": B, "Q": Q, "R": R, "x_range": x_range}.items():
        if value is not None:
            array = np.asarray(value, dtype=float)
            _checked(key, array, np.isfinite(array))
            found[key] = array.tolist()
    for key, value in {"x_min": x_min, "x_max": x_max, "u_min": u_min, "u_max": u_max}.items():
        if value is not None:
            array = np.asarray(value, dtype=float)
            # Infinity of the wrong sign would be a limit that nothing can meet.
            _checked(key, array, np.isfinite(array) | (array == (-np.inf if key.endswith("min") else np.inf)))
            found[key] = [None if np.isinf(x) else float(x) for x in array] if array.ndim else float(array)
            if array.ndim == 0 and np.isinf(array):
                del found[key]
    found |= {"horizon": int(horizon), "iterations": int(iterations)}
    if rho is not None:
        _checked("rho", np.asarray(rho), np.isfinite(rho))
        found["rho"] = float(rho)
    return found | {"references": references, "warm_start": bool(warm_start), "relinearise": int(relinearise)}


def _checked(key: str, array: NDArray[Any], good: Any) -> None:
    if not np.all(good):
        index = tuple(int(i) for i in np.argwhere(~np.asarray(good))[0])
        place = f"{key}[{', '.join(map(str, index))}]" if index else key
        raise ValueError(f"{place} is {array[index]}; it must be finite")


def program(problem: Mapping[str, Any], machine: str = DEFAULT_MACHINE, *, effort: int | None = None) -> Program:
    """A controller with the inputs `x` (and `xr`, `ur`) and the outputs `u`, `primal` and `dual`.

    Args:
        problem: What `problem` makes, or the content of a file.
        machine: The machine's name. Its memories become as deep as needed.
        effort: How long the scheduler searches; 0 is one pass.

    Raises:
        ModelError: parts of the problem do not fit, or it does not fit the machine.
        AssemblyError: the program does not fit the machine.
    """
    return modelled(_takt.predictive(_text(problem), machine), "mpc.s", machine, effort)


def terminal_weight(problem: Mapping[str, Any]) -> NDArray[np.float64]:
    """The weight of the plan's last state, of shape (n, n): the cost-to-go of the infinite horizon, with `rho` added to the diagonals of
    Q and R. Another solver that is to agree with the controller takes it for its last state.

    Args:
        problem: As `program` takes it.

    Raises:
        ModelError: parts of the problem do not fit, or it has no such weight: an unstable mode has no weight or is reached by no input.
    """
    return np.array(_takt.predictive_weight(_text(problem)))


def worst(problem: Mapping[str, Any], starts: int = 100, *, seed: int = 0, periods: int = 1) -> dict[str, Worst]:
    """The largest "primal" and "dual" residual and "violation" of a state's limit found for states within `x_range`.

    It is a search in binary64 with restarts, from a cold start with references of zero, and no bound.

    Args:
        problem: As `program` takes it, with `x_range`.
        starts: Restarts.
        seed: The seed.
        periods: Periods with the same state, of which the last counts: a warm start.
    """
    if starts < 1 or periods < 1:
        raise ValueError("starts and periods are at least 1")
    found = _takt.predictive_worst(_text(problem), starts, seed, periods)
    return {name: Worst(value, np.array(state)) for name, value, state in found}


def from_casadi(function: Any, x: ArrayLike, u: ArrayLike, period: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A and B of a `casadi.Function` (x, u) -> dx/dt about a state and an input, with the input held for a period.

    The pair is exact for the linearised system: a zero-order hold, by the matrix exponential. Deviations from the point are what the
    controller's states and inputs then mean; the point should be an equilibrium.
    """
    import casadi as ca  # type: ignore[import-not-found, import-untyped, unused-ignore]

    x, u = np.asarray(x, dtype=float).ravel(), np.asarray(u, dtype=float).ravel()
    n, m = x.size, u.size
    sx, su = ca.SX.sym("x", n), ca.SX.sym("u", m)
    dx = function(sx, su)
    if dx.numel() != n:
        raise ValueError(f"the function has {dx.numel()} derivatives of {n} states")
    jacobians = ca.Function("jacobians", [sx, su], [ca.jacobian(dx, sx), ca.jacobian(dx, su)])
    both = np.zeros((n + m, n + m))
    both[:n, :n], both[:n, n:] = (np.asarray(part.full()) for part in jacobians(x, u))
    held = _exponential(both * period)
    return held[:n, :n], held[:n, n:]


def _exponential(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """e to a matrix: a Taylor series of a fraction of it, squared as often."""
    squarings = max(0, int(np.ceil(np.log2(max(np.abs(matrix).sum(axis=0).max(), 1e-300)))) + 4)
    fraction = matrix / 2.0**squarings
    total = term = np.eye(len(matrix))
    for k in range(1, 14):
        term = term @ fraction / k
        total = total + term
    for _ in range(squarings):
        total = total @ total
    return total


def _text(problem: Mapping[str, Any]) -> str:
    try:
        return json.dumps(dict(problem), allow_nan=False, indent=1)
    except ValueError as error:
        raise ValueError("the problem has a number that is NaN or infinite; a limit that is none is None") from error

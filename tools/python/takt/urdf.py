"""Programs from robots' descriptions: URDF, MJCF, and tables of Denavit-Hartenberg parameters.

    import takt.urdf

    arm = takt.urdf.program("ur5.urdf", "inverse-dynamics")
    arm.run({"q": q, "qd": qd, "qdd": qdd}).outputs["tau"]    # all of shape (periods, 6)

docs/model.md says how descriptions are read and what the functions compute.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Literal

from takt import _takt
from takt._ports import AnyPath, path_of
from takt._program import DEFAULT_MACHINE, Program, modelled
from takt._words import in_python

#: Angles within this distance of a multiple of a quarter turn are rounded to it, rad.
SNAP = 1e-6


def functions() -> dict[str, str]:
    """What can be computed of a robot: name and description."""
    return dict(_takt.robot_functions())


def program(
    robot: AnyPath,
    function: str,
    machine: str = DEFAULT_MACHINE,
    *,
    base: str | None = None,
    tip: str | None = None,
    floating: Literal["held", "error"] = "held",
    kp: float = 100.0,
    kd: float = 20.0,
    snap: float = SNAP,
    exact: bool = False,
    without: Sequence[str] = (),
    effort: int | None = None,
) -> Program:
    """A function of a robot as a program.

    Arrays by joint, in the order of `Program.model.joints`: `q`, rad or m; `qd`, rad/s or m/s; `qdd`, rad/s² or m/s²; `tau`,
    N m or N; of computed torque also the reference `qr`, `qdr`, `qddr`. Of the tip: rotation `R` of shape (3, 3), position `p` of
    shape (3,) in m, Jacobian `J` of shape (6, joints), linear velocity first. The mass matrix `M` has shape (joints, joints).

    Args:
        robot: The path or text (which begins with `<`) of a description in URDF or MJCF, or the path of a table of Denavit-Hartenberg parameters (`.csv`).
        function: `inverse-dynamics`, `gravity`, …: see `functions()`.
        machine: The machine's name.
        base: The link that stays where it is; without, the root.
        tip: Only the joints from the base to this link, whose pose and Jacobian are computed.
        floating: A base that a joint lets move freely is held where it is, with a warning, or an error.
        kp: For computed torque: gain of the position error, 1/s².
        kd: And of the velocity error, 1/s.
        snap: Angles this close to a multiple of a quarter turn are rounded to it, rad.
        exact: Only rewrites that keep every operation's rounding.
        without: Rewrites to switch off, as `factor`; docs/model.md lists them.
        effort: How long the scheduler searches; 0 is one pass.

    Raises:
        ModelError: the description cannot be read, has what the equations cannot express, or does not fit the machine.
        AssemblyError: the program does not fit the machine.
    """
    if floating not in ("held", "error"):
        raise ValueError(f"floating is {floating!r}: it is 'held' or 'error'")
    if isinstance(robot, str) and robot.lstrip("\ufeff \t\r\n").startswith("<"):
        data, name, table, folder = robot.encode(), "robot", False, None
    else:
        path = path_of("robot", robot)
        data, name, table, folder = path.read_bytes(), path.name, path.suffix.lower() == ".csv", str(path.parent)
    model = _takt.robot(
        data, name, folder, table, function, base, tip, floating == "held",
        (float(kp), float(kd)), float(snap), exact, list(without), machine,
    )
    for note in model["notes"]:
        if note.startswith("the base is held"):
            warnings.warn(in_python(note), stacklevel=2)
    return modelled(model, f"{function}.s", machine, effort)

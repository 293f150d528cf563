# SPDX-License-Identifier: MIT OR Apache-2.0
"""A learned policy in MuJoCo: two links with a motor in the elbow only swing up and balance; on time, late, with coarse encoders.

    python3 tools/python/examples/acrobot_mujoco.py                       a hundred starts in each case
    python3 tools/python/examples/acrobot_mujoco.py --table docs/mujoco.md --plot acrobot.svg --picture acrobot.png

`acrobot_train.py` trained the policy, in some minutes, with NumPy. Needs mujoco; --plot and --picture need matplotlib, the picture a
display or MUJOCO_GL=egl.
"""

from __future__ import annotations

import argparse
import re
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco  # type: ignore[import-untyped]
import numpy as np
from numpy.typing import NDArray

import takt.onnx
from takt.mujoco import CLOCK, Controller

PERIOD, TIME, STARTS = 0.02, 10.0, 100
#: Model with the masses, lengths and inertias of acrobot.py; both angles are 0 when upright.
MODEL = """<mujoco><option gravity="0 0 -9.81" timestep="0.01" integrator="RK4"/>
<default><geom contype="0" conaffinity="0" rgba="0.3 0.32 0.36 1"/><joint axis="0 1 0" damping="0.1"/></default>
<worldbody><geom type="cylinder" fromto="0 -0.16 0 0 0.4 0" size="0.12"/><geom type="cylinder" fromto="0 0.4 0 0 0.4 -3.2" size="0.06"/>
<body><joint name="shoulder"/><inertial mass="1" pos="0 0 0.5" diaginertia="0.083 0.083 1e-4"/>
<geom type="capsule" fromto="0 0 0 0 0 1" size="0.06" rgba="0.49 0.68 0.8 1"/>
<body pos="0 0 1"><joint name="elbow"/><inertial mass="1" pos="0 0 1" diaginertia="0.33 0.33 1e-4"/>
<geom type="cylinder" fromto="0 -0.13 0 0 0.13 0" size="0.1"/>
<geom type="capsule" fromto="0 0 0 0 0 2" size="0.05" rgba="0.2 0.35 0.55 1"/></body></body></worldbody>
<actuator><motor name="motor" joint="elbow" ctrlrange="-20 20" ctrllimited="true"/></actuator></mujoco>"""

model = mujoco.MjModel.from_xml_string(MODEL)
policy = takt.onnx.program(Path(__file__).parent / "acrobot.onnx", range=(-20, 20))


@dataclass
class Swings:
    """What came of swing-ups, by start and period."""

    #: Angles of shoulder and elbow, rad; the larger of the links' distances from upright, rad; torque, N m.
    angles: NDArray[np.float64]
    distance: NDArray[np.float64]
    torque: NDArray[np.float64]
    #: Cycles per period, and simulation time in s.
    cycles: int
    took: float

    def upright(self) -> NDArray[np.bool_]:
        """Which have both links within 10° of upright in the last 3 s."""
        near: NDArray[np.bool_] = (self.distance[:, -round(3 / PERIOD) :] < np.radians(10)).all(1)
        return near

    def after(self) -> NDArray[np.float64]:
        """When each stays within 10° of upright, s."""
        return PERIOD * np.array([np.flatnonzero(np.r_[True, row >= np.radians(10)])[-1] for row in self.distance])


def starts(count: int, spread: float) -> NDArray[np.float64]:
    """Hanging, almost at rest: up to `spread`, in rad and rad/s, off in each joint; the first is at rest."""
    off = np.random.default_rng(5).uniform(-spread, spread, (count, 4))
    off[0] = 0
    return np.array([np.pi, 0, 0, 0]) + off


def swing(count: int = STARTS, latency: int | None = None, encoder: float | None = None, spread: float = 0.1) -> Swings:
    """10 s of as many robots."""
    robots = [mujoco.MjData(model) for _ in range(count)]
    for data, start in zip(robots, starts(count, spread)):
        data.qpos[:], data.qvel[:] = start[:2], start[2:]

    def state(time: float) -> dict[str, Any]:
        q, v = np.array([data.qpos for data in robots]), np.array([data.qvel for data in robots])
        q = q if encoder is None else np.round(q / encoder) * encoder
        seen = np.stack([np.cos(q[:, 0]), np.sin(q[:, 0]), np.cos(q[:, 1]), np.sin(q[:, 1]), v[:, 0], v[:, 1]], -1)
        return {"state": seen}

    loop = Controller(model, policy, period=PERIOD, latency=latency, actuators={"torque": ["motor"]}, reference=state, runs=count)
    angles, torques, begin = [], [], time.perf_counter()
    for _ in range(round(TIME / PERIOD)):
        loop.step(robots)
        angles.append([data.qpos.copy() for data in robots])
        torques.append([float(data.actuator_force[0]) for data in robots])
    angle = np.array(angles).swapaxes(0, 1)
    distance = np.abs((np.cumsum(angle, -1) + np.pi) % (2 * np.pi) - np.pi).max(-1)
    return Swings(angle, distance, np.array(torques).T, int(np.max(loop.cycles)), time.perf_counter() - begin)


CASES: dict[str, dict[str, Any]] = {
    "on time": {},
    "a period late": {"latency": round(PERIOD * CLOCK)},
    "two periods late": {"latency": round(2 * PERIOD * CLOCK)},
    "encoders of 10 bits": {"encoder": 2 * np.pi / 1024},
    "starts thrice as far off": {"spread": 0.3},
}
HEAD = "| control | upright, of 100 | after, s, median | latest | at the end within, mrad |\n|---|---|---|---|---|"


def row(name: str, result: Swings) -> str:
    """A row of the table; times and angles are of those that are upright."""
    good = result.upright()
    if not good.any():
        return f"| {name} | 0 | – | – | – |"
    after = result.after()[good]
    return f"| {name} | {good.sum()} | {np.median(after):.1f} | {after.max():.1f} | {1e3 * result.distance[good, -50:].max():.1f} |"


def upwards(angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit vectors at these angles from upright, in the plane of the links."""
    return np.stack([np.sin(angle), 0 * angle, np.cos(angle)], -1)


def picture(result: Swings, file: str) -> None:
    """The first swing-up in one picture: the ways of elbow and tip, and the links upright, pale at times before."""
    import scenes

    until = round((float(result.after()[0]) + 0.5) / PERIOD)
    angles = result.angles[0, :until]
    scene = scenes.Scene(mujoco.MjSpec.from_string(MODEL), size=5.0, floor=-3.2, target=[0.1, 0, -0.05], distance=8.5, azimuth=110, elevation=-10)
    scene.body(result.angles[0, -1])
    elbow, both = upwards(angles[:, 0]), angles.sum(-1)
    tip = elbow + 2 * upwards(both)
    gone = np.r_[0, np.linalg.norm(np.diff(tip, axis=0), axis=1).cumsum()]
    # A ghost for each metre that the tip goes: at equal times they would crowd where it is slow.
    for index in np.searchsorted(gone, np.arange(gone[-1])):
        scene.ghost(angles[index], 0.2 + 0.3 * index / until)
    scene.way(elbow, 0.035, colour=1)
    scene.way(tip, 0.035)
    scene.save(file)


#: Duration that the plot shows, s: afterwards all stand.
SHOWN = 5.0


def plot(results: dict[str, Swings], file: str) -> None:
    import pictures

    count, cases = round(SHOWN / PERIOD), {}
    for name, result in results.items():
        # The first of the starts that are further off is at rest as well.
        if name != "starts thrice as far off":
            link = result.angles[0].sum(-1)
            # Without the whole turns that the link has made at the end, when it is upright.
            cases[name] = (link[:count] - 2 * np.pi * np.round(link[-1] / (2 * np.pi)), result.torque[0, :count])
    # Before the first late output, 18 N m are missing: the axis shows the differences after that.
    pictures.compare(file, PERIOD * np.arange(1, count + 1), cases, {"second link from upright": "rad", "torque": "N m"}, {1: (-8, 8)})


def main(arguments: list[str] | None = None) -> dict[str, Swings]:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--starts", type=int, default=STARTS, metavar="N", help="this many starts in each case")
    parser.add_argument("--table", metavar="FILE", help="write the table into this document")
    parser.add_argument("--plot", metavar="FILE", help="draw angles and torques of the first start")
    parser.add_argument("--picture", metavar="FILE", help="draw the first swing-up")
    options = parser.parse_args(arguments)
    results = {name: swing(options.starts, **settings) for name, settings in CASES.items()}
    for name, result in results.items():
        good = result.upright()
        said = f"{good.sum()} of {len(good)} upright"
        said += f", after {np.median(result.after()[good]):.1f} s" if good.any() else ""
        print(f"{name}: {result.cycles} cycles; {said}; {len(good) * TIME / result.took:.0f} times real time")
    if options.table:
        file, rows = Path(options.table), "\n".join([HEAD, *(row(name, result) for name, result in results.items())])
        text, count = re.subn(r"(?<=<!-- table: acrobot -->\n).*?(?=\n<!-- end of acrobot -->)", lambda _: rows, file.read_text(), flags=re.S)
        if count != 1:
            raise SystemExit(f"{file} has no place for the table")
        file.write_text(text)
    if options.plot:
        plot(results, options.plot)
    if options.picture:
        picture(results["on time"], options.picture)
    return results


if __name__ == "__main__":
    main()

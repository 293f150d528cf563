"""The learned policy of pendulum.py in MuJoCo: a pendulum too heavy for its motor swings up; on time, late, and with a coarse encoder.

    python3 tools/python/examples/pendulum_mujoco.py                       the three cases
    python3 tools/python/examples/pendulum_mujoco.py --table docs/mujoco.md --plot pendulum.svg --picture pendulum.png

`pendulum_train.py` trained the policy, in half a minute, with NumPy. Needs mujoco; --plot and --picture need matplotlib, the picture a
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

PERIOD, TIME = 0.05, 20.0
#: Model with weight, length and inertia 1, as in training; the angle is 0 when upright.
MODEL = """<mujoco><option gravity="0 0 -1" timestep="0.01" integrator="RK4"/>
<default><geom contype="0" conaffinity="0" rgba="0.3 0.32 0.36 1"/></default>
<worldbody><geom type="cylinder" fromto="0 -0.12 0 0 0.2 0" size="0.09"/><geom type="cylinder" fromto="0 0.2 0 0 0.2 -1.25" size="0.03"/>
<body><joint name="hinge" axis="0 1 0" damping="0.05"/><inertial mass="1" pos="0 0 1" diaginertia="1e-6 1e-6 1e-6"/>
<geom type="capsule" fromto="0 0 0 0 0 1" size="0.03" rgba="0.49 0.68 0.8 1"/>
<geom type="sphere" pos="0 0 1" size="0.12" rgba="0.2 0.35 0.55 1"/></body></worldbody>
<actuator><motor name="motor" joint="hinge" ctrlrange="-0.5 0.5" ctrllimited="true"/></actuator></mujoco>"""

model = mujoco.MjModel.from_xml_string(MODEL)
policy = takt.onnx.program(Path(__file__).parent / "pendulum.onnx", range=(-3, 3))


@dataclass
class Swing:
    """What came of a swing-up, by period."""

    #: Unwrapped angle from upright, rad, its distance from upright, rad; torque.
    angle: NDArray[np.float64]
    distance: NDArray[np.float64]
    torque: NDArray[np.float64]
    #: Cycles per period, and simulation time in s.
    cycles: int
    took: float

    def upright(self) -> float:
        """When it stays within 0.1 rad of upright, s."""
        above = np.flatnonzero(self.distance >= 0.1)
        return PERIOD * (float(above[-1]) + 1)


def swing(latency: int | None = None, encoder: float | None = None) -> Swing:
    """20 s from hanging at rest."""
    data = mujoco.MjData(model)
    data.qpos[0] = np.pi - 1e-3

    def state(time: float) -> dict[str, Any]:
        q = data.qpos[0] if encoder is None else np.round(data.qpos[0] / encoder) * encoder
        return {"state": [np.cos(q), np.sin(q), data.qvel[0]]}

    loop = Controller(model, policy, period=PERIOD, latency=latency, actuators={"torque": ["motor"]}, reference=state)
    angles, torques, begin = [], [], time.perf_counter()
    for _ in range(round(TIME / PERIOD)):
        loop.step(data)
        angles.append(float(data.qpos[0]))
        torques.append(float(data.actuator_force[0]))
    angle = np.array(angles)
    distance = np.abs((angle + np.pi) % (2 * np.pi) - np.pi)
    return Swing(angle, distance, np.array(torques), int(loop.cycles[0]), time.perf_counter() - begin)


CASES: dict[str, dict[str, Any]] = {
    "on time": {},
    "a period late": {"latency": round(PERIOD * CLOCK)},
    "encoder of 8 bits": {"encoder": 2 * np.pi / 256},
}
HEAD = "| control | upright after, s | at the end within, mrad |\n|---|---|---|"


def row(name: str, result: Swing) -> str:
    """A row of the table."""
    return f"| {name} | {result.upright():.1f} | {1e3 * result.distance[-20:].max():.1f} |"


def picture(result: Swing, file: str) -> None:
    """The swing-up in one picture: the way of the mass, and the pendulum upright, pale at times before."""
    import scenes

    until = round(result.upright() / PERIOD)
    scene = scenes.Scene(mujoco.MjSpec.from_string(MODEL), size=2.0, floor=-1.25, target=[0.08, 0, 0], distance=3.2, azimuth=110, elevation=-12)
    scene.body(result.angle[-1])
    for share in (0, 0.2, 0.4, 0.6, 0.7, 0.8, 0.9):
        scene.ghost(result.angle[int(share * until)], 0.2 + 0.3 * share)
    scene.way([(np.sin(angle), 0, np.cos(angle)) for angle in result.angle[:until]], 0.018)
    scene.save(file)


def plot(results: dict[str, Swing], file: str) -> None:
    import pictures

    cases = {}
    for name, result in results.items():
        # Without the whole turns that the pendulum has made at the end, when it is upright.
        cases[name] = (result.angle - 2 * np.pi * np.round(result.angle[-1] / (2 * np.pi)), result.torque)
    times = PERIOD * np.arange(1, round(TIME / PERIOD) + 1)
    pictures.compare(file, times, cases, {"angle from upright": "rad", "torque": "of the weight's"})


def main(arguments: list[str] | None = None) -> dict[str, Swing]:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--table", metavar="FILE", help="write the table into this document")
    parser.add_argument("--plot", metavar="FILE", help="draw angles and torques")
    parser.add_argument("--picture", metavar="FILE", help="draw the swing-up")
    options = parser.parse_args(arguments)
    results = {name: swing(**settings) for name, settings in CASES.items()}
    for name, result in results.items():
        said = f"upright after {result.upright():.1f} s, at the end within {1e3 * result.distance[-20:].max():.1f} mrad"
        said = said if result.upright() < TIME - 1 else "not upright"
        print(f"{name}: {result.cycles} cycles; {said}; {TIME / result.took:.0f} times real time")
    if options.table:
        file, rows = Path(options.table), "\n".join([HEAD, *(row(name, result) for name, result in results.items())])
        text, count = re.subn(r"(?<=<!-- table: pendulum -->\n).*?(?=\n<!-- end of pendulum -->)", lambda _: rows, file.read_text(), flags=re.S)
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

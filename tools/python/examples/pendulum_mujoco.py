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
<visual><headlight ambient="0.45 0.45 0.45" diffuse="0.2 0.2 0.2"/><global offwidth="960" offheight="720"/></visual>
<asset><texture name="sky" type="skybox" builtin="gradient" rgb1="0.93 0.95 0.98" rgb2="0.75 0.8 0.87" width="256" height="256"/></asset>
<worldbody><light pos="1.5 -2.5 3" dir="-0.4 0.7 -0.8" diffuse="0.8 0.8 0.8"/>
<geom type="plane" pos="0 0 -1.3" size="3 3 0.1" rgba="0.86 0.88 0.91 1" contype="0" conaffinity="0"/>
<geom type="cylinder" fromto="0 -0.12 0 0 0.12 0" size="0.09" rgba="0.3 0.32 0.36 1" contype="0" conaffinity="0"/>
<body><joint name="hinge" axis="0 1 0" damping="0.05"/><inertial mass="1" pos="0 0 1" diaginertia="1e-6 1e-6 1e-6"/>
<geom type="capsule" fromto="0 0 0 0 0 1" size="0.03" rgba="0.49 0.68 0.8 1" contype="0" conaffinity="0"/>
<geom type="sphere" pos="0 0 1" size="0.12" rgba="0.2 0.35 0.55 1" contype="0" conaffinity="0"/></body></worldbody>
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
    """The swing-up in one picture: the pendulum every half second, the last upright."""
    import matplotlib.image

    data, camera = mujoco.MjData(model), mujoco.MjvCamera()
    camera.lookat, camera.distance, camera.azimuth, camera.elevation = [0, 0, -0.1], 3.8, 90, -8
    until = round(result.upright() / PERIOD)
    with mujoco.Renderer(model, 720, 960) as renderer:
        data.qpos[0] = result.angle[-1]
        mujoco.mj_forward(model, data)
        renderer.update_scene(data, camera)
        for index, angle in enumerate(result.angle[:until:2]):
            place = [np.sin(angle), 0, np.cos(angle)]
            share = 2 * index / until
            mujoco.mjv_initGeom(renderer.scene.geoms[renderer.scene.ngeom], mujoco.mjtGeom.mjGEOM_SPHERE, [0.02 + 0.02 * share, 0, 0], place, np.eye(3).ravel(), [0.9, 0.3, 0.1, 0.25 + 0.75 * share])
            renderer.scene.ngeom += 1
        matplotlib.image.imsave(file, renderer.render())


def plot(results: dict[str, Swing], file: str) -> None:
    import pictures

    figure, axes = pictures.subplots(2, 4.4, sharex=True)
    for name, result in results.items():
        times = PERIOD * np.arange(1, len(result.angle) + 1)
        axes[0].plot(times, result.distance, label=name)
        axes[1].plot(times, result.torque)
    axes[0].set(title="angle from upright, rad", xlim=(0, times[-1]))
    axes[1].set(xlabel="time, s", title="torque, of the weight's")
    pictures.legend(figure, axes[0], 2)
    pictures.save(figure, file)


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

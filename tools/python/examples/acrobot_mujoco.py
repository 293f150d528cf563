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
<visual><headlight ambient="0.45 0.45 0.45" diffuse="0.2 0.2 0.2"/><global offwidth="960" offheight="720"/></visual>
<asset><texture name="sky" type="skybox" builtin="gradient" rgb1="0.93 0.95 0.98" rgb2="0.75 0.8 0.87" width="256" height="256"/></asset>
<default><geom contype="0" conaffinity="0"/><joint axis="0 1 0" damping="0.1"/></default>
<worldbody><light directional="true" dir="-0.35 0.7 -0.85" diffuse="0.8 0.8 0.8"/>
<geom type="plane" pos="0 0 -3.2" size="6 6 0.1" rgba="0.86 0.88 0.91 1"/>
<geom type="cylinder" fromto="0 -0.16 0 0 0.16 0" size="0.12" rgba="0.3 0.32 0.36 1"/>
<body><joint name="shoulder"/><inertial mass="1" pos="0 0 0.5" diaginertia="0.083 0.083 1e-4"/>
<geom type="capsule" fromto="0 0 0 0 0 1" size="0.06" rgba="0.49 0.68 0.8 1"/>
<body pos="0 0 1"><joint name="elbow"/><inertial mass="1" pos="0 0 1" diaginertia="0.33 0.33 1e-4"/>
<geom type="cylinder" fromto="0 -0.13 0 0 0.13 0" size="0.1" rgba="0.3 0.32 0.36 1"/>
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


def picture(result: Swings, file: str) -> None:
    """The first swing-up in one picture: the way of elbow and tip, the links upright at its end."""
    import matplotlib.image

    data, camera = mujoco.MjData(model), mujoco.MjvCamera()
    camera.lookat, camera.distance, camera.azimuth, camera.elevation = [0, 0, -0.05], 8.6, 90, -6
    until = round((float(result.after()[0]) + 0.5) / PERIOD)
    with mujoco.Renderer(model, 720, 960) as renderer:
        data.qpos[:] = result.angles[0, -1]
        mujoco.mj_forward(model, data)
        renderer.update_scene(data, camera)
        for index, angles in enumerate(result.angles[0, :until]):
            one, both = angles[0], angles.sum()
            elbow = np.array([np.sin(one), 0, np.cos(one)])
            tip = elbow + 2 * np.array([np.sin(both), 0, np.cos(both)])
            share = index / until
            for place, colour in ((elbow, [0.2, 0.6, 0.3]), (tip, [0.9, 0.3, 0.1])):
                mujoco.mjv_initGeom(renderer.scene.geoms[renderer.scene.ngeom], mujoco.mjtGeom.mjGEOM_SPHERE, [0.03 + 0.03 * share, 0, 0], place, np.eye(3).ravel(), [*colour, 0.3 + 0.7 * share])
                renderer.scene.ngeom += 1
        matplotlib.image.imsave(file, renderer.render())


#: Line of each case in the plot: they nearly agree, so that broad pale lines lie behind narrow ones.
LOOKS: dict[str, dict[str, Any]] = {
    "on time": {"color": "C0", "lw": 5, "alpha": 0.35, "zorder": 1},
    "a period late": {"color": "C1"},
    "two periods late": {"color": "C2", "ls": "--"},
    "encoders of 10 bits": {"color": "C4", "lw": 3, "alpha": 0.5, "zorder": 0},
}
#: Duration that the plot shows, s: afterwards all stand.
SHOWN = 5.0


def plot(results: dict[str, Swings], file: str) -> None:
    import pictures

    figure, axes = pictures.subplots(2, 4.4, sharex=True)
    for name, result in results.items():
        if name == "starts thrice as far off":
            continue  # its first start is at rest as well
        times = PERIOD * np.arange(1, result.distance.shape[1] + 1)
        axes[0].plot(times, result.distance[0], label=name, **LOOKS[name])
        axes[1].plot(times, result.torque[0], **LOOKS[name])
    axes[0].set(title="angle from upright, rad", xlim=(0, SHOWN))
    axes[1].set(xlabel="time, s", title="torque, N m")
    pictures.legend(figure, axes[0], 2)
    pictures.save(figure, file)


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

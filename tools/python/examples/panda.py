"""A Panda that draws a circle by computed torque at 10 kHz, in MuJoCo: how far exact, late and quantised control are off the path.

    python3 tools/python/examples/panda.py                       one lap, and what it took
    python3 tools/python/examples/panda.py --table docs/mujoco.md --plot error.svg --picture panda.png

Needs mujoco, and `pin` and `example-robot-data` for the robot; --plot and --picture need matplotlib, the picture a display or
MUJOCO_GL=egl.
"""

from __future__ import annotations

import argparse
import re
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import takt.mujoco
from takt.mujoco import Controller, Encoder

Array = NDArray[np.float64]
LAP, RADIUS, START = 1.0, 0.15, np.array([0.0, -0.5, 0.0, -2.2, 0.0, 1.8, 0.8])
TIP = "panda_hand"


def panda() -> Any:
    """The robot of example-robot-data as MuJoCo's specification: fingers held, a motor at each joint, rotors and friction."""
    import mujoco  # type: ignore[import-untyped]
    import pinocchio  # type: ignore[import-untyped]

    share = Path(pinocchio.__file__).parents[4] / "share/example-robot-data/robots/panda_description"
    text = re.sub(r"<visual>.*?</visual>", "", (share / "urdf/panda.urdf").read_text(), flags=re.S)
    settings = f'<compiler meshdir="{share}/meshes/collision" strippath="true" discardvisual="false" fusestatic="false"/>'
    spec: Any = mujoco.MjSpec.from_string(re.sub(r"(<robot[^>]*>)", rf"\1<mujoco>{settings}</mujoco>", text, count=1))
    spec.option.timestep, spec.option.integrator = 1e-3, mujoco.mjtIntegrator.mjINT_RK4
    for joint in list(spec.joints):
        if "finger" in joint.name:
            spec.delete(joint)
            continue
        joint.armature, joint.damping, joint.frictionloss = 0.1, [0.5, 0, 0], 0
        motor = spec.add_actuator(name=joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.set_to_motor()
    for equality in list(spec.equalities):
        spec.delete(equality)
    for geom in spec.geoms:
        geom.contype = geom.conaffinity = 0
        geom.rgba = [0.85, 0.87, 0.9, 1] if geom.meshname in ("link1", "link3", "link5", "hand") else [0.35, 0.4, 0.48, 1]
    return spec


def circle(t: NDArray[Any]) -> Array:
    """Where the tip is to be, relative to its start: a lap in a vertical plane, from rest to rest."""
    s = t / LAP
    angle = 2 * np.pi * s**3 * (10 - 15 * s + 6 * s**2)
    return RADIUS * np.stack([0 * angle, np.sin(angle), np.cos(angle) - 1], axis=-1)


class Joints:
    """Positions of the joints that draw the circle, as polynomials of the time, which have derivatives."""

    def __init__(self, model: Any) -> None:
        import mujoco

        data, tip, jacobian, turn = mujoco.MjData(model), model.body(TIP).id, np.zeros((3, model.nv)), np.zeros((3, model.nv))
        # Chebyshev nodes, at which a polynomial of high degree does not oscillate at the ends.
        times, rows, q = LAP / 2 * (1 - np.cos(np.pi * (np.arange(160) + 0.5) / 160)), [], START.copy()
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        home, facing = data.xpos[tip].copy(), data.xmat[tip].copy().reshape(3, 3)
        for wanted in home + circle(times):
            for _ in range(6):
                data.qpos[:] = q
                mujoco.mj_kinematics(model, data)
                mujoco.mj_comPos(model, data)
                mujoco.mj_jacBody(model, data, jacobian, turn, tip)
                now = data.xmat[tip].reshape(3, 3)
                tilt = 0.5 * np.cross(now.T, facing.T).sum(axis=0)
                off = np.concatenate([wanted - data.xpos[tip], tilt])
                q = q + np.linalg.pinv(np.vstack([jacobian, turn])) @ off
            rows.append(q)
        fits = [np.polynomial.Chebyshev.fit(times, row, 60, domain=[0, LAP]) for row in np.array(rows).T]
        self.derivatives = [[fit.deriv(order) if order else fit for fit in fits] for order in range(3)]
        self.home = home

    def __call__(self, t: float | NDArray[Any]) -> dict[str, Array]:
        """Position, velocity and acceleration, with a row for each time."""
        values = ([fit(np.minimum(t, LAP)) for fit in fits] for fits in self.derivatives)
        return {name: np.stack(rows, axis=-1) for name, rows in zip(("qr", "qdr", "qddr"), values)}


@dataclass
class Lap:
    """What came of a lap."""

    #: Distance of the tip from its target, m, and errors of the joints, rad, by period.
    tip: Array
    joints: Array
    #: Cycles per period, and simulation time of the lap in s.
    cycles: set[int]
    took: float


def lap(model: Any, law: takt.Program, path: Joints, period: float = 1e-4, **options: Any) -> Lap:
    """Draws the circle once."""
    import mujoco

    data, tip, count = mujoco.MjData(model), model.body(TIP).id, round(LAP / period)
    data.qpos[:] = path(0)["qr"]
    mujoco.mj_forward(model, data)
    ticks = path(period * np.arange(count + 1))
    loop = Controller(model, law, period=period, reference=lambda t: {key: rows[round(t / period)] for key, rows in ticks.items()}, **options)
    wanted, places, joints, cycles = path.home + circle(period * np.arange(1, count + 1)), np.zeros((count, 3)), np.zeros((count, 7)), set()
    begin = time.perf_counter()
    for k in range(count):
        loop.step(data)
        joints[k] = data.qpos - ticks["qr"][k + 1]
        mujoco.mj_kinematics(model, data)
        places[k] = data.xpos[tip]
        cycles.add(int(loop.cycles[0]))
    return Lap(np.linalg.norm(places - wanted, axis=1), np.abs(joints).max(axis=1), cycles, time.perf_counter() - begin)


ENCODER = Encoder(counts=2**20, cutoff=400)
#: Compared cases: period, and options of the controller.
CASES: dict[str, tuple[float, dict[str, Any]]] = {
    "10 kHz, no time for control": (1e-4, {"latency": 0}),
    "10 kHz, exact to the cycle": (1e-4, {}),
    "10 kHz, a period late": (1e-4, {"latency": 12500}),
    "10 kHz, exact, encoders of 20 bits": (1e-4, {"encoder": ENCODER}),
    "10 kHz, a period late, encoders": (1e-4, {"latency": 12500, "encoder": ENCODER}),
    "1 kHz, exact to the cycle": (1e-3, {}),
    "1 kHz, a period late": (1e-3, {"latency": 125_000}),
}


HEAD = "| control | tip, largest error, µm | tip, rms, µm | joints, largest error, µrad |\n|---|---|---|---|"


def row(name: str, result: Lap) -> str:
    """A row of the table."""
    return f"| {name} | {1e6 * result.tip.max():.3g} | {1e6 * np.sqrt((result.tip ** 2).mean()):.3g} | {1e6 * result.joints.max():.3g} |"


def picture(spec: Any, path: Joints, file: str) -> None:
    """The robot on its way, and the circle."""
    import scenes

    scene = scenes.Scene(spec, size=1.0, target=[0.26, 0.03, 0.35], distance=1.05, azimuth=150, elevation=-20)
    scene.body(path(0.45 * LAP)["qr"])
    scene.way(path.home + circle(np.linspace(0, LAP, 120)), 0.006)
    scene.save(file)


#: Line of each case in the plot. A colour for each rate and measurement; of two cases that nearly agree, the first is broad and pale behind the second.
LINES: dict[str, dict[str, Any]] = {
    "10 kHz, no time for control": {"color": "C0"},
    "10 kHz, exact to the cycle": {"color": "C0", "lw": 4, "alpha": 0.35, "zorder": 1},
    "10 kHz, a period late": {"color": "C0", "ls": "--"},
    "10 kHz, exact, encoders of 20 bits": {"color": "C1", "lw": 4, "alpha": 0.35, "zorder": 1},
    "10 kHz, a period late, encoders": {"color": "C1", "ls": "--"},
    "1 kHz, exact to the cycle": {"color": "C2", "lw": 4, "alpha": 0.35, "zorder": 1},
    "1 kHz, a period late": {"color": "C2", "ls": "--"},
}


def plot(results: dict[str, Lap], file: str) -> None:
    import pictures

    figure, axes = pictures.subplots(1, 4.2)
    for name, result in results.items():
        # The picture resolves about a thousand points.
        every = max(1, len(result.tip) // 1000)
        axes.semilogy(np.linspace(0, LAP, len(result.tip))[::every], 1e6 * result.tip[::every], label=name, **LINES[name])
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set(xlabel="time, s", title="distance of the tip from its path, µm", xlim=(0, LAP), ylim=(1e-1, None))
    pictures.legend(figure, axes, 1)
    pictures.save(figure, file)


def main(arguments: list[str] | None = None) -> dict[str, Lap]:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--table", metavar="FILE", help="write the table of all cases into this document")
    parser.add_argument("--plot", metavar="FILE", help="draw the errors of all cases")
    parser.add_argument("--picture", metavar="FILE", help="draw the robot")
    options = parser.parse_args(arguments)
    spec = panda()
    model, law = spec.compile(), takt.mujoco.program(spec, "computed-torque", kp=10_000, kd=200, effort=20)
    path = Joints(model)
    names = list(CASES) if options.table or options.plot else ["10 kHz, exact to the cycle"]
    results = {}
    for name in names:
        period, settings = CASES[name]
        results[name] = result = lap(model, law, path, period, **settings)
        speed = f"{LAP / result.took:.1f} times real time"
        print(f"{name}: {max(result.cycles)} cycles, tip within {1e6 * result.tip.max():.3g} µm, joints within {1e6 * result.joints.max():.3g} µrad; {speed}")
    if options.table:
        file, rows = Path(options.table), "\n".join([HEAD, *(row(name, result) for name, result in results.items())])
        text, count = re.subn(r"(?<=<!-- table: panda -->\n).*?(?=\n<!-- end of panda -->)", lambda _: rows, file.read_text(), flags=re.S)
        if count != 1:
            raise SystemExit(f"{file} has no place for the table")
        file.write_text(text)
    if options.plot:
        plot(results, options.plot)
    if options.picture:
        picture(spec, path, options.picture)
    return results


if __name__ == "__main__":
    main()

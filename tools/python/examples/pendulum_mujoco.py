"""The learned policy of pendulum.py in MuJoCo: a pendulum too heavy for its motor swings up; on time, late, and with a coarse encoder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco  # type: ignore[import-untyped]
import numpy as np

import takt.onnx
from takt.mujoco import Controller

PERIOD = 0.05
#: Weight, length and inertia are 1, as where the policy was trained; the angle is 0 upright.
MODEL = """<mujoco><option gravity="0 0 -1" timestep="0.01" integrator="RK4"/><worldbody><body><joint name="hinge" axis="0 1 0" damping="0.05"/>
<inertial mass="1" pos="0 0 1" diaginertia="1e-6 1e-6 1e-6"/></body></worldbody>
<actuator><motor name="motor" joint="hinge" ctrlrange="-0.5 0.5" ctrllimited="true"/></actuator></mujoco>"""

model = mujoco.MjModel.from_xml_string(MODEL)
policy = takt.onnx.program(Path(__file__).parent / "pendulum.onnx", range=(-3, 3))


def swing(latency: int | None = None, encoder: float | None = None) -> tuple[np.ndarray[Any, Any], Controller]:
    """The angle over 20 s from hanging at rest."""
    data = mujoco.MjData(model)
    data.qpos[0] = np.pi - 1e-3

    def state(time: float) -> dict[str, Any]:
        q = data.qpos[0] if encoder is None else np.round(data.qpos[0] / encoder) * encoder
        return {"state": [np.cos(q), np.sin(q), data.qvel[0]]}

    loop = Controller(model, policy, period=PERIOD, latency=latency, actuators={"torque": ["motor"]}, reference=state)
    angles = []
    for _ in range(400):
        loop.step(data)
        angles.append(abs((float(data.qpos[0]) + np.pi) % (2 * np.pi) - np.pi))
    return np.array(angles), loop


CASES: dict[str, dict[str, Any]] = {
    "on time": {},
    "a period late": {"latency": round(PERIOD * takt.mujoco.CLOCK)},
    "encoder of 8 bits": {"encoder": 2 * np.pi / 256},
}
results = {}
for name, options in CASES.items():
    angles, loop = swing(**options)
    results[name] = angles
    above = np.flatnonzero(angles >= 0.1)
    time = PERIOD * (above[-1] + 1)
    said = f"upright after {time:.1f} s, at the end within {1e3 * angles[-20:].max():.1f} mrad" if time < 19 else "not upright"
    print(f"{name}: {loop.cycles[0]} cycles; {said}")

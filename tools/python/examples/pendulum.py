"""A pendulum too heavy for its motor swings up by a learned policy (pendulum.onnx, which pendulum_train.py writes): cycles, closed loop."""
from pathlib import Path

import numpy as np

import takt.onnx
from pendulum_train import LIMIT, step

policy = takt.onnx.program(Path(__file__).parent / "pendulum.onnx", range=(-3, 3))
random = np.random.default_rng(0)
q, v, sim = np.array(np.pi - 1e-3), np.array(0.0), policy.sim()
angles, torques, cycles = [], [], set()
for k in range(400):
    torque = sim.step({"state": [np.cos(q), np.sin(q), v]})["torque"][0]
    q, v = step(q, v, torque)
    angles.append(abs(float(q)))
    torques.append(abs(float(torque)))
    cycles.add(sim.cycles)
up = next(k for k in range(400) if max(angles[k:]) < 0.1)
print(f"{max(cycles)} cycles a period on {policy.machine}, {max(cycles) / 125:.2f} µs at 125 MHz, never another number; {policy.bundles} bundles")
print(f"from hanging at rest to upright in {0.05 * up:.1f} s, within {LIMIT} of the weight; then within {1e3 * angles[-1]:.1f} mrad")

"""A quadrotor (a Crazyflie of 35 g) returns to a point by model-predictive control of its linearisation: cycles, closed loop, worst case."""
import numpy as np
from numpy.typing import NDArray

import takt.mpc

G, MASS, ARM, THRUST, DRAG = 9.81, 0.035, 0.0325, 0.147, 0.00596  # m/s², kg, m, N of a motor, N m for each N
INERTIA = np.array([1.66e-5, 1.66e-5, 2.93e-5])
HOVER = MASS * G / (4 * THRUST)
MIX = THRUST * np.array([ARM * np.array([-1, -1, 1, 1]), ARM * np.array([-1, 1, 1, -1]), DRAG * np.array([-1, 1, -1, 1])])
PERIOD = 0.02


def derivative(s: NDArray[np.float64], u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Position, roll, pitch, yaw, velocity, angular velocity; u are the motors' parts of their largest thrust."""
    (roll, pitch, yaw), v, w = s[3:6], s[6:9], s[9:12]
    (sr, sp, sy), (cr, cp, cy) = np.sin(s[3:6]), np.cos(s[3:6])
    up = np.array([cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr])
    turn = np.array([[1, sr * sp / cp, cr * sp / cp], [0, cr, -sr], [0, sr / cp, cr / cp]]) @ w
    lift = up * THRUST * u.sum() / MASS - np.array([0, 0, G])
    return np.concatenate([v, turn, lift, (MIX @ u - np.cross(w, INERTIA * w)) / INERTIA])


def moved(s: NDArray[np.float64], u: NDArray[np.float64], steps: int = 10) -> NDArray[np.float64]:
    """A period later, by the classical Runge-Kutta method."""
    h = PERIOD / steps
    for _ in range(steps):
        a = derivative(s, u)
        b = derivative(s + h / 2 * a, u)
        c = derivative(s + h / 2 * b, u)
        s = s + h / 6 * (a + 2 * b + 2 * c + derivative(s + h * c, u))
    return s


def linearised() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A and B about the hovering state, by central differences of a period."""
    x, u, e = np.zeros(12), np.full(4, HOVER), 1e-5
    A = [(moved(x + d, u) - moved(x - d, u)) / (2 * e) for d in e * np.eye(12)]
    B = [(moved(x, u + d) - moved(x, u - d)) / (2 * e) for d in e * np.eye(4)]
    return tuple(np.where(abs(M := np.array(part).T) < 1e-9, 0, M) for part in (A, B))  # type: ignore[return-value]


A, B = linearised()
LIMITS = np.array([np.inf] * 3 + [0.35] * 3 + [0.8] * 3 + [np.inf] * 3)  # of angles and speeds
problem = takt.mpc.problem(
    A, B, Q=[100, 100, 100, 40, 40, 400, 10, 10, 10, 6, 6, 8], R=[8] * 4, horizon=10, rho=5, iterations=10, name="quadrotor",
    x_min=-LIMITS, x_max=LIMITS, u_min=-HOVER, u_max=1 - HOVER, x_range=[[-0.3, 0.3]] * 3 + [[-0.1, 0.1]] * 3 + [[-0.3, 0.3]] * 6,
)  # fmt: skip
controller = takt.mpc.program(problem)
bound = controller.bound().worst_period or 0
s, sim = np.array([0.6, -0.5, -0.4] + [0.0] * 9), controller.sim()
path, inputs, residuals = [s], [], []
for _ in range(200):
    outputs = sim.step({"x": s})
    s = moved(s, HOVER + np.asarray(outputs["u"], dtype=float))
    path.append(s)
    inputs.append(np.asarray(outputs["u"], dtype=float))
    residuals.append(float(outputs["primal"]))
trajectory = np.array(path)
print(f"{bound} cycles a period on {controller.machine}, {bound / 125:.0f} µs at 125 MHz; {controller.bundles} bundles")
print(f"from {np.linalg.norm(path[0][:3]):.2f} m away to within {1e3 * np.linalg.norm(s[:3]):.1f} mm in {200 * PERIOD:.0f} s; "
      f"at most {np.abs(trajectory[:, 6:9]).max():.2f} m/s and {np.abs(trajectory[:, 3:6]).max():.2f} rad")  # fmt: skip
for name, (value, state) in takt.mpc.worst(problem, 20).items():
    print(f"worst {name} found: {value:.3f}")

"""The links of Spong's Acrobot (IEEE Control Systems, 1995) with both joints driven: from a URDF to a closed loop to cycles."""
import numpy as np

import takt.urdf

LINK = """<link name="{0}"><inertial><origin xyz="0 0 -{2}"/><mass value="1"/>
  <inertia ixx="{1}" iyy="{1}" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """<joint name="{0}" type="continuous"><parent link="{1}"/><child link="{2}"/>
  <origin xyz="0 0 -{3}"/><axis xyz="0 1 0"/></joint>"""
URDF = f"""<robot name="acrobot"><link name="base"/>{LINK.format("upper", 0.083, 0.5)}{LINK.format("lower", 0.33, 1)}
  {JOINT.format("shoulder", "base", "upper", 0)}{JOINT.format("elbow", "upper", "lower", 1)}</robot>"""


def acceleration(q: np.ndarray, qd: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """The plant, in binary64: the manipulator equations as the textbooks print them (m1 = m2 = l1 = lc2 = 1, lc1 = 1/2)."""
    (s1, s2), c2, s12 = np.sin(q), np.cos(q[1]), np.sin(q.sum())
    inertia = np.array([[0.333 + 1.33 + 1 + 2 * c2, 1.33 + c2], [1.33 + c2, 1.33]])
    coriolis = s2 * np.array([-2 * qd[0] * qd[1] - qd[1] ** 2, qd[0] ** 2])
    gravity = -9.81 * np.array([1.5 * s1 + s12, s12])
    solved: np.ndarray = np.linalg.solve(inertia, tau + gravity - coriolis)
    return solved


controller = takt.urdf.program(URDF, "computed-torque", kp=400, kd=40)
sim, bound = controller.sim(), controller.bound()
step, inner, errors, cycles = 1e-3, 4, [], set()
q, qd = np.array([0.0, 1.0]), np.zeros(2)
for k in range(5000):
    t = k * step
    reference = {"qr": [np.sin(t), np.cos(2 * t)], "qdr": [np.cos(t), -2 * np.sin(2 * t)]}
    tau = sim.step({"q": q, "qd": qd, **reference, "qddr": [-np.sin(t), -4 * np.cos(2 * t)]})["tau"]
    for _ in range(inner):
        qd = qd + acceleration(q, qd, tau) * step / inner
        q = q + qd * step / inner
    errors.append(np.abs(reference["qr"] - q).max() if t > 1 else 0.0)
    cycles.add(sim.cycles)
print(f"{max(cycles)} cycles a period on {controller.machine}, {max(cycles) / 125:.2f} µs at 125 MHz; never more than {bound.worst_period}")
print(f"after a second the joints follow within {1e3 * max(errors):.2f} mrad")

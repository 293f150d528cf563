"""What MuJoCo and Pinocchio compute of a robot in MJCF.

Reads requests, one JSON object a line, and answers each with one line:

    {"mjcf": path, "joints": [...], "base": body, "tip": body, "function": name, "states": n, "seed": n, "kp": x, "kd": x}

A request `{"locate": "package:path"}` is answered with the place of a file of a Python package, `{"list": [package, ...]}` with those of
all their files whose names end in `.xml` and that MuJoCo reads; what fails is answered with `error`. Joints that are not named are held at
0. The answer has `inputs` and `outputs`, a row for each state, in the order of takt's ports, and `between`: how far Pinocchio and MuJoCo
are apart, where Pinocchio is asked. Velocities are so fast that MuJoCo's friction, which begins softly, has its full force, but for
bodies so light that it never has: with `"coulomb": true` the full force takes the place of MuJoCo's own.
"""

import importlib.util
import json
import os
import sys

import mujoco
import numpy as np
import pinocchio as pin


def locate(name):
    package, path = name.split(":")
    return os.path.join(importlib.util.find_spec(package).submodule_search_locations[0], path)


def models(packages):
    for package in packages:
        for folder, _, names in sorted(os.walk(locate(f"{package}:"))):
            for path in (os.path.join(folder, name) for name in sorted(names) if name.endswith(".xml")):
                try:
                    mujoco.MjModel.from_xml_path(path)
                except ValueError:
                    continue
                yield path


class Robot:
    def __init__(self, request):
        self.model = m = mujoco.MjModel.from_xml_path(request["mjcf"])
        for off in ("CONTACT", "LIMIT", "EQUALITY"):
            m.opt.disableflags |= getattr(mujoco.mjtDisableBit, f"mjDSBL_{off}")
        self.friction = m.dof_frictionloss.copy() if request.get("coulomb") else None
        if m.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS:
            self.friction = None
        if self.friction is not None:
            m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS
        self.data = mujoco.MjData(m)
        joints = [m.joint(name) for name in request["joints"]]
        self.q, self.v = (np.array([j.qposadr[0] for j in joints]), np.array([j.dofadr[0] for j in joints]))
        # Remaining hinges and slides are at 0; free and ball joints keep their reference, which contains a quaternion.
        self.rest = m.qpos0.copy()
        for j in range(m.njnt):
            if m.jnt_type[j] >= int(mujoco.mjtJoint.mjJNT_SLIDE):
                self.rest[m.jnt_qposadr[j]] = 0
        self.names = request["joints"]
        self.base, self.tip = m.body(request["base"]).id, m.body(request["tip"]).id
        self.pinocchio = None
        if request.get("pinocchio"):
            full = pin.buildModelFromMJCF(request["mjcf"])
            self.pinocchio, self.store = full, full.createData()
            self.columns = [full.joints[full.getJointId(name)].idx_v for name in request["joints"]]
            assert len(self.columns) == full.nv == full.nq, "joints do not match"

    def at(self, q, qd=0, qdd=0):
        d = self.data
        d.qpos[:], d.qvel[:], d.qacc[:] = self.rest, 0, 0
        d.qpos[self.q], d.qvel[self.v], d.qacc[self.v] = q, qd, qdd
        mujoco.mj_forward(self.model, d)
        d.qacc[:] = 0
        d.qacc[self.v] = qdd

    def inverse(self, q, qd, qdd):
        """With friction at the velocity `qd`."""
        self.at(q, qd, qdd)
        mujoco.mj_inverse(self.model, self.data)
        forces = self.data.qfrc_inverse[self.v].copy()
        return forces if self.friction is None else forces + self.friction[self.v] * np.sign(qd)

    def passive(self, q, qd):
        """Friction and springs, of which Pinocchio knows nothing."""
        m = self.model
        spring = m.jnt_stiffness[m.dof_jntid[self.v]] * (q - m.qpos_spring[self.q])
        return m.dof_damping[self.v] * qd + m.dof_frictionloss[self.v] * np.sign(qd) + spring

    def other(self, q, qd, qdd):
        """The same by Pinocchio."""
        states = np.zeros((3, self.pinocchio.nv))
        states[:, self.columns] = q, qd, qdd
        return pin.rnea(self.pinocchio, self.store, *states)[self.columns] + self.passive(q, qd)

    def pose(self):
        d = self.data
        turn = d.xmat[self.base].reshape(3, 3).T
        return turn @ d.xmat[self.tip].reshape(3, 3), turn @ (d.xpos[self.tip] - d.xpos[self.base])

    def jacobian(self):
        m, d = self.model, self.data
        linear, angular = np.zeros((3, m.nv)), np.zeros((3, m.nv))
        mujoco.mj_jacBody(m, d, linear, angular, self.tip)
        turn = d.xmat[self.base].reshape(3, 3).T
        return np.vstack([turn @ linear, turn @ angular])[:, self.v]

    def inertia(self):
        whole = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, whole)
        return whole[np.ix_(self.v, self.v)]


def compute(robot, function, random, request):
    n = len(robot.names)
    q, qdd, qr, qddr = random.uniform(-np.pi, np.pi, (4, n))
    qd, qdr = random.choice([-1, 1], (2, n)) * random.uniform(0.5, 2, (2, n))
    if function in ("forward-kinematics", "jacobian", "mass-matrix"):
        robot.at(q)
    if function == "forward-kinematics":
        rotation, position = robot.pose()
        return [q], np.concatenate([rotation.ravel(), position])
    if function == "jacobian":
        return [q], robot.jacobian().ravel()
    if function == "mass-matrix":
        return [q], robot.inertia()[np.tril_indices(n)]
    if function == "gravity":
        # Without velocity there is no friction.
        return [q], robot.inverse(q, 0, 0)
    if function == "inverse-dynamics":
        return [q, qd, qdd], robot.inverse(q, qd, qdd)
    if function == "forward-dynamics":
        return [q, qd, robot.inverse(q, qd, qdd)], qdd
    wanted = qddr + request["kp"] * (qr - q) + request["kd"] * (qdr - qd)
    # Friction follows the reference velocity; mj_inverse would take `qd`'s, softened by so large an acceleration.
    robot.model.dof_frictionloss[:], friction = 0, robot.model.dof_frictionloss.copy()
    tau = robot.inverse(q, qd, wanted)
    robot.model.dof_frictionloss[:] = friction
    return [q, qd, qr, qdr, qddr], tau + friction[robot.v] * np.sign(qdr)


def answer(request):
    if "locate" in request:
        return locate(request["locate"])
    if "list" in request:
        return list(models(request["list"]))
    robot, random = Robot(request), np.random.default_rng(request["seed"])
    rows = [compute(robot, request["function"], random, request) for _ in range(request["states"])]
    between = 0.0
    if robot.pinocchio is not None and request["function"] == "inverse-dynamics":
        for state, tau in rows:
            between = max(between, float(abs(robot.other(*state) - tau).max() / abs(tau).max()))
    return {"inputs": [np.concatenate(state).tolist() for state, _ in rows], "outputs": [list(tau) for _, tau in rows], "between": between}


def told(request):
    try:
        return answer(request)
    except Exception as error:
        return {"error": f"{type(error).__name__}: {error}"}


for line in sys.stdin:
    print(json.dumps(told(json.loads(line))), flush=True)

"""What Pinocchio computes, and what the same function takes in CasADi.

Reads requests, one JSON object a line, and answers each with one line:

    {"urdf": path, "joints": [...], "base": link, "tip": link or null, "function": name,
     "states": n, "seed": n, "kp": x, "kd": x, "casadi": bool}

`states` may also be rows of inputs, which are then those that are computed with.

A request `{"locate": path}` is answered with the file's place, `{"list": true}` with those of all files of example-robot-data;
what fails is answered with `error`. `urdf` may begin with `erd:`, for a file of example-robot-data. Joints that are not named are held at 0. The answer has
`inputs` and `outputs`, a row for each state, in the order of takt's ports; with `casadi`, `operations`: how many
operations the function has in CasADi after `cse`, written as the textbooks have it (Featherstone, in link frames).
"""

import json
import os
import sys

import numpy as np
import pinocchio as pin


def locate(name):
    if not name.startswith("erd:"):
        return name
    share = os.path.join(os.path.dirname(pin.__file__), *[".."] * 4, "share")
    return os.path.join(share, "example-robot-data", "robots", name[4:])


class Robot:
    """A robot whose other joints are held at 0."""

    def __init__(self, request):
        full = pin.buildModelFromUrdf(locate(request["urdf"]))
        held = [full.getJointId(n) for n in list(full.names)[1:] if n not in request["joints"]]
        self.model = m = pin.buildReducedModel(full, held, pin.neutral(full)) if held else full
        self.data = m.createData()
        self.ids = [m.getJointId(n) for n in request["joints"]]
        self.columns = [m.joints[i].idx_v for i in self.ids]
        assert sorted(self.columns) == list(range(m.nv)), "joints do not match"
        self.base = m.getFrameId(request["base"])
        self.tip = m.getFrameId(request["tip"]) if request.get("tip") else None

    def q(self, x):
        q = pin.neutral(self.model)
        for i, value in zip(self.ids, x):
            j = self.model.joints[i]
            if j.nq == 2:
                q[j.idx_q], q[j.idx_q + 1] = np.cos(value), np.sin(value)
            else:
                q[j.idx_q] = value
        return q

    def v(self, x):
        v = np.zeros(self.model.nv)
        v[self.columns] = x
        return v

    def relative(self):
        return self.data.oMf[self.base].actInv(self.data.oMf[self.tip])


SPREAD = {"q": np.pi, "qd": 2.0, "qdd": 5.0, "tau": 20.0, "qr": np.pi, "qdr": 2.0, "qddr": 5.0}
INPUTS = {
    "forward-kinematics": ["q"],
    "jacobian": ["q"],
    "gravity": ["q"],
    "mass-matrix": ["q"],
    "inverse-dynamics": ["q", "qd", "qdd"],
    "forward-dynamics": ["q", "qd", "tau"],
    "computed-torque": ["q", "qd", "qr", "qdr", "qddr"],
}


def compute(robot, function, x, request):
    m, d, c = robot.model, robot.data, robot.columns
    q = robot.q(x["q"])
    if function in ("forward-kinematics", "jacobian"):
        pin.computeJointJacobians(m, d, q)
        pin.updateFramePlacements(m, d)
        pose = robot.relative()
        if function == "forward-kinematics":
            return np.concatenate([pose.rotation.ravel(), pose.translation])
        jacobian = pin.getFrameJacobian(m, d, robot.tip, pin.LOCAL_WORLD_ALIGNED)[:, c]
        turn = d.oMf[robot.base].rotation.T
        return np.vstack([turn @ jacobian[:3], turn @ jacobian[3:]]).ravel()
    if function == "gravity":
        return pin.computeGeneralizedGravity(m, d, q)[c]
    if function == "mass-matrix":
        matrix = pin.crba(m, d, q)
        matrix = np.triu(matrix) + np.triu(matrix, 1).T
        matrix = matrix[np.ix_(c, c)]
        return matrix[np.tril_indices(len(c))]
    if function == "inverse-dynamics":
        return pin.rnea(m, d, q, robot.v(x["qd"]), robot.v(x["qdd"]))[c]
    if function == "forward-dynamics":
        return pin.aba(m, d, q, robot.v(x["qd"]), robot.v(x["tau"]))[c]
    if function == "computed-torque":
        wanted = x["qddr"] + request["kp"] * (x["qr"] - x["q"]) + request["kd"] * (x["qdr"] - x["qd"])
        return pin.rnea(m, d, q, robot.v(x["qd"]), robot.v(wanted))[c]
    raise ValueError(function)


class Textbook:
    """The same in CasADi's SX: zeros of the geometry are structural, the rest is left to `cse`."""

    def __init__(self, robot):
        import casadi

        self.ca, self.robot, m = casadi, robot, robot.model
        pin.forwardKinematics(m, robot.data, pin.neutral(m))
        pin.computeJointJacobians(m, robot.data, pin.neutral(m))
        self.axis = {}
        for i in range(1, m.njoints):
            s = np.array(robot.data.joints[i].S).ravel()
            slides = np.linalg.norm(s[3:]) == 0
            self.axis[i] = (slides, self.clean(s[:3] if slides else s[3:]))

    def clean(self, a):
        a = np.array(a, dtype=float)
        whole = np.round(a)
        return self.ca.sparsify(self.ca.SX(np.where(abs(a - whole) < 1e-6, whole, a)))

    def move(self, i, q):
        """Rotation and origin of joint `i`'s frame in its parent's."""
        ca, m = self.ca, self.robot.model
        place = m.jointPlacements[i]
        rest = self.clean(place.rotation)
        p = ca.sparsify(ca.SX(place.translation))
        slides, axis = self.axis[i]
        if slides:
            return rest, p + rest @ (axis * q)
        c, s = ca.cos(q), ca.sin(q)
        turn = ca.SX(3, 3)
        unit = [k for k in range(3) if ca.is_equal(ca.densify(axis)[k], 1) or ca.is_equal(ca.densify(axis)[k], -1)]
        if unit:
            k = unit[0]
            a, b = (k + 1) % 3, (k + 2) % 3
            sign = float(axis[k])
            turn[k, k], turn[a, a], turn[b, b], turn[a, b], turn[b, a] = 1, c, c, -sign * s, sign * s
        else:
            turn = c * ca.SX.eye(3) + s * ca.skew(axis) + (1 - c) * (axis @ axis.T)
        return rest @ turn, p

    def rnea(self, q, v, a, gravity=9.81):
        ca, m = self.ca, self.robot.model
        n = m.njoints
        zero = ca.SX(3, 1)
        w, dw, acc, f, t, moves = [zero], [zero], [ca.sparsify(ca.SX([0, 0, gravity]))], [zero], [zero], {}
        for i in range(1, n):
            k, parent = m.joints[i].idx_v, m.parents[i]
            R, p = moves[i] = self.move(i, q[k])
            slides, axis = self.axis[i]
            turned = R.T @ w[parent]
            at = R.T @ (acc[parent] + ca.cross(dw[parent], p) + ca.cross(w[parent], ca.cross(w[parent], p)))
            if slides:
                w.append(turned)
                dw.append(R.T @ dw[parent])
                acc.append(at + 2 * ca.cross(turned, axis * v[k]) + axis * a[k])
            else:
                w.append(turned + axis * v[k])
                dw.append(R.T @ dw[parent] + ca.cross(turned, axis * v[k]) + axis * a[k])
                acc.append(at)
            body = m.inertias[i]
            lever, tensor = ca.sparsify(ca.SX(body.lever)), ca.sparsify(ca.SX(body.inertia))
            force = body.mass * (acc[i] + ca.cross(dw[i], lever) + ca.cross(w[i], ca.cross(w[i], lever)))
            f.append(force)
            t.append(tensor @ dw[i] + ca.cross(w[i], tensor @ w[i]) + ca.cross(lever, force))
        tau = ca.SX(m.nv, 1)
        for i in range(n - 1, 0, -1):
            k, parent = m.joints[i].idx_v, m.parents[i]
            (R, p), (slides, axis) = moves[i], self.axis[i]
            tau[k] = ca.dot(axis, f[i] if slides else t[i])
            back = R @ f[i]
            f[parent] = f[parent] + back
            t[parent] = t[parent] + R @ t[i] + ca.cross(p, back)
        return tau

    def spatial(self, i, q):
        """Featherstone's 6x6 transform of motions from parent to joint `i`, angular first."""
        ca = self.ca
        R, p = self.move(i, q)
        E = R.T
        X = ca.SX(6, 6)
        X[:3, :3], X[3:, 3:], X[3:, :3] = E, E, -E @ ca.sparsify(ca.skew(p))
        return ca.sparsify(X)

    def subspace(self, i):
        slides, axis = self.axis[i]
        zero = self.ca.SX(3, 1)
        return self.ca.vertcat(zero, axis) if slides else self.ca.vertcat(axis, zero)

    def body(self, i):
        ca, b = self.ca, self.robot.model.inertias[i]
        c = np.array(b.lever)
        S = np.array([[0, -c[2], c[1]], [c[2], 0, -c[0]], [-c[1], c[0], 0]])
        top = np.hstack([b.inertia + b.mass * S @ S.T, b.mass * S])
        return ca.sparsify(ca.SX(np.vstack([top, np.hstack([b.mass * S.T, b.mass * np.eye(3)])])))

    def mass_matrix(self, q):
        """Composite bodies, by mass, first moments and inertia about the origin."""
        ca, m = self.ca, self.robot.model
        n = m.njoints
        whole, moves = [None] * n, {}
        for i in range(1, n):
            moves[i] = self.move(i, q[m.joints[i].idx_v])
            b = m.inertias[i]
            c = np.array(b.lever)
            about = b.inertia + b.mass * (c @ c * np.eye(3) - np.outer(c, c))
            whole[i] = (b.mass, ca.sparsify(ca.SX(b.mass * c)), ca.sparsify(ca.SX(about)))
        H = ca.SX(m.nv, m.nv)
        for i in range(n - 1, 0, -1):
            mass, h, I = whole[i]
            slides, axis = self.axis[i]
            if slides:
                f, t = mass * axis, ca.cross(h, axis)
            else:
                f, t = ca.cross(axis, h), I @ axis
            k, j = m.joints[i].idx_v, i
            H[k, k] = ca.dot(axis, f if slides else t)
            while m.parents[j] > 0:
                R, p = moves[j]
                f = R @ f
                t = R @ t + ca.cross(p, f)
                j = m.parents[j]
                sl, ax = self.axis[j]
                H[k, m.joints[j].idx_v] = ca.dot(ax, f if sl else t)
            parent = m.parents[i]
            if parent > 0:
                R, p = moves[i]
                hr = R @ h
                shift = ca.dot(p, hr) * 2 * ca.SX.eye(3) - p @ hr.T - hr @ p.T
                shift = shift + mass * (ca.dot(p, p) * ca.SX.eye(3) - p @ p.T)
                M, H0, I0 = whole[parent]
                whole[parent] = (M + mass, H0 + hr + mass * p, I0 + R @ I @ R.T + shift)
        return H

    def aba(self, q, v, tau):
        ca, m = self.ca, self.robot.model
        n = m.njoints

        def motion(a, b):
            return ca.vertcat(ca.cross(a[:3], b[:3]), ca.cross(a[:3], b[3:]) + ca.cross(a[3:], b[:3]))

        def force(a, b):
            return ca.vertcat(ca.cross(a[:3], b[:3]) + ca.cross(a[3:], b[3:]), ca.cross(a[:3], b[3:]))

        X, V, C, I, P, U, D, T = [{} for _ in range(8)]
        V[0] = ca.SX(6, 1)
        for i in range(1, n):
            k = m.joints[i].idx_v
            X[i], S = self.spatial(i, q[k]), self.subspace(i)
            V[i] = X[i] @ V[m.parents[i]] + S * v[k]
            C[i] = motion(V[i], S * v[k])
            I[i] = self.body(i)
            P[i] = force(V[i], I[i] @ V[i])
        for i in range(n - 1, 0, -1):
            k, S = m.joints[i].idx_v, self.subspace(i)
            U[i] = I[i] @ S
            D[i] = ca.dot(S, U[i])
            T[i] = tau[k] - ca.dot(S, P[i])
            parent = m.parents[i]
            if parent > 0:
                Ia = I[i] - U[i] @ U[i].T / D[i]
                pa = P[i] + Ia @ C[i] + U[i] * (T[i] / D[i])
                I[parent] = I[parent] + X[i].T @ Ia @ X[i]
                P[parent] = P[parent] + X[i].T @ pa
        A = {0: ca.sparsify(ca.SX([0, 0, 0, 0, 0, 9.81]))}
        qdd = ca.SX(m.nv, 1)
        for i in range(1, n):
            k, S = m.joints[i].idx_v, self.subspace(i)
            a = X[i] @ A[m.parents[i]] + C[i]
            qdd[k] = (T[i] - ca.dot(U[i], a)) / D[i]
            A[i] = a + S * qdd[k]
        return qdd

    def chain(self, q):
        """Axes and origin of every joint, and of the tip, in the base."""
        ca, m, r = self.ca, self.robot.model, self.robot
        frame = m.frames[r.tip]
        path, i = [], frame.parentJoint
        while i > 0:
            path.insert(0, i)
            i = m.parents[i]
        base = m.frames[r.base].placement.inverse()
        R, p = self.clean(base.rotation), ca.sparsify(ca.SX(base.translation))
        out = []
        for i in path:
            Ri, pi = self.move(i, q[m.joints[i].idx_v])
            p, R = p + R @ pi, R @ Ri
            out.append((i, R, p))
        place = frame.placement
        return out, R @ self.clean(place.rotation), p + R @ ca.sparsify(ca.SX(place.translation))

    def functions(self, function, request):
        ca, m = self.ca, self.robot.model
        sym = lambda name: ca.SX.sym(name, m.nv)
        q, v, a, zero = sym("q"), sym("v"), sym("a"), ca.SX(m.nv, 1)
        if function == "forward-kinematics":
            _, R, p = self.chain(q)
            yield [q], [R, p]
        if function == "jacobian":
            joints, _, tip = self.chain(q)
            columns = []
            for i, R, p in joints:
                slides, axis = self.axis[i]
                z = R @ axis
                columns.append(ca.vertcat(z, ca.SX(3, 1)) if slides else ca.vertcat(ca.cross(z, tip - p), z))
            yield [q], [ca.horzcat(*columns)]
        if function == "gravity":
            yield [q], [self.rnea(q, zero, zero)]
        if function == "mass-matrix":
            yield [q], [self.mass_matrix(q)]
            yield [q], [ca.tril(ca.jacobian(self.rnea(q, zero, a, 0.0), a))]
        if function == "inverse-dynamics":
            yield [q, v, a], [self.rnea(q, v, a)]
        if function == "computed-torque":
            qr, vr, ar = sym("qr"), sym("vr"), sym("ar")
            yield [q, v, qr, vr, ar], [self.rnea(q, v, ar + request["kp"] * (qr - q) + request["kd"] * (vr - v))]
        if function == "forward-dynamics":
            yield [q, v, a], [self.aba(q, v, a)]
            if m.nv <= 12:
                H = self.mass_matrix(q)
                H = ca.tril(H) + ca.tril(H, False).T
                D, L, perm = ca.ldl(H)
                bias = a - self.rnea(q, v, zero)
                yield [q, v, a], [ca.ldl_solve(bias, D, L, perm)]

    def operations(self, function, request):
        """The fewest of the ways to write it."""
        ca = self.ca
        still = (ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST)
        counts = []
        for inputs, outputs in self.functions(function, request):
            f = ca.Function("f", inputs, ca.cse(outputs))
            counts.append(sum(f.instruction_id(k) not in still for k in range(f.n_instructions())))
        return min(counts)


def answer(request):
    if "locate" in request:
        return os.path.abspath(locate(request["locate"]))
    if "list" in request:
        found = (os.path.join(folder, name) for folder, _, names in os.walk(locate("erd:")) for name in names)
        return sorted(os.path.abspath(path) for path in found if path.endswith(".urdf"))
    robot = Robot(request)
    function = request["function"]
    random = np.random.default_rng(request.get("seed"))
    names, n = INPUTS[function], len(robot.ids)
    inputs, outputs = [], []
    given = request["states"]
    for row in range(given) if isinstance(given, int) else given:
        if isinstance(given, int):
            # Rounded to binary32, as the machine reads them.
            x = {name: np.float32(random.uniform(-SPREAD[name], SPREAD[name], n)).astype(float) for name in names}
        else:
            x = dict(zip(names, np.reshape(row, (len(names), n))))
        inputs.append(np.concatenate([x[name] for name in names]).tolist())
        outputs.append(compute(robot, function, x, request).tolist())
    result = {"inputs": inputs, "outputs": outputs}
    if request.get("casadi"):
        result["operations"] = Textbook(robot).operations(function, request)
    return result


def told(request):
    try:
        return answer(request)
    except Exception as error:
        return {"error": f"{type(error).__name__}: {error}"}


if __name__ == "__main__":
    for line in sys.stdin:
        print(json.dumps(told(json.loads(line))), flush=True)

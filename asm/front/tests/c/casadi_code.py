# SPDX-License-Identifier: MIT OR Apache-2.0
"""CasADi's C of some functions, each with a step that calls it, into the folder given; prints their names."""

import sys
from pathlib import Path

import casadi as ca


def write(folder, name, function):
    """C of a function, and a step whose parameters are its inputs and outputs."""
    generator = ca.CodeGenerator(name, {"casadi_real": "float", "casadi_int": "int", "main": False, "with_header": False})
    generator.add(function)
    code = generator.dump()
    work = [function.sz_arg(), function.sz_res(), function.sz_iw(), function.sz_w()]
    inputs = [(function.name_in(i), function.nnz_in(i)) for i in range(function.n_in())]
    outputs = [(function.name_out(i), function.nnz_out(i)) for i in range(function.n_out())]
    parameters = [f"const float {n}[{max(k, 1)}]" for n, k in inputs] + [f"float {n}[{max(k, 1)}]" for n, k in outputs]
    code += f"""
void step({", ".join(parameters)})
{{
  const float *arg[{max(work[0], 1)}] = {{ {", ".join(n for n, _ in inputs)} }};
  float *res[{max(work[1], 1)}] = {{ {", ".join(n for n, _ in outputs)} }};
  static float w[{max(work[3], 1)}];
  static int iw[{max(work[2], 1)}];
  {function.name()}(arg, res, iw, w, 0);
}}
"""
    # The driver includes the file among others: the generator's own headers stand before.
    (folder / f"{name}.c").write_text(code)
    print(name)


def arm():
    """Inverse dynamics of an arm of six axes, by Newton and Euler, with numbers for links."""
    q, v, a = (ca.SX.sym(n, 6) for n in "qva")
    axes = [(0, 0, 1), (0, 1, 0), (0, 1, 0), (1, 0, 0), (0, 1, 0), (1, 0, 0)]
    at = [(0, 0, 0.3), (0, 0.1, 0.2), (0.05, 0, 0.4), (0.3, 0, 0.02), (0.1, 0, 0), (0.1, 0, 0)]
    def skew(x):
        return ca.skew(x)
    def turn(axis, angle):
        k = skew(ca.DM(axis))
        return ca.DM.eye(3) + ca.sin(angle) * k + (1 - ca.cos(angle)) * (k @ k)
    w, dw, acc = ca.SX.zeros(3), ca.SX.zeros(3), ca.DM([0, 0, 9.81])
    links = []
    for i in range(6):
        r, p = turn(axes[i], q[i]), ca.DM(at[i])
        axis = ca.DM(axes[i])
        acc = r.T @ (acc + ca.cross(dw, p) + ca.cross(w, ca.cross(w, p)))
        w, dw = r.T @ w + axis * v[i], r.T @ dw + axis * a[i] + ca.cross(r.T @ w, axis * v[i])
        m, c, inertia = 3.0 / (i + 1), ca.DM([0.05, 0.02 * i, 0.1]), ca.diag(ca.DM([0.1, 0.08, 0.05]) / (i + 1))
        force = m * (acc + ca.cross(dw, c) + ca.cross(w, ca.cross(w, c)))
        moment = inertia @ dw + ca.cross(w, inertia @ w) + ca.cross(c, force)
        links.append((r, p, force, moment))
    tau, f, n = [None] * 6, ca.SX.zeros(3), ca.SX.zeros(3)
    for i in reversed(range(6)):
        r, p, force, moment = links[i]
        if i + 1 < 6:
            r1, p1 = links[i + 1][0], links[i + 1][1]
            f, n = force + r1 @ f, moment + r1 @ n + ca.cross(p1, r1 @ f)
        else:
            f, n = force, moment
        tau[i] = ca.dot(n, ca.DM(axes[i]))
    return ca.Function("rnea", [q, v, a], [ca.vertcat(*tau)], ["q", "v", "a"], ["tau"])


def shooting():
    """A residual of multiple shooting over MX, with its Jacobian: maps, calls of functions, sparse copies."""
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u")
    rhs = ca.vertcat(x[1], u - 0.1 * x[1], x[3], (9.81 * ca.sin(x[2]) - u * ca.cos(x[2])) / 0.5)
    f = ca.Function("f", [x, u], [x + 0.05 * rhs])
    z, u = ca.MX.sym("z", 4, 4), ca.MX.sym("u", 1, 3)
    gaps = [f(z[:, k], u[k]) - z[:, k + 1] for k in range(3)]
    g = ca.vertcat(*gaps)
    cost = ca.sumsqr(z) + 0.1 * ca.sumsqr(u)
    jacobian = ca.jacobian(cost, u)
    return ca.Function("shooting", [z, u], [g, cost, jacobian], ["z", "u"], ["g", "cost", "grad"])


def filter_step():
    """A step of a Kalman filter over MX: products of matrices and a solution of a small system."""
    x, p, y = ca.MX.sym("x", 3), ca.MX.sym("p", 3, 3), ca.MX.sym("y", 2)
    a = ca.DM([[1, 0.01, 0], [0, 1, 0.01], [0, 0, 0.99]])
    c = ca.DM([[1, 0, 0], [0, 0, 1]])
    xp, pp = a @ x, a @ p @ a.T + 0.01 * ca.DM.eye(3)
    s = c @ pp @ c.T + 0.1 * ca.DM.eye(2)
    det = s[0, 0] * s[1, 1] - s[0, 1] * s[1, 0]
    inverse = ca.vertcat(ca.horzcat(s[1, 1], -s[0, 1]), ca.horzcat(-s[1, 0], s[0, 0])) / det
    k = pp @ c.T @ inverse
    return ca.Function("kalman", [x, p, y], [xp + k @ (y - c @ xp), pp - k @ c @ pp], ["x", "p", "y"], ["xn", "pn"])


def main():
    folder = Path(sys.argv[1])
    write(folder, "rnea", arm())
    write(folder, "shooting", shooting())
    write(folder, "kalman", filter_step())


main()

# SPDX-License-Identifier: MIT OR Apache-2.0
"""CasADi's C of some functions, each with a step that calls it, into the folder given; prints their names."""

import sys
from pathlib import Path

import casadi as ca

sys.path.append(str(Path(__file__).parents[1]))
from reference import Robot, Textbook  # noqa: E402

PANDA = Path(__file__).parents[4] / "programs/examples/panda/panda.urdf"


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


def panda():
    """Inverse dynamics of a Panda, of seven axes, by Newton and Euler."""
    names = [f"panda_joint{i}" for i in range(1, 8)]
    robot = Robot({"urdf": str(PANDA), "joints": names, "base": "panda_link0", "tip": "panda_hand"})
    q, v, a = (ca.SX.sym(name, 7) for name in "qva")
    return ca.Function("rnea", [q, v, a], [ca.cse(Textbook(robot).rnea(q, v, a))], ["q", "v", "a"], ["tau"])


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


def program():
    """A quadratic program, solved with its active set by CasADi's own QRQP."""
    x, p = ca.SX.sym("x", 3), ca.SX.sym("p", 3)
    problem = {"x": x, "p": p, "f": ca.sumsqr(x - p) + 0.5 * x[0] * x[1], "g": x[0] + x[1] + x[2]}
    quiet = {name: False for name in ("print_iter", "print_header", "print_info", "error_on_fail")}
    solver = ca.qpsol("solver", "qrqp", problem, quiet | {"constr_viol_tol": 1e-5, "dual_inf_tol": 1e-5, "max_iter": 40})
    p = ca.MX.sym("p", 3)
    return ca.Function("program", [p], [solver(p=p, lbx=0, ubx=1, lbg=0.2, ubg=2)["x"]], ["p"], ["x"])


def main():
    folder = Path(sys.argv[1])
    write(folder, "rnea", panda())
    write(folder, "shooting", shooting())
    write(folder, "kalman", filter_step())
    write(folder, "program", program())


main()

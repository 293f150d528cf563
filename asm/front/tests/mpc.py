# SPDX-License-Identifier: MIT OR Apache-2.0
"""Control problems for tests/mpc.rs, with what TinyMPC and OSQP compute of them: writes data/mpc/NAME.json and data/mpc/results.json.

TinyMPC 0.0.8 needs NumPy 1.26, so it has an environment of its own:

    python3 -m venv /tmp/mpc && /tmp/mpc/bin/pip install numpy==1.26.4 tinympc==0.0.8 osqp==1.1.3 scipy==1.11.4
    /tmp/mpc/bin/python asm/front/tests/mpc.py
"""

import json
from pathlib import Path

import numpy as np
import osqp
import scipy.sparse as sp
from scipy.linalg import expm, solve_discrete_are
import tinympc

FOLDER = Path(__file__).parent / "data/mpc"
random = np.random.default_rng(36)


def problem(name, A, B, Q, R, x_limit, u_min, u_max, horizon, rho, iterations, references, x_range):
    x_limit = [None if np.isinf(x) else float(x) for x in x_limit]
    return {
        "format": "takt-mpc 1",
        "name": name,
        "A": A.tolist(),
        "B": B.tolist(),
        "Q": list(Q),
        "R": list(R),
        "x_min": [None if x is None else -x for x in x_limit],
        "x_max": x_limit,
        "u_min": list(u_min),
        "u_max": list(u_max),
        "horizon": horizon,
        "rho": rho,
        "iterations": iterations,
        "references": references,
        "x_range": [[-x, x] for x in x_range],
    }


def discrete(A, B, period):
    n, m = B.shape
    both = expm(np.block([[A, B], [np.zeros((m, n + m))]]) * period)
    both[abs(both) < 1e-12] = 0
    return both[:n, :n], both[:n, n:]


def quadrotor():
    """A Crazyflie at rest in the air, linearised: position, small angles, velocity, angular velocity; thrusts relative to the largest."""
    g, mass, arm, inertia = 9.81, 0.035, 0.046 / np.sqrt(2), np.array([1.66e-5, 1.66e-5, 2.93e-5])
    thrust = 0.147
    drag = 0.00596 * thrust
    A, B = np.zeros((12, 12)), np.zeros((12, 4))
    A[0:3, 6:9] = A[3:6, 9:12] = np.eye(3)
    A[6, 4], A[7, 3] = g, -g
    B[8] = thrust / mass
    B[9] = thrust * arm * np.array([-1, -1, 1, 1]) / inertia[0]
    B[10] = thrust * arm * np.array([-1, 1, 1, -1]) / inertia[1]
    B[11] = drag * np.array([-1, 1, -1, 1]) / inertia[2]
    hover = mass * g / (4 * thrust)
    A, B = discrete(A, B, 0.02)
    Q = [100, 100, 100, 40, 40, 400, 10, 10, 10, 6, 6, 8]
    limit = [1.0] * 3 + [0.5] * 3 + [2.0] * 3 + [np.inf] * 3
    spread = [0.5] * 3 + [0.2] * 3 + [1.0] * 3 + [1.0] * 3
    return problem("quadrotor", A, B, Q, [8] * 4, limit, [-hover] * 4, [1 - hover] * 4, 10, 5.0, 10, "none", spread)


def mass():
    """A mass on a line whose speed and force are limited, that follows a state and an input in each step."""
    A, B = discrete(np.array([[0.0, 1], [0, -0.1]]), np.array([[0.0], [1]]), 0.1)
    return problem("mass", A, B, [10, 2], [1.5], [np.inf, 0.6], [-0.8], [1.0], 8, 1.0, 20, "horizon", [1, 0.5])


def dense():
    """A stable system without zeros, with one reference for the horizon."""
    A = random.normal(size=(4, 4))
    A *= 0.9 / abs(np.linalg.eigvals(A)).max()
    B = random.normal(size=(4, 2))
    return problem("dense", A, B, [3, 4, 5, 6], [3, 2.5], [0.8] * 4, [-0.5, -0.3], [0.5, 0.4], 6, 2.0, 15, "constant", [0.5] * 4)


def terminal(p):
    """The weight of the last state: the cost-to-go with the penalty in the weights, without the penalty."""
    A, B, rho = np.array(p["A"]), np.array(p["B"]), p["rho"]
    n, m = B.shape
    return solve_discrete_are(A, B, np.diag(p["Q"]) + rho * np.eye(n), np.diag(p["R"]) + rho * np.eye(m)) - rho * np.eye(n)


def tiny(p, x, xr, ur):
    """Its inputs within limits and its residuals, after the iterations of one period from zeros."""
    A, B, rho, N = np.array(p["A"]), np.array(p["B"]), p["rho"], p["horizon"]
    n, m = B.shape
    limit = lambda key, sign: np.array([sign * 1e17 if x is None else x for x in p[key]], dtype=float)
    solver = tinympc.TinyMPC()
    # TinyMPC adds the penalty to the weights twice, and applies them with the penalty added once to references.
    solver.setup(A, B, np.diag(p["Q"]) - rho * np.eye(n), np.diag(p["R"]) - rho * np.eye(m), N, rho=rho,
                 x_min=limit("x_min", -1), x_max=limit("x_max", 1), u_min=limit("u_min", -1), u_max=limit("u_max", 1),
                 max_iter=p["iterations"], check_termination=1, abs_pri_tol=0.0, abs_dua_tol=0.0)
    solver.set_x0(x)
    if np.any(xr) or np.any(ur):
        raise ValueError("TinyMPC takes references into account an iteration later")
    return solver.solve()["controls_all"]


def best(p, x, xr, ur):
    """The inputs of the optimum, to OSQP's highest accuracy."""
    A, B, N = np.array(p["A"]), np.array(p["B"]), p["horizon"]
    n, m = B.shape
    P = terminal(p)
    weights = [np.diag(p["Q"])] * (N - 1) + [P] + [np.diag(p["R"])] * (N - 1)
    H = sp.block_diag(weights, format="csc")
    q = -H @ np.concatenate([xr.ravel(), ur.ravel()])
    dynamics = np.zeros((N * n, N * n + (N - 1) * m))
    dynamics[:, : N * n] = np.eye(N * n)
    for k in range(1, N):
        dynamics[k * n : (k + 1) * n, (k - 1) * n : k * n] = -A
        dynamics[k * n : (k + 1) * n, N * n + (k - 1) * m : N * n + k * m] = -B
    start = np.concatenate([x, np.zeros((N - 1) * n)])
    low = np.concatenate([np.tile([-np.inf if v is None else v for v in p["x_min"]], N), np.tile(p["u_min"], N - 1)])
    high = np.concatenate([np.tile([np.inf if v is None else v for v in p["x_max"]], N), np.tile(p["u_max"], N - 1)])
    solver = osqp.OSQP()
    solver.setup(H, q, sp.csc_matrix(np.vstack([dynamics, np.eye(len(low))])), np.concatenate([start, low]),
                 np.concatenate([start, high]), verbose=False, eps_abs=1e-10, eps_rel=1e-10, max_iter=1_000_000)
    found = solver.solve()
    assert found.info.status == "solved", found.info.status
    return found.x[N * n :].reshape(N - 1, m)


def main():
    FOLDER.mkdir(exist_ok=True)
    results = []
    for p in (quadrotor(), mass(), dense()):
        lines = [f' "{key}": {json.dumps(value)}' for key, value in p.items()]
        (FOLDER / f"{p['name']}.json").write_text("{\n" + ",\n".join(lines) + "\n}\n")
        N, n, m = p["horizon"], len(p["A"]), len(p["B"][0])
        spread = np.array(p["x_range"])[:, 1]
        for case in range(6):
            x = random.uniform(-spread, spread)
            xr, ur = np.zeros((N, n)), np.zeros((N - 1, m))
            result = {"problem": p["name"], "x": x.tolist()}
            if case < 3:
                result["tinympc"] = np.asarray(tiny(p, x, xr, ur)).reshape(N - 1, m).tolist()
            elif p["references"] == "constant":
                xr[:], ur[:] = random.uniform(-spread, spread) / 2, random.uniform(-0.2, 0.2, m)
            elif p["references"] == "horizon":
                xr[:] = np.cumsum(random.uniform(-0.1, 0.1, (N, n)), axis=0)
                ur[:] = random.uniform(-0.3, 0.3, (N - 1, m))
            result |= {"xr": xr.tolist(), "ur": ur.tolist(), "osqp": best(p, x, xr, ur).tolist()}
            results.append(result)
    (FOLDER / "results.json").write_text("[\n" + ",\n".join(json.dumps(result) for result in results) + "\n]\n")


if __name__ == "__main__":
    main()

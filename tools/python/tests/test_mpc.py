"""Model-predictive control, against a quadratic program solved by NumPy and the closed form of linearisations."""

import json
import re
import runpy
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import takt
import takt.mpc

ROOT = Path(__file__).parents[3]
RECORDED = ROOT / "asm/front/tests/data/mpc"
A, B = np.array([[1, 0.1], [0, 0.99]]), np.array([[0.005], [0.1]])


def test_the_optimum_of_osqp_is_reached():
    """Recorded by asm/front/tests/mpc.py: with references in each step, warm start in the same state."""
    problem = json.loads((RECORDED / "mass.json").read_text())
    program = takt.mpc.program(problem)
    assert program.model.title == "mass: model-predictive control, 2 states, 1 inputs, a horizon of 8, 20 iterations"
    count = 0
    for case in json.loads((RECORDED / "results.json").read_text()):
        if case["problem"] == "mass":
            run = program.run({"x": np.tile(case["x"], (50, 1)), "xr": np.array(case["xr"]), "ur": np.array(case["ur"])})
            assert run.outputs["u"].shape == (50, 1)
            np.testing.assert_allclose(run.outputs["u"][-1], case["osqp"][0], rtol=0, atol=1e-4)
            assert run.outputs["primal"][-1] < 1e-4
            assert len(set(np.asarray(run.cycles).ravel().tolist()[1:])) == 1
            count += 1
    assert count == 6


def test_without_active_limits_it_is_the_regulator():
    """The gain of the Riccati equation of the weights with rho added, which one iteration from zeros gives."""
    problem = takt.mpc.problem(A, B, [10, 2], 1, horizon=5, rho=0.5, iterations=1)
    P = Q = np.diag([10.5, 2.5])
    for _ in range(2000):
        K = np.linalg.solve(1.5 * np.eye(1) + B.T @ P @ B, B.T @ P @ A)
        P = Q + A.T @ P @ (A - B @ K)
    x = np.random.default_rng(1).uniform(-1, 1, (20, 2))
    run = takt.mpc.program(problem | {"warm_start": False}).run({"x": x})
    np.testing.assert_allclose(run.outputs["u"], -x @ K.T, rtol=1e-4, atol=1e-5)
    assert not run.outputs["primal"].any()


def test_worst_states_lie_in_the_range_and_give_the_value():
    problem = takt.mpc.problem(
        A, B, [10, 2], 1, horizon=6, iterations=3, u_min=-0.3, u_max=0.3, x_max=[np.inf, 0.4], x_range=[[-1, 1], [-0.5, 0.5]]
    )
    assert problem["x_max"] == [None, 0.4]
    found = takt.mpc.worst(problem, 30, seed=2)
    assert set(found) == {"primal", "dual", "violation"}
    value, state = found["primal"]
    assert (np.abs(state) <= [1, 0.5]).all() and value > 0.1
    run = takt.mpc.program(problem).run({"x": state[None]})
    np.testing.assert_allclose(run.outputs["primal"][0], value, rtol=1e-4)


def test_linearisations_are_those_of_a_held_input():
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    f = ca.Function("f", [x, u], [ca.vertcat(x[1], u - ca.sin(x[0]))])
    found, held = takt.mpc.from_casadi(f, [0, 0], [0], 0.3)
    c, s = np.cos(0.3), np.sin(0.3)
    np.testing.assert_allclose(found, [[c, s], [-s, c]], atol=1e-13)
    np.testing.assert_allclose(held, [[1 - c], [s]], atol=1e-13)


def test_what_is_refused():
    def made(**changed):
        return takt.mpc.problem(**({"A": A, "B": B, "Q": 1, "R": 1, "horizon": 5} | changed))

    with pytest.raises(ValueError, match=r"A\[0, 1\] is nan; it must be finite"):
        made(A=[[1, np.nan], [0, 1]])
    with pytest.raises(ValueError, match=r"u_max\[0\] is -inf"):
        made(u_max=[-np.inf])
    for changed, text in [
        ({"B": [[1]]}, r"mpc:\d+: `B`: 1 rows, expected 2"),
        ({"u_min": 1, "u_max": 0}, r"mpc:\d+: `u_min`: limit 1 is 1, above that of `u_max`, 0"),
        ({"A": [[2, 0], [0, 1]], "Q": [0, 1]}, r"mpc:\d+: `Q`: `A` has an unstable mode"),
    ]:
        with pytest.raises(takt.ModelError, match=text):
            takt.mpc.program(made(**changed))
    with pytest.raises(takt.ModelError, match="no set of states is named"):
        takt.mpc.worst(made())


def test_the_quadrotor_returns_and_keeps_its_limits(capsys):
    names = runpy.run_path(str(ROOT / "tools/python/examples/quadrotor.py"))
    said = capsys.readouterr().out
    trajectory, inputs, hover = names["trajectory"], np.array(names["inputs"]), names["HOVER"]
    assert np.linalg.norm(trajectory[-1, :3]) < 0.02 < 0.5 < np.linalg.norm(trajectory[0, :3])
    assert (inputs >= -hover - 1e-6).all() and (inputs <= 1 - hover + 1e-6).all()
    # A motor is at its limit for some time; angles and speeds stay within theirs, apart from the linearisation error.
    assert (inputs.max(axis=1) > 1 - hover - 1e-4).any() or (inputs.min(axis=1) < -hover + 1e-4).any()
    assert np.abs(trajectory[:, 3:6]).max() < 0.4 and np.abs(trajectory[:, 6:9]).max() < 0.9
    assert 0 < int(re.search(r"(\d+) cycles a period", said)[1]) <= 56000, said

"""Programs from models, against what CasADi, SymPy and Pinocchio compute in binary64."""

import pickle
from pathlib import Path

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
import sympy as sp

import takt
import takt.casadi
import takt.sympy
import takt.urdf

UR5 = Path(__file__).parents[3] / "asm/front/tests/data/ur5.urdf"
PANDA = Path(__file__).parents[3] / "programs/examples/panda/panda.urdf"
# Tolerance relative to the largest output of a state; docs/models.md lists the measured errors.
CLOSE = 1e-5


def random(shape, seed=3):
    return np.random.default_rng(seed).uniform(-2, 2, shape)


def assert_close(ours, theirs):
    theirs = np.asarray(theirs)
    largest = np.abs(theirs).reshape(len(theirs), -1).max(axis=1)
    error = np.abs(ours - theirs).reshape(len(theirs), -1).max(axis=1)
    assert (error <= CLOSE * largest).all(), (error / largest).max()


def test_a_casadi_function_keeps_names_and_shapes():
    x, a, u = ca.SX.sym("x", 3), ca.SX.sym("A", 2, 3), ca.SX.sym("u")
    y = ca.mtimes(a, ca.sin(x)) * ca.if_else(u > 0, u, 1 - u)
    m = ca.SX(2, 2)
    m[0, 1], m[1, 0] = ca.atan2(x[0], x[1]), 2.5
    f = ca.Function("f", [x, a, u], [y, m, ca.fmin(u, x[2])], ["x", "A", "u"], ["y", "M", "least"])
    program = takt.casadi.program(f)
    given = {"x": random((40, 3)), "A": random((40, 2, 3)), "u": random(40)}
    run = program.run(given)
    expected = [f(*(value[k] for value in given.values())) for k in range(40)]
    assert run.outputs["y"].shape == (40, 2) and run.outputs["M"].shape == (40, 2, 2)
    for index, name in enumerate(["y", "M", "least"]):
        values = np.array([np.array(outputs[index]) for outputs in expected])
        assert_close(run.outputs[name], values.reshape(run.outputs[name].shape))
    # A structural zero and a constant have no port.
    assert sorted(program.outputs) == ["M_1_2", "least", "y_1", "y_2"]
    step = program.sim().step({name: value[0] for name, value in given.items()})
    for name, value in step.items():
        np.testing.assert_array_equal(value, run.outputs[name][0])


def test_mx_and_the_errors_of_expressions():
    x = ca.MX.sym("x", 2)
    program = takt.casadi.program(ca.Function("f", [x], [ca.sumsqr(x)], ["x"], ["y"]), "t1")
    assert program.machine == "t1" and program.run({"x": [[3.0, 4.0]]}).outputs["y"].tolist() == [25.0]
    x = ca.SX.sym("x")
    with pytest.raises(takt.ModelError, match=r"f:\d+: operation `erfinv` is not supported") as raised:
        takt.casadi.program(ca.Function("f", [x], [ca.erfinv(x)], ["x"], ["y"]))
    assert raised.value.line is not None
    single = [x * k for k in range(2, 42)]
    with pytest.raises(takt.ModelError, match="it does not fit: it has 40 outputs that are numbers, t3 has 32 output ports"):
        takt.casadi.program(ca.Function("f", [x], single, ["x"], [f"y{k}" for k in range(40)]))
    with pytest.raises(TypeError, match="a casadi.Function is needed, not SX"):
        takt.casadi.program(x)
    with pytest.raises(ValueError, match="no rewriting `facter`; did you mean `factor`"):
        takt.casadi.program(ca.Function("f", [x], [x], ["x"], ["y"]), without=["facter"])


@pytest.mark.parametrize("machine", ["t3", "t1"])
def test_functions_of_the_library(machine):
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    sigmoid = 1 / (1 + ca.exp(-x))
    each = {
        "tanh": ca.tanh(x), "sigmoid": sigmoid, "both": sigmoid * (1 - sigmoid), "exp": ca.exp(y), "log": ca.log(3 + x), "tan": ca.tan(x / 2),
        "asin": ca.asin(x / 2), "atan": ca.atan(y), "floor": ca.floor(3 * x), "ceil": ca.ceil(3 * x), "fmod": ca.fmod(3 * x, 2 + y * y),
        "pow": (3 + x) ** y, "root": (3 + y) ** 0.3,
    }
    f = ca.Function("f", [x, y], list(each.values()), ["x", "y"], list(each))
    program = takt.casadi.program(f, machine)
    assert "sigmoid(x)" in program.sources["f.s"] and "tanh(x)" in program.sources["f.s"]
    values = random((2, 60)).astype(np.float32)
    run = program.run({"x": values[0], "y": values[1]}).check()
    expected = np.array([[float(v) for v in f(*pair)] for pair in values.T.astype(float)]).T
    for (name, computed), right in zip(run.outputs.items(), expected):
        # `fmod` and `floor` jump if rounding moves the operand across a boundary; sums before them round.
        np.testing.assert_allclose(computed, right, rtol=2e-6, atol=1e-6, err_msg=name)
    # No overflow where 1 + exp(-x) would overflow.
    far = program.run({"x": np.array([-90.0, 90.0]), "y": 0.5})
    np.testing.assert_allclose(far.outputs["sigmoid"], [np.exp(-90), 1], rtol=1e-5)
    a, b = sp.symbols("a b")
    program = takt.sympy.program({"a": a, "b": b}, {"y": [sp.tanh(a), 1 / (1 + sp.exp(-b)), sp.Mod(3 * a, 2), sp.ceiling(b)]}, machine)
    run = program.run({"a": values[0], "b": values[1]}).check()
    x, y = values.astype(float)
    np.testing.assert_allclose(run.outputs["y"], np.array([np.tanh(x), 1 / (1 + np.exp(-y)), 3 * x % 2, np.ceil(y)]).T, rtol=2e-6, atol=1e-6)


def test_sympy_expressions():
    a, b, c = sp.symbols("a b c")
    outputs = {"y": sp.sin(a + b) * c**2, "M": sp.Matrix([[a, b * c], [sp.sqrt(c), sp.Max(a, b)]])}
    program = takt.sympy.program({"p": [a, b], "c": c}, outputs)
    p, values = random((30, 2)), 2.5 + random(30)
    run = program.run({"p": p, "c": values})
    assert_close(run.outputs["y"], np.sin(p.sum(axis=1)) * values**2)
    expected = [[[x, y * z], [z**0.5, max(x, y)]] for (x, y), z in zip(p, values)]
    assert_close(run.outputs["M"], expected)
    with pytest.raises(ValueError, match="the symbol b is not an input"):
        takt.sympy.program({"a": a}, {"y": a + b})


def test_a_robot_against_pinocchio():
    model = pin.buildModelFromUrdf(str(UR5))
    data = model.createData()
    q, qd, qdd = random((50, 6), 1), random((50, 6), 2), random((50, 6), 3)
    dynamics = takt.urdf.program(UR5, "inverse-dynamics")
    assert dynamics.model.joints == tuple(model.names[1:])
    tau = np.array([pin.rnea(model, data, *state).copy() for state in zip(q, qd, qdd)])
    assert_close(dynamics.run({"q": q, "qd": qd, "qdd": qdd}).outputs["tau"], tau)
    # The first joint's angle has no effect, and hence no port.
    assert dynamics.input_arrays[0].elements[0] is None and "q_shoulder_pan" not in dynamics.inputs

    def inertia(state):
        whole = np.triu(pin.crba(model, data, state))
        return whole + np.triu(whole, 1).T

    mass = takt.urdf.program(UR5.read_text(), "mass-matrix").run({"q": q}).outputs["M"]
    assert_close(mass, np.array([inertia(state) for state in q]))
    place = takt.urdf.program(UR5, "forward-kinematics", tip="tool0").run({"q": q})
    frame = model.getFrameId("tool0")

    def pose(state):
        pin.framesForwardKinematics(model, data, state)
        return data.oMf[frame].copy()

    assert_close(place.outputs["R"], np.array([pose(state).rotation for state in q]))
    assert_close(place.outputs["p"], np.array([pose(state).translation for state in q]))


def test_outputs_beyond_the_ports_lie_in_data_memory():
    model = pin.buildModelFromUrdf(str(PANDA))
    data, tip = model.createData(), model.getFrameId("panda_hand")
    q = random((30, 7), 4)

    def jacobian(state):
        pin.computeJointJacobians(model, data, state)
        pin.updateFramePlacements(model, data)
        return pin.getFrameJacobian(model, data, tip, pin.LOCAL_WORLD_ALIGNED).copy()

    program = takt.urdf.program(PANDA, "jacobian", tip="panda_hand")
    assert not program.outputs
    run = program.run({"q": q})
    assert run.outputs["J"].shape == (30, 6, 7)
    assert_close(run.outputs["J"], np.array([jacobian(state) for state in q]))
    # All ways of running have these outputs: period by period, in a batch, in a pickled program.
    sim, lanes = program.sim(), program.batch(30)
    np.testing.assert_array_equal(sim.step({"q": q[0]})["J"], run.outputs["J"][0])
    np.testing.assert_array_equal(lanes.step({"q": q})["J"], run.outputs["J"])
    again = pickle.loads(pickle.dumps(program)).run({"q": q[:, None]})
    np.testing.assert_array_equal(again.outputs["J"][:, 0], run.outputs["J"])
    # A vector of 40 takes all ports, including those of the 7-axis mass matrix; the matrix is also in memory as a whole.
    x = ca.SX.sym("x", 3)
    f = ca.Function("f", [x], [ca.mtimes(x, x.T), ca.vertcat(*[x[0] * k for k in range(2, 42)])], ["x"], ["outer", "many"])
    program = takt.casadi.program(f)
    values = random((5, 3))
    run = program.run({"x": values})
    assert len(program.outputs) == 9 and run.outputs["many"].shape == (5, 40)
    assert_close(run.outputs["many"], values[:, :1] * np.arange(2, 42))
    assert_close(run.outputs["outer"], values[:, :, None] * values[:, None, :])


def test_mass_matrices_of_any_size(tmp_path):
    share = Path(pin.__file__).parents[4] / "share/example-robot-data/robots/panda_description/urdf/panda.urdf"
    model = pin.buildModelFromUrdf(str(share))
    data, q = model.createData(), random((20, 9), 5) * 0.5
    program = takt.urdf.program(share, "mass-matrix")
    assert not program.outputs and program.model.joints == tuple(model.names[1:])

    def inertia(state):
        whole = np.triu(pin.crba(model, data, state))
        return whole + np.triu(whole, 1).T

    run = program.run({"q": q})
    assert run.outputs["M"].shape == (20, 9, 9)
    assert_close(run.outputs["M"], np.array([inertia(state) for state in q]))


def test_errors_of_robots(tmp_path):
    with pytest.raises(ValueError, match="there is no function `gravty` of a robot; did you mean `gravity`"):
        takt.urdf.program(UR5, "gravty")
    with pytest.raises(takt.ModelError, match="there is no link `wrist`"):
        takt.urdf.program(UR5, "gravity", tip="wrist")
    with pytest.raises(takt.ModelError, match="ur5.urdf:12: `shoulder_pan_joint`: a floating joint") as raised:
        (tmp_path / "ur5.urdf").write_text(UR5.read_text().replace('type="revolute"', 'type="floating"', 1))
        takt.urdf.program(tmp_path / "ur5.urdf", "gravity", floating="error")
    assert raised.value.line == 12
    with pytest.warns(UserWarning, match="the base is held, though it floats: `shoulder_pan_joint` .`floating=\"error\"`"):
        takt.urdf.program(tmp_path / "ur5.urdf", "gravity")
    with pytest.raises(ValueError, match="kp is -1: a gain must be finite and not negative"):
        takt.urdf.program(UR5, "computed-torque", kp=-1)
    with pytest.raises(ValueError, match=r"`q` has shape \(4, 5\); an array of shape \(6,\) is needed"):
        takt.urdf.program(UR5, "gravity").run({"q": np.zeros((4, 5))})
    with pytest.raises(FileNotFoundError):
        takt.urdf.program("missing.urdf", "gravity")

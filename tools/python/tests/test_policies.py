"""Learned policies in ONNX, against onnxruntime."""

import runpy
import sys
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest

import takt
import takt.onnx

ROOT = Path(__file__).parents[3]
EXAMPLES = ROOT / "tools/python/examples"
sys.path.insert(0, str(ROOT / "asm/front/tests"))
import policies  # noqa: E402 (the models of takt-front's own tests)

# Tolerance relative to the largest output, or to 1.
CLOSE = 1e-6


def judged(model, machine="t3", states=50, **options):
    """The program's outputs beside onnxruntime's, for random states."""
    program = takt.onnx.program(model, machine, **options)
    session = onnxruntime.InferenceSession(model.SerializeToString())
    shape = session.get_inputs()[0].shape
    x = np.random.default_rng(11).uniform(-3, 3, (states, shape[-1])).astype(np.float32)
    run = program.run({"obs": x})
    expected = np.array([session.run(None, {"obs": row if len(shape) == 1 else row[None]})[0].ravel() for row in x])
    assert run.outputs["action"].shape == expected.shape
    scale = np.maximum(np.abs(expected).max(axis=1, keepdims=True), 1)
    assert (np.abs(run.outputs["action"] - expected) / scale).max() < CLOSE
    assert not run.flags & {"invalid", "overflow"}
    return program, run


@pytest.mark.parametrize("name, model", list(policies.good()), ids=lambda value: value if isinstance(value, str) else "")
def test_policies_of_every_operator(name, model):
    for exact in (False, True):
        program, run = judged(model, exact=exact)
        assert len(set(np.asarray(run.cycles).ravel().tolist())) == 1
        assert program.model.title.startswith("policy: a policy ")


def test_the_large_policy_takes_less_than_1_15_cycles_a_weight():
    graph = policies.Graph(48, 5).gemm(128).node("Relu").gemm(128).node("Relu").gemm(12)
    program, run = judged(graph.model(), states=8)
    assert run.cycles[0] <= program.bound().worst_period <= 1.15 * 24064
    assert program.machine.startswith("t3,") and "data=32768" in program.machine


def test_what_is_refused(tmp_path):
    bad = dict(policies.bad())
    with pytest.raises(takt.ModelError, match=r"policy: node `/Conv_1` \(Conv\): this operator is not supported: convolutions"):
        takt.onnx.program(bad["conv"])
    (tmp_path / "wide.onnx").write_bytes(bad["wide"].SerializeToString())
    with pytest.raises(takt.ModelError, match="wide: it does not fit: `action` has 40 numbers, t3 has 32 output ports"):
        takt.onnx.program(tmp_path / "wide.onnx")
    (tmp_path / "text.onnx").write_text("no model")
    with pytest.raises(takt.ModelError, match="text: this is not an ONNX model"):
        takt.onnx.program(tmp_path / "text.onnx")
    with pytest.raises(FileNotFoundError):
        takt.onnx.program(tmp_path / "missing.onnx")


def test_an_enclosure_holds_for_runs():
    graph = policies.Graph(20, 1).gemm(40).node("Relu").gemm(24).node("Relu").gemm(4)
    model = graph.model()
    program = takt.onnx.program(model, range=(-1, 1))
    enclosure = program.enclose()
    assert not enclosure.hazards
    x = np.random.default_rng(2).uniform(-1, 1, (200, 20)).astype(np.float32)
    outputs = program.run({"obs": x}).outputs["action"]
    weights = {tensor.name: onnx.numpy_helper.to_array(tensor).astype(float) for tensor in model.graph.initializer}
    exact = x.astype(float)
    for k in range(0, 6, 2):
        exact = exact @ weights[f"c{k}"].T + weights[f"c{k + 1}"]
        exact = np.maximum(exact, 0) if k < 4 else exact
    for index in range(4):
        bound = enclosure.outputs[f"action[{index + 1}]"]
        assert (np.abs(outputs[:, index] - exact[:, index]) <= bound.error).all()
        assert bound.error < 1e-4


def test_the_pendulum_swings_up(capsys, monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLES))
    names = runpy.run_path(str(EXAMPLES / "pendulum.py"))
    assert len(names["cycles"]) == 1 and names["angles"][-1] < 0.05 and names["up"] < 200
    assert "cycles a period on t3" in capsys.readouterr().out
    # The same policy in onnxruntime.
    session = onnxruntime.InferenceSession(EXAMPLES / "pendulum.onnx")
    q, v = np.random.default_rng(3).uniform(-3, 3, (2, 40))
    state = np.stack([np.cos(q), np.sin(q), v], axis=1).astype(np.float32)
    found = names["policy"].run({"state": state}).outputs["torque"]
    # The weights are steep: an error of tanh in the first layer is amplified tenfold.
    np.testing.assert_allclose(found, session.run(None, {"state": state})[0], rtol=0, atol=1e-5)

"""Many closed loops in one call, against one by one."""

import copy
import pickle
from pathlib import Path

import numpy as np
import pytest

import takt
import takt.urdf

#: A controller with a state, and gains as inputs.
LAW = """
.schedule on
.input q, qr, kp, kd
.output u
.reg e d
.state before
.once
 fadd before, zero, zero
 wait loop
.period
loop:
 fsub e, qr, q
 fsub d, q, before
 fadd before, q, zero
 fmul e, e, kp
 fmul d, d, kd
 fsub u, e, d
 wait loop
"""
#: Calls endlessly if n is above 2, so that the return stack overflows.
STOPS = """
.input n:int
.output y:int
.reg more:bits
.period
loop: ilt more, 2, n
 bnz more, over
 iadd y, n, zero
 wait loop
over: call over
 ret
"""


def law():
    return takt.assemble(LAW)


def plant(q, v, u, step=0.01):
    v = v + step * (u - 0.2 * v)
    return q + step * v, v


def test_loops_are_those_of_single_machines():
    program, runs, periods = law(), 37, 50
    random = np.random.default_rng(2)
    kp, kd = random.uniform(5, 50, runs), random.uniform(1, 9, runs)
    state = {"q": np.zeros(runs), "v": np.zeros(runs)}

    def together(outputs, period):
        state["q"], state["v"] = plant(state["q"], state["v"], outputs["u"].astype(float))
        return {"q": state["q"], "qr": np.sin(0.1 * (period + 1))}

    batch = program.batch(runs)
    loops = batch.close(together, periods, {"q": np.zeros(runs), "qr": 0.0, "kp": kp, "kd": kd}, record=["u", "q"])
    assert loops.outputs["u"].shape == loops.inputs["q"].shape == loops.cycles.shape == (runs, periods)
    assert batch.periods == periods and not batch.faults
    for run in range(runs):
        sim, q, v = program.sim(), 0.0, 0.0
        for period in range(periods):
            qr = 0.0 if period == 0 else np.sin(0.1 * period)
            u = sim.step({"q": q, "qr": qr, "kp": kp[run], "kd": kd[run]})["u"]
            assert u == loops.outputs["u"][run, period] and sim.cycles == loops.cycles[run, period]
            assert np.float32(q) == loops.inputs["q"][run, period]
            q, v = plant(q, v, u)
    # Runs have different gains, and hence different outputs.
    assert len(np.unique(loops.outputs["u"][:, 10])) == runs


def test_a_batch_begins_anew():
    batch = law().batch(3)
    first = batch.step({"q": [0.1, 0.2, 0.3], "qr": 1, "kp": 2, "kd": 3})["u"]
    batch.step({"q": 0.5})
    batch.reset()
    assert batch.periods == 0
    with pytest.raises(ValueError, match="no value for `qr`, `kp`, `kd`: the first step needs every input"):
        batch.step({"q": 0.5})
    np.testing.assert_array_equal(first, batch.step({"q": [0.1, 0.2, 0.3], "qr": 1, "kp": 2, "kd": 3})["u"])
    assert batch.flags == [frozenset()] * 3 and batch.missed.tolist() == [0, 0, 0]


def test_what_does_not_fit_is_said():
    batch = law().batch(4)
    given = {"q": 0.0, "qr": 1.0, "kp": 2.0, "kd": 3.0}
    with pytest.raises(ValueError, match="the program has no input `kq`; did you mean `q`"):
        batch.step({**given, "kq": 1})
    with pytest.raises(ValueError, match=r"`q` has shape \(3,\), not \(4,\) nor \(\)"):
        batch.step({**given, "q": [1, 2, 3]})
    with pytest.raises(ValueError, match=r"`q`\[2\] of period 0: NaN is not an input for a controller"):
        batch.step({**given, "q": [0, 0, np.nan, 0]})
    with pytest.raises(ValueError, match="`q` of period 0: 1e\\+39 does not fit binary32"):
        batch.step({**given, "q": 1e39})
    # Values from rejected calls have not been stored.
    with pytest.raises(ValueError, match="no value for `q`, `qr`, `kp`, `kd`"):
        batch.step()
    with pytest.raises(ValueError, match="record: there is no input or output `w`"):
        batch.close(lambda outputs, period: {}, 3, given, record=["w"])
    with pytest.raises(ValueError, match="runs is 0: it is 1 at least"):
        law().batch(0)
    with pytest.raises(ValueError, match="runs is 9999999999: it is between 1 and"):
        law().batch(9_999_999_999)


def test_two_batches_never_share_machines():
    for copies in (copy.copy, copy.deepcopy, pickle.dumps):
        with pytest.raises(TypeError, match="a Batch can be neither pickled nor copied"):
            copies(law().batch(2))


def test_a_fault_stops_one_and_ends_the_call():
    program = takt.assemble(STOPS)
    batch = program.batch(3)
    assert batch.step({"n": [1, 2, 3]})["y"].tolist() == [1, 2, 0]
    (fault,) = batch.faults
    assert fault.run == 2 and batch.cycles[2] == 0 and batch.cycles[0] > 0
    assert batch.step({"n": [2, 1, 1]})["y"].tolist() == [2, 1, 0]
    with pytest.raises(takt.FaultError):
        program.batch(3).close(lambda outputs, period: {"n": 3}, 5, {"n": 1})


def test_arrays_of_ports_keep_their_elements():
    program = takt.urdf.program(Path(__file__).parents[3] / "asm/front/tests/data/ur5.urdf", "gravity")
    q = np.random.default_rng(4).uniform(-3, 3, (20, 6))
    outputs = program.batch(20).step({"q": q})["tau"]
    # The result equals that of runs over arrays; the first joint's torque is constant, and its angle has no port.
    np.testing.assert_array_equal(outputs, program.run({"q": q[:, None]}).outputs["tau"][:, 0])
    loops = program.batch(20).close(lambda outputs, period: {}, 2, {"q": q}, record=["q", "tau"])
    np.testing.assert_array_equal(loops.outputs["tau"][:, 1], outputs)
    np.testing.assert_array_equal(loops.inputs["q"][:, 0, 1:4], q[:, 1:4].astype(np.float32))

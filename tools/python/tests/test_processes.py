"""Programs and machines in other processes: pickled, copied, forked; and Ctrl-C."""

import copy
import multiprocessing
import os
import pickle
import signal

import numpy as np
import pytest

import takt
from test_programs import GAIN, HALTS, LAW, TABLE, states

#: Time after which a process is considered hung, s.
PATIENCE = 60

INPUTS = [{"q": k / 7, "qr": k / 3, "n": k} for k in range(8)]


def copies(of):
    return [pickle.loads(pickle.dumps(of)), copy.copy(of), copy.deepcopy(of)]


def test_a_pickled_program_is_the_program(tmp_path):
    (tmp_path / "law.s").write_text(LAW)
    (tmp_path / "warns.s").write_text(LAW.replace("e, d, p, v", "e, d, p, v, unused"))
    with pytest.warns(takt.AssemblyWarning):
        warns = takt.load(tmp_path / "warns.s")
    law = takt.load(tmp_path / "law.s", schedule="on")
    (tmp_path / "law.takt").write_bytes(law.image())
    image = takt.load(tmp_path / "law.takt")
    inputs = states((5, 30))
    for program in [law, warns, image]:
        expected = program.run(inputs)
        for other in [*copies(program), *(takt_copy for one in copies(program) for takt_copy in copies(one))]:
            assert (other.machine, other.bundles, other.sources) == (program.machine, program.bundles, program.sources)
            assert (other.inputs, other.outputs, other.warnings) == (program.inputs, program.outputs, program.warnings)
            assert other.listing() == program.listing()
            assert other.image() == program.image()
            assert other.bound() == program.bound()
            assert other._core.blocks() == program._core.blocks()
            run = other.run(inputs)
            assert np.array_equal(run.outputs["u"], expected.outputs["u"])
            assert np.array_equal(run.cycles, expected.cycles)
            assert str(other.analyse(name="law")) == str(program.analyse(name="law"))


def test_a_pickled_machine_goes_on_where_it_was():
    program = takt.assemble(LAW)
    sim = program.sim(tick=500)
    for before, inputs in enumerate(INPUTS[:-1]):
        for other in copies(sim):
            assert (other.periods, other.cycles, other.missed) == (sim.periods, sim.cycles, sim.missed)
            assert (other.now, other.flags, other.outputs) == (sim.now, sim.flags, sim.outputs)
            original = copy.copy(sim)
            for rest in INPUTS[before:]:
                assert other.step(rest) == original.step(rest)
                assert (other.now, other.cycles) == (original.now, original.cycles)
        # Inputs that keep their values are also known.
        sim.step(inputs if before == 0 else {"q": inputs["q"]})
    sim.reset()
    with pytest.raises(ValueError, match="the first step needs every input"):
        pickle.loads(pickle.dumps(sim)).step({"q": 1.0})


def test_what_stopped_is_pickled_with_it():
    program = takt.assemble(TABLE)
    sim = program.sim()
    sim.step({"i": 1})
    with pytest.raises(takt.FaultError):
        sim.step({"i": 100_000})
    for other in copies(sim):
        with pytest.raises(takt.FaultError) as stopped:
            other.step({"i": 1})
        assert stopped.value.fault.text == sim._core.failure.text
        error = pickle.loads(pickle.dumps(stopped.value))
        assert (str(error), error.fault.line) == (str(stopped.value), stopped.value.fault.line)
    run = program.run({"i": [[0, 1], [2, 70_000]]})
    again = pickle.loads(pickle.dumps(run))
    assert [str(fault) for fault in again.faults] == [str(fault) for fault in run.faults] != []
    assert np.array_equal(again.outputs["y"], run.outputs["y"], equal_nan=True)
    error = pickle.loads(pickle.dumps(takt.ModelError("no such joint", 7)))
    assert (str(error), error.line) == ("no such joint", 7)


def test_a_machine_that_cannot_be_pickled_says_why():
    sim = takt.assemble(GAIN).sim()
    sim.step({"x": 1.0})

    def stop(*_):
        raise InterruptedError

    spin = takt.assemble(".input x\n.output y\n.period\nloop: mov y, x\nhere: bz zero, here\n wait loop\n").sim()
    before = signal.signal(signal.SIGALRM, stop)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.05)
        with pytest.raises(InterruptedError):
            spin.step({"x": 1.0})
    finally:
        signal.signal(signal.SIGALRM, before)
    with pytest.raises(TypeError, match="interrupted in the middle .copy.copy copies it"):
        pickle.dumps(spin)
    copy.copy(spin)
    spin.reset()
    pickle.dumps(spin)


def test_signals_are_heard_between_and_within_periods():
    """A period of about a million cycles, a hundred times: the handler is called often, not every 64 periods."""
    source = ".input x\n.output y\n.reg n:int\n.period\nloop: li n, 100000\nturn: isub n, n, 1\n bnz n, turn\n mov y, x\n wait loop\n"
    program = takt.assemble(source)
    calls = 0

    def handler(*_):
        nonlocal calls
        calls += 1

    before = signal.signal(signal.SIGALRM, handler)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.05, 0.01)
        program.run({"x": np.zeros(100)})
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    # A check every 64 periods would give a single call.
    assert calls > 5


def batch(program):
    return program.run({"x": np.arange(200, dtype=np.float32).reshape(100, 2)}).outputs["y"].tolist()


def in_a_child(work):
    """What some work comes to in a child that `fork` has made."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.close(reader)
            with os.fdopen(writer, "wb") as out:
                out.write(pickle.dumps(work()))
        finally:
            os._exit(0)
    os.close(writer)

    def hangs(*_):
        os.kill(child, signal.SIGKILL)

    before = signal.signal(signal.SIGALRM, hangs)
    signal.alarm(PATIENCE)
    try:
        with os.fdopen(reader, "rb") as made:
            result = made.read()
        os.waitpid(child, 0)
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
    assert result, "the child does not end"
    return pickle.loads(result)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_forked_child_runs_batches():
    program = takt.assemble(GAIN)
    expected = batch(program)
    assert in_a_child(lambda: batch(program)) == expected
    # Children of a child also work, and so does the parent afterwards.
    assert in_a_child(lambda: [batch(program), in_a_child(lambda: batch(program)), batch(program)]) == [expected] * 3
    assert batch(program) == expected


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize("method", multiprocessing.get_all_start_methods())
def test_a_pool_of_processes(method):
    program = takt.assemble(GAIN)
    expected = batch(program)
    with multiprocessing.get_context(method).Pool(2) as pool:
        assert pool.map_async(batch, [program] * 3).get(PATIENCE) == [expected] * 3


def test_a_program_that_halts_is_pickled():
    assert pickle.loads(pickle.dumps(takt.assemble(HALTS))).run({"a": 1.0}).outputs["y"] == 2.0

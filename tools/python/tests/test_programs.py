"""Programs: assembled, run over arrays, in batches, stepped, bounded, and what is said of mistakes."""

import os
import pickle
from pathlib import Path

import numpy as np
import pytest

import takt

# A PD law with a state, integers and bits; NumPy computes its results in binary32.
LAW = """
.input  q, qr, n:int
.output u, count:int, mask:bits
.state  previous
.preset previous = 0.0
.reg    e, d, p, v

.once
        wait    law
.period
law:    fsub    e, qr, q
        fsub    d, e, previous
        fmul    p, e, 40.0
        fmul    v, d, 3.0
        fadd    u, p, v
        iadd    count, n, 1
        iand    mask, n, 255
        mov     previous, e
        wait    law
"""

GAIN = ".input x\n.output y\n.period\nloop: fmul y, x, 0.5\n wait loop\n"

# Function of x and of memory: a load outside the table faults.
TABLE = """
.input  i:int
.output y
.once
        wait    loop
.period
loop:   ld      y, table[i]
        wait    loop
.data
table:  .float 1.0, 2.0, 3.0
"""

HALTS = ".input a\n.output y\n.once\n fadd y, a, 1.0\n halt\n"


def law(q, qr, n):
    """What the law computes, in NumPy's binary32."""
    q, qr = np.float32(q), np.float32(qr)
    e = qr - q
    previous = np.concatenate([np.zeros((*e.shape[:-1], 1), np.float32), e[..., :-1]], axis=-1)
    u = e * np.float32(40) + (e - previous) * np.float32(3)
    return {"u": u, "count": np.int32(n + 1), "mask": np.uint32(n & 255)}


def states(shape, seed=1):
    random = np.random.default_rng(seed)
    return {"q": random.normal(size=shape), "qr": random.normal(size=shape), "n": random.integers(-500, 500, shape)}


def same(run, expected):
    assert list(run.outputs) == list(expected)
    for name, values in expected.items():
        assert run.outputs[name].dtype == values.dtype
        np.testing.assert_array_equal(run.outputs[name], values)


@pytest.mark.parametrize("machine", sorted(takt.machines()))
def test_a_run_has_numpys_bits(machine):
    program = takt.assemble(LAW, machine)
    inputs = states(1000)
    run = program.run(inputs)
    same(run, law(**inputs))
    assert run.cycles.shape == (1000,) and run.cycles.dtype == np.int64
    assert run.flags == frozenset() and run.faults == [] and run.completed == 1000 and run.unwritten == {}
    (section,) = [section for section in program.bound().sections if not section.once]
    assert (run.cycles == section.cycles.worst).all() and section.cycles.best == section.cycles.worst
    assert program.bound().worst_period >= section.cycles.worst


def test_a_batch_is_many_runs():
    program = takt.assemble(LAW)
    # More runs than fit into one group, and not a multiple of a vector's lanes.
    inputs = states((4099, 3))
    batch = program.run(inputs)
    same(batch, law(**inputs))
    assert batch.cycles.shape == (4099, 3) and batch.completed.tolist() == [3] * 4099
    one = program.run({name: values[17] for name, values in inputs.items()})
    for name in one.outputs:
        np.testing.assert_array_equal(one.outputs[name], batch.outputs[name][17])
    np.testing.assert_array_equal(one.cycles, batch.cycles[17])


def test_inputs_are_broadcast():
    program = takt.assemble(LAW)
    q = np.linspace(-1, 1, 5)
    gains = np.array([[0.5], [1.5], [2.5]])
    run = program.run({"q": q, "qr": gains, "n": 3})
    same(run, law(np.broadcast_to(q, (3, 5)), np.broadcast_to(gains, (3, 5)), np.full((3, 5), 3)))
    assert program.run({"q": 1, "qr": 2, "n": 3}, periods=4).outputs["u"].shape == (4,)
    assert program.run({"q": 1, "qr": 2, "n": 3}, periods=0).outputs["u"].shape == (0,)


def test_a_loop_steps_as_a_run_does():
    program = takt.assemble(LAW)
    inputs = states(50)
    run, sim = program.run(inputs), program.sim()
    for k in range(50):
        out = sim.step({name: values[k] for name, values in inputs.items()})
        assert {name: values[k] for name, values in run.outputs.items()} == out
        assert sim.cycles == run.cycles[k] and sim.periods == k + 1 and sim.outputs == out
    # Inputs that are not given keep their values.
    again = sim.step({"n": 7})
    assert again["count"] == 8 and again["u"] == np.float32(40) * (np.float32(inputs["qr"][-1]) - np.float32(inputs["q"][-1]))
    now = sim.now
    sim.reset()
    assert sim.periods == 0 and sim.now < now
    with pytest.raises(ValueError, match="no value for `qr`, `n`: the first step needs every input"):
        sim.step({"q": 0.0})


def test_flags_deadlines_and_unwritten_outputs():
    source = ".input x\n.output y, z\n.period\nloop: fdiv y, 1.0, x\n wait loop\n"
    program = takt.assemble(source, warnings=["allow=unused"])
    run = program.run({"x": [1.0, 0.0, 2.0]})
    assert run.flags == {"divide-by-zero"} and np.isinf(run.outputs["y"][1])
    assert np.isnan(run.outputs["z"]).all() and run.unwritten == {"z": 3}
    sim = program.sim()
    assert sim.step({"x": 0.0}) == {"y": np.inf, "z": None} and sim.flags == {"divide-by-zero"}
    # With a tick every eight cycles, a division misses its deadline.
    assert run.missed.sum() == 0 and program.run({"x": np.ones(5)}, tick=8).missed.sum() > 0
    batch = program.run({"x": [[1.0], [0.0]]})
    assert batch.flags == [frozenset(), {"divide-by-zero"}]


def test_a_fault_ends_its_run_alone():
    program = takt.assemble(TABLE, name="table.s")
    index = np.array([[0, 1, 2, 0], [0, 5000, 1, 2]])
    run = program.run({"i": index})
    np.testing.assert_array_equal(run.outputs["y"][0], np.float32([1, 2, 3, 1]))
    np.testing.assert_array_equal(run.outputs["y"][1], np.float32([1, np.nan, np.nan, np.nan]))
    assert run.completed.tolist() == [4, 1] and (run.cycles[1, 1:] == 0).all()
    (fault,) = run.faults
    assert (fault.run, fault.period, fault.kind, fault.file, fault.line) == (1, 1, "data address", "table.s", 7)
    assert "reads data word 5000" in fault.message and "table[i]" in fault.text
    with pytest.raises(takt.FaultError, match="reads data word 5000") as raised:
        run.check()
    assert raised.value.fault is fault
    alone = program.run({"i": index[1]})
    assert alone.completed == 1 and alone.faults[0].message == fault.message
    sim = program.sim()
    assert sim.step({"i": 2}) == {"y": 3.0}
    for _ in range(2):
        with pytest.raises(takt.FaultError, match="reads data word 5000"):
            sim.step({"i": 5000})


def test_a_program_that_halts():
    program = takt.assemble(HALTS)
    run = program.run({"a": 1.5})
    assert run.outputs["y"].shape == () and run.outputs["y"] == 2.5 and run.cycles > 0
    assert program.run({"a": [1.0, 2.0]}).faults[0].kind == "halted"
    endless = takt.assemble(".once\nloop: jmp loop\n")
    assert endless.run(max_cycles=1000).faults[0].kind == "cycle limit"
    with pytest.raises(ValueError, match="waits for the tick: give it periods"):
        takt.assemble(GAIN).run({"x": 1.0})


def test_an_image_is_the_program(tmp_path):
    program = takt.assemble(LAW, "t1", name="law.s")
    (tmp_path / "law.takt").write_bytes(program.image())
    image = takt.load(tmp_path / "law.takt")
    assert image.machine == "t1" and list(image.inputs) == ["q", "qr", "n"] and image.sources == program.sources
    inputs = states(20)
    same(image.run(inputs), program.run(inputs).outputs)
    with pytest.raises(ValueError, match="is for t1, not for t3"):
        takt.load(tmp_path / "law.takt", "t3")
    (tmp_path / "law.takt").write_bytes(program.image()[:-10])
    with pytest.raises(ValueError, match="not an image that can run"):
        takt.load(tmp_path / "law.takt")


def test_sources_include_files(tmp_path):
    (tmp_path / "gain.inc").write_text(".const GAIN = 0.25\n")
    (tmp_path / "main.s").write_text('.include "gain.inc"\n.input x\n.output y\n.period\nloop: fmul y, x, GAIN\n wait loop\n')
    program = takt.load(tmp_path / "main.s")
    assert program.run({"x": [8.0]}).outputs["y"] == 2.0 and list(program.sources) == ["main.s", "gain.inc"]
    with pytest.raises(FileNotFoundError, match="missing.s"):
        takt.load(tmp_path / "missing.s")


def test_the_listing_shows_every_bundle():
    program = takt.assemble(LAW)
    lines = [line for line in program.listing().splitlines() if line.startswith("  0")]
    assert len(lines) == program.bundles and any("fmul    p, e, 40.0" in line for line in lines)


def test_mistakes_in_a_source_are_data():
    with pytest.raises(takt.AssemblyError) as raised:
        takt.assemble(".input x\n.output y\n.period\nloop: fmull y, x, 0.5\n wait lop\n", name="gain.s")
    first, second = raised.value.diagnostics
    assert (first.severity, first.file, first.line, first.column) == ("error", "gain.s", 4, 7)
    assert "fmull" in first.message and first.replacement == "fmul" and "fmul" in first.help
    assert second.line == 5 and second.replacement == "loop"
    assert "gain.s:4:7" in str(raised.value) and "^^^^^" in str(raised.value)


def test_warnings_are_warned_of():
    source = ".input x\n.output y\n.reg unused\n.period\nloop: fmul y, x, 0.5\n wait loop\n"
    with pytest.warns(takt.AssemblyWarning, match="unused"):
        program = takt.assemble(source)
    (warning,) = program.warnings
    assert warning.severity == "warning" and warning.line == 3
    with pytest.raises(takt.AssemblyError):
        takt.assemble(source, warnings=["error"])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda p: p.run({"q": 1, "qr": 1, "m": 1}), r"no input `m`; did you mean `n`\?|no input `m` \(there are: q, qr, n\)"),
        (lambda p: p.run({"q": [1], "qrr": 1, "n": 1}), r"no input `qrr`; did you mean `qr`\?"),
        (lambda p: p.run({"q": [1]}), "no values for the inputs `qr`, `n`"),
        (lambda p: p.run({"q": [1, 2], "qr": [1, 2, 3], "n": 1}), r"different lengths: `q` \(2,\), `qr` \(3,\)"),
        (lambda p: p.run({"q": np.zeros((2, 2, 2)), "qr": 1, "n": 1}), "`q` has 3 dimensions"),
        (lambda p: p.run({"q": [1, 2], "qr": 1, "n": 1}, periods=3), "periods is 3, and the inputs have 2"),
        (lambda p: p.run({"q": [1, np.nan], "qr": 1, "n": 1}), r"`q`\[1\]: NaN is not an input"),
        (lambda p: p.run({"q": [1, 2, -1e39], "qr": 1, "n": 1}), r"`q`\[2\]: -1e\+39 does not fit binary32"),
        (lambda p: p.run({"q": [1], "qr": 1, "n": 1.5}), "the port carries integers, the array float64"),
        (lambda p: p.run({"q": [1], "qr": 1, "n": 2**31}), "2147483648 is not between -2147483648 and 2147483647"),
        (lambda p: p.run({"q": ["1"], "qr": 1, "n": 1}), "`q`: an array of <U1 is none of numbers"),
        (lambda p: p.run({"q": [[1], [1, 2]], "qr": 1, "n": 1}), "`q`: no array of numbers"),
        (lambda p: p.run({"q": [1], "qr": 1, "n": 1}, tick=0), "tick is 0: it is 1 at least"),
        (lambda p: p.sim(max_cycles=2**70), "max_cycles is"),
        (lambda p: p.sim().step({"q": 1, "qr": 1, "nn": 1}), r"no input `nn`; did you mean `n`\?"),
        (lambda p: p.sim().step({"q": float("nan"), "qr": 1, "n": 1}), "input `q` of period 0: NaN is not an input"),
        (lambda p: p.sim().step({"q": 1e300, "qr": 1, "n": 1}), "input `q` of period 0: 1e300 does not fit binary32"),
        (lambda p: p.sim().step({"q": 1, "qr": 1, "n": 2**40}), "input `n` of period 0: 1099511627776 does not fit 32 bits, signed"),
        (lambda p: takt.assemble(GAIN, "t33"), r"no machine `t33`; did you mean `t3"),
        (lambda p: takt.assemble(GAIN, schedule="onn"), r"schedule is 'onn'; did you mean `on`\?"),
        (lambda p: takt.assemble(GAIN, warnings=["loud"]), "warnings: `loud`: write `error`"),
        (lambda p: takt.assemble(GAIN, include=["/nowhere/at/all"]), "include: there is no folder /nowhere/at/all"),
        (lambda p: p.analyse({"q": [1, 2]}, period=3), "the inputs have 2 periods, so there is no period 3"),
    ],
)
def test_arguments_that_do_not_fit_have_one_clear_error(call, message):
    program = takt.assemble(LAW)
    with pytest.raises(ValueError, match=message):
        call(program)


def test_types_that_do_not_fit():
    program = takt.assemble(LAW)
    with pytest.raises(TypeError, match="input `q` takes float"):
        program.sim().step({"q": "1", "qr": 1, "n": 1})
    with pytest.raises(TypeError, match="input `n` takes int"):
        program.sim().step({"q": 1, "qr": 1, "n": 1.5})
    with pytest.raises(TypeError, match="takt.load reads files"):
        takt.assemble(Path("law.s"))


def test_a_file_name_is_no_source(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "gain.s").write_text(GAIN)
    with pytest.raises(ValueError, match=r"takt.load\('gain.s'\) reads it"):
        takt.assemble("gain.s")


def test_what_has_no_bound_says_why():
    program = takt.assemble(".input x\n.output y\n.period\nloop: fmul y, x, 0.5\nagain: bnz x, again\n wait loop\n")
    with pytest.raises(takt.NoBoundError, match=".loop_bound"):
        program.bound()


def test_an_analysis_is_the_pages_picture():
    program = takt.assemble(LAW, name="law.s")
    analysis = program.analyse(states(10))
    run = program.run(states(10))
    assert analysis.cycles == run.cycles[-1] == analysis.data["cycles"] and analysis.data["period"] == 10
    assert "period 10 on t3" in str(analysis) and "the chain that sets the time" in str(analysis)
    units = {one["unit"]: one for one in analysis.data["one_cycle_less"]}
    assert units["multiply"]["reassembled"] is None and "reassembled" not in str(analysis)
    again = program.analyse(states(10), reassemble=True)
    units = {one["unit"]: one for one in again.data["one_cycle_less"]}
    assert units["multiply"]["reassembled"] <= analysis.cycles and "reassembled" in str(again)
    shown = analysis._repr_html_()
    assert shown.startswith("<iframe srcdoc=\"&lt;!doctype html&gt;") and "law.s" in analysis.html
    assert program.analyse(period=0).data["period"] == 0
    with pytest.raises(takt.FaultError, match="reads data word 5000"):
        takt.assemble(TABLE).analyse({"i": [1, 5000]})


def test_bounds_of_errors_hold_in_every_run():
    source = """
        .input a, b
        .output y
        .reg t
        .range a = -2, 2
        .range b = 1, 8
        .period
    loop:
        fdiv t, a, b
        fmul t, t, t
        fadd y, t, 0.1
        wait loop
    """
    program = takt.assemble(source, name="law.s")
    found = program.enclose()
    bound = found.outputs["y"]
    assert found.safe and found.assumed == ()
    random = np.random.default_rng(5)
    a, b = random.uniform(-2, 2, 10_000).astype(np.float32), random.uniform(1, 8, 10_000).astype(np.float32)
    y = program.run({"a": a, "b": b}).outputs["y"]
    exact = (a.astype(np.float64) / b) ** 2 + np.float64(0.1)
    assert bound.range[0] <= y.min() and y.max() <= bound.range[1] < 4.2
    error = np.abs(y - exact).max()
    assert error <= bound.error < 20 * error
    assert {place.split(":")[0] for place, _ in bound.operations} == {"law.s"}
    assert sum(error for _, error in bound.operations) <= bound.error * (1 + 1e-12)

    hazard = takt.assemble(source.replace("= 1, 8", "= -1, 8")).enclose().hazards[0]
    assert hazard.problem == "the divisor may be zero" and ("b", (-1.0, 8.0)) in hazard.operands
    with pytest.raises(takt.NoBoundError, match="`b`"):
        takt.assemble(source.replace(".range b = 1, 8", "")).enclose()


def test_the_accuracy_is_that_of_binary64():
    program = takt.assemble(LAW, name="law.s")
    inputs = states(100)
    found = program.accuracy(inputs)["u"]
    # The same law in binary64, with inputs rounded to binary32.
    q, qr = (np.float64(np.float32(inputs[name])) for name in ("q", "qr"))
    e = qr - q
    exact = e * 40 + np.diff(e, prepend=0.0) * 3
    error = np.abs(program.run(inputs).outputs["u"] - exact)
    assert found.periods == 100 and found.absolute.period == error.argmax()
    assert abs(found.absolute.error) == pytest.approx(error.max(), rel=1e-6)
    assert sum(share for _, share in found.operations) == pytest.approx(found.absolute.error, rel=1e-6)
    assert {place.split(":")[0] for place, _ in found.operations} == {"law.s"}


def test_masked_elements_are_no_values():
    program = takt.assemble(GAIN)
    x = np.ma.masked_array([1.0, 2.0, 3.0], mask=[False, True, False])
    for call in [lambda: program.run({"x": x}), lambda: program.accuracy({"x": x}), lambda: program.analyse({"x": x})]:
        with pytest.raises(ValueError, match=r"`x`\[1\] is masked: there is no value to run with"):
            call()
    with pytest.raises(ValueError, match="`x` is masked"):
        program.run({"x": np.ma.masked})
    none_masked = program.run({"x": np.ma.masked_array([1.0, 2.0])})
    assert none_masked.outputs["y"].tolist() == [0.5, 1.0]
    assert program.run({"x": x.filled(4.0)}).outputs["y"].tolist() == [0.5, 2.0, 1.5]


def test_a_tick_that_no_period_can_wait_for():
    program = takt.assemble(GAIN)
    for run in [lambda tick, **most: program.run({"x": 1.0}, periods=2, tick=tick, **most), program.sim]:
        with pytest.raises(ValueError, match="tick is 1000000000 cycles: it is 100000000 at most"):
            run(tick=10**9)
        with pytest.raises(ValueError, match="tick is 600 cycles, and max_cycles 500: every period would end with a fault"):
            run(tick=600, max_cycles=500)
        run(tick=100_000_000)


def test_inputs_that_have_no_names():
    program = takt.assemble(GAIN)
    for inputs in [[1.0, 2.0], (1.0,), np.ones(3), 0.5, "x"]:
        for call in [program.run, program.analyse, program.accuracy, program.sim().step]:
            with pytest.raises(TypeError, match=rf"inputs are values by the name of their port, as .*, and not a {type(inputs).__name__}"):
                call(inputs)

    class Table:
        """As a table of pandas: columns by name."""

        def keys(self):
            return ["x"]

        def items(self):
            return [("x", np.ones(3))]

        def __getitem__(self, name):
            return np.ones(3)

        def __bool__(self):
            raise ValueError("ambiguous")

    assert program.run(Table()).outputs["y"].tolist() == [0.5] * 3


def test_paths_of_bytes(tmp_path):
    (tmp_path / "gain.s").write_text('.include "part.s"\n')
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "part.s").write_text(GAIN)
    path, parts = os.fsencode(tmp_path / "gain.s"), os.fsencode(tmp_path / "parts")
    assert takt.load(path, include=[parts]).run({"x": 1.0}, periods=1).outputs["y"] == 0.5
    assert takt.assemble('.include "part.s"\n', folder=parts).bundles == takt.assemble(GAIN).bundles
    with pytest.raises(TypeError, match="path is a path: a str, bytes or os.PathLike, not a int"):
        takt.load(3)
    for include in [str(tmp_path), parts, tmp_path]:
        with pytest.raises(TypeError, match="include is a list of folders"):
            takt.load(path, include=include)


def test_parameters() -> None:
    """Parameters have a value and a range, and change between two periods."""
    law = takt.assemble(
        ".param kp = 2.0 range 0..50\n.param n:int = 3\n.input x\n.output y, k:int\n.period\np: y = kp*x\n k = n\n wait p\n"
    )
    assert law.parameters["kp"].value == 2.0 and law.parameters["kp"].limits == (0.0, 50.0)
    assert law.parameters["n"].value == 3 and law.parameters["n"].limits is None
    tuned = law.with_parameters({"kp": 4, "n": -1})
    assert (tuned.parameters["kp"].value, law.parameters["kp"].value) == (4.0, 2.0)
    assert tuned.run({"x": [1.0]}).outputs["y"].tolist() == [4.0]
    restored = pickle.loads(pickle.dumps(tuned))
    assert restored.parameters["n"].value == -1
    sim = tuned.sim()
    assert sim.step({"x": 1.0}) == {"y": 4.0, "k": -1}
    assert sim.step({"kp": 0.5}) == {"y": 0.5, "k": -1}
    assert sim.step() == {"y": 0.5, "k": -1}, "it keeps its value"
    with pytest.raises(ValueError, match="51 is no value of the parameter `kp`"):
        sim.step({"kp": 51})
    with pytest.raises(ValueError, match="no parameter `kq`; did you mean `kp`"):
        law.with_parameters({"kq": 1})
    with pytest.raises(ValueError, match="the source states the range 0 to 50"):
        law.with_parameters({"kp": -1})

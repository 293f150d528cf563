"""What a learner gets wrong: each has an error that says what is missing."""

import io
import sys
import threading
import time

import numpy as np
import pytest

import takt
import takt.casadi
import takt.mpc
import takt.urdf
from takt._progress import progress
from takt._words import in_python
from test_programs import GAIN

LONG = ".input x\n.output y\n.reg f i:int\n.period\np: fmul f, x, 0.5\n .for i, 1, 60000\n fadd f, f, x\n .endfor\n mov y, f\n wait p\n"


def forgetful(*_):
    """A plant without `return`."""


def test_a_plant_without_return_is_an_error():
    program = takt.assemble(GAIN)
    sim = program.sim()
    sim.step({"x": 1.0})
    with pytest.raises(TypeError, match="inputs are None: does the function that makes them lack a `return`"):
        sim.step(forgetful(sim.outputs))
    assert sim.periods == 1 and sim.step() == {"y": 0.5}
    batch = program.batch(3)
    with pytest.raises(TypeError, match="the plant returned None after period 0: it lacks a `return`"):
        batch.close(forgetful, 5, {"x": 1.0})
    with pytest.raises(TypeError, match="inputs are None"):
        batch.step(None)
    # Without new inputs, all values are kept.
    assert batch.close(lambda outputs, period: {}, 5, {"x": 1.0}).cycles.shape == (3, 5)


def test_a_nan_names_its_input_and_period():
    program = takt.assemble(GAIN)
    sim = program.sim()
    for _ in range(3):
        sim.step({"x": 1.0})
    with pytest.raises(ValueError, match="input `x` of period 3: NaN is not an input"):
        sim.step({"x": float("nan")})
    plant = lambda outputs, period: {"x": np.where(np.arange(4) == 2, np.nan if period == 1 else 0.0, 1.0)}
    with pytest.raises(ValueError, match=r"`x`\[2\] of period 2: NaN is not an input"):
        program.batch(4).close(plant, 5, {"x": 1.0})


def test_two_threads_on_one_machine_are_told_so():
    program = takt.assemble(LONG)
    for machine in (program.sim(), program.batch(2)):
        machine.step({"x": 1.0})
        errors, done = [], threading.Event()

        def other():
            while not done.is_set() and not errors:
                try:
                    machine.step({"x": 1.0})
                except RuntimeError as error:
                    errors.append(str(error))

        thread = threading.Thread(target=other)
        thread.start()
        try:
            for _ in range(200):
                machine.step({"x": 1.0})
                machine.periods
                if errors:
                    break
        except RuntimeError as error:
            errors.append(str(error))
        finally:
            done.set()
            thread.join()
        assert errors and all("another thread is using this" in error and "for each thread" in error for error in errors), errors


def test_messages_name_arguments_not_options():
    for text, expected in {
        "--tip: link `x` does not move": "`tip=`: link `x` does not move",
        "take the part of the robot behind it with `--base leg`": 'take the part of the robot behind it with `base="leg"`',
        "`takt asm --effort` lets the scheduler search longer": "`effort=` lets the scheduler search longer",
        "choose a link with --tip, among them a": "choose a link with `tip=`, among them a",
        "the base is held (`--floating error` refuses)": 'the base is held (`floating="error"` refuses)',
        "unless `--no-strength`": 'unless `without=["strength"]`',
        "a body (--body) has its inputs in registers": "a body (`--body` on the command line) has its inputs in registers",
        "bound the period instead: `takt bound --deadline`": "bound the period instead: `program.bound()`",
        "`takt live PORT stop` stops it; `takt live PORT status` says which": "`board.stop()` stops it; `board.status` says which",
        # Minus signs and source lines are not options.
        "a - b -- c, x--y": "a - b -- c, x--y",
        " 12 │ mov a, b ; as --tip": " 12 │ mov a, b ; as --tip",
        "`takt machines t3 --toml` prints a file": "`takt machines t3 --toml` prints a file",
    }.items():
        assert in_python(text) == expected


URDF = """<robot name='r'><link name='a'/><link name='b'/><link name='c'/>
<joint name='j' type='planar'><parent link='a'/><child link='b'/></joint>
<joint name='k' type='revolute'><parent link='b'/><child link='c'/><axis xyz='0 0 1'/><limit effort='1' velocity='1'/></joint></robot>"""


def test_errors_and_warnings_name_arguments():
    with pytest.raises(takt.ModelError, match='with `base="b"`') as caught:
        takt.urdf.program(URDF, "gravity")
    assert "--" not in str(caught.value)
    with pytest.raises(takt.ModelError) as caught:
        takt.urdf.program(URDF, "gravity", base="b", tip="nothing")
    assert "--" not in str(caught.value) and "`tip=`" in str(caught.value)
    latched = ".ports latched\n.input x\n.output y\n.period\n.deadline y = 9\np: fmul y, x, x\n wait p\n"
    with pytest.raises(takt.AssemblyError, match=r"bound the period instead: `program.bound\(\)`") as error:
        takt.assemble(latched)
    assert "--deadline" not in str(error.value) and any("program.bound()" in (one.help or "") for one in error.value.diagnostics)


def test_a_call_names_what_is_called():
    import casadi as ca

    x = ca.MX.sym("x")
    table = ca.interpolant("torque_table", "linear", [[0, 1, 2]], [0, 1, 4])
    with pytest.raises(takt.ModelError, match="`f` calls `torque_table`.*'simplify': True"):
        takt.casadi.program(ca.Function("f", [x], [table(x)]))
    state, rate = ca.SX.sym("x"), ca.SX.sym("u")
    dae = {"x": state, "p": rate, "ode": rate - state}
    simple = ca.integrator("step", "rk", dae, 0, 0.1, {"simplify": True, "number_of_finite_elements": 1})
    u = ca.MX.sym("u")
    f = ca.Function("f", [x, u], [simple(x0=x, p=u)["xf"]], ["x", "u"], ["next"])
    assert abs(float(takt.casadi.program(f).run({"x": 1.0, "u": 0.0}, periods=1).outputs["next"][0]) - np.exp(-0.1)) < 1e-6


def test_the_terminal_weight_is_the_cost_to_go():
    A, B = np.array([[1, 0.1], [0, 0.99]]), np.array([[0.005], [0.1]])
    problem = takt.mpc.problem(A, B, [10, 2], 1, horizon=5, rho=0.5)
    P = Q = np.diag([10.5, 2.5])
    for _ in range(2000):
        K = np.linalg.solve(1.5 * np.eye(1) + B.T @ P @ B, B.T @ P @ A)
        P = Q + A.T @ P @ (A - B @ K)
    np.testing.assert_allclose(takt.mpc.terminal_weight(problem), P, rtol=1e-6)


def test_the_version_is_the_packages():
    from importlib.metadata import version

    assert takt.__version__ == version("takt")


def test_notebooks_show_tables():
    program = takt.assemble(GAIN)
    run = program.run({"x": [1.0, 2.0]})
    for shown, parts in [
        (program, ["<td>input</td><td>x</td><td>float</td>", "<details>"]),
        (program.bound(), ["<td>loop</td>", "a period takes"]),
        (run, ["<td>y</td><td>float32</td><td>(2,)</td><td>0.5</td><td>1.0</td><td>1.0</td>"]),
        (program.run({"x": np.ones((3, 2))}), ["<td>(3, 2)</td>"]),
    ]:
        text = shown._repr_html_()
        assert all(part in text for part in parts), text
        assert text.count("<table>") == 1 and "<takt." not in text


def test_building_says_how_far_it_is(monkeypatch):
    said = []
    takt.set_progress(lambda what, seconds: said.append((what, seconds)))
    try:
        with progress("building a.s"):
            time.sleep(2.3)
        with progress("building b.s"):
            pass
    finally:
        takt.set_progress(None)
    assert len(said) >= 2 and all(what == "building a.s" and seconds >= 1 for what, seconds in said)


class Terminal(io.StringIO):
    def isatty(self):
        return True


class Notebook(io.StringIO):
    """As a notebook's kernel has standard error."""


Notebook.__module__ = "ipykernel.iostream"


@pytest.mark.parametrize("kind", [Terminal, Notebook, io.StringIO])
def test_building_shows_a_line_where_somebody_looks(monkeypatch, kind):
    errors = kind()
    monkeypatch.setattr(sys, "stderr", errors)
    with progress("building c.s"):
        time.sleep(1.3)
    line = "\rbuilding c.s … 1 s"
    # The line is cleared at the end.
    assert errors.getvalue() == ("" if kind is io.StringIO else line + "\r" + " " * (len(line) - 1) + "\r")
    with progress("building d.s"):
        pass
    assert "d.s" not in errors.getvalue()


def test_what_was_built_is_kept(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    body = "".join(f" s{i} = sin(x*{i}.0 + y)*cos(x - {i}.0*y)\n" for i in range(12))
    names = ", ".join(f"s{i}" for i in range(12))
    source = f".schedule on\n.input x, y\n.output z\n.reg {names}\n.period\np:\n{body} z = {' + '.join(f's{i}' for i in range(12))}\n wait p\n"
    first = takt.assemble(source, effort=4)
    kept = list((tmp_path / "takt/python").iterdir())
    assert len(kept) == 1 and (tmp_path / "takt").stat().st_mode & 0o777 == 0o700
    again = takt.assemble(source, effort=4)
    inputs = {"x": np.linspace(0, 1, 7), "y": 0.3}
    assert again.listing() == first.listing() and again.image() == first.image() and again.sources == first.sources
    np.testing.assert_array_equal(again.run(inputs).outputs["z"], first.run(inputs).outputs["z"])
    assert again.bound() == first.bound() and len(again.analyse(inputs).data) == len(first.analyse(inputs).data)
    # A damaged entry is assembled again.
    whole = kept[0].read_bytes()
    kept[0].write_bytes(whole[:-20] + bytes([whole[-20] ^ 4]) + whole[-19:])
    assert takt.assemble(source, effort=4).image() == first.image()
    assert kept[0].read_bytes() == whole
    # A different effort gives a different program.
    takt.assemble(source, effort=5)
    assert len(list((tmp_path / "takt/python").iterdir())) == 2

"""The examples in the documents run, each with what its document says that the reader has."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
import sympy

import takt
from test_board import FakeBoard
from test_programs import LAW

ROOT = Path(__file__).parents[3]
AXIS = ROOT / "programs/examples/board/axis"


def blocks(name):
    """The examples of a document, each with the heading above it."""
    text = (ROOT / "docs" / name).read_text()
    heading = ""
    for found in re.finditer(r"^#+ (?P<heading>[^\n]*)$|^```python\n(?P<code>.*?)^```", text, re.M | re.S):
        heading = found["heading"] or heading
        if found["code"]:
            yield heading, found["code"]


PYTHON = dict(blocks("python.md"))


@pytest.fixture
def here(tmp_path, monkeypatch):
    (tmp_path / "law.s").write_text(LAW)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_every_example_has_its_test():
    assert set(PYTHON) == {
        "Takt from Python",
        "A plant",
        "Many closed loops",
        "On several computers",
        "A system of several cores",
        "A board",
        "Models",
    }


def test_the_first_example(here):
    names = {"angles": np.linspace(0, 1, 5), "steps": np.arange(5), "reference": lambda k: 0.5, "plant": lambda q, u: 0.0}
    exec(compile(PYTHON["Takt from Python"].replace("range(1000)", "range(3)"), "python.md", "exec"), names)
    assert names["run"].cycles.shape == (5,) and names["sim"].periods == 3


def test_a_plant(here):
    for file in ("pi.s", "plant/dc_motor.toml"):
        shutil.copy(ROOT / "programs/examples" / file, here)
    names = {"takt": takt}
    exec(compile(PYTHON["A plant"], "python.md", "exec"), names)
    assert names["run"].states["i"].shape == (400,) and abs(names["sim"].inputs["w"] - 80) < 2


def test_many_closed_loops(here):
    source = ".input q, qr, kp\n.output u\n.period\nlaw: fsub u, qr, q\n fmul u, u, kp\n wait law\n"
    names = {
        "law": takt.assemble(source),
        "q": 0.0,
        "gains": np.linspace(1, 2, 1000),
        "plant": lambda outputs, period: {"q": outputs["u"] * 0.01},
    }
    exec(compile(PYTHON["Many closed loops"].replace("5000", "5"), "python.md", "exec"), names)
    assert names["loops"].cycles.shape == (1000, 5)


def test_several_computers(here):
    head = """import functools, numpy as np, takt
def plant(outputs, period):
    return {"q": outputs["u"] * 0.01}
q, gains = 0.0, np.linspace(1, 2, 200)
law = takt.assemble(".input q, qr, kp\\n.output u\\n.period\\nlaw: fsub u, qr, q\\n fmul u, u, kp\\n wait law\\n")
"""
    code = PYTHON["On several computers"].replace("5000", "1200").replace(', hq_server="~/takt-server"', ", jobs=2")
    (here / "sweep.py").write_text(head + code.replace("100)", "2)") + "    print(len(np.concatenate(errors)))\n")
    done = subprocess.run([sys.executable, "sweep.py"], capture_output=True, text=True)
    assert done.stdout == "200\n", done.stderr


def test_a_system(here):
    for file in AXIS.iterdir():
        shutil.copy(file, here)
    names = {"takt": takt, "plant": lambda n, duty: n + round(10 * duty)}
    exec(compile(PYTHON["A system of several cores"], "python.md", "exec"), names)
    assert names["system"].ticks == 1000 and names["system"].periods["servo"].longest > 0


def test_a_board(here, monkeypatch):
    source = ".input x n:int\n.output y m:int\n.reg e\n.once\n mov y, zero\n mov m, zero\n wait loop\n.period\nloop: fmul y, x, 0.5\n mov e, y\n iadd m, n, 1\n wait loop\n.data\ntable: .float 1.0, 2.0, 3.0, 4.0\n"
    program = takt.assemble(source, "t1")
    simulated = FakeBoard(program)
    simulated.start()
    try:
        code = PYTHON["A board"].replace('"/dev/ttyUSB0"', "port")
        # The law of the document and the board of the tests have different ports.
        for own, other in {'"qr"': '"x"', '"u"': '"y"', '"q"': '"x"', "@m12": "@r3"}.items():
            code = code.replace(own, other)
        # The emulated board has no scope: test_board.py records with one.
        code = "\n".join(line for line in code.splitlines() if not line.startswith("taken"))
        exec(compile(code.replace("count=100", "count=3"), "python.md", "exec"), {"takt": takt, "law": program, "port": simulated.port})
    finally:
        simulated.stops = True


def test_models(here):
    shutil.copy(ROOT / "asm/front/tests/data/ur5.urdf", here / "ur5.urdf")
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    a, b = sympy.symbols("a b", real=True)
    names = {
        "takt": takt,
        "f": ca.Function("f", [x, u], [ca.vertcat(x[1], u - ca.sin(x[0]))], ["x", "u"], ["dx"]),
        "states": np.zeros((3, 2)),
        "a": a,
        "b": b,
        "sin": sympy.sin,
    }
    exec(compile(PYTHON["Models"], "python.md", "exec"), names)
    assert len(names["arm"].model.joints) == 6


def test_the_exporters_of_the_models_document(here):
    (code,) = [code for _, code in blocks("model.md") if "takt_expressions" in code]
    x = ca.SX.sym("x")
    a, b = sympy.symbols("a b", real=True)
    exec(compile(code, "model.md", "exec"), {"f": ca.Function("f", [x], [x * x]), "a": a, "b": b, "sin": sympy.sin})
    assert (here / "f.json").read_text().startswith('{"format": "takt-expressions 1"')

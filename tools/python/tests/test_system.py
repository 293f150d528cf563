"""Systems of several cores, stepped from Python."""

import copy
import re
from pathlib import Path

import numpy as np
import pytest

import takt

ROOT = Path(__file__).parents[3]
SPEED = ROOT / "programs/systems/speed.toml"
#: One core sums its input, another halves the sum; in each tick both read the values present at the tick.
SUM = ".input x\n.output s\n.state a\n.preset a = 0\n.schedule on\n.period\np: a = a + x\n s = a\n wait p\n"
HALF = ".input s\n.output y\n.schedule on\n.period\np: y = 0.5*s\n wait p\n"
SYSTEM = """tick = 1000
[[core]]
name = "sum"
program = "sum.s"
[[core]]
name = "half"
program = "half.s"
machine = "t1"
tick = 2
offset = 200
[[wire]]
from = "host.x"
to = "sum.x"
[[wire]]
from = "sum.s"
to = "half.s"
[[wire]]
from = "sum.s"
to = "host.s"
[[wire]]
from = "half.y"
to = "host.y"
"""


@pytest.fixture
def folder(tmp_path):
    for name, text in [("sum.s", SUM), ("half.s", HALF), ("system.toml", SYSTEM)]:
        (tmp_path / name).write_text(text)
    return tmp_path


def test_cores_compute_and_pass_on(folder):
    system = takt.System(folder / "system.toml")
    assert system.cores == {"sum": 1000, "half": 2000} and system.tick == 1000
    assert list(system.inputs) == ["x"] and list(system.outputs) == ["s", "y"] and not system.pushes
    total, half = 0.0, 0.0
    for k in range(8):
        x = 0.25 * (k + 1)
        out = system.step({"x": x})
        total += x
        # The half runs in every second tick, 200 cycles after the sum is ready.
        half = total / 2 if k % 2 == 0 else half
        assert out == {"s": total, "y": half} == system.values
    # An input that is not set keeps its value.
    assert system.step()["s"] == total + 2.0
    assert system.ticks == 9 and system.periods["sum"].count == 9 and system.periods["half"].count == 5
    assert 0 < system.periods["sum"].longest < 100 and system.periods["sum"].skipped == 0
    now = system.now
    system.reset()
    assert system.ticks == 0 and system.now < now and system.step({"x": 1.5}) == {"s": 1.5, "y": 0.75}
    with pytest.raises(TypeError, match="neither pickled nor copied"):
        copy.copy(system)


def test_the_motor_follows_its_commands():
    system = takt.System(SPEED)
    assert list(system.pushes) == ["moves"] and list(system.pushes["moves"]) == ["target", "rate"]
    w, reached = 0.0, []
    assert system.push("moves", {"target": 10.0, "rate": 0.05})
    alone = takt.load(ROOT / "programs/examples/pi.s").sim()
    for k in range(1500):
        out = system.step({"w": w})
        reached.append(w)
        # First-order model of a motor.
        w += 1e-3 * (20.0 * out["u"] - 5.0 * w)
    assert abs(np.mean(reached[-100:]) - 10.0) < 0.1, reached[-1]
    # The servo alone, started in the same state, gives the same outputs as its core in the system.
    system.reset()
    first = system.step({"w": 2.0})["u"]
    assert first == alone.step({"w": 2.0, **{name: 0.0 for name in alone.program.inputs if name != "w"}})["u"] != 0
    assert set(system.values) == {"u", "seen.peak", "seen.values"}


def test_entries_go_in_and_out(tmp_path):
    (tmp_path / "echo.s").write_text(
        ".input v, empty:int\n.output w, push:int, done:int\n.once\n wait p\n.period\n"
        "p: bnz empty, idle\n fadd w, v, v\n nop\n nop\n nop\n nop\n nop\n nop\n nop\n mov push, zero\n mov done, zero\nidle: wait p\n"
    )
    (tmp_path / "echo.toml").write_text(
        'tick = 1000\n[[core]]\nname = "echo"\nprogram = "echo.s"\n'
        '[[fifo]]\nname = "to"\nfrom = "host"\nto = "echo"\ndepth = 4\nports = ["v"]\npop = "done"\nreceiver = { empty = "empty" }\n'
        '[[fifo]]\nname = "back"\nfrom = "echo"\nto = "host"\ndepth = 16\nports = ["w"]\npush = "push"\n'
    )
    system = takt.System(tmp_path / "echo.toml")
    assert system.pop("back") is None
    assert [system.push("to", {"v": v}) for v in (1.0, 2.5)] == [True, True]
    for _ in range(3):
        system.step()
    found = []
    while (entry := system.pop("back")) is not None:
        found.append(entry["w"])
    assert found == [2.0, 5.0]
    with pytest.raises(ValueError, match=re.escape("the system has no FIFO `bak` to the host (there are: back)")):
        system.pop("bak")
    with pytest.raises(ValueError, match="an entry of `to` has the fields v"):
        system.push("to", {"u": 1})


def test_mistakes_and_faults(folder):
    with pytest.raises(takt.AssemblyError, match="there is no program none.s"):
        (folder / "bad.toml").write_text(SYSTEM.replace("half.s\"", "none.s\"", 1))
        takt.System(folder / "bad.toml")
    with pytest.raises(FileNotFoundError):
        takt.System(folder / "none.toml")
    system = takt.System(folder / "system.toml")
    with pytest.raises(ValueError, match="the system has no input `z`"):
        system.step({"z": 1})
    with pytest.raises(ValueError, match="`x` of tick 0: NaN is not an input for a controller"):
        system.step({"x": float("nan")})
    (folder / "half.s").write_text(".input s\n.output y\n.reg n:int\n.period\np: ftoi n, s\n ld y, table[n]\n wait p\n.data\ntable: .float 1, 2\n")
    system = takt.System(folder / "system.toml")
    assert system.step({"x": 1.0})["y"] == 2.0
    with pytest.raises(takt.FaultError, match="core `half`") as raised:
        for _ in range(4):
            system.step({"x": 1e6})
    assert raised.value.fault.run == 1 and raised.value.fault.kind == "data address"
    with pytest.raises(takt.FaultError):
        system.step()
    system.reset()
    assert system.step({"x": 0.0})["y"] == 1.0

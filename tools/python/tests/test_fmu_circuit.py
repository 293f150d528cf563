# SPDX-License-Identifier: MIT OR Apache-2.0
"""`takt fmu --circuit` in FMPy: the pins of a Verilated board, value by value those of `takt board sim`; its host, its end, mistakes."""

import csv
import os
import shutil
import signal
import struct
import subprocess
import sys
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

from test_fmu import LIBRARY, TOOL, Master

PARTS = TOOL.exists() and LIBRARY is not None and shutil.which("verilator") is not None
pytestmark = pytest.mark.skipif(not PARTS, reason="target/release has no takt or no libtakt_fmu.so, or there is no Verilator")

PERIOD = 1e-4
WIRING = """board = "ulx3s-85f"
clock = 50
period = 100
baud = 1_000_000
autostart = true

[signals]
drive = "gp5"
stop = "gp6"

[peripheral.limit]
kind = "digital-in"
pins = { in = "gp0" }
ports = { level = "at_end" }

[peripheral.drive]
kind = "quadrature"
pins = { a = "gp3", b = "gn3" }
start = 5
ports = { count = "n" }

[peripheral.motor]
kind = "pwm"
pins = { high = "gp2" }
half = 1250
ports = { duty = "duty" }
scale = { duty = 1024 }

[peripheral.lamp]
kind = "digital-out"
pins = { out = "gp1" }
ports = { level = "lit" }
"""
PROGRAM = """
.schedule on
.param  slow = 0.5
.input  at_end:int, n:int
.input  flash:int, stop                ; the host's
.range  stop = -0.25, 0.25
.output duty, lit:int
.once
        duty, lit = 0, 0
        wait    period
.period
period: duty = at_end ? stop : n > 10 ? 1 : slow
        lit = xor(at_end, flash)
        wait    period
"""
# Types of segments in a program; one that is linked dynamically has the latter.
LOAD, INTERPRETER = 1, 3
OUTPUTS = ["drive", "motor.high", "lamp.out"]


@pytest.fixture(scope="module")
def board(tmp_path_factory):
    """A folder with a program and its wirings: one that starts by itself, and one whose host must not be silent for 40 periods."""
    folder = tmp_path_factory.mktemp("board")
    (folder / "limit.s").write_text(PROGRAM)
    (folder / "limit.toml").write_text(WIRING)
    (folder / "host.toml").write_text(WIRING.replace("autostart = true", "host = 40"))
    return folder


def write(folder, wiring, *options):
    file = folder / f"{Path(wiring).stem}{''.join(options)}.fmu".replace("=", "")
    command = [TOOL.resolve(), "fmu", "limit.s", "--circuit", "--wiring", wiring, "--machine", "t1", "-o", file, "--library", LIBRARY.resolve()]
    said = subprocess.run([*command, *options], check=True, capture_output=True, text=True, cwd=folder).stdout
    assert "the circuit of ulx3s-85f in Verilator, 6 inputs, 3 outputs, a step of 0.0001 s or 5000 cycles" in said
    assert " periods a second on this machine" in said
    return file


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_pins_are_those_of_the_simulated_board(board, fmi):
    """Every output of every period; the encoder's name is that of a signal, too."""
    file = write(board, "limit.toml", "--fmi", fmi)
    assert validate_fmu(str(file)) == []
    rows = [(0, 5), (0, 5), (0, 10), (0, 17), (0, 17), (0, 11), (1, 11), (1, -4), (0, -4), (0, 12), (0, 12)]
    with (board / "in.csv").open("w") as out:
        csv.writer(out).writerows([("limit", "drive"), *rows])
    command = "board sim --wiring limit.toml --program limit.s --machine t1 --inputs in.csv --outputs out.csv"
    subprocess.run([TOOL.resolve(), *command.split()], check=True, capture_output=True, cwd=board)
    expected = list(csv.DictReader((board / "out.csv").read_text().splitlines()))
    assert len(expected) == len(rows) and len({row["motor.high"] for row in expected}) > 5

    description = fmpy.read_model_description(str(file))
    real, integer = ("Real", "Integer") if fmi == "2" else ("Float32", "Int32")
    shown = {v.name: (v.type, v.causality, v.start) for v in description.modelVariables}
    assert shown["limit.in"] == shown["stop"] == shown["button"] == ("Boolean", "input", "false")
    assert shown["drive.count"] == (integer, "input", "5") and shown["drive"] == (real, "output", None)
    assert shown["flash"] == (integer, "input", "0") and shown["stop.port"] == (real, "input", "0.0")
    assert not description.coSimulation.canGetAndSetFMUstate and not description.coSimulation.canSerializeFMUstate
    names = [("time", float), ("limit.in", bool), ("drive.count", np.int32)]
    inputs = np.array([(i * PERIOD, *row) for i, row in enumerate(rows)], dtype=names)
    result = fmpy.simulate_fmu(str(file), stop_time=len(rows) * PERIOD, input=inputs, output=OUTPUTS)
    assert [result[0][name] for name in OUTPUTS] == [0, 0, 0]
    for got, row in zip(result[1:], expected, strict=True):
        for name in OUTPUTS:
            assert np.float32(got[name]) == np.float32(row[name]), (name, got, row)


def test_the_host_starts_the_program_and_is_not_silent(board, tmp_path):
    """Without a request in 40 periods the outputs would become safe. A parameter's start is in the circuit."""
    master = Master(write(board, "host.toml", "--param", "slow=0.25"), tmp_path)
    for _ in range(100):
        master.step(PERIOD)
    assert (master.get("drive"), master.messages) == (1.0, [])
    # In a period of two of the PWM, whose counter has 1250 steps up and 1250 down.
    assert master.get("motor.high") == pytest.approx((1 + 0.25 * 1024 / 1250) / 2, abs=0.001)
    master.set(stop=True)
    master.step(2 * PERIOD)
    assert master.get("drive") == 0.0 and "the outputs become safe: stop" in master.messages[0]
    master.end()


@pytest.mark.parametrize("wiring", ["limit.toml", "host.toml"])
def test_the_host_sets_ports_without_pins(board, tmp_path, wiring):
    """Before the first tick those that are set before; later ones when the request has come."""
    master = Master(write(board, wiring), tmp_path, initialise=False)
    pulse = lambda duty: pytest.approx((1 + duty * 1024 / 1250) / 2, abs=0.001)
    master.set(**{"flash": 1, "stop.port": -0.125, "limit.in": True})
    master.initialise()
    if wiring == "host.toml":
        master.step(PERIOD)
    master.step(2 * PERIOD)
    assert (master.get("lamp.out"), master.get("motor.high")) == (1 - 1, pulse(-0.125))
    # The ports are neighbours; a request of two words takes 160 bits, 160 µs at this rate. Meanwhile other values come.
    for value in (0.25, 0.2, 0.125, 0.0625):
        master.set(**{"flash": 0, "stop.port": value})
        master.step(PERIOD)
    master.step(4 * PERIOD)
    assert (master.get("lamp.out"), master.get("motor.high")) == (1.0, pulse(0.0625))
    master.fails("0.5 is no value of `stop.port`: the source states the range -0.25 to 0.25", lambda: master.set(**{"stop.port": 0.5}))
    assert master.get("drive") == 1.0 and master.messages == []
    master.end()


def children():
    """Processes that this one has started and not yet waited for."""
    return {int(pid) for task in Path("/proc/self/task").iterdir() for pid in (task / "children").read_text().split()}


def test_instances_and_the_end_of_the_simulation(board, tmp_path):
    """Two instances do not touch each other; a killed simulation is an error of the step, and a reset begins another."""
    before = children()
    file = write(board, "limit.toml")
    one = Master(file, tmp_path)
    (first,) = children() - before
    two = Master(file, tmp_path)
    one.set(**{"limit.in": True})
    for _ in range(3):
        one.step(PERIOD)
        two.step(PERIOD)
    assert (one.get("lamp.out"), two.get("lamp.out")) == (1.0, 0.0)
    one.fails("the state of a board's circuit cannot be saved", one.fmu.getFMUState)
    getter = one.fmu.getInteger
    one.fails("no variable of this type has the value reference 1", lambda: getter([1]))
    # A master in C dies of the signal.
    handler = signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    os.kill(first, signal.SIGKILL)
    one.fails("the simulation has ended", lambda: one.step(PERIOD))
    signal.signal(signal.SIGPIPE, handler)
    two.step(PERIOD)
    one.fmu.reset()
    one.time = 0.0
    one.initialise()
    for _ in range(3):
        one.step(PERIOD)
    assert (one.get("drive"), one.get("lamp.out")) == (1.0, 0.0)
    one.end()
    two.end()
    assert children() == before


def test_no_tool_is_needed(board, tmp_path):
    """The simulation is linked statically, and starts where the archive's permissions are lost and no program is on the path."""
    with zipfile.ZipFile(write(board, "limit.toml")) as archive:
        archive.extractall(tmp_path)
    simulation = tmp_path / "resources" / "simulation"
    elf = simulation.read_bytes()
    at, count = struct.unpack_from("<Q", elf, 32)[0], struct.unpack_from("<H", elf, 56)[0]
    segments = [struct.unpack_from("<I", elf, at + 56 * i)[0] for i in range(count)]
    assert LOAD in segments and INTERPRETER not in segments and not os.access(simulation, os.X_OK)
    script = f"import fmpy; print(fmpy.simulate_fmu({str(tmp_path)!r}, stop_time=5e-4, output=['drive'])['drive'][-1])"
    said = subprocess.run([sys.executable, "-c", script], env={"PATH": str(tmp_path)}, check=True, capture_output=True, text=True)
    assert said.stdout.split()[-1] == "1.0"

# SPDX-License-Identifier: MIT OR Apache-2.0
"""`takt fmu` in FMPy, a master of another maker: descriptions, values bit for bit those of `takt run`, states, mistakes."""

import csv
import ctypes
import json
import struct
import subprocess
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

TOOL = Path("target/release/takt")
LIBRARY = next((path for path in map(Path, ["target/release/libtakt_fmu.so", "target/release/deps/libtakt_fmu.so"]) if path.exists()), None)
pytestmark = pytest.mark.skipif(not TOOL.exists() or LIBRARY is None, reason="target/release has no takt or no libtakt_fmu.so")

# Ports and parameters of every type, and names that the FMU's own variables have.
LAW = """
.param  kp = 2.0 range 0..50
.param  K[2] = 1, 3
.param  bias:int = 0 range -100..100
.input  n:int, x, mask:bits, q[2]
.output duty, error:int, masked:bits, cycles, y[2]
.state  sum
.range  x = 0.5, 4
.range  n = -1000, 1000
.once
        mov     sum, zero
        mov     duty, zero
        mov     error, bias
        wait    period
.period
period: error = n + bias
        masked = xor(mask, 255)
        sum = sum + x
        duty = kp*K[2]*x + K[1] + sum
        cycles = x / q[1]
        y[1] = q[2]
        y[2] = sum
        wait    period
"""
PERIOD = 1e-3


def write(folder, program, *options, name="p.fmu"):
    file = folder / name
    command = [TOOL, "fmu", program, "-o", file, "--library", LIBRARY, *options]
    if "--period" not in options and not str(program).endswith(".toml"):
        command += ["--period", "1ms"]
    subprocess.run(command, check=True, capture_output=True, text=True)
    return file


class Master:
    """One instance with its log."""

    def __init__(self, file, folder, start=0.0, initialise=True):
        self.description = fmpy.read_model_description(str(file))
        unpacked = folder / (file.name + " unpacked")
        if not unpacked.exists():
            fmpy.extract(str(file), str(unpacked))
        self.messages = []
        self.is_two = self.description.fmiVersion == "2.0"
        identifier = self.description.coSimulation.modelIdentifier
        kind = FMU2Slave if self.is_two else FMU3Slave
        self.fmu = kind(guid=self.description.guid, unzipDirectory=str(unpacked), modelIdentifier=identifier, instanceName="one")
        if self.is_two:
            from fmpy.fmi2 import fmi2CallbackFunctions, fmi2CallbackLoggerTYPE

            callbacks = fmi2CallbackFunctions()
            callbacks.logger = fmi2CallbackLoggerTYPE(lambda *message: self.messages.append(message[4].decode()))
            self.fmu.instantiate(callbacks=callbacks, loggingOn=True)
        else:
            self.fmu.instantiate(loggingOn=True, logMessage=lambda *message: self.messages.append(message[3].decode()))
        self.start, self.time = start, start
        self.variables = {variable.name: variable for variable in self.description.modelVariables}
        if initialise:
            self.initialise()

    def initialise(self):
        if self.is_two:
            self.fmu.setupExperiment(startTime=self.start)
            self.fmu.enterInitializationMode()
        else:
            self.fmu.enterInitializationMode(startTime=self.start)
        self.fmu.exitInitializationMode()

    def set(self, **values):
        for name, value in values.items():
            variable = self.variables[name]
            getattr(self.fmu, "set" + variable.type)([variable.valueReference], [value])

    def get(self, name):
        variable = self.variables[name]
        return getattr(self.fmu, "get" + variable.type)([variable.valueReference])[0]

    def step(self, size=PERIOD):
        self.fmu.doStep(currentCommunicationPoint=self.time, communicationStepSize=size)
        self.time += size

    def fails(self, message, call):
        with pytest.raises(Exception):
            call()
        assert any(message in text for text in self.messages), (message, self.messages)
        self.messages.clear()

    def end(self):
        self.fmu.terminate()
        self.fmu.freeInstance()


@pytest.fixture
def law(tmp_path):
    source = tmp_path / "law & order.s"
    source.write_text(LAW)
    return source


@pytest.mark.parametrize("fmi", ["2", "3"])
@pytest.mark.parametrize(("program", "inputs"), [
    ("programs/examples/pi.s", "programs/examples/pi.csv"),
    ("programs/examples/foc.s", "programs/examples/foc.csv"),
    ("programs/hybrid/tracking.s", "programs/hybrid/tracking.csv"),
])
def test_runs_like_takt_run(tmp_path, program, inputs, fmi):
    """Every output of every period has the bits that `takt run` prints; cycles are equal."""
    file = write(tmp_path, program, "--fmi", fmi)
    assert validate_fmu(str(file)) == []
    said = subprocess.run([TOOL, "run", program, "--inputs", inputs, "--outputs", "-"], check=True, capture_output=True, text=True).stdout
    expected = list(csv.DictReader(said.splitlines()))
    rows = list(csv.DictReader(Path(inputs).read_text().splitlines()))
    assert len(rows) == len(expected) >= 300
    master = Master(file, tmp_path, initialise=False)
    parse = lambda name, text: int(text) if "Int" in master.variables[name].type else float(text)
    feed = lambda row: master.set(**{name: parse(name, text) for name, text in row.items() if name in master.variables})
    feed(rows[0])
    master.initialise()
    for row, results in zip(rows, expected):
        feed(row)
        master.step()
        for name, text in results.items():
            got = master.get(name)
            if "Int" in master.variables[name].type:
                assert got == int(text)
            else:
                assert struct.pack("<f", got) == struct.pack("<f", np.float32(text)), (name, got, text)
    assert master.get("missed") == 0 and master.messages == []
    master.end()


# A FIFO each way, a snapshot, wires, two rates, a parameter in each core.
SYSTEM = """
tick = 1000
[[core]]
name = "sum"
program = "sum.s"
machine = "t1"
[[core]]
name = "twice"
program = "twice.s"
tick = 2
offset = 990
[[wire]]
from = "host.x"
to = "sum.x"
[[wire]]
from = "sum.total"
to = "host.total"
[[snapshot]]
name = "seen"
from = "sum"
to = "twice"
ports = ["total"]
[[fifo]]
name = "in"
from = "host"
to = "sum"
depth = 2
ports = ["entry"]
pop = "done"
receiver = { empty = "empty" }
[[fifo]]
name = "out"
from = "twice"
to = "host"
depth = 4
ports = ["double", "count"]
push = "count"
"""
SUM = """
.param  gain = 1.0 range 0..10          ; N·m/rad
.input  x, entry                        ; rad, N·m
.input  empty:int
.output total                           ; N·m: so far
.output done:int
.state  s
.range  x = -8, 8
.once
        mov     s, gain
        mov     total, s
        wait    period
.period
period:
        s = s + gain*x
        mov     total, s
        bnz     empty, idle
        s = s + entry
        mov     total, s
        mov     done, zero
idle:   wait    period
"""
TWICE = """
.param  cycles:int = 5
.input  total
.output double
.output count:int
.state  n:int
.once
        mov     n, zero
        wait    period
.period
period: double = 2*total
        n = n + cycles
        count = n
        wait    period
"""


@pytest.fixture
def cores(tmp_path):
    for name, text in [("cores.toml", SYSTEM), ("sum.s", SUM), ("twice.s", TWICE)]:
        (tmp_path / name).write_text(text)
    return tmp_path / "cores.toml"


def compare_system(folder, system, rows, period, fmi, *parameters):
    """Every output of every base tick has the bits that `takt run` prints."""
    file = write(folder, system, "--fmi", fmi, *parameters, name=Path(system).stem + ".fmu")
    assert validate_fmu(str(file)) == []
    table = folder / "rows.csv"
    with table.open("w") as out:
        lines = csv.DictWriter(out, rows[0])
        lines.writeheader()
        lines.writerows(rows)
    command = [TOOL, "run", system, "--inputs", table, "--outputs", "-", *parameters]
    said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    expected = list(csv.DictReader(said.splitlines()))
    assert len(expected) == len(rows)
    master, entries = Master(file, folder), 0
    for row, results in zip(rows, expected):
        master.set(**row)
        master.step(period)
        for name, text in results.items():
            got, link = master.get(name), name.split(".")[0]
            if link + ".popped" in master.variables:
                assert master.get(link + ".popped") == (text != ""), name
                entries += text != ""
            if "Int" in master.variables[name].type:
                assert got == int(text or 0)
            else:
                assert struct.pack("<f", got) == struct.pack("<f", np.float32(text or 0)), (name, got, text)
    return master, entries


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_a_system_runs_like_takt_run(tmp_path, cores, fmi):
    random = np.random.default_rng(1)
    value = lambda: float(np.float32(random.uniform(-8, 8)))
    rows = [{"x": value(), "in.entry": value(), "in.push": int(random.integers(3)) // 2} for _ in range(300)]
    master, entries = compare_system(tmp_path, cores, rows, 8e-6, fmi, "--param", "twice.cycles=7")
    # Two fields in every second base tick.
    assert 290 <= entries <= 300 and master.get("out.count") % 7 == 0
    assert master.get("sum.missed") == 0 and 5 < master.get("sum.cycles") < 100 and master.get("takt.twice.cycles") > 3
    assert not master.messages
    master.end()
    rows = [{"moves.target": 3.0 * (i % 40), "moves.rate": 2.5, "moves.push": int(i % 40 == 0), "w": 0.3 * (i % 90)} for i in range(400)]
    master, _ = compare_system(tmp_path, "programs/systems/speed.toml", rows, PERIOD, fmi)
    assert [master.get(name + ".missed") for name in ("profile", "servo", "watch")] == [0, 0, 0]
    master.end()


def test_missed_ticks_of_a_system(tmp_path, cores):
    """At a short tick: the counts are those of `takt run`."""
    cores.write_text(SYSTEM.replace("tick = 1000", "tick = 40").replace("offset = 990", "offset = 30"))
    rows = [{"x": 1.0, "in.entry": 2.0, "in.push": 1}] * 200
    master, _ = compare_system(tmp_path, cores, rows, 40 / 125e6, "2")
    command = [TOOL, "run", cores, "--inputs", tmp_path / "rows.csv", "--json"]
    said = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    missed = [said["cores"][name]["deadlines_missed"] for name in ("sum", "twice")]
    assert missed[0] > 50 and [master.get(name + ".missed") for name in ("sum", "twice")] == missed
    assert any("core sum missed a tick" in text for text in master.messages)
    master.end()


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_a_system_in_a_master(tmp_path, cores, fmi):
    """FMPy's own loop; units, ranges and starts; states in bytes; full FIFOs."""
    file = write(tmp_path, cores, "--fmi", fmi)
    result = fmpy.simulate_fmu(str(file), stop_time=80e-6, start_values={"x": 1.0, "sum.gain": 2.0}, output=["total", "out.count"])
    assert list(result["total"]) == [2.0 + 2.0 * i for i in range(11)]
    one, two = Master(file, tmp_path), Master(file, tmp_path)
    real = "Real" if fmi == "2" else "Float32"
    shown = {v.name: (v.type, v.variability, v.start, v.min, v.max, v.unit) for v in one.description.modelVariables}
    assert shown["x"] == (real, "discrete", "0.0", "-8.0", "8.0", "rad")
    assert shown["sum.gain"] == (real, "tunable", "1.0", "0.0", "10.0", "N·m/rad")
    assert shown["total"][5] == "N·m" and shown["time"][5] == "s" and shown["out.double"][5] is None
    torque = {unit.name: unit.baseUnit for unit in one.description.unitDefinitions}["N·m"]
    assert (torque.kg, torque.m, torque.s, torque.A, float(torque.factor)) == (1, 2, -2, 0, 1.0)
    row = {"x": 0.25, "in.entry": 3.0, "in.push": 1}
    for _ in range(5):
        one.set(**row)
        one.step(8e-6)
    # The tick of `twice` came in the cycles before.
    busy = one.fmu.getFMUState()
    one.fails("the state has no bytes while core `twice` is within a period", lambda: one.fmu.serializeFMUState(busy))
    one.step(8e-6)
    state, time = one.fmu.getFMUState(), one.time
    data = one.fmu.serializeFMUState(state)

    def rest(master):
        master.time, found = time, []
        for i in range(20):
            master.set(**{"x": i / 8, "in.push": i % 2})
            master.step(8e-6)
            found.append([master.get(name) for name in master.variables if name != "time"])
        return found

    first = rest(one)
    one.fmu.setFMUState(state)
    assert rest(one) == first
    two.fmu.setFMUState(two.fmu.deserializeFMUState(data))
    assert rest(two) == first
    one.fails("51.0 is no value of `sum.gain`", lambda: one.set(**{"sum.gain": 51.0}))
    for master in (one, two):
        master.end()


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_simulate_fmu(tmp_path, law, fmi):
    """FMPy's own loop, with the step of the description."""
    file = write(tmp_path, law, "--fmi", fmi)
    assert validate_fmu(str(file)) == []
    result = fmpy.simulate_fmu(str(file), stop_time=0.1, start_values={"x": 1.0, "kp": 3.0, "q[1]": 0.5}, output=["y[2]", "duty", "cycles"])
    assert list(result["y[2]"][:4]) == [0, 1, 2, 3] and len(result) == 101
    assert list(result["duty"][:2]) == [0, 3 * 3 + 1 + 1] and result["cycles"][-1] == 2


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_description(tmp_path, law, fmi):
    """Types, ranges, starts, tunable parameters; what the FMU says about the period stands beside a port of the same name."""
    master = Master(write(tmp_path, law, "--fmi", fmi), tmp_path)
    shown = {v.name: (v.type, v.causality, v.variability, v.start, v.min, v.max) for v in master.description.modelVariables}
    real, integer, bits = ("Real", "Integer", "Integer") if fmi == "2" else ("Float32", "Int32", "UInt32")
    assert shown["kp"] == (real, "parameter", "tunable", "2.0", "0.0", "50.0")
    assert shown["bias"] == (integer, "parameter", "tunable", "0", "-100", "100")
    assert shown["K[2]"] == (real, "parameter", "tunable", "3.0", None, None)
    assert shown["x"] == (real, "input", "discrete", "0.5", "0.5", "4.0"), "0 lies outside of the range"
    assert shown["mask"] == (bits, "input", "discrete", "0", None, None)
    assert shown["cycles"] == (real, "output", "discrete", None, None, None)
    assert shown["takt.cycles"] == (integer, "output", "discrete", None, None, None)
    assert master.description.modelName == "law & order" and master.description.coSimulation.modelIdentifier == "law___order"
    assert float(master.description.defaultExperiment.stepSize) == PERIOD
    master.set(mask=0x1FF, x=2.0, n=-7, bias=9)
    master.step()
    assert (master.get("masked"), master.get("error"), master.get("y[2]")) == (0x100, 2, 2.0)
    # 2 / 0
    assert master.get("cycles") == float("inf") and master.get("flags") == 8
    cycles = master.get("takt.cycles")
    assert 10 < cycles < 200
    # Parameters between two steps; a step of several periods.
    master.set(kp=10.0, bias=-100)
    master.step(5 * PERIOD)
    assert (master.get("error"), master.get("y[2]")) == (-107, 12.0)
    assert master.get("duty") == 10 * 3 * 2 + 1 + 12 and master.get("missed") == 0
    master.end()


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_states_and_instances(tmp_path, law, fmi):
    """Two instances do not touch each other; a state, its bytes, and another instance that gets them go on alike."""
    # At this clock each period misses the next tick.
    file = write(tmp_path, law, "--fmi", fmi, "--clock", "0.01")
    one, two = Master(file, tmp_path), Master(file, tmp_path, start=1.0)
    one.set(x=1.0)
    two.set(x=3.0, kp=7.0)
    for _ in range(10):
        one.step()
        two.step()
    assert (one.get("y[2]"), two.get("y[2]")) == (10.0, 30.0)
    state, time = one.fmu.getFMUState(), one.time
    data = one.fmu.serializeFMUState(state)

    def rest(master):
        master.time = time
        found = []
        for i in range(20):
            master.set(x=1.0 + i / 10)
            master.step()
            found.append([master.get(name) for name in ("duty", "y[2]", "takt.cycles", "missed", "flags")])
        return found

    first = rest(one)
    assert [row[3] for row in first] == list(range(11, 31))
    one.fmu.setFMUState(state)
    assert one.get("y[2]") == 10.0 and rest(one) == first
    two.fmu.setFMUState(two.fmu.deserializeFMUState(data))
    assert two.get("kp") == 2.0 and rest(two) == first
    # As new, and before the initialisation.
    one.fmu.reset()
    fresh = one.fmu.getFMUState()
    one.time = one.start = 0.0
    one.initialise()
    one.set(x=1.0)
    one.step()
    assert one.get("y[2]") == 1.0
    one.fmu.setFMUState(fresh)
    one.time = 0.0
    one.fails("a step cannot be called before the initialisation", one.step)
    one.time = 0.0
    one.initialise()
    one.step()
    assert (one.get("y[2]"), one.get("missed")) == (0.5, 1)
    for tampered in [data[:-1], b"", b"TAKTFMU\x01", data[:40] + bytes([data[40] ^ 1]) + data[41:], b"X" + data[1:]]:
        two.fails("the state cannot be restored", lambda: two.fmu.deserializeFMUState(tampered))
    other = write(tmp_path, law, "--fmi", fmi, "--param", "kp=4", name="other.fmu")
    other = Master(other, tmp_path)
    other.fails("it belongs to another FMU", lambda: other.fmu.deserializeFMUState(data))
    one.fmu.freeFMUState(state)
    for master in (other, two):
        master.end()


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_mistakes(tmp_path, law, fmi):
    """Values out of range, wrong steps, faults: an error with a message, after which the instance can be reset."""
    master = Master(write(tmp_path, law, "--fmi", fmi), tmp_path)
    master.fails("51.0 is no value of `kp`: the source states the range 0.0 to 50.0", lambda: master.set(kp=51.0))
    master.fails("NaN is no value of `K[1]`: parameters are finite", lambda: master.set(**{"K[1]": float("nan")}))
    master.fails("-101 is no value of `bias`", lambda: master.set(bias=-101))
    master.fails("4.5 is no value of `x`", lambda: master.set(x=4.5))
    master.fails("`duty` cannot be set: it is neither an input nor a parameter", lambda: master.set(duty=1.0))
    getter, setter = (master.fmu.getReal, master.fmu.setReal) if fmi == "2" else (master.fmu.getFloat32, master.fmu.setFloat32)
    master.fails("no variable of this type has the value reference 99", lambda: getter([99]))
    master.fails("no variable of this type has the value reference 4294967295", lambda: setter([2**32 - 1], [0.0]))
    if fmi == "2":
        master.fails("1e39 is no value of `q[1]`: binary32 ends at", lambda: master.set(**{"q[1]": 1e39}))
    for size in (0.5e-3, 1.01e-3, 0.0, -1e-3, float("nan"), float("inf")):
        time = master.time
        master.fails("it must be a whole number of periods", lambda: master.step(size))
        master.time = time
    master.time = 0.1
    master.fails("a step from 0.1 s: the last one ended at 0 s", master.step)
    master.time = 0.0
    master.step()
    assert master.get("kp") == 2.0 and master.get("y[2]") == 0.5
    master.end()
    fault = tmp_path / "fault.s"
    fault.write_text(".input i:int\n.output v\n.once\n        mov v, zero\n        wait period\n.period\nperiod: ld v, t[i]\n        wait period\n.data\nt: .float 1, 2\n")
    master = Master(write(tmp_path, fault, "--fmi", fmi, name="fault.fmu"), tmp_path)
    master.set(i=1)
    master.step()
    assert master.get("v") == 2.0
    state = master.fmu.getFMUState()
    master.set(i=10**9)
    master.fails("period 1: ", master.step)
    master.fails("after the program has stopped", master.step)
    master.fails("after the program has stopped", master.fmu.getFMUState)
    master.fmu.setFMUState(state)
    master.time = PERIOD
    master.set(i=0)
    master.step()
    assert master.get("v") == 1.0
    master.end()


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_missed_ticks(tmp_path, law, fmi):
    """At a clock at which the period is too long, each period is counted, and the log says so."""
    master = Master(write(tmp_path, law, "--fmi", fmi, "--clock", "0.01"), tmp_path)
    master.step()
    master.step()
    assert master.get("missed") == 2 and "and the next tick comes after 10" in master.messages[0]
    master.end()


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_tampered_files(tmp_path, law, fmi):
    """Files of another FMU, damaged or missing ones: no instance, and a message."""
    file = write(tmp_path, law, "--fmi", fmi)
    assert write(tmp_path, law, "--fmi", fmi, name="again.fmu").read_bytes() == file.read_bytes()
    master = Master(file, tmp_path)
    unpacked = tmp_path / (file.name + " unpacked") / "resources"
    image, settings = unpacked / "program.takt", unpacked / "takt.json"
    for path, content, message in [
        (image, image.read_bytes()[:-100], "program.takt: the image is truncated or damaged"),
        (image, b"", "program.takt: this is not an image"),
        (settings, b'{"period": 2e-3, "tick": 125000}', "they belong to different FMUs"),
        (settings, b'{"period": -1, "tick": 125000}', "takt.json: the period must be more than 0 s"),
        (settings, b"{", "takt.json: "),
        (settings, None, "takt.json: No such file"),
    ]:
        before = path.read_bytes()
        path.unlink()
        if content is not None:
            path.write_bytes(content)
        messages = master.messages
        messages.clear()
        with pytest.raises(Exception):
            broken = Master.__new__(Master)
            Master.__init__(broken, file, tmp_path)
        assert any(message in text for text in broken.messages), (message, broken.messages)
        path.write_bytes(before)
    master.end()


def test_null_pointers(tmp_path, law):
    """A master that passes null gets an error, not a crash."""
    master = Master(write(tmp_path, law), tmp_path)
    library, instance = master.fmu.dll, master.fmu.component
    null, one = ctypes.c_void_p(None), (ctypes.c_uint * 1)(1)
    call = lambda name, *arguments: getattr(ctypes.CDLL(library._name), name)(*arguments)
    for name in ("fmi2DoStep", "fmi2GetReal", "fmi2SetReal", "fmi2GetFMUstate", "fmi3GetFloat32", "fmi3EnterEventMode"):
        assert call(name, null, null, null, null, null) == 3, name
    call("fmi2FreeInstance", null)
    instance, count = ctypes.c_void_p(instance), ctypes.c_size_t(1)
    for name in ("fmi2GetReal", "fmi2SetReal", "fmi2GetInteger", "fmi2SetInteger", "fmi2GetString"):
        assert call(name, instance, null, count, null) == 3, name
        assert call(name, instance, null, ctypes.c_size_t(0), null) == 0, name
    assert call("fmi2GetReal", instance, one, count, null) == 3
    for name in ("fmi2GetFMUstate", "fmi2SetFMUstate"):
        assert call(name, instance, null) == 3, name
    assert call("fmi2FreeFMUstate", instance, null) == 0
    assert call("fmi2GetDirectionalDerivative", instance) == 3
    assert any("this FMU does not offer fmi2GetDirectionalDerivative" in text for text in master.messages)
    assert call("fmi2Instantiate", null, 1, null, null, null, 0, 0) == 0
    master.end()


def test_the_command_line(tmp_path, law, cores):
    """Mistakes of the command line, and a library that is none."""
    def said(*options, system=law):
        done = subprocess.run([TOOL, "fmu", system, "-o", tmp_path / "x.fmu", *options], capture_output=True, text=True)
        assert done.returncode in (1, 2) and not (tmp_path / "x.fmu").exists()
        return done.stderr
    assert "--period" in said()
    assert "`.const T = 100e-6 ; s`" in said()
    assert "a period has 1 to 100000000" in said("--period", "10s")
    assert "no shared library for Linux or Windows" in said("--period", "1ms", "--library", law)
    twice = said("--period", "1ms", "--library", LIBRARY, "--library", LIBRARY)
    assert "two libraries are for Linux, and an FMU holds one for each platform" in twice
    (tmp_path / "other.so").write_bytes(LIBRARY.read_bytes().replace(b"fmi3DoStep", b"fmi9DoStep"))
    assert "it does not export fmi3DoStep" in said("--period", "1ms", "--library", tmp_path / "other.so")
    assert "no parameter `kq`" in said("--period", "1ms", "--param", "kq=1", "--library", LIBRARY)
    # The source states the period, 1 ms.
    command = [TOOL, "fmu", "programs/examples/pi.s", "-o", tmp_path / "stated.fmu", "--library", LIBRARY]
    subprocess.run(command, check=True, capture_output=True)
    assert float(fmpy.read_model_description(str(tmp_path / "stated.fmu")).defaultExperiment.stepSize) == PERIOD
    # Systems.
    wrong = lambda *options, system=cores: said(*options, "--library", LIBRARY, system=system)
    assert "--period cannot be used with a system: a step is its file's `tick`" in wrong("--period", "1ms")
    assert "--machine cannot be used with a system" in wrong("-m", "t1")
    assert "in a system it begins with `sum.`, `twice.`" in wrong("--param", "summ.gain=1")
    assert "no parameter `gian`" in wrong("--param", "sum.gian=1")
    (tmp_path / "twice.s").unlink()
    assert "there is no program twice.s" in wrong()
    assert "cannot" in wrong(system=tmp_path / "none.toml")
    names = zipfile.ZipFile(write(tmp_path, law)).namelist()
    assert names == ["modelDescription.xml", "resources/program.takt", "resources/takt.json", "binaries/linux64/law___order.so"]


MOTOR = '''
from pythonfmu import Fmi2Causality, Fmi2Slave, Real

class Motor(Fmi2Slave):
    """A motor's speed at a voltage."""
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u, self.w = 0.0, 0.0
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("w", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.w += step_size * (self.u * 8.0 - self.w) / 0.05
        return True
'''


def test_a_loop_with_a_plant_of_another_maker(tmp_path):
    """The PI controller holds the speed of a motor that pythonfmu made; the loop equals one in Python, bit for bit."""
    pythonfmu = pytest.importorskip("pythonfmu.builder")
    (tmp_path / "motor.py").write_text(MOTOR)
    plant_file = Path(pythonfmu.FmuBuilder.build_FMU(str(tmp_path / "motor.py"), dest=str(tmp_path)))
    controller, plant = Master(write(tmp_path, "programs/examples/pi.s"), tmp_path), Master(plant_file, tmp_path)
    controller.set(w_ref=100.0)
    w = 0.0
    for _ in range(1000):
        controller.set(w=plant.get("w"))
        controller.step()
        plant.set(u=controller.get("u"))
        plant.step()
        w += PERIOD * (controller.get("u") * 8.0 - w) / 0.05
        assert plant.get("w") == w
    assert abs(w - 100) < 0.1
    controller.end()
    plant.end()

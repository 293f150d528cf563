"""A board at a serial port: a board of this file's own behind a pseudo-terminal, by docs/protocol.md, and the circuit in Verilator."""

import os
import pty
import shutil
import struct
import subprocess
import threading
import tty
from pathlib import Path

import numpy as np
import pytest

import takt

GAIN = ".input x n:int\n.output y m:int\n.once\n mov y, zero\n mov m, zero\n wait loop\n.period\nloop: fmul y, x, 0.5\n iadd m, n, 1\n wait loop\n"
INPUTS, OUTPUTS, IMAGE, REGISTERS, DATA = 0x1000, 0x2000, 0x4000, 0x8000, 0xC000
CONTROL, STATUS, PERIOD, LEAD, STEP, PERIODS, RECORDS, STREAM, PAGE = 1, 2, 4, 5, 6, 9, 12, 13, 17
RUN, HOLD = 1, 2


def crc(data):
    """CRC-16/CCITT-FALSE, by its definition: the remainder of a division of polynomials."""
    value = 0xFFFF
    for bit in (byte >> i & 1 for byte in data for i in range(7, -1, -1)):
        value = (value << 1 & 0xFFFF) ^ (0x1021 if (value >> 15) ^ bit else 0)
    return value


def circuit(program):
    """The register `circuit`: FNV-1a of the machine and its latched inputs, of which these programs have none."""
    value = 0x811C9DC5
    for byte in f"{program.machine} 0".encode():
        value = (value ^ byte) * 0x01000193 & 0xFFFFFFFF
    return value


class FakeBoard(threading.Thread):
    """A board whose program is emulated."""

    def __init__(self, program):
        super().__init__(daemon=True)
        self.sim, self.stops, self.noise = program.sim(), False, b""
        self.words = {0: 0x544B0201, CONTROL: RUN, 15: 2048, 16: circuit(program)}
        self.fd, slave = pty.openpty()
        tty.setraw(slave)
        self.port = os.ttyname(slave)
        self.slave = slave
        # Number of the last write, and status of its answer; input ports that a peripheral drives.
        self.last, self.status, self.driven = None, 0, set()

    def run(self):
        pending = b""
        while not self.stops:
            try:
                pending += os.read(self.fd, 4096)
            except OSError:
                return
            while len(pending) >= 8:
                length = 8 + (4 * pending[3] if pending[2] == 2 else 0)
                if len(pending) < length:
                    break
                frame, pending = pending[:length], pending[length:]
                assert frame[0] == 0xA5 and crc(frame[1:-2]) == struct.unpack("<H", frame[-2:])[0]
                self.answer(frame)

    def send(self, kind, number, words, status=0):
        body = bytes([number, status, len(words)]) + struct.pack(f"<{len(words)}I", *words)
        os.write(self.fd, self.noise + bytes([kind]) + body + struct.pack("<H", crc(body)))
        self.noise = b""

    def answer(self, frame):
        number, command, count = frame[1:4]
        (at,) = struct.unpack("<H", frame[4:6])
        if command == 1:
            self.words.setdefault(STATUS, 0)
            # The core is in reset while it does not run.
            self.words[STATUS] = self.words[STATUS] & ~0x400 | (0 if self.words[CONTROL] & RUN else 0x400)
            words = [self.words.get(at + i, at + i if at >= REGISTERS else 0) for i in range(count)]
            return self.send(0x5A, number, words)
        if number != self.last:
            self.status = 0 if all(self.writable(at + i) for i in range(count)) else 1
            for i, word in enumerate(struct.unpack(f"<{count}I", frame[6:-2]) if self.status == 0 else []):
                self.words[at + i] = word
                if at + i == STEP:
                    self.period()
        self.last = number
        self.send(0x5A, number, [], self.status)
        if self.words.get(STREAM, 0) >> 20:
            for _ in range(3):
                self.period()

    def writable(self, at):
        control = self.words[CONTROL]
        if at == STEP:
            return bool(control & HOLD)
        if at == RECORDS or IMAGE <= at < REGISTERS:
            return not control & RUN
        return at in (CONTROL, PERIOD, LEAD, STREAM, PAGE) or INPUTS <= at < OUTPUTS and at not in self.driven

    def period(self):
        x, n = (self.words.get(INPUTS + i, 0) for i in range(2))
        values = self.sim.step({"x": np.uint32(x).view(np.float32), "n": np.uint32(n).view(np.int32)})
        self.words[OUTPUTS] = int(np.float32(values["y"]).view(np.uint32))
        self.words[OUTPUTS + 1] = values["m"] & 0xFFFFFFFF
        self.words[PERIODS] = self.words.get(PERIODS, 0) + 1
        stream = self.words.get(STREAM, 0)
        if stream >> 20:
            first, count = stream & 0xFFFF, stream >> 16 & 15
            words = [self.words.get(first + i, 0) for i in range(count)]
            self.send(0x3C, self.words[PERIODS] & 255, [self.words[PERIODS], *words])


@pytest.fixture
def fake():
    program = takt.assemble(GAIN, "t1")
    board = FakeBoard(program)
    board.start()
    yield board, program
    board.stops = True
    os.close(board.slave)
    os.close(board.fd)


def test_ports_are_read_and_set(fake):
    simulated, program = fake
    board = takt.Board(simulated.port, program)
    board.set({"x": 3.0, "n": np.int32(-7)})
    assert simulated.words[INPUTS] == 0x40400000 and simulated.words[INPUTS + 1] == 0xFFFFFFF9
    board.hold()
    assert simulated.words[CONTROL] == RUN | HOLD and board.status.state == "held"
    assert board.step({"x": -2.5}) == {"y": -1.25, "m": -6}
    assert board.read() == {"x": -2.5, "n": -7, "y": -1.25, "m": -6}
    assert board.status.periods == 1
    # Registers without a port have addresses of their own: here, the address is a number.
    simulated.words |= {REGISTERS + 3: 0x3F800000, DATA + 9: 0x40000000}
    assert board.read("@r3", "[9]") == {"@r3": 1.0, "[9]": 2.0}
    board.go()
    board.stop()
    assert simulated.words[CONTROL] == 0 and not board.status.drives


def test_a_port_that_a_peripheral_drives_is_read_only(fake):
    simulated, program = fake
    board = takt.Board(simulated.port, program)
    simulated.driven = {INPUTS + 1}
    board.set({"x": 2.0})
    with pytest.raises(takt.BoardError, match="refuses to write 2 words from address 0x1000"):
        board.set({"x": 3.0, "n": 4})
    assert simulated.words[INPUTS] == 0x40000000, "all or none"


def test_a_program_is_loaded_and_compared(fake):
    simulated, program = fake
    board = takt.Board(simulated.port, program)
    board.load()
    records = simulated.words[RECORDS]
    assert records > 0 and all(IMAGE + 4 * i + 2 in simulated.words for i in range(records))
    # An answer is found even after noise.
    simulated.noise = b"\x00\x5a\x01\xff\xa5"
    assert board.status.state == "stopped"
    assert board.status.corrections == 0
    simulated.words |= {STATUS: 4 | 3 << 12 | 255 << 24, 3: 2 << 16 | 17}
    status = board.status
    assert (status.state, status.causes, status.fault) == ("stopped with a fault", ("fault", "halt"), (17, "data address"))
    assert status.corrections == 255


def test_a_stream_has_periods_and_values(fake):
    simulated, program = fake
    board = takt.Board(simulated.port, program)
    board.set({"x": 4.0, "n": 1})
    frames = list(board.stream(["m", "y"], every=1, count=3))
    assert [values for _, values in frames] == [{"m": 2, "y": 2.0}] * 3
    assert [period for period, _ in frames] == [1, 2, 3]
    assert simulated.words[STREAM] == 0, "it is ended"


def test_what_is_wrong_is_said(fake, tmp_path):
    simulated, program = fake
    with pytest.raises(takt.BoardError, match="cannot open"):
        takt.Board(tmp_path / "nothing", program)
    with pytest.raises(ValueError, match="baud is"):
        takt.Board(simulated.port, program, baud=10**9)
    board = takt.Board(simulated.port, program)
    with pytest.raises(ValueError, match="no input `z`"):
        board.set({"z": 1})
    with pytest.raises(ValueError, match="no input `y`"):
        board.set({"y": 1})
    with pytest.raises(ValueError, match="one number"):
        board.set({"x": [1.0, 2.0]})
    with pytest.raises(ValueError, match="NaN"):
        board.set({"x": float("nan")})
    with pytest.raises(ValueError, match="no port, register or data word `nothing`"):
        board.read("nothing")
    with pytest.raises(ValueError, match="consecutive numbers"):
        next(board.stream(["x", "y"]))
    with pytest.raises(ValueError, match="4095 at most"):
        board.stream(["y"], every=5000)
    with pytest.raises(takt.BoardError, match="not held"):
        board.step()
    simulated.words[16] ^= 1
    with pytest.raises(takt.BoardError, match="circuit is that of another program or system"):
        takt.Board(simulated.port, program)
    simulated.words[0] = 0x544B0203
    with pytest.raises(takt.BoardError, match="number of cores: 3 on the board, 1 in the program or system"):
        takt.Board(simulated.port, program)
    simulated.words[0] = 0x544B0101
    with pytest.raises(takt.BoardError, match="version 1 of the protocol"):
        takt.Board(simulated.port, program)
    simulated.words[0] = 7
    with pytest.raises(takt.BoardError, match="not a board of Takt"):
        takt.Board(simulated.port, program)


def test_the_circuit_in_verilator(tmp_path):
    """The complete top level, which `takt board sim` runs behind a pseudo-terminal."""
    tool = Path("target/release/takt")
    if not tool.exists() or shutil.which("verilator") is None:
        pytest.skip("neither target/release/takt nor Verilator is there")
    source = tmp_path / "gain.s"
    source.write_text(GAIN)
    (tmp_path / "w.toml").write_text("clock = 50\nperiod = 100\nbaud = 5_000_000\n[scope]\nchannels = 2\ndepth = 32\n")
    command = [tool, "board", "sim", "--board", "ulx3s-85f", "--wiring", tmp_path / "w.toml", "--program", source, "--machine", "t1"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as sim:
        try:
            port, baud = sim.stdout.readline().split()
            program = takt.assemble(GAIN, "t1")
            board = takt.Board(port, program, baud=int(baud))
            board.load()
            board.hold()
            board.start()
            expected = program.run({"x": [1.5, -3.25, 1e-42], "n": [5, -1, 2**31 - 1]})
            for i, (x, n) in enumerate([(1.5, 5), (-3.25, -1), (1e-42, 2**31 - 1)]):
                assert board.step({"x": x, "n": n}) == {"y": expected.outputs["y"][i], "m": expected.outputs["m"][i]}
            assert board.status.state == "held" and board.status.misses == 0 and board.read("[0]") == {"[0]": 0.0}
            board.go()
            frames = list(board.stream(["y", "m"], every=2, count=4))
            assert [period - frames[0][0] for period, _ in frames] == [0, 2, 4, 6]
            recording = board.scope(["y", "m"], samples=10)
            assert list(recording.periods - recording.periods[0]) == list(range(10)) and recording.causes == ("the host",)
            assert recording.values["y"].dtype == np.float32 and (recording.values["m"] == -(2**31)).all()
            board.arm(["m", "x"], trigger="m rises 7", every=2, samples=8, before=3)
            with pytest.raises(takt.BoardError, match="waits for its trigger"):
                board.recording()
            # A comparison waits for the samples before it.
            armed = board.status.periods
            while board.status.periods < armed + 8:
                pass
            board.set({"n": 41})
            while not board.recorded:
                pass
            recording = board.recording()
            assert recording.trigger == 3 and list(np.diff(recording.periods)) == [2] * 7
            assert list(recording.values["m"]) == [-(2**31)] * 3 + [42] * 5 and recording.causes == ("`m rises 7`",)
            with pytest.raises(ValueError, match="3 channels are asked for; the board's scope has 2"):
                board.arm(["x", "y", "m"])
            with pytest.raises(ValueError, match="`often` is not a trigger"):
                board.arm(["x"], trigger="often")
            with pytest.raises(takt.BoardError, match="no recording within 0.2 s"):
                board.scope(["x"], trigger="x > 1e30", timeout=0.2)
            board.stop()
            assert board.status.state == "stopped"
        finally:
            sim.terminate()


def test_a_system_in_verilator(tmp_path):
    """The example of three cores: inputs, FIFOs, each core's state."""
    tool, axis = Path("target/release/takt"), Path("programs/examples/board/axis")
    if not tool.exists() or shutil.which("verilator") is None:
        pytest.skip("neither target/release/takt nor Verilator is there")
    command = [tool, "board", "sim", "--wiring", axis / "wiring.toml", "--program", axis / "axis.toml"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as sim:
        try:
            port, baud = sim.stdout.readline().split()
            board = takt.Board(port, axis / "axis.toml", baud=int(baud))
            assert list(board.inputs) == ["n", "limit"] and "servo.error" in board.outputs
            board.set({"limit": 2.5})
            assert board.push("moves", {"target": 4.0, "rate": 4.0})
            while (entry := board.pop("reached")) is None:
                pass
            assert entry == {"there": 4.0} and board.read("profile.wanted", "limit") == {"profile.wanted": 4.0, "limit": 2.5}
            assert list(board.statuses) == ["profile", "servo", "watch"]
            assert all(status.state == "runs" and status.drives for status in board.statuses.values())
            with pytest.raises(ValueError, match="has the fields target, rate"):
                board.push("moves", {"target": 1.0})
            with pytest.raises(ValueError, match="no FIFO `nothing` to the host"):
                board.pop("nothing")
            with pytest.raises(takt.BoardError, match="number of cores: 3 on the board, 1"):
                takt.Board(port, takt.assemble(GAIN, "t1"), baud=int(baud))
        finally:
            sim.terminate()

"""A program, or a system of several cores, on a board, over its serial port."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from takt import _takt
from takt._errors import BoardError
from takt._exclusive import exclusive
from takt._ports import KEPT, AnyPath, Port, count_of, mapping_of, near, path_of, value_of, word_of
from takt._program import Program

#: Maximum number of periods between two frames of a stream.
_EVERY = 4095
#: Maximum baud rate, in bits per second.
_BAUD = 12_000_000
#: Pause between two questions whether a recording is done, in seconds.
_PAUSE = 0.05
#: Time without a frame after which a stream has ended, in tenths of a second.
_SILENCE = 50


def _words(what: str, value: int | None, least: int) -> int | None:
    """A count for the board, whose own limits are lower than a word's."""
    count = count_of(what, value, least)
    return None if count is None else min(count, 0xFFFF_FFFF)


def _samples(kind: str, bits: list[int | None]) -> np.ndarray:
    """Samples of a channel as an array of its type."""
    words = np.array([word or 0 for word in bits], dtype=np.uint32)
    missing = np.array([word is None for word in bits])
    if kind == "float":
        floats = words.view(np.float32)
        floats[missing] = np.nan
        return floats
    values: np.ndarray = words.view(np.int32) if kind == "int" else words
    return np.ma.masked_array(values, missing) if missing.any() else values


@dataclass(frozen=True)
class BoardStatus:
    """The state of a core."""

    #: Activity: `runs`, `held`, `stopped`, `halted` or `stopped with a fault`.
    state: str
    #: Whether the outputs drive; otherwise they are at their safe levels.
    drives: bool
    #: Causes of safe outputs: `fault`, `halt`, `missed deadline`, `host silent`, `stop`, `NaN output`, `trip`, `cores differ`, `memory error`.
    causes: tuple[str, ...]
    #: Bundle and kind of a fault; None without a fault.
    fault: tuple[int, str] | None
    #: Since the start: periods, missed deadlines, and the cycles from tick to outputs in the last period and at most. Since power-up:
    #: frames that were dropped (`errors`), and frames of the stream that were not sent (`lost`).
    periods: int
    misses: int
    cycles: int
    most_cycles: int
    errors: int
    lost: int
    #: Since the start: words of memories that error correction has mended, at most 255.
    corrections: int


@dataclass(frozen=True)
class Recording:
    """Samples that a board's scope has recorded, of every `every`-th period, around the trigger."""

    #: The period of each sample, counted from the program's start.
    periods: np.ndarray
    #: The samples of each channel, by name: float32 or int32 (uint32 for bits). Where a float has no value yet, NaN stands; other types
    #: are masked there.
    values: dict[str, np.ndarray]
    #: Index of the trigger's sample, and the period in which it was triggered; None if the recording was ended without.
    trigger: int | None
    trigger_period: int | None
    #: Causes of the trigger, in words.
    causes: tuple[str, ...]
    #: The last sample has the values that the program left when it stopped, in mid-period.
    stopped: bool


@exclusive("a lock around its calls lets threads take turns")
class Board:
    """A board that carries a circuit from `takt board build` (docs/board.md):

        board = takt.Board("/dev/ttyUSB0", program, baud=1_000_000)
        board.load()
        board.start()
        board.set({"wanted": 52})
        for period, values in board.stream(["force"], every=10, count=100):
            ...

    Ports are read and set. Registers, by their name in the source or their place (`@m12`), and data words (`table[3]`) are only read.
    In a system, names are `core.name`, and the inputs are the values of links that the host drives.
    """

    #: Program, or path of a system's file, whose names are used. Only `load` ensures that the board carries it.
    program: Program | Path
    #: Inputs that the host sets, and output ports of the cores, by name.
    inputs: dict[str, Port]
    outputs: dict[str, Port]

    def __init__(self, port: AnyPath, program: Program | AnyPath, *, baud: int = 115_200) -> None:
        """Opens a serial port, or the pseudo-terminal that `takt board sim` prints.

        Args:
            port: The serial port.
            program: The program that runs there, or is to be loaded; or the path of the file of a system of several cores, whose
                sources are assembled.
            baud: Bits per second, as in the wiring.

        Raises:
            BoardError: there is no such port, nothing answers, or the device that answers is not a board with a circuit for this program
                or system.
            AssemblyError: mistakes in the system's file, or in a program of it.
        """
        rate = count_of("baud", baud) or 0
        if rate > _BAUD:
            raise ValueError(f"baud is {rate}: it is {_BAUD} at most")
        where = path_of("port", port)
        self.program = program if isinstance(program, Program) else path_of("program", program)
        if isinstance(self.program, Program):
            self._core = _takt.Board(where, self.program._core, None, rate)
        else:
            self._core = _takt.Board(where, None, self.program, rate)
        inputs, outputs = self._core.ports()
        self.inputs = {name: Port(name, kind) for name, kind in inputs}
        self.outputs = {name: Port(name, kind) for name, kind in outputs}

    @property
    def status(self) -> BoardStatus:
        """The state of the program, or of a system's first core, and counters."""
        return self._status(0)

    @property
    def statuses(self) -> dict[str, BoardStatus]:
        """The state of each core, by its name; a single program's is empty."""
        return {name: self._status(core) for core, name in enumerate(self._core.cores())}

    def _status(self, core: int) -> BoardStatus:
        state, drives, causes, fault, counters = self._core.status(core)
        return BoardStatus(state, drives, tuple(causes), fault, **dict(counters))

    def push(self, fifo: str, entry: Mapping[str, ArrayLike]) -> bool:
        """Puts an entry into a FIFO of a system, from the host: a value for each field.

        Returns:
            False if the FIFO is full; then nothing is put in.

        Raises:
            BoardError: the system is stopped.
            ValueError: there is no such FIFO, or a field or value does not fit.
        """
        fields = {name: Port(name, kind) for name, kind in self._core.fields(fifo, False)}
        given = mapping_of("entry", entry)
        if set(given) != set(fields):
            raise ValueError(f"an entry of `{fifo}` has the fields {', '.join(fields)}")
        return self._core.push(fifo, [word_of(name, given[name], port) for name, port in fields.items()])

    def pop(self, fifo: str) -> dict[str, float | int] | None:
        """Takes an entry out of a FIFO of a system, to the host; `None` if it is empty.

        Raises:
            BoardError: the system is stopped.
            ValueError: there is no such FIFO.
        """
        fields = self._core.fields(fifo, True)
        words = self._core.pop(fifo)
        return None if words is None else {name: value_of(kind, bits) for (name, kind), bits in zip(fields, words)}

    def load(self) -> None:
        """Stops the board's program and loads this one, which is read back and compared. It stays until power-off. The program does not
        start, and is no longer held."""
        self._core.load()

    def start(self) -> None:
        """Starts the program from its beginning; outputs drive with the end of its first period. If it was held, it is held there."""
        self._core.control("start")

    def stop(self) -> None:
        """Stops the program; outputs are safe."""
        self._core.control("stop")

    def hold(self) -> None:
        """No more ticks: the program waits at the end of its period. Outputs keep what they drive."""
        self._core.control("hold")

    def go(self) -> None:
        """Lets the program run on after `hold`."""
        self._core.control("go")

    def step(self, inputs: Mapping[str, ArrayLike] = KEPT) -> dict[str, float | int]:
        """Sets inputs and runs one period, while the program is held.

        Returns:
            The outputs after it, by port.

        Raises:
            BoardError: the program is not held, or does not come to its `wait`.
        """
        self.set(mapping_of("inputs", inputs))
        self._core.step()
        return self.read(*self.outputs)

    def read(self, *names: str) -> dict[str, float | int]:
        """Values by name, read between two periods or when the program has stopped; without names, those of all ports. Elements of
        arrays have the indices of the source (`M[2,3]`); the name of an array stands for all of them.

        Raises:
            BoardError: the program does not wait for its tick.
            ValueError: there is no such name.
        """
        each = [element for name in names for element in self._core.elements(name)]
        wanted = each or [*self.inputs, *self.outputs]
        return {name: value_of(*value) for name, value in zip(wanted, self._core.read(wanted))}

    def set(self, values: Mapping[str, ArrayLike]) -> None:
        """Sets input ports between two periods; those with consecutive numbers, up to 16, change together.

        Raises:
            BoardError: the program does not wait for its tick.
            ValueError: a name or value that does not fit; then nothing is set.
        """
        words: list[tuple[str, int]] = []
        for name, value in mapping_of("values", values).items():
            port = self.inputs.get(name)
            if port is None:
                raise ValueError(f"there is no input `{name}`{near(name, list(self.inputs))}")
            words.append((name, word_of(name, value, port)))
        self._core.set(words)

    def arm(
        self,
        names: list[str],
        *,
        trigger: str | Sequence[str] = (),
        every: int = 1,
        samples: int | None = None,
        before: int | None = None,
    ) -> None:
        """Arms the board's scope, which records registers and ports in every period without a cycle of the program. `recording` reads it.

        Args:
            names: Channels: registers and ports of one core by name; `x:57` is what line 57 of the source writes.
            trigger: `x >= 1.5` (or >, <, <=, ==), `x rises 1.5`, `x falls 1.5`, `x changes`, `fault`, `miss`, `trip`, `safe`; one
                comparison at most. Without any, the recording begins at once.
            every: Periods from one sample to the next, up to 4095.
            samples: How many; without it, as many as the board's scope has.
            before: Samples before the trigger's; without it, a quarter, or none without a trigger.

        Raises:
            BoardError: the board has no scope.
            ValueError: a name or trigger that does not fit, or more than the board's scope has.
        """
        periods = count_of("every", every) or 1
        if periods > _EVERY:
            raise ValueError(f"every is {periods}: it is {_EVERY} at most")
        triggers = [trigger] if isinstance(trigger, str) else list(trigger)
        self._core.arm(list(names), triggers, periods, _words("samples", samples, 1), _words("before", before, 0))

    @property
    def recorded(self) -> bool:
        """Whether the scope's recording is complete."""
        return self._core.is_recorded()

    def recording(self) -> Recording:
        """Reads what the scope has recorded since `arm`.

        Raises:
            BoardError: it is not armed, or not done.
        """
        periods, trigger, causes, stopped, channels = self._core.recording()
        values = {name: _samples(kind, bits) for name, kind, bits in channels}
        index, period = trigger or (None, None)
        return Recording(np.array(periods, dtype=np.uint32), values, index, period, tuple(causes), stopped)

    def scope(
        self,
        names: list[str],
        *,
        trigger: str | Sequence[str] = (),
        every: int = 1,
        samples: int | None = None,
        before: int | None = None,
        timeout: float | None = None,
    ) -> Recording:
        """Records with the board's scope: arms it, waits, and reads. Arguments are those of `arm`.

        Args:
            timeout: Seconds to wait; without it, until the recording is done. The scope stays armed.

        Raises:
            BoardError: the board has no scope, the program has no periods, or the time is over.
            ValueError: as of `arm`.
        """
        self.arm(names, trigger=trigger, every=every, samples=samples, before=before)
        end = None if timeout is None else time.monotonic() + timeout
        while not self.recorded:
            if self.status.state in ("stopped", "halted", "stopped with a fault") and not self.recorded:
                raise BoardError("the program has stopped before the trigger: trigger='fault' records what leads to it")
            if end is not None and time.monotonic() > end:
                raise BoardError(f"no recording within {timeout} s: the scope stays armed, and `recording` reads it later")
            time.sleep(_PAUSE)
        return self.recording()

    def stream(
        self, names: list[str], *, every: int = 1, count: int | None = None
    ) -> Iterator[tuple[int, dict[str, float | int]]]:
        """Values that the board sends by itself, each time with the number of the period. The names must lie within 15 consecutive ports,
        registers or data words.

        Args:
            names: As for `read`.
            every: Periods from one frame to the next, up to 4095. Frames for which the line has no time are left out, and counted in
                `status.lost`.
            count: How many frames; without it, until the iterator is closed.

        Raises:
            BoardError: no frame comes: the program has no periods any more.
        """
        periods = count_of("every", every) or 1
        if periods > _EVERY:
            raise ValueError(f"every is {periods}: it is {_EVERY} at most")
        return self._frames(list(names), periods, count_of("count", count))

    def _frames(self, names: list[str], every: int, count: int | None) -> Iterator[tuple[int, dict[str, Any]]]:
        kinds = self._core.stream(names, every)
        try:
            seen, silent = 0, 0
            while count is None or seen < count:
                frame = self._core.frame()
                silent = 0 if frame else silent + 1
                if silent == _SILENCE:
                    raise BoardError(f"the stream ended after {seen} frames: the program has no periods any more")
                if frame:
                    seen += 1
                    period, words = frame
                    yield period, {name: value_of(kind, bits) for name, kind, bits in zip(names, kinds, words)}
        finally:
            self._core.quiet()

"""A system of several cores, base tick by base tick."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from numpy.typing import ArrayLike

from takt import _takt
from takt._errors import FaultError
from takt._exclusive import exclusive
from takt._ports import KEPT, AnyPath, Port, mapping_of, near, path_of, value_of, word_of
from takt._progress import progress


@dataclass(frozen=True)
class CorePeriods:
    """Figures of a core's periods so far."""

    #: Number of completed periods.
    count: int
    #: Cycles of the shortest and of the longest period; 0 if there was none.
    shortest: int
    longest: int
    #: Ticks for which the core took no snapshot because it did not reach its `wait` in time.
    skipped: int


@exclusive("`takt.System(path)` makes a system for each thread")
class System:
    """Cores and links as a system's file describes them (docs/system.md), with Python as the host:

        system = takt.System("speed.toml")
        system.push("moves", {"target": 80.0, "rate": 0.5})
        for k in range(1000):
            out = system.step({"w": w})
            w = plant(w, out["u"])

    Values are exact to the bit and to the cycle: those of `takt run speed.toml`.

    Args:
        path: The file. Programs are looked for beside it.

    Raises:
        AssemblyError: the file or a program has errors, with places.
        OSError: the file cannot be read.
        ValueError: no core comes to a tick.
    """

    #: Inputs and outputs by name: `w` for a wire, `seen.peak` for a snapshot. Fields of FIFOs are in `pushes` and `pops`.
    inputs: dict[str, Port]
    outputs: dict[str, Port]
    #: FIFOs from the host and to the host, with their fields.
    pushes: dict[str, dict[str, Port]]
    pops: dict[str, dict[str, Port]]

    def __init__(self, path: AnyPath) -> None:
        file = path_of("path", path)
        with progress(f"building {file.name}"):
            self._core = _takt.SystemSim(file)
        ins, outs = self._core.ports()
        self.inputs = {name: Port(name, kind) for name, kind in ins}
        self.outputs = {name: Port(name, kind) for name, kind in outs}
        pushes, pops = self._core.fifos()
        self.pushes = {fifo: {name: Port(name, kind) for name, kind in self._core.fields(fifo, False)} for fifo in pushes}
        self.pops = {fifo: {name: Port(name, kind) for name, kind in self._core.fields(fifo, True)} for fifo in pops}

    def step(self, inputs: Mapping[str, ArrayLike] = KEPT) -> dict[str, float | int]:
        """Writes inputs and runs a base tick.

        Args:
            inputs: Values by name; one that is not given keeps its value, at first 0. They are written so early that the periods which
                begin with this tick read them. All snapshots from the host are published.

        Returns:
            The outputs as the host sees them when it would write for the next tick.

        Raises:
            FaultError: a core has stopped; `fault.run` is its number, and the system stays where it is until `reset`.
            ValueError: a name or value that does not fit.
        """
        words = []
        for name, value in mapping_of("inputs", inputs).items():
            port = self.inputs.get(name)
            if port is None:
                raise ValueError(f"the system has no input `{name}`{near(name, list(self.inputs))}")
            words.append((name, word_of(name, value, port, f" of tick {self.ticks}")))
        found = self._core.step(words)
        return self._shown(self._checked(found))

    def push(self, fifo: str, entry: Mapping[str, ArrayLike]) -> bool:
        """Puts an entry into a FIFO from the host: a value for each field. False if it does not fit.

        Raises:
            ValueError: there is no such FIFO, or a field or value does not fit.
        """
        given = mapping_of("entry", entry)
        fields = self.pushes.get(fifo) or {name: Port(name, kind) for name, kind in self._core.fields(fifo, False)}
        if set(given) != set(fields):
            raise ValueError(f"an entry of `{fifo}` has the fields {', '.join(fields)}")
        return self._core.push(fifo, [word_of(name, given[name], port) for name, port in fields.items()])

    def pop(self, fifo: str) -> dict[str, float | int] | None:
        """Takes an entry out of a FIFO to the host; None if it is empty.

        Raises:
            ValueError: there is no such FIFO.
        """
        words = self._core.pop(fifo)
        return None if words is None else {name: value_of(port.type, bits) for (name, port), bits in zip(self.pops[fifo].items(), words)}

    def reset(self) -> None:
        """Back to the state after loading, before the first tick."""
        self._core.reset()
        self._checked([])

    def _checked(self, found: list[int] | None) -> list[int]:
        fault = self._core.failure
        if fault is not None or found is None:
            raise RuntimeError("the system has stopped") if fault is None else FaultError(fault)
        return found

    def _shown(self, words: list[int]) -> dict[str, float | int]:
        return {name: value_of(port.type, bits) for (name, port), bits in zip(self.outputs.items(), words)}

    @property
    def values(self) -> dict[str, float | int]:
        """The outputs now, as `step` gives them."""
        return self._shown(self._core.read())

    @property
    def cores(self) -> dict[str, int]:
        """Cores: name, and cycles from tick to tick."""
        return dict(self._core.cores())

    @property
    def periods(self) -> dict[str, CorePeriods]:
        """Figures of each core's periods since reset."""
        return {name: CorePeriods(*figures) for name, figures in zip(self.cores, self._core.periods())}

    @property
    def tick(self) -> int:
        """Cycles from base tick to base tick."""
        return self._core.tick

    @property
    def ticks(self) -> int:
        """Base ticks since reset."""
        return self._core.ticks

    @property
    def now(self) -> int:
        """Cycles since reset."""
        return self._core.now

    def __reduce__(self) -> Any:
        raise TypeError("a System can be neither pickled nor copied: make another one of its file")

    def __repr__(self) -> str:
        return f"<takt.System of {', '.join(self.cores)}: {self.ticks} ticks, ({', '.join(self.inputs)}) -> ({', '.join(self.outputs)})>"

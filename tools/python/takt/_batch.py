"""Many machines with the same program in them, period by period."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from takt import _takt
from takt._errors import FaultError
from takt._exclusive import exclusive
from takt._ports import KEPT, Port, count_of, mapping_of, near, numbers, words_of
from takt._results import flags_of

if TYPE_CHECKING:
    from takt._program import Program

#: Plant function: receives the machines' outputs and the number of the period, from 0; returns their next inputs.
Plant = Callable[[dict[str, NDArray[Any]], int], Mapping[str, ArrayLike]]


@dataclass(frozen=True)
class Loops:
    """Closed loops that have run."""

    #: Recorded outputs by name, of shape (runs, periods); an array of ports adds its dimensions after these.
    outputs: dict[str, NDArray[Any]]
    #: Recorded inputs, likewise; an element without effect, which has no port, is 0.
    inputs: dict[str, NDArray[Any]]
    #: Cycles of each period; int64 of shape (runs, periods).
    cycles: NDArray[np.int64]


@exclusive("`program.batch(runs)` makes machines for each thread")
class Batch:
    """Closed loops of many runs, in one call or period by period:

        batch = program.batch(1000)
        loops = batch.close(plant, 5000, {"q": q, "kp": gains, "qr": 0.5}, record=["q"])

    Values are arrays of shape (runs,), or of an array of ports (runs, 6); one without the runs is the same for all. Every run has the
    outputs and the cycles that it would have alone.
    """

    def __init__(self, program: Program, runs: int, tick: int | None, max_cycles: int) -> None:
        self.program = program
        self.runs = count_of("runs", runs) or 1
        self._core = _takt.Lanes(program._core, list(program._data.values()), self.runs, tick, max_cycles)
        self._inputs = np.zeros((len(program.inputs), self.runs), np.uint32)
        self._outputs = np.zeros((len(program.outputs) + len(program._data), self.runs), np.uint32)
        self._cycles = np.zeros(self.runs, np.uint64)
        self._missed = np.zeros(self.runs, np.uint64)
        rows = {name: row for row, name in enumerate(program.inputs)}
        # For each input and array of inputs: shape, indices of the elements with ports, their rows, and the port of a single input.
        self._wanted: dict[str, tuple[tuple[int, ...], list[int], list[int], Port | None]] = {}
        for name, row in rows.items():
            self._wanted[name] = ((), [0], [row], program.inputs[name])
        for array in program.input_arrays:
            places = [(index, element) for index, element in enumerate(array.elements) if isinstance(element, str)]
            port = program.inputs[places[0][1]] if places else None
            wanted = [rows[element] for _, element in places]
            self._wanted[array.name] = (array.shape, [index for index, _ in places], wanted, port)
        self._floats: list[int] | slice = [row for name, row in rows.items() if program.inputs[name].type == "float"]
        if len(self._floats) == len(rows):
            self._floats = slice(None)
        self._given = np.zeros(len(rows), bool)
        self._complete = False
        ports = [*program.outputs, *program._data]
        self._read: list[tuple[str, tuple[int, ...], list[tuple[int, int]], NDArray[np.float32]]] = []
        for array in program.output_arrays:
            taken = [(index, ports.index(element)) for index, element in enumerate(array.elements) if isinstance(element, str)]
            fixed = np.array([element if isinstance(element, float) else 0.0 for element in array.elements], np.float32)
            self._read.append((array.name, array.shape, taken, fixed))

    def _set(self, inputs: Mapping[str, ArrayLike]) -> None:
        """Takes inputs, all of them or, with an error, none."""
        words, when = self._inputs.copy(), f" of period {self._core.periods}"
        floats, seen = words.view(np.float32), list[int]()
        for name, value in inputs.items():
            wanted = self._wanted.get(name)
            if wanted is None:
                raise ValueError(f"the program has no input `{name}`{near(name, list(self._wanted))}")
            shape, places, rows, port = wanted
            values = numbers(f"`{name}`", value, when)
            if values.shape != shape and values.shape != (self.runs, *shape):
                raise ValueError(f"`{name}` has shape {values.shape}, not {(self.runs, *shape)} nor {shape}")
            if port is None:
                continue
            into: NDArray[Any] = floats
            if port.type != "float":
                into, values = words, words_of(f"`{name}`", port, values, when)
            if shape:
                flat = values.reshape(*values.shape[: values.ndim - len(shape)], -1)
                flat = flat if len(places) == flat.shape[-1] else flat[..., places]
                into[rows] = flat.T if flat.ndim == 2 else flat[:, None]
            else:
                into[rows[0]] = values
            seen += rows
        # Check all values at once; find out which is wrong only if one is.
        if not np.isfinite(floats[self._floats]).all():
            for name, value in inputs.items():
                port = self._wanted[name][3]
                if port is not None:
                    words_of(f"`{name}`", port, numbers(f"`{name}`", value, when), when)
        if len(seen) != len(set(seen)):
            raise ValueError("an input is given twice: by itself and in an array")
        if not self._complete:
            given = self._given.copy()
            given[seen] = True
            missing = [f"`{name}`" for name, there in zip(self.program.inputs, given) if not there]
            if missing:
                raise ValueError(f"no value for {', '.join(missing)}: the first step needs every input")
            self._complete = True
        self._inputs = words

    def step(self, inputs: Mapping[str, ArrayLike] = KEPT) -> dict[str, NDArray[Any]]:
        """Sets inputs, lets the tick come and runs every machine to its `wait`.

        Args:
            inputs: Values by port or array of ports, of shape (runs, …) or the same for all. The first step needs all; later an input
                that is not given keeps its value.

        Returns:
            The outputs, of shape (runs, …): new arrays. Of a machine that has stopped, NaN or 0: see `faults`.

        Raises:
            ValueError: a name, shape or value that does not fit.
        """
        with np.errstate(over="ignore"):
            self._set(mapping_of("inputs", inputs))
        self._core.step(self._inputs, self._outputs, self._cycles, self._missed)
        return self.outputs

    def close(
        self, plant: Plant, periods: int, inputs: Mapping[str, ArrayLike], *, record: Sequence[str] = ()
    ) -> Loops:
        """Runs closed loops: so many periods of every machine, and between them of the plant.

        Args:
            plant: A function of the outputs, as `step` gives them, and the number of the period, from 0, that returns the inputs of the
                next; it computes all runs at once, on arrays. What it leaves out keeps its value.
            periods: How many.
            inputs: Those of the first period.
            record: Inputs and outputs to keep of every period. Everything takes memory: 4 bytes for each run, period and element.

        Returns:
            What was recorded, and the cycles.

        Raises:
            TypeError: the plant returned None.
            FaultError: a machine has stopped; `Loops` of a run up to there comes from stepping it.
        """
        count = count_of("periods", periods, least=0) or 0
        kept: dict[str, list[NDArray[Any]]] = {name: [] for name in record}
        known = {*self._wanted, *self._names}
        for name in record:
            if name not in known:
                raise ValueError(f"record: there is no input or output `{name}`{near(name, sorted(known))}")
        cycles = np.zeros((count, self.runs), np.int64)
        for period in range(count):
            outputs = self.step(inputs)
            if self._core.failures:
                raise FaultError(self._core.failures[0])
            cycles[period] = self._cycles
            for name, values in kept.items():
                values.append(outputs[name] if name in outputs else self._input(name))
            inputs = plant(outputs, period)
            if inputs is None:
                raise TypeError(f"the plant returned None after period {period}: it lacks a `return` of the inputs of the next (an empty dict keeps them)")
        whole = {name: np.stack(values, axis=1) if values else np.zeros((self.runs, 0)) for name, values in kept.items()}
        return Loops(
            {name: values for name, values in whole.items() if name in self._names},
            {name: values for name, values in whole.items() if name not in self._names},
            cycles.T,
        )

    @property
    def _names(self) -> list[str]:
        return [name for name, *_ in self._read] or list(self.program.outputs)

    def _input(self, name: str) -> NDArray[Any]:
        """What an input was last given."""
        shape, places, rows, port = self._wanted[name]
        if not shape:
            single: NDArray[Any] = self._inputs[rows[0]].view(np.float32 if port is None else port.dtype).copy()
            return single
        whole = np.zeros((self.runs, int(np.prod(shape, dtype=int))), np.float32)
        whole[:, places] = self._inputs[rows].view(np.float32).T
        return whole.reshape(self.runs, *shape)

    @property
    def outputs(self) -> dict[str, NDArray[Any]]:
        """What is on the outputs now, as `step` gives it."""
        if not self._read:
            ports = self.program.outputs.items()
            return {name: row.view(port.dtype).copy() for (name, port), row in zip(ports, self._outputs)}
        floats = self._outputs.view(np.float32)
        outputs: dict[str, NDArray[Any]] = {}
        for name, shape, taken, fixed in self._read:
            whole = np.empty((self.runs, len(fixed)), np.float32)
            whole[:] = fixed
            for index, row in taken:
                whole[:, index] = floats[row]
            outputs[name] = whole.reshape(self.runs, *shape)
        return outputs

    def reset(self) -> None:
        """Every machine back to the state after loading."""
        self._core.reset()
        self._given[:] = False
        self._complete = False

    @property
    def cycles(self) -> NDArray[np.int64]:
        """Cycles of each machine's last period, from the tick to the `wait`; 0 of one that has stopped."""
        return self._cycles.astype(np.int64)

    @property
    def missed(self) -> NDArray[np.int64]:
        """Deadlines missed in the last period."""
        return self._missed.astype(np.int64)

    @property
    def periods(self) -> int:
        """Periods since reset."""
        return self._core.periods

    @property
    def faults(self) -> list[_takt.Fault]:
        """What has stopped machines since reset; `run` says which."""
        return self._core.failures

    @property
    def flags(self) -> list[frozenset[str]]:
        """Of each machine the exception flags raised since reset, among `invalid`, `divide-by-zero`, `overflow`."""
        return [flags_of(bits) for bits in self._core.flags]

    def __reduce__(self) -> Any:
        raise TypeError("a Batch can be neither pickled nor copied: make another one of its program, and step it as this one was")

    def __repr__(self) -> str:
        return f"<takt.Batch of {self.runs} on {self.program.machine}: {self.periods} periods>"

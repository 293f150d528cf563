"""A machine with a program in it, period by period."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from takt import _takt
from takt._errors import FaultError
from takt._exclusive import exclusive
from takt._plant import Plant, core_of
from takt._ports import KEPT, mapping_of, near, numbers
from takt._results import flags_of

if TYPE_CHECKING:
    from takt._program import Program


@exclusive("`copy.copy(sim)` or `program.sim()` makes a machine for each thread")
class Sim:
    """A closed loop, period by period:

        sim = program.sim()
        for k in range(1000):
            out = sim.step({"q": q, "qd": qd})
            q, qd = plant(q, qd, out["tau"])
    """

    #: The plant that closes the loop, if there is one.
    plant: Plant | None

    def __init__(self, program: Program, core: _takt.Sim, plant: Plant | None = None) -> None:
        self.program = program
        self.plant = plant
        self._core = core

    def step(self, inputs: Mapping[str, ArrayLike] = KEPT) -> dict[str, Any]:
        """Sets inputs, lets the tick come and runs the program to its `wait`.

        Args:
            inputs: Values by port or array of ports. The first step needs all; later an input that is not given keeps
                its value. With a plant, those that it gives are left out, and those that its file states may be.

        Returns:
            The outputs: a float or int for each port, None if nothing was ever written there; an array of ports as
            float32 of its shape.

        Raises:
            FaultError: the machine has stopped, or the plant has failed or diverged; it stays where it is until `reset`.
            ValueError: a name, shape or value that does not fit.
        """
        program = self.program
        given: dict[str, Any] = dict(mapping_of("inputs", inputs))
        if program.input_arrays:
            given = self._elements(given)
        values = self._core.step(given)
        if values is None:
            fault = self._core.failure
            raise RuntimeError("the machine has stopped") if fault is None else FaultError(fault)
        return self._shaped(values)

    def _elements(self, inputs: dict[str, Any]) -> dict[str, Any]:
        """Arrays of ports as their elements."""
        elements: dict[str, Any] = {}
        arrays = {array.name: array for array in self.program.input_arrays}
        for name, value in inputs.items():
            array = arrays.get(name)
            if array is None and name not in self.program.inputs:
                raise ValueError(f"the program has no input `{name}`{near(name, [*arrays, *self.program.inputs])}")
            if array is None or array.shape == ():
                pairs = [(name if array is None else array.elements[0], value)]
            else:
                values = numbers(f"`{name}`", value, f" of period {self.periods}")
                if values.shape != array.shape:
                    raise ValueError(f"`{name}` has shape {values.shape}, not {array.shape}")
                pairs = list(zip(array.elements, values.ravel().tolist()))
            for port, number in pairs:
                if isinstance(port, str) and port in elements:
                    raise ValueError(f"`{port}` is given twice")
                if isinstance(port, str):
                    elements[port] = number
        return elements

    def _shaped(self, values: dict[str, Any]) -> dict[str, Any]:
        if not self.program.output_arrays:
            return values
        known = {name: np.nan if value is None else value for name, value in values.items()}
        data = self.program._data
        words = [word or 0 for word in self._core.words(list(data.values()))] if data else []
        known |= zip(data, np.array(words, np.uint32).view(np.float32).tolist())
        shaped: dict[str, Any] = {}
        for array in self.program.output_arrays:
            whole = array.stacked(known, ())
            shaped[array.name] = whole if array.shape else float(whole)
        return shaped

    def reset(self) -> None:
        """Back to the state after loading, with the plant at its beginning."""
        if self.plant is None:
            self._core.reset()
        else:
            tick, max_cycles = self._core.limits
            self._core = _takt.Sim(self.program._core, tick, max_cycles, self.plant._core)

    @property
    def inputs(self) -> dict[str, float | int | None]:
        """Inputs by port, as the last period read them; None if an input was never set."""
        return self._core.read_inputs()

    @property
    def states(self) -> dict[str, float]:
        """States of the plant when the last period read its inputs, in SI units; empty without a plant, and before the first period."""
        return {} if self.plant is None else dict(zip(self.plant.states, self._core.states))

    @property
    def outputs(self) -> dict[str, Any]:
        """What is on the outputs now, as `step` gives it."""
        return self._shaped(self._core.read())

    @property
    def cycles(self) -> int:
        """Cycles of the last period, from the tick to the `wait`."""
        return self._core.cycles

    @property
    def missed(self) -> int:
        """Deadlines missed in the last period."""
        return self._core.missed

    @property
    def periods(self) -> int:
        """Periods since reset."""
        return self._core.periods

    @property
    def now(self) -> int:
        """Cycles since reset, waiting included."""
        return self._core.now

    @property
    def flags(self) -> frozenset[str]:
        """The exception flags raised since reset, among `invalid`, `divide-by-zero`, `overflow`."""
        return flags_of(self._core.flags)

    def __copy__(self) -> Sim:
        """A machine in the same state, which goes on by itself."""
        if self.plant is not None:
            # Plants cannot be copied in motion: the loop is run again.
            restored, arguments = self.__reduce__()
            return restored(*arguments)  # type: ignore[no-any-return]
        return Sim(self.program, copy.copy(self._core))

    def __deepcopy__(self, memo: dict[int, Any]) -> Sim:
        return copy.copy(self)

    def __reduce__(self) -> tuple[Any, ...]:
        """For `pickle`. The machine's state is made again by running what it was given since reset; a machine that has run for very
        long, or was interrupted in the middle of a period, is none that can be pickled (TypeError)."""
        return _restored, (self.program, self.plant, *self._core.state())

    def __repr__(self) -> str:
        return f"<takt.Sim on {self.program.machine}: {self.periods} periods, the last {self.cycles} cycles>"


def _restored(program: Program, plant: Plant | None, tick: int | None, max_cycles: int, history: bytes) -> Sim:
    """A machine that was pickled."""
    core = _takt.Sim(program._core, tick, max_cycles, core_of(plant))
    core.replay(history)
    return Sim(program, core, plant)

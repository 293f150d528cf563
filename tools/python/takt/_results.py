"""What is known of a program, and what came of a run."""

from __future__ import annotations

import html
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from takt import _takt
from takt._errors import FaultError
from takt._ports import Array

_FLAGS = _takt.flag_names()
#: Number of faults shown in a notebook.
_SHOWN = 3


def flags_of(bits: int) -> frozenset[str]:
    return frozenset(name for bit, name in _FLAGS if bits & bit)


@dataclass(frozen=True)
class Largest:
    """The largest error of a kind that an output has had, and when."""

    #: Error, in the unit of the output, in ulps, or as a fraction of the exact value.
    error: float
    #: Number of the period, from 0.
    period: int
    #: Value of the output.
    value: float
    #: Value in binary64.
    exact: float


@dataclass(frozen=True)
class Accuracy:
    """The errors of an output at the ends of the periods, against the same operations in binary64."""

    name: str
    #: Number of periods at whose end the output was compared.
    periods: int
    #: Largest error in the unit of the output, in ulps, and relative to the exact value; None if the output never was a finite number.
    absolute: Largest | None
    ulp: Largest | None
    relative: Largest | None
    #: Origins of the largest absolute error, largest share first: place (`law.s:12`) and share; the shares add up to the error.
    operations: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class OutputBound:
    """What is proved of an output, whatever the inputs and states in their ranges."""

    name: str
    #: Range of the output, including its ends; None if a hazard leaves it open.
    range: tuple[float, float] | None
    #: Bound of the error, in the unit of the output and in ulps of its largest value; None if a hazard leaves it open, and for an integer.
    error: float | None
    ulp: float | None
    #: Bounds of the rounding errors that operations contribute, largest first: place (`law.s:12`) and error.
    operations: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class Hazard:
    """An operation that may have no number as its result."""

    place: str
    problem: str
    #: Operands: names, and their ranges where known.
    operands: tuple[tuple[str, tuple[float, float] | None], ...]


@dataclass(frozen=True)
class Assumed:
    """A state that is not shown to be in the range that the source promises: when the first period begins, or when one ends."""

    name: str
    range: tuple[float, float]
    #: The assumption concerns the start of the first period, otherwise the end of every period.
    first: bool
    #: Range found at that point; None if it may not be a number.
    found: tuple[float, float] | None


@dataclass(frozen=True)
class Enclosure:
    """What holds for every period whose inputs and states begin it within their `.range`, the states free of error."""

    outputs: dict[str, OutputBound]
    hazards: tuple[Hazard, ...]
    assumed: tuple[Assumed, ...]

    @staticmethod
    def of(core: _takt.Program) -> Enclosure:
        outputs, hazards, assumed = _takt.enclose(core)
        return Enclosure(
            {
                one["name"]: OutputBound(
                    one["name"], one["range"], one["error"], one["ulp"], tuple(one["operations"])
                )
                for one in outputs
            },
            tuple(Hazard(place, problem, tuple(operands)) for place, problem, operands in hazards),
            tuple(Assumed(*one) for one in assumed),
        )

    @property
    def safe(self) -> bool:
        """Whether no NaN, no overflow, no division by zero, no conversion, shift or index out of range and no integer that wraps is possible, as
        long as states keep their ranges."""
        return not self.hazards and not any(state.first for state in self.assumed)


@dataclass(frozen=True)
class Model:
    """What a program was made of."""

    #: One-line description of the computation.
    title: str
    #: Decisions made during generation.
    notes: tuple[str, ...]
    #: Number of scalar operations after rewriting.
    operations: int
    #: Joints of a robot, in the order of the arrays.
    joints: tuple[str, ...]
    #: Meaning and unit of each port.
    ports: dict[str, str]


@dataclass(frozen=True)
class Span:
    """Cycles, from the fewest to the most."""

    best: int
    worst: int


@dataclass(frozen=True)
class Section:
    """What a section of a program can take, in cycles, whatever the inputs."""

    #: Label at which the section begins; `once` for code that runs once.
    name: str
    #: Place of the beginning, such as `pd.s:12`.
    place: str | None
    #: The section begins with reset, not with a tick.
    once: bool
    #: Cycles if the tick comes long after the `wait`.
    cycles: Span
    #: Cycles if the tick comes at any time after the `wait`.
    in_time: Span
    #: Cycles after a missed deadline.
    missed: Span


@dataclass(frozen=True)
class Bound:
    """The best and the worst that each section can take."""

    sections: tuple[Section, ...]
    #: Cycles of the longest period if every tick comes in time; None if there is no period.
    worst_period: int | None

    def _repr_html_(self) -> str:
        def span(of: Span) -> str:
            return str(of.best) if of.best == of.worst else f"{of.best} to {of.worst}"

        rows = [
            (one.name, one.place or "", span(one.cycles), "" if one.once else span(one.in_time), "" if one.once else span(one.missed))
            for one in self.sections
        ]
        worst = "no period" if self.worst_period is None else f"a period takes {self.worst_period} cycles at most"
        return _table(("section", "place", "cycles", "tick in time", "after a missed deadline"), rows, worst)


def _table(head: Sequence[str], rows: Iterable[Sequence[object]], caption: str) -> str:
    """A table for a notebook."""

    def row(cells: Sequence[object], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(str(cell))}</{tag}>" for cell in cells) + "</tr>"

    body = "".join(row(cells, "td") for cells in rows)
    return f"<table><caption>{html.escape(caption)}</caption><thead>{row(head, 'th')}</thead><tbody>{body}</tbody></table>"


def ports_table(ports: Iterable[tuple[str, str, str]], caption: str) -> str:
    """A program's ports for a notebook: direction, name and type of each."""
    return _table(("port", "name", "type"), ports, caption)


class Analysis:
    """Where the cycles of a period went. In a notebook it shows the pipeline as a picture; as text it is the report that
    `takt analyse` prints."""

    #: Complete result, as printed by `takt analyse --json`.
    data: dict[str, Any]
    #: Pipeline diagram, as a self-contained page for a browser.
    html: str

    def __init__(self, text: str, data: str, html: str) -> None:
        self._text = text
        self.data = json.loads(data)
        self.html = html

    @property
    def cycles(self) -> int:
        """Cycles of the period."""
        cycles: int = self.data["cycles"]
        return cycles

    def __str__(self) -> str:
        return self._text

    def __repr__(self) -> str:
        data = self.data
        return f"<takt.Analysis of {data['program']}, period {data['period']}: {data['cycles']} cycles on {data['machine']}>"

    def _repr_html_(self) -> str:
        # Use a separate frame, so that styles and script of the page do not affect the notebook.
        page = html.escape(self.html, quote=True)
        return f'<iframe srcdoc="{page}" style="width:100%;height:720px;border:0" sandbox="allow-scripts"></iframe>'


class Run:
    """What came of a run.

    Arrays have shape (periods,), those of a batch (runs, periods). A run that a fault has ended has, from then on, outputs
    as if never written and 0 cycles.
    """

    #: Outputs by name, float32, int32 or uint32; an array of ports adds its dimensions after those of the run. Values never written are
    #: NaN or 0, and counted in `unwritten`.
    outputs: dict[str, NDArray[Any]]
    #: Outputs by port.
    ports: dict[str, NDArray[Any]]
    #: Inputs by port, as the program read them, in a loop that a plant closes; empty otherwise.
    inputs: dict[str, NDArray[Any]]
    #: States of the plant when the program read its inputs, float64 in SI units; NaN from a fault on. Empty without a plant.
    states: dict[str, NDArray[np.float64]]
    #: Cycles of each period, from the tick to the `wait`; int64.
    cycles: NDArray[np.int64]
    #: Number of deadlines missed in each period, by ticks that came before the `wait`; int64.
    missed: NDArray[np.int64]
    #: Number of completed periods; for a batch, int64 of shape (runs,).
    completed: int | NDArray[np.int64]
    #: Exception flags raised since reset: `invalid`, `divide-by-zero`, `overflow`; for a batch, a list.
    flags: frozenset[str] | list[frozenset[str]]
    #: Events that ended runs early, by run.
    faults: list[_takt.Fault]
    #: Output ports with the number of periods that ended before the port was ever written.
    unwritten: dict[str, int]
    #: Number of NaNs written to output ports.
    nan_writes: int

    def __init__(
        self,
        arrays: tuple[Array, ...],
        ports: dict[str, NDArray[Any]],
        cycles: NDArray[np.int64],
        missed: NDArray[np.int64],
        ran: _takt.Ran,
    ) -> None:
        self.ports = ports
        self.inputs, self.states = {}, {}
        self.outputs = {array.name: array.stacked(ports, cycles.shape) for array in arrays} or ports
        self.cycles = cycles
        self.missed = missed
        single = cycles.ndim < 2
        self.completed = ran["completed"][0] if single else np.array(ran["completed"], np.int64)
        self.flags = flags_of(ran["flags"][0]) if single else [flags_of(bits) for bits in ran["flags"]]
        self.faults = ran["failures"]
        names = list(ports)
        self.unwritten = {name: count for name, count in zip(names, ran["unwritten"]) if count}
        self.nan_writes = ran["nan_writes"]

    def check(self) -> Run:
        """The run itself if it came to its end.

        Raises:
            FaultError: the first fault.
        """
        if self.faults:
            raise FaultError(self.faults[0])
        return self

    def _repr_html_(self) -> str:
        rows = []
        for name, values in self.outputs.items():
            numbers = values[np.isfinite(values)]
            least, most = (numbers.min(), numbers.max()) if numbers.size else ("", "")
            last = values[..., -1] if self.cycles.shape and values.ndim == 1 and values.size else values if values.ndim == 0 else ""
            rows.append((name, values.dtype, values.shape, least, most, last))
        faults = "".join(f"<pre>{html.escape(fault.text)}</pre>" for fault in self.faults[:_SHOWN])
        return _table(("output", "type", "shape", "least", "most", "last"), rows, repr(self)[1:-1]) + faults

    def __repr__(self) -> str:
        shape, cycles = self.cycles.shape, self.cycles
        what = "to its halt" if not shape else " × ".join(
            f"{count} {name}{'' if count == 1 else 's'}" for count, name in zip(shape, ("run", "period")[-len(shape):])
        )
        done = cycles[cycles > 0]
        span = "" if done.size == 0 else f", {done.min()} to {done.max()} cycles" if done.min() != done.max() else f", {done.min()} cycles"
        faults = f", {len(self.faults)} ended by a fault: {self.faults[0].message}" if self.faults else ""
        return f"<takt.Run: {what}{span}, outputs {', '.join(self.outputs)}{faults}>"

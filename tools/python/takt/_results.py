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
#: Faults that a notebook shows.
_SHOWN = 3


def flags_of(bits: int) -> frozenset[str]:
    return frozenset(name for bit, name in _FLAGS if bits & bit)


@dataclass(frozen=True)
class Largest:
    """The largest error of a kind that an output has had, and when."""

    #: In the output's unit, in ulps, or as a part of the exact value.
    error: float
    #: The period, from 0.
    period: int
    #: What the output was.
    value: float
    #: What it is in binary64.
    exact: float


@dataclass(frozen=True)
class Accuracy:
    """The errors of an output at the ends of the periods, against the same operations in binary64."""

    name: str
    #: Periods at whose end it was compared.
    periods: int
    #: The largest in the output's own unit, in ulps, and in relation to the exact value; None if it never was a finite number.
    absolute: Largest | None
    ulp: Largest | None
    relative: Largest | None
    #: Where the largest absolute error comes from, the largest share first: place (`law.s:12`) and share, which add up to it.
    operations: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class OutputBound:
    """What is proved of an output, whatever the inputs and states in their ranges."""

    name: str
    #: What it may be, its ends included; None if a hazard leaves that open.
    range: tuple[float, float] | None
    #: The error at most, in the output's own unit, and in ulps of its largest value; None likewise.
    error: float | None
    ulp: float | None
    #: What each operation's rounding adds to the error at most, the largest first: place (`law.s:12`) and error.
    operations: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class Hazard:
    """An operation that may have no number as its result."""

    place: str
    problem: str
    #: What it reads: names, and what may be in them, where that is known.
    operands: tuple[tuple[str, tuple[float, float] | None], ...]


@dataclass(frozen=True)
class Assumed:
    """A state that is not shown to be in the range that the source promises: when the first period begins, or when one ends."""

    name: str
    range: tuple[float, float]
    #: Whether this is about the beginning of the first period; else about the end of every period.
    first: bool
    #: Where it may be then; None if that is not known as a number.
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
        """Whether no NaN, no overflow, no division by zero and no conversion out of range is possible, as long as states keep their ranges."""
        return not self.hazards and not any(state.first for state in self.assumed)


@dataclass(frozen=True)
class Model:
    """What a program was made of."""

    #: What is computed, in a line.
    title: str
    #: What was decided on the way.
    notes: tuple[str, ...]
    #: Scalar operations after rewriting.
    operations: int
    #: Of a robot: its joints, in the order of the arrays.
    joints: tuple[str, ...]
    #: What each port is, and its unit.
    ports: dict[str, str]


@dataclass(frozen=True)
class Span:
    """Cycles, from the fewest to the most."""

    best: int
    worst: int


@dataclass(frozen=True)
class Section:
    """What a section of a program can take, in cycles, whatever the inputs."""

    #: The label that it begins at; of what runs once, `once`.
    name: str
    #: Where it begins, as `pd.s:12`.
    place: str | None
    #: Whether it begins with reset, not with a tick.
    once: bool
    #: With the tick long after the `wait`.
    cycles: Span
    #: With the tick at any time after the `wait`.
    in_time: Span
    #: After a missed deadline.
    missed: Span


@dataclass(frozen=True)
class Bound:
    """The best and the worst that each section can take."""

    sections: tuple[Section, ...]
    #: The longest period, in cycles, with every tick in time; None if there is no period.
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

    #: Everything, as `takt analyse --json` prints it.
    data: dict[str, Any]
    #: The picture, as a self-contained page for a browser.
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
        # A frame of its own: the page's styles and script are not the notebook's.
        page = html.escape(self.html, quote=True)
        return f'<iframe srcdoc="{page}" style="width:100%;height:720px;border:0" sandbox="allow-scripts"></iframe>'


class Run:
    """What came of a run.

    Arrays have shape (periods,), those of a batch (runs, periods). A run that a fault has ended has, from then on, outputs
    as if never written and 0 cycles.
    """

    #: Output by name; an array of ports has its own dimensions behind those of the run. float32, int32 or uint32. What
    #: was never written is NaN or 0, and counted in `unwritten`.
    outputs: dict[str, NDArray[Any]]
    #: The same by port.
    ports: dict[str, NDArray[Any]]
    #: Cycles of each period, from the tick to the `wait`; int64.
    cycles: NDArray[np.int64]
    #: Deadlines missed in each period: ticks that came before the `wait`; int64.
    missed: NDArray[np.int64]
    #: Periods that came to their end: of a batch, int64 of shape (runs,).
    completed: int | NDArray[np.int64]
    #: The exception flags raised since reset, among `invalid`, `divide-by-zero`, `overflow`: of a batch a list.
    flags: frozenset[str] | list[frozenset[str]]
    #: What ended runs early, by run.
    faults: list[_takt.Fault]
    #: Output ports that a period ended with before anything was written there, and how many periods.
    unwritten: dict[str, int]
    #: NaNs written to output ports.
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

"""What can go wrong, as exceptions and plain data."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from takt._words import in_python

if TYPE_CHECKING:
    from takt._takt import Fault


@dataclass(frozen=True)
class Place:
    """A range of a source. Lines and columns count from 1, columns in characters."""

    file: str
    line: int
    column: int
    end_line: int
    end_column: int
    #: Text at the place; may be empty.
    message: str


@dataclass(frozen=True)
class Diagnostic:
    """An error or a warning of the assembler."""

    #: `error` or `warning`.
    severity: str
    #: Kind of mistake in a word or two; stable, for tools.
    code: str
    message: str
    #: Places: first that of the mistake, then those that explain it; empty if there are none.
    places: tuple[Place, ...]
    notes: tuple[str, ...]
    #: Advice on how to correct the mistake.
    help: str | None
    #: Replacement for the faulty text.
    replacement: str | None

    @property
    def file(self) -> str | None:
        """The file of the mistake."""
        return self.places[0].file if self.places else None

    @property
    def line(self) -> int | None:
        """The line of the mistake, from 1."""
        return self.places[0].line if self.places else None

    @property
    def column(self) -> int | None:
        """The column of its first character, from 1."""
        return self.places[0].column if self.places else None


def diagnostics(text: str) -> list[Diagnostic]:
    """Diagnostics from the assembler's JSON."""

    def one(message: dict[str, Any]) -> Diagnostic:
        places = tuple(Place(**place) for place in message.pop("places"))
        notes = tuple(in_python(note) for note in message.pop("notes"))
        for key in ("message", "help"):
            message[key] = None if message[key] is None else in_python(message[key])
        return Diagnostic(places=places, notes=notes, **message)

    return [one(message) for message in json.loads(text)]


class TaktError(Exception):
    """Every error of this package that is not one of the arguments' types or values."""


class AssemblyError(TaktError, ValueError):
    """The source has errors. As text it shows each at its line, as the command line does."""

    #: All errors and warnings, in source order.
    diagnostics: list[Diagnostic]

    def __init__(self, rendered: str, messages: str) -> None:
        super().__init__(rendered, messages)
        self.rendered = in_python(rendered.rstrip("\n"))
        self.diagnostics = diagnostics(messages)

    def __str__(self) -> str:
        return "\n" + self.rendered


class AssemblyWarning(UserWarning):
    """The assembler warns. `Program.warnings` has the diagnostics."""


class NoBoundError(TaktError, ValueError):
    """The cycles of a program cannot be bounded, and why."""

    def __str__(self) -> str:
        return in_python(super().__str__())


class ModelError(TaktError, ValueError):
    """A robot's description or an expression that cannot become a program, and why."""

    #: Line number in the description, from 1, if it is known.
    line: int | None

    def __init__(self, text: str, line: int | None = None) -> None:
        super().__init__(in_python(text))
        self.line = line

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (*self.args, self.line)


class PlantError(TaktError, ValueError):
    """A plant that cannot run, or cannot close a program's loop, and why."""

    def __str__(self) -> str:
        return in_python(super().__str__())


class BoardError(TaktError, OSError):
    """A board does not answer, rejects a request, or the device is not a board."""

    def __str__(self) -> str:
        return in_python(super().__str__())


class FaultError(TaktError, RuntimeError):
    """The machine has stopped where the program does not mean it to."""

    #: The fault, with its place.
    fault: Fault

    def __init__(self, fault: Fault) -> None:
        super().__init__(fault)
        self.fault = fault

    def __str__(self) -> str:
        return self.fault.text

"""The extension module. Use `takt`, which gives these names, shapes and types of NumPy."""

from os import PathLike
from typing import TypedDict, final

import numpy as np
from numpy.typing import NDArray

@final
class Fault:
    """What ended a run early."""

    @property
    def run(self) -> int:
        """The run of a batch, from 0."""
    @property
    def period(self) -> int:
        """The period in which it happened, from 0."""
    @property
    def kind(self) -> str:
        """What happened, in a word or two, as `data address`; `halted` if the program has halted."""
    @property
    def message(self) -> str:
        """What happened."""
    @property
    def cycle(self) -> int | None:
        """The cycle, counted from reset."""
    @property
    def bundle(self) -> int | None:
        """The bundle's address."""
    @property
    def slot(self) -> str | None:
        """The slot of the operation, where it is one operation's."""
    @property
    def file(self) -> str | None:
        """The source file, as far as the program knows it."""
    @property
    def line(self) -> int | None:
        """The line in it, from 1."""
    @property
    def text(self) -> str:
        """The whole message, with the source line if that is at hand."""

class Ran(TypedDict):
    completed: list[int]
    flags: bytes
    failures: list[Fault]
    unwritten: list[int]
    nan_writes: int

_Shaped = tuple[str, list[int], list[str | float | None]]

class Model(TypedDict):
    source: str
    title: str
    notes: list[str]
    operations: int
    texts: list[tuple[str, str]]
    inputs: list[_Shaped]
    outputs: list[_Shaped]
    data: list[tuple[str, str, int]]
    joints: list[str]

_Largest = tuple[float, int, float, float]

class Measured(TypedDict):
    name: str
    periods: int
    absolute: _Largest | None
    ulp: _Largest | None
    relative: _Largest | None
    operations: list[tuple[str, float]]

class OutputBound(TypedDict):
    name: str
    range: tuple[float, float] | None
    error: float | None
    ulp: float | None
    operations: list[tuple[str, float]]

_Span = tuple[int, int]

@final
class Program:
    @property
    def machine(self) -> str: ...
    def is_for(self, machine: str) -> bool: ...
    @property
    def bundles(self) -> int: ...
    @property
    def latched(self) -> bool: ...
    @property
    def inputs(self) -> list[tuple[str, str]]: ...
    @property
    def outputs(self) -> list[tuple[str, str]]: ...
    @property
    def sources(self) -> list[tuple[str, str]]: ...
    @property
    def warnings(self) -> tuple[str, str] | None: ...
    def listing(self) -> str: ...
    def image(self) -> bytes: ...
    def blocks(self) -> list[tuple[str | None, int, int]]: ...
    def bound(self) -> tuple[list[tuple[str, str | None, bool, _Span, _Span, _Span]], int | None]: ...
    def sim(self, tick: int | None, max_cycles: int) -> Sim: ...
    def data_address(self, name: str) -> int | None: ...
    def lanes(self, words: list[int], runs: int, tick: int | None, max_cycles: int) -> Lanes: ...
    def __copy__(self) -> Program: ...
    def __deepcopy__(self, memo: object) -> Program: ...

@final
class Sim:
    @property
    def periods(self) -> int: ...
    @property
    def cycles(self) -> int: ...
    @property
    def missed(self) -> int: ...
    @property
    def failure(self) -> Fault | None: ...
    @property
    def now(self) -> int: ...
    @property
    def flags(self) -> int: ...
    def step(self, inputs: dict[str, float | int]) -> dict[str, float | int | None] | None: ...
    def read(self) -> dict[str, float | int | None]: ...
    def words(self, addresses: list[int]) -> list[int | None]: ...
    def reset(self) -> None: ...
    def state(self) -> tuple[int | None, int, bytes]: ...
    def replay(self, history: bytes) -> None: ...
    def __copy__(self) -> Sim: ...

@final
class Lanes:
    @property
    def periods(self) -> int: ...
    @property
    def failures(self) -> list[Fault]: ...
    @property
    def flags(self) -> bytes: ...
    def step(
        self,
        inputs: NDArray[np.uint32],
        outputs: NDArray[np.uint32],
        cycles: NDArray[np.uint64],
        missed: NDArray[np.uint64],
    ) -> bool: ...
    def reset(self) -> None: ...

@final
class Board:
    def __init__(
        self, port: str | PathLike[str], program: Program | None, system: str | PathLike[str] | None, baud: int
    ) -> None: ...
    def ports(self) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]: ...
    def cores(self) -> list[str]: ...
    def push(self, name: str, entry: list[int]) -> bool: ...
    def pop(self, name: str) -> list[int] | None: ...
    def fields(self, name: str, to_host: bool) -> list[tuple[str, str]]: ...
    def status(self, core: int) -> tuple[str, bool, list[str], tuple[int, str] | None, list[tuple[str, int]]]: ...
    def load(self) -> None: ...
    def control(self, what: str) -> None: ...
    def step(self) -> None: ...
    def read(self, names: list[str]) -> list[tuple[str, int]]: ...
    def set(self, values: list[tuple[str, int]]) -> None: ...
    def stream(self, names: list[str], every: int) -> list[str]: ...
    def frame(self) -> tuple[int, list[int]] | None: ...
    def quiet(self) -> None: ...

def longest_tick() -> int: ...
def flag_names() -> list[tuple[int, str]]: ...
def machines() -> list[tuple[str, str]]: ...
def nearest(name: str, names: list[str]) -> str | None: ...
def assemble(
    text: bytes,
    name: str,
    folder: str | PathLike[str],
    include: list[str | PathLike[str]],
    machine: str,
    schedule: str,
    contract: str,
    effort: int | None,
    warnings: list[str],
) -> Program: ...
def load(path: str | PathLike[str]) -> tuple[Program | None, bytes]: ...
def run(
    program: Program,
    words: list[int],
    inputs: NDArray[np.uint32],
    outputs: NDArray[np.uint32],
    cycles: NDArray[np.uint64],
    missed: NDArray[np.uint64],
    tick: int | None,
    max_cycles: int,
) -> Ran: ...
def run_to_halt(
    program: Program, words: list[int], inputs: list[int], max_cycles: int
) -> tuple[int, list[int | None], int, Fault | None]: ...
def analyse(
    program: Program, name: str, rows: list[list[int]], wanted: int | None
) -> tuple[tuple[str, str, str] | None, Fault | None]: ...
def robot_functions() -> list[tuple[str, str]]: ...
def robot(
    text: str,
    name: str,
    table: bool,
    function: str,
    base: str | None,
    tip: str | None,
    gains: tuple[float, float],
    snap: float,
    exact: bool,
    without: list[str],
    machine: str,
) -> Model: ...
def expressions(text: str, name: str, exact: bool, without: list[str], machine: str) -> Model: ...
def perceptron(
    bytes: bytes, name: str, exact: bool, range: tuple[float, float] | None, machine: str
) -> Model: ...
def predictive(text: str, machine: str) -> Model: ...
def predictive_worst(text: str, starts: int, seed: int, periods: int) -> list[tuple[str, float, list[float]]]: ...
def accuracy(
    program: Program, inputs: NDArray[np.uint32], each_period: bool, max_cycles: int
) -> tuple[list[Measured], Fault | None]: ...
def enclose(
    program: Program,
) -> tuple[
    list[OutputBound],
    list[tuple[str, str, list[tuple[str, tuple[float, float] | None]]]],
    list[tuple[str, tuple[float, float], bool, tuple[float, float] | None]],
]: ...

"""Ports and their values: what NumPy has on one side, words of 32 bits on the other."""

from __future__ import annotations

import os
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from takt import _takt

_DTYPES: dict[str, np.dtype[Any]] = {
    "float": np.dtype(np.float32),
    "int": np.dtype(np.int32),
    "bits": np.dtype(np.uint32),
}


#: A path in any form.
AnyPath: TypeAlias = "str | bytes | os.PathLike[str] | os.PathLike[bytes]"


@dataclass(frozen=True)
class Port:
    """An input or output port: a register with a name."""

    name: str
    #: `float` (binary32), `int` (32 bits, signed) or `bits` (32 bits, unsigned).
    type: str

    @property
    def dtype(self) -> np.dtype[Any]:
        """The type of its values in arrays: float32, int32 or uint32."""
        return _DTYPES[self.type]


@dataclass(frozen=True)
class Parameter(Port):
    """A parameter of a program, which `Sim.step` sets like an input."""

    #: Value at the start.
    value: float
    #: Range that the source states, if any.
    limits: tuple[float, float] | None = None


@dataclass(frozen=True)
class Array:
    """Several ports as one array, as models have them: `q` of shape (6,) for `q_shoulder`, ….

    `elements` are in row-major order. Each is a port's name, or a number (an output that is constant has no port), or
    None (an input without effect has none).
    """

    name: str
    shape: tuple[int, ...]
    elements: tuple[str | float | None, ...]

    def stacked(self, ports: Mapping[str, Any], lead: tuple[int, ...]) -> NDArray[Any]:
        """Its elements, taken from values by port, in one array of shape (*lead, *shape)."""
        whole = np.zeros((*lead, len(self.elements)), np.float32)
        for index, element in enumerate(self.elements):
            if element is not None:
                whole[..., index] = ports[element] if isinstance(element, str) else element
        return whole.reshape((*lead, *self.shape))


def near(name: str, names: Sequence[str]) -> str:
    found = _takt.nearest(name, list(names))
    if found is not None:
        return f"; did you mean `{found}`?"
    return f" (there are: {', '.join(names)})" if 0 < len(names) <= 40 else ""


def first(wrong: NDArray[np.bool_]) -> str:
    """Where the first of some elements is, as an index."""
    place = np.unravel_index(int(np.argmax(wrong)), wrong.shape) if wrong.ndim else ()
    return "" if not place else "[" + ", ".join(str(int(i)) for i in place) + "]"


#: Empty mapping: every input keeps its value.
KEPT: Mapping[str, ArrayLike] = MappingProxyType({})


def mapping_of(what: str, values: Mapping[str, ArrayLike]) -> Mapping[str, ArrayLike]:
    """Values by name."""
    if values is None:
        raise TypeError(f"{what} are None: does the function that makes them lack a `return`? Without the argument, every input keeps its value")
    # Accept anything with keys and items, such as a pandas table.
    if not (hasattr(values, "keys") and hasattr(values, "items")):
        raise TypeError(f"{what} are values by the name of their port, as {{'x': 0.5}}, and not a {type(values).__name__}")
    return values


def path_of(what: str, value: AnyPath) -> Path:
    """A path, however it is written."""
    try:
        return Path(os.fsdecode(value))
    except TypeError:
        raise TypeError(f"{what} is a path: a str, bytes or os.PathLike, not a {type(value).__name__}") from None


def numbers(what: str, value: ArrayLike, when: str = "") -> NDArray[Any]:
    """Numbers as an array; `when` is the time in messages, as ` of period 3`."""
    if isinstance(value, np.ma.MaskedArray):
        masked = np.ma.getmaskarray(value)
        if masked.any():
            raise ValueError(f"{what}{first(masked)}{when} is masked: there is no value to run with; .filled(…) gives masked elements one")
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise ValueError(f"{what}{when}: no array of numbers: {error}") from None
    if array.dtype.kind not in "fiub":
        raise ValueError(f"{what}{when}: an array of {array.dtype} is none of numbers")
    return array


def words_of(what: str, port: Port, array: NDArray[Any], when: str = "") -> NDArray[np.uint32]:
    """The bits of values for a port; numbers are rounded to binary32 once."""
    if port.type == "float":
        nan = np.isnan(array)
        if nan.any():
            raise ValueError(f"{what}{first(nan)}{when}: NaN is not an input for a controller")
        with np.errstate(over="ignore"):
            rounded = array.astype(np.float32)
        infinite = np.isinf(rounded)
        if infinite.any():
            number = array[infinite].flat[0]
            raise ValueError(f"{what}{first(infinite)}{when}: {number} does not fit binary32, whose largest is 3.4028235e38")
        return rounded.view(np.uint32)
    if array.dtype.kind == "f":
        raise ValueError(f"{what}{when}: the port carries integers, the array {array.dtype}; round it and use .astype(np.{port.dtype})")
    limits = np.iinfo(port.dtype)
    outside = (array < limits.min) | (array > limits.max) if array.dtype.itemsize >= 4 or limits.min == 0 else np.zeros(array.shape, bool)
    if outside.any():
        number = array[outside].flat[0]
        raise ValueError(f"{what}{first(outside)}{when}: {number} is not between {limits.min} and {limits.max}")
    return array.astype(port.dtype).view(np.uint32)


def word_of(name: str, value: ArrayLike, port: Port, when: str = "") -> int:
    """The bits of one value for a port; `when` is the time in messages, as ` of tick 3`."""
    array = numbers(f"`{name}`", value, when)
    if array.shape != ():
        raise ValueError(f"`{name}`{when} is one number, not an array of shape {array.shape}")
    return int(words_of(f"`{name}`", port, np.asarray(array), when))


def value_of(kind: str, bits: int) -> float | int:
    """The number that the bits of a port of this type are."""
    if kind == "float":
        return float(struct.unpack("<f", struct.pack("<I", bits))[0])
    return bits - (1 << 32) if kind == "int" and bits >> 31 else bits


def count_of(what: str, value: int | None, least: int = 1) -> int | None:
    if value is None:
        return None
    try:
        number = value.__index__()
    except AttributeError:
        raise TypeError(f"{what} is a whole number, not {value!r}") from None
    if not least <= number < 1 << 62:
        raise ValueError(f"{what} is {number}: it is {least} at least, and less than 2**62")
    return number


#: Maximum number of cycles between ticks.
LONGEST_TICK = _takt.longest_tick()


def limits_of(tick: int | None, max_cycles: int, default: int) -> tuple[int | None, int]:
    """Cycles from tick to tick, and those that a period may take."""
    every, most = count_of("tick", tick), count_of("max_cycles", max_cycles) or default
    if every is not None and every > LONGEST_TICK:
        raise ValueError(f"tick is {every} cycles: it is {LONGEST_TICK} at most")
    if every is not None and every > most:
        raise ValueError(f"tick is {every} cycles, and max_cycles {most}: every period would end with a fault")
    return every, most

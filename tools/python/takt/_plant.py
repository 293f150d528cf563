"""Plants that close a program's loop."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from takt import _takt
from takt._ports import AnyPath, mapping_of, near, numbers, path_of

#: Program of the process of an FMU. An interrupt is for the process that started it, and that ends it.
_PROCESS = """import signal, sys
signal.signal(signal.SIGINT, signal.SIG_IGN)
sys.path[:] = {path!r}
from takt._takt import serve_fmu
serve_fmu(sys.argv[1])"""


def _command() -> list[str]:
    """The command that starts the process of an FMU, with the modules that this process finds."""
    return [sys.executable, "-c", _PROCESS.format(path=sys.path)] if sys.executable else []


class Plant:
    """A plant behind a program: a model with its numbers in a TOML file, or an FMU of another tool (docs/plant.md).

        motor = takt.Plant("dc_motor.toml")
        run = takt.load("pi.s").run(plant=motor, periods=400)
        run.inputs["w"], run.outputs["u"], run.states["i"]

    `Program.run` and `Program.sim` take it; each run starts a plant of its own. Values are those of `takt run --plant`, bit for bit. An FMU
    runs in a process of its own.

    Args:
        path: The file, `….toml` or `….fmu`.
        connect: The program's port for a signal of the plant, by the signal's name, in place of the file's `[ports]`.
        period: Length of a period in s. Unless given, it is the program's constant `T` in s, or `FS` in Hz.

    Raises:
        AssemblyError: the file has mistakes, with places.
        PlantError: the FMU cannot run here.
        OSError: the file cannot be read.
        ValueError: a period or a name that makes no sense.
    """

    #: Name of the plant: its model's, or the FMU's.
    name: str
    #: Signals by which a program moves the plant, and disturbances.
    inputs: tuple[str, ...]
    #: Signals that a program may read.
    sensors: tuple[str, ...]
    #: State variables, in SI units; of an FMU its outputs.
    states: tuple[str, ...]
    #: Numbers of a model by name, in SI units: parameters, and of each disturbance value and time of its last step (`load`, `load.at`).
    parameters: dict[str, float]

    def __init__(self, path: AnyPath, *, connect: Mapping[str, str] | None = None, period: float | None = None) -> None:
        pairs = dict(connect or {})
        for signal, port in pairs.items():
            if not isinstance(signal, str) or not isinstance(port, str):
                raise TypeError(f"connect maps names of signals to names of ports, as {{'w': 'speed'}}, and not {signal!r} to {port!r}")
        if period is not None:
            period = _number("period", period)
            if not 0 < period < float("inf"):
                raise ValueError(f"period is {period} s: it must be more than 0, and finite")
        self._make(path_of("path", path), pairs, period, {})

    def _make(self, path: Path, connect: dict[str, str], period: float | None, settings: dict[str, float]) -> None:
        self._recipe = (path, connect, period, settings)
        self._core = _takt.Plant(path, list(connect.items()), period, list(settings.items()), _command())
        self.name, inputs, sensors, states = self._core.signals
        self.inputs, self.sensors, self.states = tuple(inputs), tuple(sensors), tuple(states)
        self.parameters = {name: value for name, value, _, _ in self._core.settings}

    def with_parameters(self, values: Mapping[str, float]) -> Plant:
        """The plant with other numbers; the file, which is read again, stays as it is.

        Args:
            values: Numbers in SI units by name, of `parameters`. (Those of an FMU are in a TOML file: docs/plant.md.)

        Raises:
            ValueError: an unknown name, or a value that makes no sense.
        """
        path, connect, period, settings = self._recipe
        made = dict(settings)
        for name, value in mapping_of("values", values).items():
            if name not in self.parameters:
                raise ValueError(f"the plant `{self.name}` has no parameter `{name}`{near(str(name), list(self.parameters))}")
            made[name] = _number(f"`{name}`", value)
        return _restored(path, connect, period, made)

    def __reduce__(self) -> tuple[Any, ...]:
        """For `pickle`: the file is read again."""
        path, connect, period, settings = self._recipe
        return _restored, (path.absolute(), connect, period, settings)

    def __repr__(self) -> str:
        return f"<takt.Plant {self.name}: ({', '.join(self.inputs)}) -> ({', '.join(self.sensors)})>"


def _number(what: str, value: Any) -> float:
    array = numbers(what, value)
    if array.shape != ():
        raise ValueError(f"{what} is one number, not an array of shape {array.shape}")
    return float(array)


def _restored(path: Path, connect: dict[str, str], period: float | None, settings: dict[str, float]) -> Plant:
    plant = Plant.__new__(Plant)
    plant._make(path, connect, period, settings)
    return plant


def core_of(plant: Plant | None) -> _takt.Plant | None:
    """The plant of an argument."""
    if plant is not None and not isinstance(plant, Plant):
        raise TypeError(f"plant is a takt.Plant, as takt.Plant('motor.toml'), and not a {type(plant).__name__}")
    return None if plant is None else plant._core

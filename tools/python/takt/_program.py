"""Programs, with the names, shapes and types of NumPy around the extension module."""

from __future__ import annotations

import html
import os
import warnings as python_warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from takt import _takt
from takt._batch import Batch
from takt._errors import AssemblyWarning, Diagnostic, FaultError, diagnostics
from takt._ports import AnyPath, Array, Parameter, Port, count_of, limits_of, mapping_of, near, numbers, path_of, word_of, words_of
from takt._plant import Plant, core_of
from takt._progress import progress
from takt._results import Accuracy, Analysis, Bound, Enclosure, Largest, Model, Run, Section, Span, ports_table
from takt._sim import Sim
from takt._words import in_python

#: Default limit on the cycles of a period.
MAX_CYCLES = 1_000_000_000
#: Default machine for sources.
DEFAULT_MACHINE = _takt.machines()[0][0]


def machines() -> dict[str, str]:
    """The machines that programs can be assembled for: name and description."""
    return dict(_takt.machines())


class Program:
    """A program for one machine: `takt.assemble`, `takt.load` and the modules for models make them."""

    #: Input and output ports by name, in order of declaration.
    inputs: dict[str, Port]
    outputs: dict[str, Port]
    #: Parameters (`.param`) by name, in order of declaration.
    parameters: dict[str, Parameter]
    #: Arrays of ports, for programs generated from models.
    input_arrays: tuple[Array, ...]
    output_arrays: tuple[Array, ...]
    #: Description of the model that the program was generated from; None for other programs.
    model: Model | None

    def __init__(
        self,
        core: _takt.Program,
        input_arrays: Sequence[Array] = (),
        output_arrays: Sequence[Array] = (),
        model: Model | None = None,
        data: Mapping[str, int] | None = None,
    ) -> None:
        self._core = core
        # Outputs of a model that exceed the machine's ports: address in data memory, by name.
        self._data = dict(data or {})
        self.model = model
        self.inputs = {name: Port(name, kind) for name, kind in core.inputs}
        self.outputs = {name: Port(name, kind) for name, kind in core.outputs}
        self.parameters = {
            name: Parameter(name, kind, np.array([bits], np.uint32).view(Port(name, kind).dtype)[0].item(), limits)
            for name, kind, bits, limits in core.parameters
        }
        self.input_arrays = tuple(input_arrays)
        self.output_arrays = tuple(output_arrays)

    def with_parameters(self, values: Mapping[str, float]) -> Program:
        """The program with other values of parameters at the start.

        Args:
            values: Numbers by the parameter's name; an element of an array is `K[1,2]`.

        Raises:
            ValueError: an unknown name, or a value outside of the range in the source.
        """
        settings = []
        for name, value in mapping_of("values", values).items():
            if name not in self.parameters:
                raise ValueError(f"the program has no parameter `{name}`{near(name, list(self.parameters))}")
            settings.append((name, word_of(name, value, self.parameters[name])))
        return Program(
            self._core.with_parameters(settings), self.input_arrays, self.output_arrays, self.model, self._data
        )

    # ---- Properties.

    @property
    def machine(self) -> str:
        """The machine's name."""
        return self._core.machine

    @property
    def bundles(self) -> int:
        """Bundles in the program memory."""
        return self._core.bundles

    @property
    def sources(self) -> dict[str, str]:
        """The sources by file; empty of an image without debug information."""
        return dict(self._core.sources)

    @property
    def warnings(self) -> list[Diagnostic]:
        """The assembler's warnings."""
        found = self._core.warnings
        return [] if found is None else diagnostics(found[1])

    def listing(self) -> str:
        """Every bundle's words beside the source lines they come from; of an image, source that assembles to it."""
        return self._core.listing()

    def image(self) -> bytes:
        """The image, as `takt asm -o` writes it; `takt.load` and every command read it."""
        return self._core.image()

    def bound(self) -> Bound:
        """The best and the worst that each section can take, in cycles, whatever the inputs.

        Raises:
            NoBoundError: a loop without `.loop_bound`, recursion, …: what cannot be bounded for certain.
        """
        sections, worst = self._core.bound()
        return Bound(
            tuple(Section(name, place, once, Span(*plain), Span(*in_time), Span(*missed)) for name, place, once, plain, in_time, missed in sections),
            worst,
        )

    def analyse(
        self,
        inputs: Mapping[str, ArrayLike] | None = None,
        *,
        period: int | None = None,
        name: str | None = None,
        reassemble: bool = False,
    ) -> Analysis:
        """Where the cycles of one period went: every bundle, every stall, the chain that sets the time.

        Args:
            inputs: Values as `run` takes them, of one run; inputs that are not given are 0.
            period: Which to look at, from 1; 0 is what runs once. Otherwise the last of the inputs, or the second.
            name: What the report calls the program.
            reassemble: What one cycle less would gain, also with the source assembled again for each faster machine.

        Raises:
            FaultError: the program came to a fault before.
            ValueError: there is no such period.
        """
        given = self._by_port(mapping_of("inputs", {} if inputs is None else inputs))
        lead = self._lead({what: shape for what, shape, _ in given.values()})
        if len(lead) > 1:
            raise ValueError(f"an analysis is of one run, and the inputs have {lead[0]}")
        wanted = count_of("period", period, least=0)
        if lead and wanted is not None and wanted > lead[0]:
            raise ValueError(f"the inputs have {lead[0]} periods, so there is no period {wanted}")
        count = lead[0] if lead else max(wanted, 1) if wanted is not None else 2
        words = np.zeros((count, len(self.inputs)), np.uint32)
        for column, port in enumerate(self.inputs):
            if port in given:
                words[:, column] = given[port][2]
        name = name or next(iter(self.sources), "program")
        made, fault = _takt.analyse(self._core, name, words.tolist(), wanted, reassemble)
        if fault is not None:
            raise FaultError(fault)
        if made is None:
            raise RuntimeError("there is neither an analysis nor a fault")
        return Analysis(*made)

    def accuracy(
        self, inputs: Mapping[str, ArrayLike], *, each_period: bool = False, max_cycles: int = MAX_CYCLES
    ) -> dict[str, Accuracy]:
        """The errors of the outputs against binary64, and the operations that they come from, by output port.

        Args:
            inputs: Values as `run` takes them, of one run.
            each_period: Let each period begin with exact values: errors that states carry from period to period are left out.
            max_cycles: A period that takes more is a fault.

        Raises:
            FaultError: the program came to a fault.
        """
        given = self._by_port(mapping_of("inputs", {} if inputs is None else inputs))
        self._all_given(given)
        lead = self._lead({what: shape for what, shape, _ in given.values()})
        if len(lead) > 1:
            raise ValueError(f"the accuracy is that of one run, and the inputs have {lead[0]}")
        words = np.empty((lead[0] if lead else 1, len(given)), np.uint32)
        for column, port in enumerate(self.inputs):
            words[:, column] = given[port][2]
        limit = count_of("max_cycles", max_cycles) or MAX_CYCLES
        outputs, fault = _takt.accuracy(self._core, words, each_period, limit)
        if fault is not None:
            raise FaultError(fault)

        def largest(of: tuple[float, int, float, float] | None) -> Largest | None:
            return None if of is None else Largest(*of)

        return {
            one["name"]: Accuracy(
                one["name"],
                one["periods"],
                largest(one["absolute"]),
                largest(one["ulp"]),
                largest(one["relative"]),
                tuple(one["operations"]),
            )
            for one in outputs
        }

    def enclose(self) -> Enclosure:
        """What the outputs can be and how large their errors, in every period that begins with inputs and states in the ranges
        that the source gives them (`.range`).

        Raises:
            NoBoundError: no such bound can be given: an input without a range, a loop without a bound.
        """
        return Enclosure.of(self._core)

    # ---- Runs.

    def run(
        self,
        inputs: Mapping[str, ArrayLike] | None = None,
        *,
        periods: int | None = None,
        plant: Plant | None = None,
        tick: int | None = None,
        max_cycles: int = MAX_CYCLES,
    ) -> Run:
        """Runs the program from reset, a period for each element of the inputs.

        Args:
            inputs: Values of every input port by name, in the port's unit: a number for all periods, an array of shape
                (periods,), or, for a batch of independent runs, (runs, periods); NumPy's rules of broadcasting join them,
                so that (runs, 1) is a parameter of each run. An array of ports, as `q` of shape (6,), has its own
                dimensions behind these: (periods, 6). Numbers are rounded to binary32 once.
            periods: How many, if no input says so. Without both, the program runs to its `halt`, and outputs and cycles
                have shape ().
            plant: Closes the loop of a single run: it gives the inputs that its sensors drive, which are left out of `inputs`, and moves
                between the periods. Inputs that its file states may be left out, too. `Run.inputs` and `Run.states` have the loop.
            tick: Cycles from tick to tick, 100,000,000 at most; without it, the tick comes when the program is ready.
            max_cycles: A period, or a run to `halt`, that takes more is ended by a fault.

        Returns:
            Outputs, cycles, exception flags and faults. A fault does not raise: see `Run.faults` and `Run.check`.

        Raises:
            ValueError: a name, shape or value that does not fit, with the name nearest to it.
            PlantError: the plant cannot run, or inputs have no source; AssemblyError: it does not fit the program.
        """
        tick, max_cycles = limits_of(tick, max_cycles, MAX_CYCLES)
        given = self._by_port(mapping_of("inputs", {} if inputs is None else inputs))
        closing = core_of(plant)
        if closing is None:
            self._all_given(given)
        lead = self._lead({what: shape for what, shape, _ in given.values()})
        if periods is not None:
            wanted = count_of("periods", periods, least=0) or 0
            if lead and lead[-1] not in (1, wanted):
                raise ValueError(f"periods is {wanted}, and the inputs have {lead[-1]}")
            lead = (*lead[:-1], wanted)
        if closing is not None and plant is not None:
            if len(lead) != 1:
                raise ValueError("a plant moves from period to period in one run: " + ("give periods" if not lead else f"the inputs have {lead[0]} runs"))
            return self._run_loop(plant, closing, given, lead[0], tick, max_cycles)
        if not lead:
            return self._run_to_halt({name: words for name, (_, _, words) in given.items()}, max_cycles)
        runs, count = lead if len(lead) == 2 else (1, lead[0])
        words = np.empty((len(given), count, runs), np.uint32)
        for series, name in zip(words, self.inputs):
            series[:] = np.broadcast_to(given[name][2], (runs, count)).T
        outputs = np.empty((len(self.outputs) + len(self._data), count, runs), np.uint32)
        cycles, missed = np.zeros((count, runs), np.uint64), np.zeros((count, runs), np.uint64)
        ran = _takt.run(self._core, list(self._data.values()), words, outputs, cycles, missed, tick, max_cycles)

        def shaped(array: NDArray[Any]) -> NDArray[Any]:
            return array.T if len(lead) == 2 else array[:, 0]

        ports = {name: shaped(bits.view(port.dtype)) for (name, port), bits in zip(self.outputs.items(), outputs)}
        ports |= {name: shaped(bits.view(np.float32)) for name, bits in zip(self._data, outputs[len(self.outputs) :])}
        return Run(self.output_arrays, ports, shaped(cycles.view(np.int64)), shaped(missed.view(np.int64)), ran)

    def _run_loop(
        self, plant: Plant, closing: _takt.Plant, given: Mapping[str, Any], count: int, tick: int | None, max_cycles: int
    ) -> Run:
        nothing = {"float": np.array(np.nan, np.float32).view(np.uint32)}
        words = np.zeros((len(self.inputs), count), np.uint32)
        for series, port in zip(words, self.inputs.values()):
            series[:] = given[port.name][2] if port.name in given else nothing.get(port.type, np.uint32(0))
        outputs = np.empty((len(self.outputs) + len(self._data), count), np.uint32)
        states = np.full((len(plant.states), count), np.nan)
        cycles, missed = np.zeros(count, np.uint64), np.zeros(count, np.uint64)
        data, known = list(self._data.values()), [name in given for name in self.inputs]
        ran = _takt.run_loop(self._core, closing, data, known, words, outputs, states, cycles, missed, tick, max_cycles)
        ports: dict[str, NDArray[Any]] = {name: bits.view(port.dtype) for (name, port), bits in zip(self.outputs.items(), outputs)}
        ports |= {name: bits.view(np.float32) for name, bits in zip(self._data, outputs[len(self.outputs) :])}
        run = Run(self.output_arrays, ports, cycles.view(np.int64), missed.view(np.int64), ran)
        run.inputs = {name: bits.view(port.dtype) for (name, port), bits in zip(self.inputs.items(), words)}
        run.states = dict(zip(plant.states, states))
        return run

    def _run_to_halt(self, words: Mapping[str, NDArray[np.uint32]], max_cycles: int) -> Run:
        bits = [int(words[name]) for name in self.inputs]
        cycles, values, flags, fault = _takt.run_to_halt(self._core, list(self._data.values()), bits, max_cycles)
        nothing = {"float": np.array(np.nan, np.float32).view(np.uint32)}
        ports: dict[str, NDArray[Any]] = {}
        for port, value in zip(self.outputs.values(), values):
            word = nothing.get(port.type, np.array(0, np.uint32)) if value is None else np.array(value, np.uint32)
            ports[port.name] = word.view(port.dtype)
        for name, value in zip(self._data, values[len(self.outputs) :]):
            ports[name] = np.array(value or 0, np.uint32).view(np.float32)
        ran: _takt.Ran = {
            "completed": [0 if fault else 1],
            "flags": bytes([flags]),
            "failures": [fault] if fault else [],
            "unwritten": [int(value is None) for value in values[: len(self.outputs)]],
            "nan_writes": 0,
        }
        return Run(self.output_arrays, ports, np.array(cycles, np.int64), np.array(0, np.int64), ran)

    def sim(self, *, plant: Plant | None = None, tick: int | None = None, max_cycles: int = MAX_CYCLES) -> Sim:
        """A machine with the program in it, to be stepped period by period.

        Args:
            plant: Closes the loop: `step` then takes only the inputs that neither its sensors nor its file give.
            tick: Cycles from tick to tick, 100,000,000 at most; without it, the tick comes when the program is ready.
            max_cycles: A period that takes more is ended by a fault.
        """
        return Sim(self, _takt.Sim(self._core, *limits_of(tick, max_cycles, MAX_CYCLES), core_of(plant)), plant)

    def batch(self, runs: int, *, tick: int | None = None, max_cycles: int = MAX_CYCLES) -> Batch:
        """So many machines with the program in them, whose closed loops run together, computed in vectors and on all cores.

        Args:
            runs: How many.
            tick: Cycles from tick to tick, 100,000,000 at most; without it, the tick comes when the program is ready.
            max_cycles: A period that takes more is ended by a fault.
        """
        return Batch(self, runs, *limits_of(tick, max_cycles, MAX_CYCLES))

    # ---- Names and shapes.

    def _by_port(self, inputs: Mapping[str, ArrayLike]) -> dict[str, tuple[str, tuple[int, ...], NDArray[np.uint32]]]:
        """For each port that is given a value: what it is called there, the shape before its own, and the words."""
        arrays = {array.name: array for array in self.input_arrays}
        ports: dict[str, tuple[str, tuple[int, ...], NDArray[np.uint32]]] = {}

        def give(port: str, what: str, values: NDArray[Any]) -> None:
            if port in ports:
                raise ValueError(f"`{port}` is given twice: by {ports[port][0]} and by {what}")
            ports[port] = (what, values.shape, words_of(what, self.inputs[port], values))

        for name, value in inputs.items():
            what = f"`{name}`"
            array = arrays.get(name)
            if array is None and name not in self.inputs:
                raise ValueError(f"the program has no input {what}{near(name, [*arrays, *self.inputs])}")
            values = numbers(what, value)
            if array is None:
                give(name, what, values)
                continue
            own = len(array.shape)
            if own and values.shape[-own:] != array.shape:
                raise ValueError(
                    f"{what} has shape {values.shape}; an array of shape {array.shape} is needed, or that with the periods before it"
                )
            flat = values.reshape(*values.shape[: values.ndim - own], -1) if own else values[..., None]
            for index, element in enumerate(array.elements):
                if isinstance(element, str):
                    give(element, what, flat[..., index])
        return ports

    def _all_given(self, given: Mapping[str, Any]) -> None:
        missing = [f"`{name}`" for name in self.inputs if name not in given]
        if missing:
            raise ValueError(f"no values for the input{'s' if len(missing) > 1 else ''} {', '.join(missing)}")

    @staticmethod
    def _lead(shapes: Mapping[str, tuple[int, ...]]) -> tuple[int, ...]:
        """The shape that inputs have together: (), (periods,) or (runs, periods)."""
        for what, shape in shapes.items():
            if len(shape) > 2:
                raise ValueError(f"{what} has {len(shape)} dimensions before its own: there are runs and periods at most")
        try:
            return np.broadcast_shapes(*shapes.values())
        except ValueError:
            text = ", ".join(f"{what} {shape}" for what, shape in shapes.items() if shape)
            raise ValueError(f"inputs of different lengths: {text}") from None

    def _repr_html_(self) -> str:
        ports = [("input", port.name, port.type) for port in self.inputs.values()]
        ports += [("output", port.name, port.type) for port in self.outputs.values()]
        listing = f"<details><summary>listing</summary><pre>{html.escape(self.listing())}</pre></details>"
        return ports_table(ports, repr(self)[1:-1]) + listing

    def __repr__(self) -> str:
        def names(ports: Mapping[str, Port], arrays: Sequence[Array]) -> str:
            listed = [f"{array.name}{list(array.shape) if array.shape else ''}" for array in arrays] or list(ports)
            return ", ".join(listed[:8]) + (", …" if len(listed) > 8 else "")

        ins, outs = names(self.inputs, self.input_arrays), names(self.outputs, self.output_arrays)
        return f"<takt.Program for {self.machine}: {self.bundles} bundles, ({ins}) -> ({outs})>"


def assemble(
    text: str,
    machine: str | None = None,
    *,
    name: str = "program.s",
    folder: AnyPath = ".",
    include: Sequence[AnyPath] = (),
    schedule: str = "source",
    contract: str = "source",
    effort: int | None = None,
    warnings: Sequence[str] = (),
) -> Program:
    """Assembles a source.

    Args:
        text: The source.
        machine: The machine's name, as `takt.machines()` lists them, or the file of one (`my.toml`). Memories of other depths may
            follow it, as in `t3,data=32768`.
            Unless given, it is the one that the source names (`.machine`), or `takt.DEFAULT_MACHINE`.
        name: What diagnostics call the source.
        folder: Where what it includes is looked for.
        include: And in these folders, and then in Takt's library.
        schedule: Which bundles the scheduler packs: `source` (under `.schedule on`), `on` (all), `off` (none).
        contract: Which products are fused into sums, on machines that can: `source`, `on`, `off`.
        effort: How long the scheduler searches; 0 is one pass.
        warnings: What becomes of warnings: `error`, `error=NAME`, `allow=NAME`, as `takt asm -W`.

    Raises:
        AssemblyError: the source has errors: all of them, with places.
        ValueError: there is no such machine, or the source names another.
    """
    if not isinstance(text, str):
        raise TypeError(f"a source is a str, not {type(text).__name__}; takt.load reads files")
    if "\n" not in text and text.endswith((".s", ".takt")) and Path(text).is_file():
        raise ValueError(f"{text!r} is a file's name, not a source: takt.load({text!r}) reads it")
    where, included = path_of("folder", folder), _folders(include)
    with progress(f"building {name}"):
        core = _takt.assemble(
            text.encode(), name, where, included, machine or DEFAULT_MACHINE, schedule, contract, count_of("effort", effort, 0), list(warnings)
        )
    _check_machine(core, machine, name)
    return _warned(Program(core))


def _check_machine(core: _takt.Program, machine: str | None, name: object) -> None:
    if machine is not None and not core.is_for(machine):
        raise ValueError(f"{name} is for {core.machine}, not for {machine}")


def load(
    path: AnyPath,
    machine: str | None = None,
    *,
    include: Sequence[AnyPath] = (),
    schedule: str = "source",
    contract: str = "source",
    effort: int | None = None,
    warnings: Sequence[str] = (),
) -> Program:
    """The program in a file: a source, which is assembled as `assemble` does it, or an image.

    Args:
        path: The file. What a source includes is looked for beside it first.
        machine: The machine's name, or its file; of an image, or of a source that names one (`.machine`), it must be its own.

    Raises:
        OSError: the file cannot be read.
        AssemblyError: the source has errors.
        ValueError: the image is damaged, or for another machine.
    """
    path = path_of("path", path)
    core, text = _takt.load(path)
    if core is None:
        with progress(f"building {path.name}"):
            core = _takt.assemble(
                text, path.name, path.parent, _folders(include), machine or DEFAULT_MACHINE, schedule, contract, count_of("effort", effort, 0), list(warnings)
            )
    _check_machine(core, machine, path)
    return _warned(Program(core))


def _folders(include: Sequence[AnyPath]) -> list[str | os.PathLike[str]]:
    # Without this check, a str would be a sequence of letters and bytes one of numbers.
    if isinstance(include, (str, bytes, os.PathLike)):
        raise TypeError(f"include is a list of folders: [{include!r}]")
    return [path_of("include", folder) for folder in include]


def _warned(program: Program) -> Program:
    found = program._core.warnings
    if found is not None:
        python_warnings.warn("\n" + in_python(found[0].rstrip("\n")), AssemblyWarning, stacklevel=3)
    return program


def modelled(model: _takt.Model, name: str, machine: str, effort: int | None) -> Program:
    """The program of a model's source."""

    def arrays(shaped: list[tuple[str, list[int], list[str | float | None]]]) -> list[Array]:
        return [Array(name, tuple(shape), tuple(elements)) for name, shape, elements in shaped]

    with progress(f"building {name}"):
        core = _takt.assemble(
            model["source"].encode(), name, ".", [], machine, "source", "source", count_of("effort", effort, 0), []
        )
    about = Model(
        model["title"], tuple(in_python(note) for note in model["notes"]), model["operations"], tuple(model["joints"]), dict(model["texts"])
    )
    data = {name: (core.data_address(array) or 0) + word for name, array, word in model["data"]}
    return _warned(Program(core, arrays(model["inputs"]), arrays(model["outputs"]), about, data))

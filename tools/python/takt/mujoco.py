"""MuJoCo as the plant of a program, exact to the cycle.

    import mujoco, takt.mujoco

    law = takt.mujoco.program("panda.xml", "computed-torque", kp=400, kd=40)
    loop = takt.mujoco.Controller(model, law, period=1e-4, reference=lambda t: {"qr": …, "qdr": …, "qddr": …})
    for k in range(10_000):
        loop.step(data)                 # a period: 10,000 make a second

    mujoco.set_mjcb_control(loop)       # or as MuJoCo's control callback, on the grid of its own steps

docs/mujoco.md describes what is exact, and what the options do.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from takt import urdf
from takt._errors import FaultError
from takt._ports import near
from takt._program import DEFAULT_MACHINE, Program

__all__ = ["CLOCK", "Controller", "Encoder", "program"]

#: Default clock of the machine, Hz.
CLOCK = 125e6

_mujoco: Any = importlib.import_module("mujoco")


def program(robot: Any, function: str, machine: str = DEFAULT_MACHINE, **options: Any) -> Program:
    """As `takt.urdf.program`, which reads MJCF as well as URDF; `robot` may be a `mujoco.MjSpec`, too."""
    return urdf.program(robot.to_xml() if hasattr(robot, "to_xml") else robot, function, machine, **options)


@dataclass(frozen=True)
class Encoder:
    """Joint positions as an encoder counts them, and velocities as differences of counts."""

    #: Encoder counts per turn, or per metre for a sliding joint.
    counts: float
    #: Corner frequency of the first-order filter after the differences, Hz; None disables the filter.
    cutoff: float | None = None

    def __post_init__(self) -> None:
        if not (self.counts > 0 and math.isfinite(self.counts)):
            raise ValueError(f"counts is {self.counts}: a positive number")
        if self.cutoff is not None and not self.cutoff > 0:
            raise ValueError(f"cutoff is {self.cutoff}: a positive frequency, or None")


class Controller:
    """A program as the controller of one robot, or of several that are alike.

    The program's inputs `q` and `qd` are positions and velocities of the joints that it is about, its output `tau` the forces of their
    motors; other inputs are sensors of the same name, those that `sensors` names, or what `reference` returns.

    Args:
        model: The `mujoco.MjModel`.
        program: The program. If it is not made of a robot, `joints` says what `q`, `qd` and `tau` are about.
        period: The time from tick to tick, s: a whole number of cycles.
        clock: The machine's clock, Hz.
        runs: Robots; `step` then takes as many `mujoco.MjData`.
        latency: Cycles from the tick, when inputs are read, until the outputs act. None is what the program takes, to its `wait`: each
            period its own. 0 is a controller that takes no time.
        encoder: How positions and velocities are measured; None is exactly.
        sensors: By input or array of inputs, the names of the sensors that it reads.
        actuators: By output or array of outputs, the names of the actuators whose `ctrl` it is.
        reference: A function of the time in s that returns further inputs.
        joints: The names of the joints, in the order of `q`.

    Raises:
        ValueError: a name that the model does not have, with the one nearest to it; an actuator that is no motor.
    """

    def __init__(
        self,
        model: Any,
        program: Program,
        *,
        period: float,
        clock: float = CLOCK,
        runs: int = 1,
        latency: int | None = None,
        encoder: Encoder | None = None,
        sensors: Mapping[str, str | Sequence[str]] | None = None,
        actuators: Mapping[str, str | Sequence[str]] | None = None,
        reference: Callable[[float], Mapping[str, ArrayLike]] | None = None,
        joints: Sequence[str] | None = None,
    ) -> None:
        cycles = period * clock
        self.tick = round(cycles)
        if self.tick < 1 or abs(cycles - self.tick) > 1e-6 * cycles:
            raise ValueError(f"period is {period} s, {cycles} cycles of {clock:g} Hz: a whole number of them is needed")
        if latency is not None and latency < 0:
            raise ValueError(f"latency is {latency}: it is 0 at least")
        self.model, self.program, self.clock, self.runs = model, program, float(clock), runs
        self.latency, self.encoder, self.reference = latency, encoder, reference
        if joints is None:
            joints = program.model.joints if program.model is not None else ()
        kinds = _mujoco.mjtJoint
        self._joints = np.array([_id(model, "joint", name, int(kinds.mjJNT_SLIDE)) for name in joints], int)
        self._slides = model.jnt_type[self._joints] == int(kinds.mjJNT_SLIDE)
        self._qpos, self._dofs = model.jnt_qposadr[self._joints], model.jnt_dofadr[self._joints]
        known_inputs = [*(array.name for array in program.input_arrays), *program.inputs]
        known_outputs = [array.name for array in program.output_arrays] or list(program.outputs)
        self._moving = [name for name in ("q", "qd") if len(joints) and name in known_inputs]
        self._sensors: dict[str, NDArray[np.int64]] = {}
        for name, wanted in {**_same(model, program), **(sensors or {})}.items():
            if name not in known_inputs:
                raise ValueError(f"sensors: the program has no input `{name}`{near(name, known_inputs)}")
            self._sensors[name] = _places(model, wanted)
        # Indices in `ctrl`, and the force of a motor at a `ctrl` of 1.
        self._actuators: dict[str, tuple[NDArray[np.int64], NDArray[np.float64] | float]] = {}
        for name, wanted in (actuators or {}).items():
            if name not in known_outputs:
                raise ValueError(f"actuators: the program has no output `{name}`{near(name, known_outputs)}")
            names = [wanted] if isinstance(wanted, str) else wanted
            self._actuators[name] = np.array([_id(model, "actuator", one) for one in names], int), 1.0
        if "tau" in known_outputs and "tau" not in self._actuators and len(joints):
            self._actuators["tau"] = _motors(model, self._joints)
        if not self._actuators:
            raise ValueError(f"no output moves anything: actuators={{…}} names them (outputs: {', '.join(known_outputs)})")
        arrays = {array.name for array in program.input_arrays if array.shape}
        read = {name: len(self._joints) for name in self._moving} | {name: len(places) for name, places in self._sensors.items()}
        self._single = {name for name in read if name not in arrays}
        for name in self._single:
            if read[name] != 1:
                raise ValueError(f"input `{name}` is one number, and reads {read[name]}: give it one joint or sensor")
        self._batch = program.batch(runs, tick=self.tick)
        self.reset()

    def reset(self) -> None:
        """Back to the state after loading; the next tick is when `step` or MuJoCo calls."""
        self._batch.reset()
        self._start: float | None = None
        self._position: NDArray[np.float64] | None = None
        self._velocity = np.zeros((self.runs, len(self._joints)))
        # Pending actuation of each robot: cycles since the first tick, and `ctrl`.
        self._pending: list[list[tuple[int, NDArray[np.float64]]]] = [[] for _ in range(self.runs)]

    @property
    def periods(self) -> int:
        """Periods since reset."""
        return self._batch.periods

    @property
    def cycles(self) -> NDArray[np.int64]:
        """Cycles of the last period, by robot."""
        return self._batch.cycles

    @property
    def missed(self) -> NDArray[np.int64]:
        """Deadlines missed in the last period, by robot."""
        return self._batch.missed

    @property
    def outputs(self) -> dict[str, NDArray[Any]]:
        """The outputs of the last period."""
        return self._batch.outputs

    def _measured(self, datas: Sequence[Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        position = np.stack([data.qpos[self._qpos] for data in datas])
        if self.encoder is None:
            return position, np.stack([data.qvel[self._dofs] for data in datas])
        count = np.where(self._slides, 1.0, 2 * np.pi) / self.encoder.counts
        position = np.round(position / count) * count
        if self._position is not None:
            period = self.tick / self.clock
            difference = (position - self._position) / period
            cutoff = self.encoder.cutoff
            share = 1.0 if cutoff is None else -math.expm1(-2 * math.pi * cutoff * period)
            self._velocity += share * (difference - self._velocity)
        self._position = position
        return position, self._velocity.copy()

    def _compute(self, datas: Sequence[Any]) -> None:
        """A tick: reads the sensors, runs the program, and notes what will act and when."""
        read: dict[str, NDArray[Any]] = {}
        if self._moving:
            measured = dict(zip(("q", "qd"), self._measured(datas)))
            read = {name: measured[name] for name in self._moving}
        for name, places in self._sensors.items():
            read[name] = np.stack([data.sensordata[places] for data in datas])
        # Pass a single value for a port that is not an array.
        inputs: dict[str, ArrayLike] = {name: value[:, 0] if name in self._single else value for name, value in read.items()}
        if self.reference is not None:
            inputs.update(self.reference(float(datas[0].time)))
        begin = self._batch.periods * self.tick
        outputs = self._batch.step(inputs)
        if self._batch.faults:
            raise FaultError(self._batch.faults[0])
        for run, (data, cycles) in enumerate(zip(datas, self._batch.cycles)):
            queue = self._pending[run]
            control = (queue[-1][1] if queue else data.ctrl).copy()
            for name, (places, force) in self._actuators.items():
                control[places] = outputs[name][run] / force
            queue.append((begin + (int(cycles) if self.latency is None else self.latency), control))

    def step(self, data: Any | Sequence[Any]) -> None:
        """Simulates a period, from one tick to the next.

        The plant is integrated in steps that end when outputs change, no longer than the model's own `timestep`.

        Args:
            data: The `mujoco.MjData`; of several robots, a list.

        Raises:
            FaultError: the machine has stopped.
        """
        datas: list[Any] = list(data) if isinstance(data, (list, tuple)) else [data]
        if len(datas) != self.runs:
            raise ValueError(f"{len(datas)} MjData for {self.runs} robots")
        if self._sensors:
            for one in datas:
                _mujoco.mj_forward(self.model, one)
        number = self._batch.periods
        if self._start is None:
            self._start = float(datas[0].time)
        self._compute(datas)
        end = (number + 1) * self.tick
        longest = float(self.model.opt.timestep)
        try:
            for one, queue in zip(datas, self._pending):
                now = number * self.tick
                while now < end:
                    while queue and queue[0][0] <= now:
                        one.ctrl[:] = queue.pop(0)[1]
                    until = min(end, queue[0][0]) if queue else end
                    time = (until - now) / self.clock
                    steps = max(1, math.ceil(time / longest - 1e-9))
                    self.model.opt.timestep = time / steps
                    _mujoco.mj_step(self.model, one, steps)
                    now = until
                # Adding up steps would drift relative to the cycles.
                one.time = self._start + end / self.clock
        finally:
            self.model.opt.timestep = longest

    def __call__(self, model: Any, data: Any) -> None:
        """MuJoCo's control callback (`mujoco.set_mjcb_control(loop)`), of one robot. Ticks and changes of outputs take effect in the first
        of MuJoCo's steps that begins then or later: with a `timestep` that divides both, this is exact, too."""
        if self.runs != 1:
            raise ValueError(f"the callback is for one robot, this is for {self.runs}: use step")
        if int(model.opt.integrator) == int(_mujoco.mjtIntegrator.mjINT_RK4):
            raise ValueError("the integrator RK4 calls the controller within a step: take another one, or use step")
        if self._start is None or data.time < self._start:
            self.reset()
            self._start = float(data.time)
        now = math.floor((data.time - self._start) * self.clock + 0.5)
        while self._batch.periods * self.tick <= now:
            self._compute([data])
        queue = self._pending[0]
        while queue and queue[0][0] <= now:
            data.ctrl[:] = queue.pop(0)[1]

    def __repr__(self) -> str:
        time = "as long as the program takes" if self.latency is None else f"{self.latency} cycles"
        return f"<takt.mujoco.Controller of {self.runs}: {self.tick} cycles a period, outputs after {time}>"


def _id(model: Any, what: str, name: str, least: int | None = None) -> int:
    """The number of a joint, a sensor or an actuator."""
    kind = getattr(_mujoco.mjtObj, f"mjOBJ_{what.upper()}")
    number = int(_mujoco.mj_name2id(model, int(kind), name))
    if number < 0:
        count = {"joint": model.njnt, "sensor": model.nsensor, "actuator": model.nu}[what]
        names = [_mujoco.mj_id2name(model, int(kind), index) or "" for index in range(count)]
        raise ValueError(f"the model has no {what} `{name}`{near(name, [one for one in names if one])}")
    if least is not None and model.jnt_type[number] < least:
        raise ValueError(f"joint `{name}` neither turns nor slides: a free or ball joint has no one position")
    return number


def _places(model: Any, names: str | Sequence[str]) -> NDArray[np.int64]:
    """The places of sensors' values in `sensordata`."""
    places: list[int] = []
    for name in [names] if isinstance(names, str) else names:
        number = _id(model, "sensor", name)
        places += range(model.sensor_adr[number], model.sensor_adr[number] + model.sensor_dim[number])
    return np.array(places, int)


def _same(model: Any, program: Program) -> dict[str, str]:
    """Inputs that are called as a sensor is."""
    kind = int(_mujoco.mjtObj.mjOBJ_SENSOR)
    sensors = {_mujoco.mj_id2name(model, kind, index) for index in range(model.nsensor)}
    own = {element for array in program.input_arrays for element in array.elements}
    names = [*(array.name for array in program.input_arrays), *(name for name in program.inputs if name not in own)]
    return {name: name for name in names if name in sensors}


def _motors(model: Any, joints: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The actuators of joints, and the force of each for a `ctrl` of 1."""
    at_joint = int(_mujoco.mjtTrn.mjTRN_JOINT)
    found, forces = [], []
    for joint in joints:
        name = _mujoco.mj_id2name(model, int(_mujoco.mjtObj.mjOBJ_JOINT), int(joint))
        here = [i for i in range(model.nu) if model.actuator_trntype[i] == at_joint and model.actuator_trnid[i, 0] == joint]
        if len(here) != 1:
            count = "no actuator" if not here else f"{len(here)} actuators"
            raise ValueError(f"joint `{name}` has {count}: one motor is needed, or actuators={{'tau': […]}}")
        (i,) = here
        plain = (
            model.actuator_gaintype[i] == int(_mujoco.mjtGain.mjGAIN_FIXED)
            and model.actuator_biastype[i] == int(_mujoco.mjtBias.mjBIAS_NONE)
            and model.actuator_dyntype[i] == int(_mujoco.mjtDyn.mjDYN_NONE)
        )
        force = float(model.actuator_gear[i, 0] * model.actuator_gainprm[i, 0])
        if not plain or force == 0:
            actuator = _mujoco.mj_id2name(model, int(_mujoco.mjtObj.mjOBJ_ACTUATOR), i)
            raise ValueError(f"actuator `{actuator}` of joint `{name}` is no motor: its force is not in proportion to `ctrl`")
        found.append(i)
        forces.append(force)
    return np.array(found, int), np.array(forces)

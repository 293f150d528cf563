"""Programs for the Takt processor, from Python: assemble, run over NumPy arrays, close a loop, bound, analyse.

    import numpy as np, takt

    program = takt.assemble(".input x\\n.output y\\n.period\\nloop: fmul y, x, 0.5\\n wait loop\\n")
    run = program.run({"x": np.linspace(0, 1, 1000)})    # a period for each element
    run.outputs["y"], run.cycles                         # float32 and int64, each of shape (1000,)

    sim = program.sim()                                  # the same, period by period
    y = sim.step({"x": 0.25})["y"]
    batch = program.batch(1000)                          # and a thousand of them at once
    motor = takt.Plant("dc_motor.toml")                    # a plant in a file, or an FMU: program.run(plant=motor, periods=400)

    system = takt.System("axis.toml")                      # several cores with links between them
    board = takt.Board("/dev/ttyUSB0", program)            # and on a board

The arithmetic is the machine's, bit for bit, and so are the cycles. `takt.urdf`, `takt.casadi`, `takt.sympy` and `takt.onnx` make
programs from robots' descriptions, from expressions and from learned policies; `takt.mujoco` runs them against MuJoCo.
"""

from takt import _takt
from takt._batch import Batch, Loops
from takt._board import Board, BoardStatus, Recording
from takt._distribute import distribute
from takt._errors import (
    AssemblyError,
    AssemblyWarning,
    BoardError,
    Diagnostic,
    FaultError,
    ModelError,
    NoBoundError,
    Place,
    PlantError,
    TaktError,
)
from takt._plant import Plant
from takt._ports import Array, Parameter, Port
from takt._program import DEFAULT_MACHINE, Program, assemble, load, machines
from takt._progress import set_progress
from takt._results import (
    Accuracy,
    Analysis,
    Assumed,
    Bound,
    Enclosure,
    Hazard,
    Largest,
    Model,
    OutputBound,
    Run,
    Section,
    Span,
)
from takt._sim import Sim
from takt._system import CorePeriods, System
from takt._takt import Fault

#: Version of the package.
__version__ = _takt.version(_takt.__file__)

__all__ = [
    "DEFAULT_MACHINE",
    "Accuracy",
    "Analysis",
    "Array",
    "AssemblyError",
    "AssemblyWarning",
    "Assumed",
    "Batch",
    "Board",
    "BoardError",
    "BoardStatus",
    "Bound",
    "CorePeriods",
    "Diagnostic",
    "Enclosure",
    "Fault",
    "FaultError",
    "Hazard",
    "Largest",
    "Loops",
    "Model",
    "ModelError",
    "NoBoundError",
    "OutputBound",
    "Parameter",
    "Place",
    "Plant",
    "PlantError",
    "Port",
    "Program",
    "Recording",
    "Run",
    "Section",
    "Sim",
    "Span",
    "System",
    "TaktError",
    "assemble",
    "distribute",
    "load",
    "machines",
    "set_progress",
]

"""Programs from learned policies in ONNX.

    import takt.onnx

    policy = takt.onnx.program("policy.onnx")
    policy.run({"obs": states}).outputs["action"]      # names of the file; states of shape (periods, 48), say
"""

from __future__ import annotations

from typing import Any

from takt import _takt
from takt._ports import AnyPath, path_of
from takt._program import DEFAULT_MACHINE, Program, modelled


def program(
    policy: AnyPath | Any,
    machine: str = DEFAULT_MACHINE,
    *,
    output: str | None = None,
    range: tuple[float, float] | None = None,
    exact: bool = False,
    effort: int | None = None,
) -> Program:
    """A network as a program whose input and output have the names of the file and shape (n,).

    Args:
        policy: The path of a file in ONNX, whose weights may lie in a file beside it, or a model (`onnx.ModelProto`, anything with
            `SerializeToString`). docs/readers.md lists the operators that are read.
        machine: The machine's name. Its memories become as deep as the weights need.
        output: The output to compute, of several; without a name, the only one that depends on the input.
        range: States that every number of the input lies between these, which `Program.enclose` needs.
        exact: Computes a normalisation as the file has it; otherwise its factors become part of the weights.
        effort: How long the scheduler searches; 0 is one pass.

    Raises:
        ModelError: the file is not an ONNX model, has an operator that is not read, or does not fit the machine.
        AssemblyError: the program does not fit the machine.
    """
    if hasattr(policy, "SerializeToString"):
        content, name, folder = policy.SerializeToString(), "policy", None
    else:
        path = path_of("policy", policy)
        content, name, folder = path.read_bytes(), path.stem, str(path.parent)
    ends = None if range is None else (float(range[0]), float(range[1]))
    model = _takt.perceptron(content, name, exact, ends, machine, output, folder)
    return modelled(model, f"{name}.s", machine, effort)

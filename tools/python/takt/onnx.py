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
    range: tuple[float, float] | None = None,
    exact: bool = False,
    effort: int | None = None,
) -> Program:
    """A multi-layer perceptron as a program whose input and output have the names of the file and shape (n,).

    Args:
        policy: The path of a file in ONNX, or a model (`onnx.ModelProto`, anything with `SerializeToString`). A chain of Gemm, MatMul,
            Add, Sub, Mul, Div, Relu, Tanh, Sigmoid, Elu and Clip is read; weights lie in the file itself.
        machine: The machine's name. Its memories become as deep as the weights need.
        range: States that every number of the input lies between these, which `Program.enclose` needs.
        exact: Computes a normalisation as the file has it; otherwise its factors become part of the weights.
        effort: How long the scheduler searches; 0 is one pass.

    Raises:
        ModelError: the file is no model of ONNX, has another operator or a branch, or does not fit the machine.
        AssemblyError: the program does not fit the machine.
    """
    if hasattr(policy, "SerializeToString"):
        content, name = policy.SerializeToString(), "policy"
    else:
        path = path_of("policy", policy)
        content, name = path.read_bytes(), path.stem
    ends = None if range is None else (float(range[0]), float(range[1]))
    model = _takt.perceptron(content, name, exact, ends, machine)
    return modelled(model, f"{name}.s", machine, effort)

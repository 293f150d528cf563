# SPDX-License-Identifier: MIT OR Apache-2.0
"""Compares a unit of one operand with the specification for every operand, by bit-parallel simulation of its gates.

The function that a unit computes is what is left of it, unrolled over the cycles of one operation, if it depends on nothing else.
`cargo evidence enumerate` evaluates it, for 512 operands at a time.
"""

import hashlib
import os
import re
import subprocess
from pathlib import Path

from balance import Unrolled
from circuit import FORMAL, UNITS, Failure, Graph
from unrolled import needed

# Program that evaluates a graph beside the specification: cargo's path of the binary `evidence`.
ENUMERATOR = os.environ.get("TAKT_ENUMERATOR")
# Sources of the specification, and of that program's comparison.
COMPARED = [FORMAL.parents[1] / "isa" / "src" / "fp", FORMAL / "src"]
# Driver of a circuit in Verilator.
DRIVER = FORMAL.parent / "tests" / "harness"
# Number of combinations of sign and exponent.
CASES = 512


def function(unit, timing, name, operation):
    """The graph of result and flags of one operation, of a unit with its registers; raises Failure if they depend on more."""
    latency, interval = timing
    code = re.search(rf"//@ op +(\S+) +{operation}\b", (UNITS / f"{name}.v").read_text())
    if not code:
        raise Failure(f"{name} has no operation {operation}")
    gates = Unrolled()
    operands = {bit: gates.free() for bit in unit.inputs}
    given = {} if code[1] == "-" else {"op": int(code[1].rpartition("b")[2], 2)}
    state = {literal: gates.free() for literal in unit.latches}
    outputs, _ = gates.operation(unit, interval, {**operands, **given}, state, range(1 - interval, latency))
    if outputs.pop("out_valid") != 1:
        raise Failure(f"{name}: an operation gives no out_valid")
    inputs = {bit: literal for bit, literal in operands.items() if bit.startswith("a[")}
    ands = needed(gates.ands, outputs.values())
    known = {0, *inputs.values(), *(gate[0] for gate in ands)}
    used = [*(literal for gate in ands for literal in gate[1:]), *outputs.values()]
    if any(literal & ~1 not in known for literal in used):
        raise Failure(f"{name}: result or flags depend on more than the operand")
    return Graph(inputs, {}, outputs, ands)


def write_aiger(graph, path):
    """Writes a graph without registers in AIGER's ASCII form."""
    rows = [[literal] for literal in [*graph.inputs.values(), *graph.outputs.values()]] + [list(gate) for gate in graph.ands]
    most = max(literal for row in rows for literal in row) // 2
    lines = [f"aag {most} {len(graph.inputs)} 0 {len(graph.outputs)} {len(graph.ands)}"]
    lines += [" ".join(map(str, row)) for row in rows]
    lines += [f"{kind}{i} {name}" for kind, names in (("i", graph.inputs), ("o", graph.outputs)) for i, name in enumerate(names)]
    Path(path).write_text("\n".join(lines) + "\n")


class Enumeration:
    """A function, of which no operand may have another result or other flags than in the specification."""

    def __init__(self, graph, operation, path):
        self.operation = operation
        self.path = path
        path.parent.mkdir(parents=True, exist_ok=True)
        write_aiger(graph, path)

    @staticmethod
    def key(graph):
        """A hash of all that the outcome depends on."""
        texts = [path.read_bytes() for folder in COMPARED for path in sorted(folder.glob("*.rs"))]
        return hashlib.sha256(b"".join([graph.key.encode(), *texts])).hexdigest()[:16]

    def evaluated(self):
        """Arguments that name what is evaluated."""
        return [self.path]

    def counterexample(self, number=None):
        """The first operand of a case, or of all, that differs, by bits; None if there is none."""
        if not ENUMERATOR:
            raise Failure("the variable TAKT_ENUMERATOR does not name the program: use `cargo evidence formal --units`")
        case = [] if number is None else ["--case", str(number)]
        command = [ENUMERATOR, "enumerate", *self.evaluated(), "--op", self.operation, *case]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise Failure(f"the enumeration of {self.operation} failed:\n{done.stderr}")
        if not done.stdout:
            return None
        return {f"a[{i}]": int(done.stdout, 16) >> i & 1 for i in range(32)}

    def uncovered(self, parts):
        """None: every sign and exponent is a case."""
        assert parts == CASES


class Simulation(Enumeration):
    """A unit's circuit in Verilator, instead of its gates: another front end, and another evaluator."""

    def __init__(self, unit, operation):
        self.unit, self.operation = unit, operation

    @staticmethod
    def key(texts):
        """A hash of all that the outcome depends on."""
        compared = [path.read_bytes() for folder in (*COMPARED, DRIVER) for path in sorted(folder.iterdir())]
        return hashlib.sha256(b"".join([repr(texts).encode(), *compared])).hexdigest()[:16]

    def evaluated(self):
        return ["--circuit", self.unit]

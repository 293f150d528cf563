# SPDX-License-Identifier: MIT OR Apache-2.0
"""Shows of mutants in a netlist that they are no faults: with the same inputs and the same values in all registers, all outputs and
all next values are those without a mutant.

python3 mutants.py FOLDER MODULE NUMBER…   prints a line for each: its number, and `equivalent`, `different` or `unknown`.

The netlist is FOLDER/netlist.v, whose input `mutsel` chooses the mutant, 0 for none. A mutant that is different may still be no fault:
if it shows only for values that the registers never have together.
"""

import argparse
from pathlib import Path

from pysat.solvers import Solver

from circuit import Graph, read_aiger, yosys

# Conflicts after which a mutant is left undecided.
CONFLICTS = 300_000


class Copies:
    """Several copies of one graph in one and-inverter graph, where equal gates are one gate."""

    def __init__(self):
        self.gates = {}
        self.clauses = [[-1]]
        self.last = 1

    def variable(self):
        """A new variable, as a literal of AIGER."""
        self.last += 1
        return 2 * (self.last - 1)

    def conjunction(self, left, right):
        """The gate of two literals, which may be no gate."""
        left, right = min(left, right), max(left, right)
        if left == 0 or left == right ^ 1:
            return 0
        if left in (1, right):
            return right
        if (left, right) not in self.gates:
            out = self.variable()
            self.gates[left, right] = out
            o, a, b = (self.number(literal) for literal in (out, left, right))
            self.clauses += [[-o, a], [-o, b], [o, -a, -b]]
        return self.gates[left, right]

    @staticmethod
    def number(literal):
        """A literal of AIGER as one of the solver."""
        return -(literal // 2 + 1) if literal & 1 else literal // 2 + 1

    def copy(self, graph, given):
        """The outputs and next values of a copy whose inputs and registers are given, literal -> literal."""
        value = {0: 0} | given

        def of(literal):
            return value[literal & ~1] ^ (literal & 1)

        for out, left, right in graph.ands:
            value[out] = self.conjunction(of(left), of(right))
        return [of(literal) for literal in [*graph.outputs.values(), *graph.latches.values()]]

    def differ(self, one, other):
        """The solver's answer to the question if two lists can differ; None if it gives up."""
        pairs = {(min(a, b), max(a, b)) for a, b in zip(one, other) if a != b}
        clauses, some = [], []
        for a, b in pairs:
            self.last += 1
            x, a, b = self.last, self.number(a), self.number(b)
            clauses += [[-x, a, b], [-x, -a, -b]]
            some.append(x)
        if not some:
            return False
        with Solver(name="glucose4", bootstrap_with=self.clauses + clauses + [some]) as solver:
            solver.conf_budget(CONFLICTS)
            return solver.solve_limited()


def graph_of(folder, module):
    """The netlist's graph, its memories as registers."""
    script = ["read_verilog netlist.v", f"hierarchy -check -top {module}", "proc", "opt_clean", "memory -nomap"]
    script += ["memory_map", "opt -nodffe -nosdff", "setundef -anyseq"]
    script += ["techmap", "opt_expr", "opt_merge", "opt_clean", "aigmap", "opt_clean", "write_aiger -ascii -symbols mutants.aag"]
    yosys(folder, script)
    return read_aiger((folder / "mutants.aag").read_text())


def answer(graph: Graph, number):
    """`equivalent`, `different` or `unknown`."""
    copies = Copies()
    choice = {literal: name for name, literal in graph.inputs.items() if name.startswith("mutsel")}
    shared = {literal: copies.variable() for literal in [*graph.inputs.values(), *graph.latches] if literal not in choice}

    def chosen(value):
        bit = lambda name: value >> int(name[len("mutsel[") : -1]) & 1
        return shared | {literal: bit(name) for literal, name in choice.items()}

    differ = copies.differ(copies.copy(graph, chosen(0)), copies.copy(graph, chosen(number)))
    return {True: "different", False: "equivalent", None: "unknown"}[differ]


def main():
    """The command line."""
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("module")
    parser.add_argument("numbers", type=int, nargs="+")
    arguments = parser.parse_args()
    graph = graph_of(arguments.folder, arguments.module)
    for number in arguments.numbers:
        print(number, answer(graph, number), flush=True)


if __name__ == "__main__":
    main()

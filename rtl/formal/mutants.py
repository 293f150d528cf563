# SPDX-License-Identifier: MIT OR Apache-2.0
"""Shows of mutants in a netlist that they are no faults.

python3 mutants.py FOLDER MODULE NUMBER…   prints a line for each: its number, and `equivalent`, `different` or `unknown`.

The netlist is FOLDER/netlist.v, whose input `mutsel` chooses the mutant, 0 for none. Two copies begin with the same arbitrary values in
all registers and have the same inputs. One has the mutant in the first cycle, and neither has it in those that follow. If no output
ever differs, and all registers are the same again after some cycles, then the mutant is no fault: the mutant in cycles 0 to n does
what the mutant in cycles 0 to n - 1 does, whatever that has made of the registers, and so, by induction, what the circuit does
without it.

Registers that have one value ever after a reset of 16 cycles have it. Memories are left out. Both copies must write the same words; a word that is read is arbitrary, and the same in both where their
addresses are. A mutant that is different may still be no fault, if it shows only for values that the registers never have together.
"""

import argparse
import re
from pathlib import Path

from pysat.solvers import Solver

from circuit import Graph, read_aiger, yosys

# Conflicts after which the solver leaves a question undecided.
CONFLICTS = 30_000
# Answers of the solver to one question; literals not settled by then count as true in some case.
ANSWERS = 12
# Most registers that may differ; a mutant that exceeds it is given up.
REGISTERS = 250
# Most gates of a circuit whose constant registers are found by induction.
SMALL = 30_000
# Cycles of a core's reset: loading its program takes one per word.
RESET = 16
# Cycles after which the registers must agree again: more than the longest latency.
CYCLES = 40


class Gates:
    """An and-inverter graph in which equal gates are one gate, and a solver that knows the gates that it was asked about."""

    def __init__(self):
        self.gates = {}
        self.operands = {}
        self.last = 0
        self.known = set()
        self.solver = Solver(name="glucose4", bootstrap_with=[[-1]])

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.solver.delete()

    def variable(self):
        """A new variable, as a literal of AIGER."""
        self.last += 2
        return self.last

    def conjunction(self, left, right):
        """The gate of two literals, which may be no gate."""
        if left > right:
            left, right = right, left
        if left == 0 or left == right ^ 1:
            return 0
        if left in (1, right):
            return right
        out = self.gates.get((left, right))
        if out is None:
            out = self.variable()
            self.gates[left, right] = out
            self.operands[out] = (left, right)
        return out

    def either(self, left, right):
        """The disjunction of two literals."""
        return self.conjunction(left ^ 1, right ^ 1) ^ 1

    def choice(self, which, yes, no):
        """One of two literals."""
        if yes == no:
            return yes
        return self.either(self.conjunction(which, yes), self.conjunction(which ^ 1, no))

    def differ(self, one, other):
        """The literal that is true if two others differ."""
        return self.choice(one, other ^ 1, other)

    @staticmethod
    def number(literal):
        """A literal of AIGER as one of the solver."""
        return -(literal // 2 + 1) if literal & 1 else literal // 2 + 1

    def tell(self, literals):
        """Tells the solver of the gates behind literals."""
        stack = [literal & ~1 for literal in literals]
        while stack:
            gate = stack.pop()
            if gate in self.known or gate not in self.operands:
                continue
            self.known.add(gate)
            left, right = self.operands[gate]
            o, a, b = self.number(gate), self.number(left), self.number(right)
            for clause in ([-o, a], [-o, b], [o, -a, -b]):
                self.solver.add_clause(clause)
            stack += [left & ~1, right & ~1]

    def true_in_some(self, literals, answers=ANSWERS):
        """Of these literals, those that can be true, and some that are undecided; None if the solver gives up."""
        left, found = {literal for literal in literals if literal != 0}, set()
        for _ in range(answers):
            if not left:
                return found
            if 1 in left:
                found.add(1)
                left.discard(1)
                continue
            self.tell(left)
            # Holds only if `some` does, so that later questions can drop the clause.
            some = self.number(self.variable())
            self.solver.add_clause([-some, *(self.number(literal) for literal in left)])
            self.solver.conf_budget(CONFLICTS)
            answer = self.solver.solve_limited(assumptions=[some])
            if answer is None:
                return None
            if not answer:
                self.solver.add_clause([-some])
                return found
            model = self.solver.get_model()
            true = {literal for literal in left if self.holds(model, literal)}
            found |= true
            left -= true
        return found | left

    def holds(self, model, literal):
        """The value of a literal in a model."""
        number = abs(self.number(literal))
        value = number <= len(model) and model[number - 1] > 0
        return value != bool(literal & 1)


class Circuit:
    """A netlist's graph with its memories' ports."""

    def __init__(self, graph: Graph):
        self.graph = graph
        self.choice = {
            literal: int(name[len("mutsel[") : -1]) for name, literal in graph.inputs.items() if name.startswith("mutsel[")
        }
        ports, outputs = {}, []
        for name, literal in graph.outputs.items():
            port = re.fullmatch(r"(.+)\.(WR_EN|WR_ADDR|WR_DATA|RD_ADDR|\w+_CLK|RD_EN|RD_[AS]RST)(?:\[(\d+)\])?", name)
            if port:
                bits = ports.setdefault(port[1], {}).setdefault(port[2], {})
                bits[int(port[3] or 0)] = literal
            else:
                outputs.append(literal)
        self.outputs = outputs
        # Write ports: literals of enable, data and address. Read ports: literals of the address, and of the inputs for
        # the data.
        self.writes, self.reads = [], []
        for name, bits in ports.items():
            data = {}
            for other, literal in graph.inputs.items():
                if other == f"{name}.RD_DATA" or other.startswith(f"{name}.RD_DATA["):
                    data[int(other.rpartition("[")[2][:-1]) if other.endswith("]") else 0] = literal
            self.reads.append((self.bits(bits["RD_ADDR"]), self.bits(data)))
            enable, value, address = (self.bits(bits.get(port, {})) for port in ("WR_EN", "WR_DATA", "WR_ADDR"))
            count = len(address) // len(bits["RD_ADDR"])
            for port in range(count):
                part = lambda all: all[port * len(all) // count : (port + 1) * len(all) // count]
                self.writes.append((part(enable), part(value), part(address)))
        self.shared = {literal for literal in graph.inputs.values() if literal not in self.choice}
        self.read_data = {literal for _, data in self.reads for literal in data}

    @staticmethod
    def bits(numbered):
        """Literals in the order of their numbers."""
        return [numbered[i] for i in range(len(numbered))]


def evaluate(gates, graph, value, other=None, same=None):
    """Fills in the values of all gates; of those whose operands have the values of another copy, that copy's."""
    conjunction = gates.conjunction
    if other is None:
        for out, left, right in graph.ands:
            value[out] = conjunction(value[left & ~1] ^ (left & 1), value[right & ~1] ^ (right & 1))
        return
    for out, left, right in graph.ands:
        a, b = left & ~1, right & ~1
        if value[a] == other[a] and value[b] == other[b]:
            value[out] = other[out]
        else:
            value[out] = conjunction(value[a] ^ (left & 1), value[b] ^ (right & 1))


def chosen(circuit, number):
    """The values of the choice's inputs."""
    return {literal: number >> bit & 1 for literal, bit in circuit.choice.items()}


def cycle(gates, circuit, states, number):
    """One cycle of both copies, the second with this mutant: the values of all literals of both."""
    graph = circuit.graph
    given = {0: 0} | {literal: gates.variable() for literal in circuit.shared}
    one = given | states[0] | chosen(circuit, 0)
    evaluate(gates, graph, one)
    other = given | states[1] | chosen(circuit, number)
    # A read word depends on its address, so its dependents are evaluated again until nothing changes.
    changed = True
    while changed:
        evaluate(gates, graph, other, one)
        changed = False
        for address, data in circuit.reads:
            of = lambda values, literal: values[literal & ~1] ^ (literal & 1)
            differ = 0
            for literal in address:
                differ = gates.either(differ, gates.differ(of(one, literal), of(other, literal)))
            if differ and other[data[0]] == one[data[0]]:
                changed = True
                for literal in data:
                    other[literal] = gates.choice(differ, gates.variable(), one[literal])
    return one, other


def seen(gates, circuit, values):
    """All that a copy shows in a cycle: its outputs, and what it writes to memories."""
    of = lambda literal: values[literal & ~1] ^ (literal & 1)
    result = [of(literal) for literal in circuit.outputs]
    for enable, data, address in circuit.writes:
        some = 0
        for literal in enable:
            some = gates.either(some, of(literal))
        result += [of(literal) for literal in enable]
        result += [gates.conjunction(of(e), of(d)) for e, d in zip(enable, data)]
        result += [gates.conjunction(some, of(literal)) for literal in address]
    return result


def constants(circuit, number):
    """The registers that have one value ever after RESET cycles of reset, with the mutant or without: literal -> value. By simulation
    with three values, None for either; of a small circuit, what follows after the reset is by induction."""
    graph = circuit.graph
    reset = circuit.graph.inputs.get("rst")

    def after(state, resets, of):
        value = {0: 0} | dict.fromkeys(circuit.shared) | state | chosen(circuit, of)
        if resets:
            value[reset] = 1
        for out, left, right in graph.ands:
            a, b = value[left & ~1], value[right & ~1]
            a = a if a is None else a ^ (left & 1)
            b = b if b is None else b ^ (right & 1)
            value[out] = 0 if a == 0 or b == 0 else (None if a is None or b is None else 1)
        of = lambda literal: None if value[literal & ~1] is None else value[literal & ~1] ^ (literal & 1)
        return {literal: of(next_value) for literal, next_value in graph.latches.items()}

    def joined(one, other):
        return {literal: value if value == other[literal] else None for literal, value in one.items()}

    if reset is None:
        return {}
    state = dict.fromkeys(graph.latches)
    for _ in range(RESET):
        state = joined(after(state, True, 0), after(state, True, number))
    if len(graph.ands) < SMALL:
        return kept(circuit, number, {literal: value for literal, value in state.items() if value is not None})
    while True:
        new = joined(state, joined(after(state, False, 0), after(state, False, number)))
        if new == state:
            return {literal: value for literal, value in state.items() if value is not None}
        state = new


def kept(circuit, number, values):
    """Of these values of registers, the most that a cycle keeps, with the mutant or without, if they all hold before it."""
    graph = circuit.graph
    while values:
        with Gates() as gates:
            shared = {0: 0} | {literal: gates.variable() for literal in circuit.shared}
            state = {literal: values[literal] if literal in values else gates.variable() for literal in graph.latches}
            broken = {}
            for of in (0, number):
                value = shared | state | chosen(circuit, of)
                evaluate(gates, graph, value)
                for literal, kept_value in values.items():
                    after = graph.latches[literal]
                    broken.setdefault(value[after & ~1] ^ (after & 1) ^ kept_value, set()).add(literal)
            can = gates.true_in_some(broken, answers=len(broken) + 1)
            if can is None:
                return {}
            lost = set().union(*(broken[literal] for literal in can))
        if not lost:
            return values
        values = {literal: value for literal, value in values.items() if literal not in lost}
    return {}


def answer(circuit, number, log=lambda text: None):
    """`equivalent`, `different` or `unknown`."""
    graph = circuit.graph
    with Gates() as gates:
        known = constants(circuit, number)
        log(f"{len(known)} registers are constant")
        state = {literal: known[literal] if literal in known else gates.variable() for literal in graph.latches}
        states = (state, dict(state))
        for now in range(CYCLES):
            one, other = cycle(gates, circuit, states, number if now == 0 else 0)
            pairs = zip(seen(gates, circuit, one), seen(gates, circuit, other))
            shown = gates.true_in_some(gates.differ(a, b) for a, b in set(pairs))
            if shown is None:
                return "unknown"
            if shown:
                return f"different after {now} cycles"
            states = ({}, {})
            different = {}
            for literal, after in graph.latches.items():
                a, b = (values[after & ~1] ^ (after & 1) for values in (one, other))
                states[0][literal], states[1][literal] = a, b
                if a != b:
                    different[literal] = gates.differ(a, b)
            can = gates.true_in_some(different.values())
            if can is None:
                return "unknown"
            for literal, differ in different.items():
                if differ not in can:
                    states[1][literal] = states[0][literal]
            log(f"{now}: {len(can)} of {len(different)} registers can differ, {gates.last // 2} gates")
            if not can:
                return "equivalent"
            if len(can) > REGISTERS:
                break
    return "unknown"


def graph_of(folder, module):
    """The netlist's graph; memories that are written are left out."""
    script = ["read_verilog netlist.v", f"hierarchy -check -top {module}", "proc", "opt_clean", "memory_collect"]
    script += ["memory_map -rom-only", "opt_clean", "expose -evert t:$mem_v2", "opt -nodffe -nosdff", "setundef -anyseq"]
    script += ["techmap", "opt_expr", "opt_merge", "opt_clean", "aigmap", "opt_clean", "write_aiger -ascii -symbols mutants.aag"]
    yosys(folder, script)
    return read_aiger((folder / "mutants.aag").read_text())


def main():
    """The command line."""
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("module")
    parser.add_argument("numbers", type=int, nargs="+")
    parser.add_argument("--verbose", action="store_true")
    parser.add_argument("--keep", action="store_true", help="take the graph that is there")
    arguments = parser.parse_args()
    if arguments.keep:
        graph = read_aiger((arguments.folder / "mutants.aag").read_text())
    else:
        graph = graph_of(arguments.folder, arguments.module)
    circuit = Circuit(graph)
    log = (lambda text: print(f"  {text}", flush=True)) if arguments.verbose else lambda text: None
    for number in arguments.numbers:
        print(number, answer(circuit, number, log), flush=True)


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: MIT OR Apache-2.0
"""The proofs that a result comes when it must, from the structure of gates and registers.

A pipeline is balanced: if every path from the inputs to the outputs passes through the same number of registers, and no path
returns to where it came from, the outputs of a cycle are a function of the inputs of one cycle, that many cycles before, and of
nothing else: whatever the registers held at first and whatever comes before, between and after. This function is the circuit with
its registers replaced by wires, which is what the other proofs are about.

A unit that takes an operation every so many cycles is unrolled over time, twice: two runs with the same operands in one cycle and
arbitrary, different ones in all others, from arbitrary, different states, have the same result.
"""

from pysat.solvers import Solver

from circuit import Failure
from solve import SOLVER, gate, literal


def depths(graph):
    """The number of registers on the way to each literal of a graph; None for what does not depend on the inputs.

    Raises Failure if two ways to a gate differ, or if a way leads back.
    """
    gates = {out: (left, right) for out, left, right in graph.ands}
    depth = {0: None, **{literal: 0 for literal in graph.inputs.values()}}
    origin = {literal: name for name, literal in graph.inputs.items()}
    on_way = set()
    for root in graph.outputs.values():
        stack = [root & ~1]
        while stack:
            node = stack[-1]
            if node in depth:
                stack.pop()
                continue
            below = [literal & ~1 for literal in gates.get(node) or (graph.latches[node],)]
            missing = [literal for literal in below if literal not in depth]
            if missing:
                if node in on_way and any(literal in on_way for literal in missing):
                    raise Failure("a path leads from a register back to itself: this is no pipeline")
                on_way.add(node)
                stack += missing
                continue
            stack.pop()
            on_way.discard(node)
            known = {depth[literal]: literal for literal in below if depth[literal] is not None}
            if len(known) > 1:
                (one, first), (other, second) = sorted(known.items())
                names = f"{origin[first]} ({one} registers) and {origin[second]} ({other})"
                raise Failure(f"a gate joins values of two cycles, for example of {names}")
            level = next(iter(known), None)
            depth[node] = None if level is None else level + (node in graph.latches)
            origin[node] = origin.get(next(iter(known.values()), 0))
    return depth


def pipeline(graph, latency):
    """Proves that results come exactly `latency - 1` cycles after operands, in any mix; raises Failure if not."""
    depth = depths(graph)
    for name, literal in graph.outputs.items():
        found = depth[literal & ~1]
        if found not in (None, latency - 1):
            raise Failure(f"{name} comes {found} cycles after the operands, not {latency - 1}")
    if depth[graph.outputs["out_valid"] & ~1] is None:
        raise Failure("out_valid does not depend on the inputs")


class Unrolled:
    """Gates over time, each of which exists once: literals as in AIGER."""

    def __init__(self):
        self.next = 2
        self.known = {}
        self.ands = []

    def free(self):
        """A new arbitrary value."""
        self.next += 2
        return self.next - 2

    def both(self, left, right):
        """The conjunction of two literals."""
        left, right = min(left, right), max(left, right)
        if left == 0 or left == right ^ 1:
            return 0
        if left in (1, right):
            return right
        if (left, right) not in self.known:
            self.known[left, right] = self.free()
            self.ands.append((self.known[left, right], left, right))
        return self.known[left, right]

    def cycle(self, graph, state, inputs):
        """The outputs of a cycle, and the next state, for literals of state and inputs."""
        value = {0: 0, **state}
        for name, literal in graph.inputs.items():
            value[literal] = inputs[name]
        of = lambda literal: value[literal & ~1] ^ (literal & 1)
        for out, left, right in graph.ands:
            value[out] = self.both(of(left), of(right))
        return {name: of(at) for name, at in graph.outputs.items()}, {q: of(d) for q, d in graph.latches.items()}

    def inputs(self, graph, interval, operands, cycle):
        """What is on the inputs: in cycle 0 an operation begins, in the interval before and after it none does, and all else is
        arbitrary."""
        inputs = operands if cycle == 0 else {name: self.free() for name in graph.inputs}
        return {**inputs, "in_valid": 1 if cycle == 0 else 0 if abs(cycle) < interval else inputs["in_valid"]}

    def operation(self, graph, interval, operands, state, cycles):
        """The outputs of the last of these cycles, and the state after it, around an operation that begins in cycle 0."""
        outputs = None
        for cycle in cycles:
            outputs, state = self.cycle(graph, state, self.inputs(graph, interval, operands, cycle))
        return outputs, state


def iterative(graph, latency, interval, split=None):
    """Proves that the result of an operation depends on its operands alone, if no other began within `interval` cycles before or after
    it, and that out_valid is in_valid of `latency - 1` cycles before; raises Failure if not.

    A split is a register, the cycle after which it holds what the operands make of it, and patterns of 0, 1 and - (any), the highest
    bit first: its values are taken pattern by pattern, as arbitrary ones.
    """
    alone = {"out_valid": graph.outputs["out_valid"]}
    valid = type(graph)(graph.inputs, graph.latches, alone, graph.ands)
    if depths(valid)[graph.outputs["out_valid"] & ~1] != latency - 1:
        raise Failure(f"out_valid does not come {latency - 1} cycles after in_valid")
    gates = Unrolled()
    operands = {name: gates.free() for name in graph.inputs}

    run = lambda state, cycles: gates.operation(graph, interval, operands, state, cycles)
    register, settled, patterns = split or (None, 0, [""])
    states = [run({literal: gates.free() for literal in graph.latches}, range(1 - interval, settled + 1))[1] for _ in range(2)]
    bits = []
    if register is not None:
        while f"{register}[{len(bits)}]" in graph.registers:
            bits.append(graph.registers[f"{register}[{len(bits)}]"])
        if not bits or any(states[0][bit] != states[1][bit] for bit in bits):
            raise Failure(f"the register {register} does not hold in cycle {settled} what the operands alone make of it")
        for value in range(1 << len(bits)):
            digits = f"{value:0{len(bits)}b}"
            if not any(all(p in ("-", d) for p, d in zip(pattern, digits, strict=True)) for pattern in patterns):
                raise Failure(f"no pattern covers {register} = {digits}")
    built = (dict(gates.known), list(gates.ands), gates.next)
    for pattern in patterns:
        gates.known, gates.ands, gates.next = dict(built[0]), list(built[1]), built[2]
        chosen = {bit: gates.free() if p == "-" else int(p) for bit, p in zip(reversed(bits), pattern, strict=True)}
        agree(gates, *(run({**state, **chosen}, range(settled + 1, latency))[0] for state in states))


def agree(gates, first, second):
    """Raises Failure if the outputs of two runs can differ."""
    if first["out_valid"] != 1:
        raise Failure("an operation gives no out_valid")
    differ = [name for name in first if first[name] != second[name]]
    if not differ:
        return
    with Solver(name=SOLVER, bootstrap_with=[[-1]]) as solver:
        for out, left, right in gates.ands:
            solver.append_formula(gate(out, left, right))
        some = []
        for name in differ:
            x, y, z = literal(first[name]), literal(second[name]), gates.free() // 2 + 1
            some.append(z)
            solver.add_clause([-z, x, y])
            solver.add_clause([-z, -x, -y])
        solver.add_clause(some)
        if solver.solve():
            raise Failure(f"{len(differ)} bits of the result may depend on more than the operation, for example {differ[0]}")

# SPDX-License-Identifier: MIT OR Apache-2.0
"""The proof that a pipeline is balanced, from the structure of its gates and registers.

If every path from the inputs to the outputs passes through the same number of registers, and no path returns to where it came
from, the outputs of a cycle are a function of the inputs of one cycle, that many cycles before, and of nothing else: whatever
the registers held at first and whatever comes before, between and after. This function is the circuit with its registers
replaced by wires, which is what the other proofs are about.
"""

from circuit import Failure


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


def prove(graph, latency):
    """Proves that results come exactly `latency - 1` cycles after operands, in any mix; raises Failure if not."""
    depth = depths(graph)
    for name, literal in graph.outputs.items():
        found = depth[literal & ~1]
        if found not in (None, latency - 1):
            raise Failure(f"{name} comes {found} cycles after the operands, not {latency - 1}")
    if depth[graph.outputs["out_valid"] & ~1] is None:
        raise Failure("out_valid does not depend on the inputs")

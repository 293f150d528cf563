# SPDX-License-Identifier: MIT OR Apache-2.0
"""An iterative unit over the cycles of one operation, beside a miter that sees its registers.

The miter is combinational. Its inputs are operands, the operation's result and flags, and registers of the unit: `rest_6` is what `rest`
holds in cycle 6, if the operands are on the inputs in cycle 0. A register that is given has an arbitrary value in that cycle, and
the cycles that follow go on from it. For a proof of one step, `rest_now` and `rest_next` are a register before and after any of the
steps; before it, all registers of the step are given. Other inputs of the miter are arbitrary.
"""

import re

from balance import Unrolled
from circuit import Failure, Graph

REGISTER = re.compile(r"\w+_(now|next|\d+)(\[\d+\])?$")


def named(name, suffix):
    """The name of a register's bit in a cycle: `rest[3]`, 6 -> `rest_6[3]`."""
    return re.sub(r"^([^\[]*)", rf"\g<1>_{suffix}", name, count=1)


def seen(proof):
    """The registers that are given, or that a step has."""
    return sorted({name.rpartition("_")[0] for name in proof.given} | set(proof.stepped) | set(proof.held))


def beside(unit, miter, timing, proof):
    """The graph of the miter with the unit, in arbitrary state at first and without operations in the interval before and after."""
    latency, interval = timing
    gates = Unrolled()
    operands = {name: gates.free() for name in unit.inputs}
    given = [(register, int(cycle)) for register, _, cycle in (name.rpartition("_") for name in proof.given)]
    bits = lambda register: [name for name in unit.registers if name.partition("[")[0] == register]
    for register in seen(proof):
        if not bits(register):
            raise Failure(f"{proof.name}: there is no register {register}")
    values = dict(operands)
    before = {unit.registers[name]: gates.free() for register in (*proof.stepped, *proof.held) for name in bits(register)}
    after = None
    state, outputs = {literal: gates.free() for literal in unit.latches}, {}
    for cycle in range(1 - interval, latency):
        inputs = gates.inputs(unit, interval, operands, cycle)
        state |= {unit.registers[name]: gates.free() for register, at in given if at == cycle for name in bits(register)}
        values |= {named(name, cycle): state[literal] for name, literal in unit.registers.items()}
        if cycle in proof.steps:
            step = gates.cycle(unit, {**state, **before}, inputs)[1]
            step = {unit.registers[name]: step[unit.registers[name]] for register in proof.stepped for name in bits(register)}
            if after not in (None, step):
                raise Failure(f"{proof.name}: what cycle {cycle} does is not what the step before did")
            after = step
        outputs, state = gates.cycle(unit, state, inputs)
    values |= {name: literal for name, literal in outputs.items() if name != "out_valid"}
    values |= {named(name, "now"): before[literal] for name, literal in unit.registers.items() if literal in before}
    values |= {named(name, "next"): after[literal] for name, literal in unit.registers.items() if literal in (after or {})}
    used = {literal & ~1 for gate in needed(miter.ands, miter.outputs.values()) for literal in gate[1:]}
    lost = [name for name, literal in miter.inputs.items() if REGISTER.match(name) and name not in values and literal in used]
    if lost:
        raise Failure(f"{proof.name}: no register holds {lost[0]}")
    inputs = {name: values[name] if name in values else gates.free() for name in miter.inputs}
    found, _ = gates.cycle(miter, {}, inputs)
    return Graph(inputs, {}, found, needed(gates.ands, found.values()))


def needed(ands, roots):
    """The gates that these literals depend on."""
    wanted, kept = {literal & ~1 for literal in roots}, []
    for out, left, right in reversed(ands):
        if out in wanted:
            wanted |= {left & ~1, right & ~1}
            kept.append((out, left, right))
    return kept[::-1]

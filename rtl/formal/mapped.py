# SPDX-License-Identifier: MIT OR Apache-2.0
"""Proves that a mapped netlist equals the Verilog, register by register: `cargo evidence netlist --prove` runs this. README.md says how,
and what is trusted."""

import argparse
import copy
import json
import random
import re
import sys
import time
from collections import Counter, defaultdict
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import solve
from circuit import Failure, Graph

# Patterns of simulation.
PATTERNS = 2048
FALSE, TRUE = 0, 1


class Logic:
    """An and-inverter graph in which a gate exists once. Literals are those of AIGER."""

    def __init__(self):
        self.nodes = [None]  # by variable: the operands of a gate, or the name of an input
        self.gates = {}

    def input(self, name):
        self.nodes.append(name)
        return 2 * len(self.nodes) - 2

    def both(self, left, right):
        left, right = min(left, right), max(left, right)
        if left == FALSE or left ^ right == 1:
            return FALSE
        if left in (TRUE, right):
            return right
        if (left, right) not in self.gates:
            self.nodes.append((left, right))
            self.gates[left, right] = 2 * len(self.nodes) - 2
        return self.gates[left, right]

    def either(self, left, right):
        return self.both(left ^ 1, right ^ 1) ^ 1

    def differ(self, left, right):
        # Negations go outside, so that a sum has the same gates however its operands are negated.
        plain = left & ~1, right & ~1
        return self.both(self.both(*plain) ^ 1, self.both(plain[0] ^ 1, plain[1] ^ 1) ^ 1) ^ (left & 1) ^ (right & 1)

    def choose(self, select, one, zero):
        if one == zero:
            return one
        if one ^ zero == 1:
            return self.differ(select, zero)
        return self.either(self.both(select, one), self.both(select ^ 1, zero))

    def table(self, contents, address):
        """A look-up table; the first literal is the lowest bit of the address."""
        if not address:
            return contents & 1
        half = 1 << len(address) - 1
        low, high = (self.table(part, address[:-1]) for part in (contents & (1 << half) - 1, contents >> half))
        return self.choose(address[-1], high, low)

    def cone(self, literals):
        """The variables on which literals depend, each after those that it depends on."""
        found, stack = set(), [literal >> 1 for literal in literals]
        while stack:
            variable = stack.pop()
            if variable and variable not in found:
                found.add(variable)
                if isinstance(self.nodes[variable], tuple):
                    stack += [operand >> 1 for operand in self.nodes[variable]]
        return sorted(found)

    def inputs(self, literals):
        """The inputs on which literals depend."""
        return [2 * variable for variable in self.cone(literals) if isinstance(self.nodes[variable], str)]

    def simulate(self, bits, zero=()):
        """Random values of all variables, as words of so many bits; some inputs are 0."""
        chance, ones = random.Random(1), (1 << bits) - 1
        values = [0]
        for node in self.nodes[1:]:
            if isinstance(node, tuple):
                left, right = (values[literal >> 1] ^ -(literal & 1) & ones for literal in node)
                values.append(left & right)
            else:
                values.append(0 if 2 * len(values) in zero else chance.getrandbits(bits))
        return lambda literal: values[literal >> 1] ^ -(literal & 1) & ones

    def cofactors(self, literal, of, value):
        """Values of a literal where an input is 0, and where it is 1; `value` is a simulation's."""
        found = []
        for constant in (FALSE, TRUE):
            new = {of >> 1: value(constant)}
            word = lambda literal: new.get(literal >> 1, value(literal & ~1)) ^ (value(TRUE) if literal & 1 else 0)
            for variable in self.cone([literal]):
                node = self.nodes[variable]
                if isinstance(node, tuple):
                    new[variable] = word(node[0]) & word(node[1])
            found.append(word(literal))
        return tuple(found)

    def replaced(self, literal, by):
        """A literal with inputs replaced by other literals."""
        new = {}
        for variable in self.cone([literal]):
            node = self.nodes[variable]
            if isinstance(node, tuple):
                new[variable] = self.both(*(new[operand >> 1] ^ operand & 1 for operand in node))
            else:
                new[variable] = by(2 * variable)
        return new[literal >> 1] ^ literal & 1 if literal > 1 else literal

    def question(self, outputs):
        """The cone of outputs, name -> literal, as a graph."""
        number = {0: 0}
        graph = Graph({}, {}, {}, [])
        new = lambda literal: number[literal >> 1] | literal & 1
        for variable in self.cone(outputs.values()):
            number[variable] = 2 * len(number)
            node = self.nodes[variable]
            if isinstance(node, tuple):
                graph.ands.append((number[variable], *map(new, node)))
            else:
                graph.inputs[node] = number[variable]
        graph.outputs = {name: new(literal) for name, literal in outputs.items()}
        return solve.Question(graph)


class Netlist:
    """The top module of a netlist that yosys has written as JSON: logic, flip-flops of one clock, and cells that are cut out."""

    def __init__(self, path):
        modules = json.loads(path.read_text())["modules"].values()
        top = next(module for module in modules if "top" in module["attributes"])
        self.path, self.ports, self.nets = path, top["ports"], top["netnames"]
        self.logic, self.cut, self.registers = {}, {}, {}
        clocks = set()
        for name, cell in top["cells"].items():
            kind, pins = cell["type"], cell["connections"]
            if kind == "$_DFF_P_":
                # By the net of the output: the net of the next state.
                self.registers[pins["Q"][0]] = pins["D"][0]
                clocks.add(pins["C"][0])
            elif not kind.startswith("$"):
                self.cut[name] = cell
            elif kind != "$scopeinfo":
                self.logic[name] = cell
        if not clocks <= set(self.ports["clk"]["bits"]):
            raise Failure(f"{path}: a register has another clock than the port `clk`")
        # Names and initial values by net; a name is the wire's and the number of the bit.
        self.names, self.initial = defaultdict(list), {}
        for name, wire in self.nets.items():
            for i, bit in enumerate(wire["bits"]):
                self.names[bit].append((name, i))
            for bit, value in zip(wire["bits"], reversed(wire["attributes"].get("init", ""))):
                if value in "01":
                    self.initial[bit] = int(value)

    def name(self, net):
        """The name of a register for people: the shortest of the source's."""
        return min(self.names[net], key=lambda name: (name[0].startswith("$"), len(name[0]), name))

    def pins(self, direction):
        """Pins of the cells that are cut out: (cell, pin, bit), net."""
        for name, cell in self.cut.items():
            for pin, nets in cell["connections"].items():
                if cell["port_directions"][pin] == direction:
                    for i, net in enumerate(nets):
                        yield (name, pin, i), net

    def bits(self, direction):
        """Bits of the ports: (port, bit), net."""
        for name, port in self.ports.items():
            if port["direction"] == direction:
                for i, net in enumerate(port["bits"]):
                    yield (name, i), net

    def evaluate(self, order, logic, values, unknown):
        """The literals of all nets, from those of inputs, registers and outputs of cut cells; `unknown` makes those of a net that nothing
        drives."""
        values = values | {"0": FALSE, "1": TRUE}

        def of(net):
            if net in values:
                return values[net]
            literal = unknown(net)
            if not isinstance(net, str):
                values[net] = literal
            return literal

        for name in order:
            cell = self.logic[name]
            pins = {pin: [of(net) for net in nets] for pin, nets in cell["connections"].items() if pin != "Y"}
            if cell["type"] == "$lut":
                value = logic.table(int(cell["parameters"]["LUT"], 2), pins["A"])
            elif cell["type"] in GATES:
                value = GATES[cell["type"]](logic, *(pins[pin][0] for pin in sorted(pins)))
            else:
                raise Failure(f"{self.path}: the cell {name} has the unknown type {cell['type']}")
            values[cell["connections"]["Y"][0]] = value
        return of


GATES = {
    "$_BUF_": lambda logic, a: a,
    "$_NOT_": lambda logic, a: a ^ 1,
    "$_AND_": Logic.both,
    "$_OR_": Logic.either,
    "$_XOR_": Logic.differ,
    "$_MUX_": lambda logic, a, b, s: logic.choose(s, b, a),
}


def ordered(netlists, clocked):
    """The order of evaluation of each netlist's logic. Outputs of a cut cell follow its inputs within the cycle, but for those pins or cells
    that are clocked. Such ways must be in no loop, even if a loop goes through both netlists: otherwise equal outputs would be assumed of
    equal inputs, and these of them."""
    before = {}
    for side, netlist in enumerate(netlists):
        drives = {cell["connections"]["Y"][0]: (side, name) for name, cell in netlist.logic.items()}
        for (name, _, _), net in netlist.pins("output"):
            drives[net] = name
        for name, cell in netlist.logic.items():
            inputs = [net for pin, nets in cell["connections"].items() if pin != "Y" for net in nets]
            before[side, name] = [drives[net] for net in inputs if net in drives]
        for (name, pin, _), net in netlist.pins("input"):
            kind = netlist.cut[name]["type"]
            if not {kind, f"{kind}.{pin}"} & clocked and net in drives:
                before.setdefault(name, []).append(drives[net])
    try:
        order = [node for node in TopologicalSorter(before).static_order() if isinstance(node, tuple)]
    except CycleError as error:
        raise Failure(f"the logic has a loop: {error.args[1]}") from None
    return [[name for side, name in order if side == which] for which in range(len(netlists))]


class Comparison:
    """The Verilog's netlist, mapped by its memories alone, beside the mapped netlist. Inputs and outputs of cut cells are the same in both;
    each register of the Verilog is replaced by its counterpart, a function of the mapped registers."""

    def __init__(self, source, mapped, clocked):
        self.source, self.mapped = source, mapped
        self.logic = Logic()
        self.orders = ordered((source, mapped), clocked)
        self.same_cells()
        self.shared = {}
        self.states = {net: self.logic.input("register {} {}".format(*mapped.name(net))) for net in mapped.registers}
        self.counterparts = {}
        self.evaluate_mapped()
        self.named()
        self.evaluate_source()
        while self.proposed():
            self.evaluate_source()

    def changed(self, mapped):
        """The comparison with a mapped netlist that has the same registers and cells. Literals mean the same in both, so that what is proved of
        one here need not be proved there."""
        other = copy.copy(self)
        other.mapped = mapped
        other.same_cells()
        other.evaluate_mapped()
        return other

    def same_cells(self):
        """Ports are the same, and so are names, types, parameters and connected pins of the cells that are cut out."""
        cells = lambda side: {name: (cell["type"], cell["parameters"], sorted(cell["connections"])) for name, cell in side.cut.items()}
        ports = lambda side: {name: (port["direction"], len(port["bits"])) for name, port in side.ports.items()}
        for kind, of in (("cell", cells), ("port", ports)):
            source, mapped = of(self.source), of(self.mapped)
            for name in sorted(source.keys() | mapped.keys()):
                if source.get(name) != mapped.get(name):
                    raise Failure(f"the {kind} `{name}` is another or lacks in one netlist")

    def given(self, netlist):
        """Literals of a netlist's inputs, and of the outputs of its cut cells."""
        found = {}
        for key, net in [*netlist.bits("input"), *netlist.pins("output")]:
            if key not in self.shared:
                self.shared[key] = self.logic.input(" ".join(map(str, key)))
            found[net] = self.shared[key]
        return found

    def evaluate_mapped(self):
        # Nothing is known of a net that nothing drives, nor that it is the same in two places.
        unknown = lambda net: self.logic.input(f"unknown {len(self.logic.nodes)}")
        self.after = self.mapped.evaluate(self.orders[1], self.logic, self.given(self.mapped) | self.states, unknown)
        self.next_states = {state: self.after(self.mapped.registers[net]) for net, state in self.states.items()}

    def evaluate_source(self):
        """Evaluates the Verilog's logic twice: with every undefined value (x) 0, and 1."""
        values = self.given(self.source)
        self.missing = {}
        for net in self.source.registers:
            if net in self.counterparts:
                values[net] = self.counterparts[net]
            else:
                values[net] = self.missing[net] = self.logic.input("missing {} {}".format(*self.source.name(net)))
        self.before = [
            self.source.evaluate(self.orders[0], self.logic, values, lambda net, undefined=undefined: undefined) for undefined in (FALSE, TRUE)
        ]

    def named(self):
        """Counterparts by the names that yosys has kept: a function of mapped registers alone."""
        direct = {FALSE, TRUE, *self.states.values()}
        driven = {net for _, net in [*self.mapped.bits("input"), *self.mapped.pins("output")]} | self.states.keys()
        driven |= {cell["connections"]["Y"][0] for cell in self.mapped.logic.values()} | {"0", "1"}
        for net in self.source.registers:
            for name, i in sorted(self.source.names[net], key=lambda name: (len(name[0]), name)):
                bits = self.mapped.nets.get(name, {"bits": []})["bits"]
                if i < len(bits) and bits[i] in driven:
                    literal = self.after(bits[i])
                    if literal in direct or set(self.logic.inputs([literal])) <= direct:
                        self.counterparts[net] = literal
                        break

    def proposed(self):
        """Counterparts of registers without one, by simulation: a constant that the register seems to keep, or a mapped register, or its
        negation, whose next state seems to be the same; failing that, seems to be the same where all others without a counterpart are 0,
        and the register itself 0, or 1. The proof decides. True if any was found."""
        kept = lambda own, constant: lambda literal: constant if literal == own else literal
        for net, own in self.missing.items():
            next_state = self.before[0](self.source.registers[net])
            for constant in (FALSE, TRUE):
                if self.source.initial.get(net, constant) == constant and self.logic.replaced(next_state, kept(own, constant)) == constant:
                    self.counterparts[net] = constant
                    break
        value = self.logic.simulate(PATTERNS)
        alike = defaultdict(list)
        for state, next_state in self.next_states.items():
            for negated in (0, 1):
                alike[value(next_state ^ negated)].append(state ^ negated)
        candidates = {}
        for net in self.missing.keys() - self.counterparts.keys():
            candidates[net] = alike[value(self.before[0](self.source.registers[net]))]
        lonely = {net: self.missing[net] for net, states in candidates.items() if not states}
        free = set(self.states.values()) - {literal & ~1 for literal in self.counterparts.values()}
        if lonely and free:
            value = self.logic.simulate(PATTERNS, free | set(lonely.values()))
            alike = defaultdict(list)
            for state in free:
                alike[self.logic.cofactors(self.next_states[state], state, value)].append(state)
            for net, own in lonely.items():
                candidates[net] = alike[self.logic.cofactors(self.before[0](self.source.registers[net]), own, value)]
        # Mapped registers with the same next state may differ in the first cycle: the one that is read in the same places is meant.
        read, used = self.read_together(candidates), set(self.counterparts.values())
        for net, states in candidates.items():
            if states:
                self.counterparts[net] = max(states, key=lambda state: (read[net, state], state not in used))
        return bool(self.missing.keys() & self.counterparts.keys())

    def read_together(self, candidates):
        """How many bits depend on a register in the Verilog, and on a candidate for it in the mapped netlist."""
        marked = {self.missing[net] for net in candidates} | {state & ~1 for states in candidates.values() for state in states}
        marks = {literal: 1 << i for i, literal in enumerate(sorted(marked))}
        # Obligations add gates.
        obligations = [(self.before[0](net), literal) for _, net, literal in self.obligations()]
        depends = [0]
        for variable, node in enumerate(self.logic.nodes[1:], 1):
            depends.append(depends[node[0] >> 1] | depends[node[1] >> 1] if isinstance(node, tuple) else marks.get(2 * variable, 0))
        found = Counter()
        for literals in obligations:
            in_source, in_mapped = (depends[literal >> 1] for literal in literals)
            for register in candidates if in_source and in_mapped else ():
                if in_source & marks[self.missing[register]]:
                    found.update((register, state) for state in candidates[register] if in_mapped & marks[state & ~1])
        return found

    def bases(self):
        """Registers whose initial values differ from those of their counterparts."""
        at_start = {state: self.mapped.initial.get(net) for net, state in self.states.items()}
        for net, value in self.source.initial.items():
            if net in self.counterparts:
                counterpart = self.counterparts[net]
                known = all(at_start[state] is not None for state in self.logic.inputs([counterpart]))
                if not known or self.logic.replaced(counterpart, at_start.get) != value:
                    yield self.source.name(net)

    def obligations(self):
        """What must be equal: (name, bit), the Verilog's net, and the mapped netlist's literal."""
        of_mapped = dict(self.mapped.bits("output"))
        for (name, i), net in self.source.bits("output"):
            yield ("output", name, str(i)), net, self.after(of_mapped[name, i])
        of_mapped = dict(self.mapped.pins("input"))
        for (name, pin, i), net in self.source.pins("input"):
            yield ("cell", name, f"{pin} {i}"), net, self.after(of_mapped[name, pin, i])
        for net, counterpart in self.counterparts.items():
            name, i = self.source.name(net)
            next_state = self.logic.replaced(counterpart, self.next_states.get)
            yield ("register", name, str(i)), self.source.registers[net], next_state

    def differences(self):
        """By register, output or cell: by bit, a literal that is 1 where the netlists differ. Where the Verilog's value is undefined, either
        value of the mapped netlist's will do."""
        found = defaultdict(dict)
        for (kind, name, bit), net, literal in self.obligations():
            wrong = [self.logic.differ(before(net), literal) for before in self.before]
            found[kind, name][bit] = self.logic.both(*wrong)
        return found

    def flip_flops(self):
        """Which registers of the Verilog are one in the mapped netlist, and which are none: all names of each, with the numbers of bits."""
        text = lambda net: " ".join(sorted(f"{name}[{i}]" for name, i in self.source.names[net] if not name.startswith("$")))
        of = defaultdict(list)
        for net, counterpart in self.counterparts.items():
            of[counterpart & ~1].append(text(net))
        none = of.pop(FALSE, []) + [text(net) for net in self.missing]
        if of.keys() != set(self.states.values()):
            raise Failure("not every flip-flop is a register of the Verilog, or not every register a flip-flop")
        return {"one": sorted(sorted(names) for names in of.values() if len(names) > 1), "none": sorted(none)}

    def unread(self, differences):
        """Registers without counterpart; none may be read."""
        read = set(self.logic.inputs([literal for bits in differences.values() for literal in bits.values()]))
        for net, literal in self.missing.items():
            if literal in read:
                raise Failure("the register `{}` [{}] has no counterpart in the mapped netlist".format(*self.source.name(net)))
        return len(self.missing)


def question(logic, bits):
    """Whether any of some literals, by name, can be 1."""
    bad = FALSE
    for literal in bits.values():
        bad = logic.either(bad, literal)
    return logic.question(bits | {"bad": bad})


def differing(kind, name, bits):
    """In words, where netlists differ."""
    return f"the {kind} `{name}` differs in {', '.join(bits)}"


def counterexample(asked, kind, name):
    """In words, what a solution shows; None if there is none."""
    values = asked.counterexample()
    # Bits that always differ depend on no input.
    if values is None:
        return None
    return differing(kind, name, [bit for bit, value in asked.graph.evaluate(values).items() if value and bit != "bad"])


class Progress:
    """Lines for people, every ten seconds."""

    def __init__(self, what, count):
        self.what, self.count, self.shown = what, count, time.monotonic()

    def show(self, done):
        if time.monotonic() - self.shown > 10:
            self.shown = time.monotonic()
            print(f"{self.what}: {done} of {self.count}", file=sys.stderr, flush=True)


def prove(comparison, certifier, what):
    """Proves that the netlists never differ; returns figures. Without a certifier there are no proofs that another program checks."""
    for name, i in comparison.bases():
        raise Failure(f"the register `{name}` [{i}] begins with another value")
    differences = comparison.differences()
    unread = comparison.unread(differences)
    unequal = {key: bits for key, bits in differences.items() if any(bits.values())}
    solving, size, checking = 0.0, 0, 0.0
    progress = Progress(f"{what}: proofs", len(unequal))
    for number, ((kind, name), bits) in enumerate(unequal.items()):
        asked = question(comparison.logic, bits)
        proof = asked.decided(number, asked.wrong(), certifier)
        if proof is None:
            raise Failure(counterexample(asked, kind, name))
        solving, size, checking = solving + proof[0], size + proof[1], checking + proof[2]
        progress.show(number + 1)
    kinds = Counter()
    for (kind, _), bits in differences.items():
        kinds[kind] += len(bits)
    counterparts = Counter(comparison.counterparts.values())
    constant = sum(counterparts.pop(literal, 0) for literal in (FALSE, TRUE))
    return {
        "registers": len(comparison.source.registers),
        "mapped": len(comparison.mapped.registers),
        "constant": constant,
        "merged": counterparts.total() - len(counterparts),
        "unread": unread,
        "outputs": kinds["output"],
        "pins": kinds["cell"],
        "structure": sum(not literal for bits in differences.values() for literal in bits.values()),
        "proofs": len(unequal),
        "seconds": round(solving),
        "bytes": size,
        "checking": round(checking),
    }


def cut_out(netlist):
    """The cells that were cut out: by memory or multiplier, how many of which type."""
    found = Counter((re.sub(r"(\.\d+)+$", "", name), cell["type"]) for name, cell in netlist.cut.items())
    return {name: f"{count} {kind}" for (name, kind), count in sorted(found.items())}


def flipped(bits, chance):
    """Binary digits with one changed, and its place from the right."""
    at = chance.randrange(len(bits))
    return bits[:at] + "10"[int(bits[at])] + bits[at + 1 :], len(bits) - 1 - at


def with_parts(netlist, **parts):
    """A netlist with parts replaced."""
    changed = copy.copy(netlist)
    vars(changed).update(parts)
    return changed


def wrong_table(comparison, chance):
    """One bit of a look-up table is changed."""
    netlist, logic = comparison.mapped, comparison.logic
    name = chance.choice(sorted(name for name, cell in netlist.logic.items() if cell["type"] == "$lut"))
    cell = netlist.logic[name]
    contents, at = flipped(cell["parameters"]["LUT"], chance)
    chosen = TRUE
    for i, net in enumerate(cell["connections"]["A"]):
        chosen = logic.both(chosen, comparison.after(net) ^ 1 ^ at >> i & 1)
    changed = netlist.logic | {name: cell | {"parameters": cell["parameters"] | {"LUT": contents}}}
    return f"bit {at} of the table {name}", with_parts(netlist, logic=changed), chosen


def wrong_register(comparison, chance):
    """A register takes the next state of another."""
    netlist = comparison.mapped
    one, other = chance.sample(sorted(netlist.registers), 2)
    registers = netlist.registers | {one: netlist.registers[other]}
    names = ["{} [{}]".format(*netlist.name(net)) for net in (one, other)]
    return "next state of {} is that of {}".format(*names), with_parts(netlist, registers=registers), TRUE


def wrong_pin(comparison, chance):
    """An input of a cell that is cut out is constant; a constant input has the other value. No input is chosen that is undefined anyway."""
    netlist = comparison.mapped
    (name, pin, i), net = chance.choice(sorted((pin for pin in netlist.pins("input") if pin[1] != "x"), key=str))
    cell = netlist.cut[name]
    nets = [*cell["connections"][pin]]
    nets[i] = "1" if net == "0" else "0"
    cut = netlist.cut | {name: cell | {"connections": cell["connections"] | {pin: nets}}}
    return f"{nets[i]} at {pin} {i} of {name}", with_parts(netlist, cut=cut), TRUE


def wrong_contents(comparison, chance):
    """One bit of a parameter of a cell that is cut out is changed: of a word that a memory begins with."""
    netlist = comparison.mapped
    bits = lambda cell: {key: value for key, value in cell["parameters"].items() if value and not value.strip("01")}
    name = chance.choice(sorted(name for name, cell in netlist.cut.items() if bits(cell)))
    cell = netlist.cut[name]
    key = chance.choice(sorted(bits(cell)))
    contents, at = flipped(cell["parameters"][key], chance)
    cut = netlist.cut | {name: cell | {"parameters": cell["parameters"] | {key: contents}}}
    return f"bit {at} of {key} of {name}", with_parts(netlist, cut=cut), TRUE


# By kind, what plants a fault at random: the fault in words, the netlist with it, and a literal of the netlist without that must be 1 for the
# fault to matter.
FAULTS = {"tables": wrong_table, "registers": wrong_register, "pins": wrong_pin, "contents": wrong_contents}


def refuted(comparison, proved, faulty):
    """In words, where a mapped netlist with a fault differs; None if it is proved to equal the Verilog in spite of it, given the literals that
    are proved to be 0 without."""
    try:
        changed = comparison.changed(faulty)
        left = {
            key: {bit: literal for bit, literal in bits.items() if literal not in proved} for key, bits in changed.differences().items()
        }
        changed.unread(left)
    except Failure as failure:
        return str(failure)
    value = changed.logic.simulate(PATTERNS)
    for (kind, name), bits in left.items():
        wrong = [bit for bit, literal in bits.items() if value(literal)]
        if wrong:
            return differing(kind, name, wrong)
    for (kind, name), bits in left.items():
        text = bits and counterexample(question(changed.logic, bits), kind, name)
        if text:
            return text
    return None


def mutants(comparison, count, what, verbose):
    """Plants faults until so many of each kind are refuted. By kind: how many were, how many changes are no fault because the place is never
    used, and how many because nothing depends on it."""
    chance = random.Random(1)
    proved = {literal for bits in comparison.differences().values() for literal in bits.values()}
    progress = Progress(f"{what}: planted faults", count * len(FAULTS))
    found = {}
    for kind, plant in FAULTS.items():
        of = found[kind] = {"refuted": 0, "unused": 0, "masked": 0}
        while of["refuted"] < count:
            if sum(of.values()) > 10 * count:
                raise Failure(f"of {sum(of.values())} faults in {kind}, {of['refuted']} are refuted")
            try:
                text, faulty, matters = plant(comparison, chance)
            except IndexError:
                # There is no place for such a fault.
                break
            how = refuted(comparison, proved, faulty)
            if how:
                outcome, how = "refuted", f"refuted: {how}"
            elif comparison.logic.question({"bad": matters}).counterexample() is None:
                outcome, how = "unused", "no fault: the place is never used"
            else:
                outcome, how = "masked", "no fault: the netlist with it equals the Verilog, too"
            of[outcome] += 1
            if verbose or outcome != "refuted":
                print(f"{what}: {text}: {how}", flush=True)
            progress.show(sum(of["refuted"] for of in found.values()))
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="of the netlists source.json and gates.json")
    parser.add_argument("--name", required=True)
    parser.add_argument("--clocked", nargs="*", default=[], metavar="CELL[.PIN]", help="cells or pins that are cut out and sampled by the clock")
    parser.add_argument("--certify", metavar="CHECKER", help=solve.CERTIFY)
    parser.add_argument("--mutants", type=int, default=0, help="faults to plant of each kind")
    parser.add_argument("--flip-flops", action="store_true", help="write down which registers are one in the mapped netlist, or none")
    parser.add_argument("--record", action="store_true")
    parser.add_argument("--verbose", action="store_true")
    arguments = parser.parse_args()
    name, clocked = arguments.name, set(arguments.clocked)
    try:
        source, mapped = (Netlist(arguments.folder / f"{of}.json") for of in ("source", "gates"))
        comparison = Comparison(source, mapped, clocked)
        figures = prove(comparison, solve.certifier(arguments.folder, arguments.certify), name)
        figures["cut"] = cut_out(source)
        if arguments.flip_flops:
            figures["flip_flops"] = comparison.flip_flops()
        print(
            "{}: equal: next states of {registers} registers ({mapped} mapped: {merged} merged with others, {constant} constant, {unread} read "
            "by nothing), {outputs} output bits, {pins} inputs of cells cut out; {structure} bits by structure, the others by {proofs} proofs, "
            "{seconds} s{certified}".format(name, certified=solve.certified(arguments.certify, figures), **figures)
        )
        for cell, count in figures["cut"].items():
            print(f"{name}: cut out: {cell}: {count}", flush=True)
        if arguments.mutants:
            figures["mutants"] = mutants(comparison, arguments.mutants, name, arguments.verbose)
            for kind, of in figures["mutants"].items():
                print("{}: planted in {}: {refuted} refuted; no faults: {unused} never used, {masked} masked".format(name, kind, **of))
    except Failure as failure:
        sys.exit(f"error: {name}: {failure}")
    if arguments.record:
        solve.remember("mapped", name, **figures)


if __name__ == "__main__":
    main()

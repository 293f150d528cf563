# SPDX-License-Identifier: MIT OR Apache-2.0
"""A second reading of the Verilog: Verilator's front end parses and elaborates a circuit, and its syntax tree (XML) becomes a netlist here, which
`mapped.py` compares with yosys' netlist, register by register. README.md says what that leaves to be trusted.

In the tree parameters are numbers, generate blocks are written out, and every expression has its width; yosys shares nothing of that.
"""

import argparse
import json
import re
import subprocess
import sys
import time
import xml.etree.ElementTree as xml
from pathlib import Path

import mapped
from circuit import Failure, yosys
from mapped import FALSE, TRUE, Logic
from solve import CERTIFY, certified, certifier, remember

# Type of the cells that stand for `*` in both netlists: two ways to multiply have too little in common for a solver.
TIMES = "takt_times"
NUMBER = re.compile(r"\d+'s?h([0-9a-fA-F]+)")
# A constant with its digits, of which x and z stand for places of their own.
CONSTANT = re.compile(r"(\d+)'s?([hb])([0-9a-fA-FxzXZ?]+)")
STATEMENTS = {"assign", "assigndly", "if", "case", "begin", "while"}


def yosys_netlist(folder, files, cut, top, parameters):
    """Writes `source.json`: yosys' reading as the proofs have it before anything is optimised, with memories as registers."""
    script = [f"read_verilog -lib {' '.join(cut)}"] if cut else []
    script += [f"read_verilog -sv {' '.join(files)}", *(f"chparam -set {name} {value} {top}" for name, value in parameters.items())]
    script += [f"hierarchy -check -top {top}", "proc -norom", "flatten", "memory -nomap", "memory_map", "opt_clean", "dffunmap"]
    script += ["techmap t:$mul %n", "simplemap t:$mul %n", "clean", "write_json yosys.json"]
    yosys(folder, script)
    modules = json.loads((folder / "yosys.json").read_text())["modules"].values()
    module = next(module for module in modules if "top" in module["attributes"])
    for name, cell in list(module["cells"].items()):
        if cell["type"] == "$mul":
            # The name has the instances that the multiplication is in.
            path = re.match(r"\$flatten\\(.*)\.\$mul\$", name)
            del module["cells"][name]
            module["cells"][f"{path[1].replace(chr(92), '')}.times" if path else "times"] = times(
                *(extended(cell["connections"][pin], len(cell["connections"]["Y"]), int(cell["parameters"][f"{pin}_SIGNED"], 2)) for pin in "AB"),
                cell["connections"]["Y"],
            )
    (folder / "source.json").write_text(json.dumps({"modules": {top: module}}))
    return {name: cell for name, cell in module["cells"].items() if not cell["type"].startswith("$")}


def extended(bits, width, signed):
    """A word with another width."""
    return [*bits, *[bits[-1] if signed else "0"] * (width - len(bits))][:width]


def times(a, b, y):
    """The cell of a product."""
    directions = {"A": "input", "B": "input", "Y": "output"}
    return {"type": TIMES, "parameters": {}, "port_directions": directions, "connections": {"A": a, "B": b, "Y": y}}


class Scope:
    """A module's instance, or a generate block in one: its names, and the scope around it if names may be found there."""

    def __init__(self, path, around=None):
        self.path, self.around, self.names = path, around, {}

    def find(self, name):
        scope = self
        while scope and name not in scope.names:
            scope = scope.around
        if not scope:
            raise Failure(f"no variable `{name}` in `{self.path}`")
        return scope.names[name]


class Variable:
    """A wire, a register or an array of words; bits of a word are numbered from 0, words as well."""

    def __init__(self, name, width, words, direction):
        self.name, self.width, self.words, self.direction = name, width, words, direction


class Circuit:
    """Verilator's syntax tree as gates: every bit has what drives it, and is evaluated when it is asked for."""

    def __init__(self, path, top, cut):
        root = xml.parse(path).getroot()
        self.modules = {module.get("name"): module for module in root.iter("module")}
        self.types = {one.get("id"): one for one in root.find("netlist/typetable")}
        self.cut = cut
        self.logic = Logic()
        self.drivers, self.values, self.busy = {}, {}, set()
        self.registers, self.initial, self.boxes, self.clocked = {}, {}, {}, []
        self.arrays = {}
        scope = Scope("")
        self.instance(self.modules[top], scope)
        self.ports = {name: one for name, one in scope.names.items() if one.direction}
        for name, port in self.ports.items():
            if port.direction == "input":
                for i in range(port.width):
                    self.values[name, i] = self.logic.input(f"{name} {i}")
        for name, i in self.registers:
            self.values[name, i] = self.logic.input(f"register {name} {i}")

    # ---- the tree's parts

    def width(self, node):
        """Bits of a word, and how many words there are (None: it is no array)."""
        kind = self.types[node.get("dtype_id")]
        if kind.tag == "unpackarraydtype":
            low, high = (self.number(one) for one in kind.find("range"))
            if low:
                raise Failure(f"{node.get('name')}: words are not numbered from 0")
            return self.width_of(self.types[kind.get("sub_dtype_id")]), high + 1
        return self.width_of(kind), None

    def width_of(self, kind):
        left, right = int(kind.get("left", 0)), int(kind.get("right", 0))
        if kind.tag != "basicdtype" or kind.get("name") not in ("logic", "integer", "bit"):
            raise Failure(f"a type {kind.tag} {kind.get('name')} is not known")
        return 32 if kind.get("name") == "integer" else left - right + 1

    @staticmethod
    def number(node):
        return int(NUMBER.fullmatch(node.get("name"))[1], 16)

    def instance(self, module, scope):
        """Enters what a module, or a generate block, has."""
        for node in module:
            if node.tag == "var":
                width, words = self.width(node)
                direction = {"input": "input", "output": "output"}.get(node.get("dir"))
                variable = Variable(scope.path + node.get("name"), width, words, direction)
                scope.names[node.get("name")] = variable
                if words:
                    self.arrays[variable.name] = variable
                if node.find("const") is not None:
                    into = self.values if node.get("param") or node.get("localparam") else self.initial
                    into |= {(variable.name, i): bit for i, bit in enumerate(self.evaluate(node.find("const"), scope, None))}
            elif node.tag == "begin":
                self.instance(node, Scope(f"{scope.path}{node.get('name')}.", scope) if node.get("name") else scope)
        for node in module:
            if node.tag in ("contassign", "assign"):
                self.drive(node[1], scope, ("word", node[0], scope, {}))
            elif node.tag == "always":
                self.always(node, scope)
            elif node.tag == "initial":
                self.begins(node, scope)
            elif node.tag == "instance":
                self.within(node, scope)
            elif node.tag not in ("var", "begin", "typedef"):
                raise Failure(f"{scope.path}: a {node.tag} is not known")

    def within(self, node, scope):
        """Enters an instance of a module."""
        module, path = self.modules[node.get("defName")], f"{scope.path}{node.get('name')}"
        if module.get("origName") in self.cut:
            self.boxes[path] = (module, node, scope)
            for port in node.iter("port"):
                if port.get("direction") == "out" and len(port):
                    self.drive(port[0], scope, ("box", path, port.get("name"), {}))
            return
        inner = Scope(f"{path}.")
        self.instance(module, inner)
        for port in node.iter("port"):
            own = inner.names[port.get("name")]
            if not len(port):
                continue
            if port.get("direction") == "in":
                driver = ("word", port[0], scope, {})
                for i in range(own.width):
                    self.driven(own.name, i, (driver, i))
            else:
                self.drive(port[0], scope, ("variable", own, None, {}))

    def driven(self, name, i, driver):
        if (name, i) in self.drivers:
            raise Failure(f"`{name}` [{i}] is driven twice")
        self.drivers[name, i] = driver

    def targets(self, node, scope):
        """The bits of a left side, the lowest first."""
        if node.tag == "varref":
            variable = scope.find(node.get("name"))
            return [(variable.name, i) for i in range(variable.width)]
        if node.tag == "concat":
            return self.targets(node[1], scope) + self.targets(node[0], scope)
        if node.tag == "sel" and node[1].tag == "const":
            low = self.number(node[1])
            return self.targets(node[0], scope)[low : low + self.number(node[2])]
        if node.tag == "arraysel" and node[1].tag == "const":
            variable = scope.find(node[0].get("name"))
            return [(f"{variable.name}[{self.number(node[1])}]", i) for i in range(variable.width)]
        raise Failure(f"{scope.path}: the left side {node.tag} is not known")

    def drive(self, node, scope, driver):
        for at, (name, i) in enumerate(self.targets(node, scope)):
            self.driven(name, i, (driver, at))

    def assigned(self, nodes, scope):
        """The bits that statements may assign."""
        found = {}
        for node in (one for root in nodes for one in root.iter()):
            if node.tag in ("assign", "assigndly"):
                left = node[1]
                while left.tag == "sel" and left[1].tag != "const":
                    left = left[0]
                if left.tag == "arraysel" and left[1].tag != "const":
                    variable = scope.find(left[0].get("name"))
                    found |= {(f"{variable.name}[{word}]", i): node.tag for word in range(variable.words) for i in range(variable.width)}
                else:
                    found |= {bit: node.tag for bit in self.targets(left, scope)}
        return found

    def always(self, node, scope):
        tree, body = node.find("sentree"), [one for one in node if one.tag != "sentree"]
        edges = [item.get("edgeType") for item in tree.iter("senitem")] if tree is not None else []
        assigned = self.assigned(body, scope)
        if edges == ["POS"]:
            clock = self.targets(tree.find("senitem")[0], scope)
            self.clocked.append((body, scope, clock))
            # The value of a blocking assignment is read in the block alone.
            for bit in (bit for bit, kind in assigned.items() if kind == "assigndly"):
                if bit in self.registers:
                    raise Failure("`{}` [{}] is assigned by two clocked blocks".format(*bit))
                self.registers[bit] = len(self.clocked) - 1
        elif set(edges) <= {"CHANGED", "ANY"}:
            driver = ("block", body, scope, {})
            for bit in assigned:
                # Blocks may share the variable of their loops, which nothing else reads.
                self.drivers[bit] = (("twice", None, None, {}) if bit in self.drivers else driver, bit)
        else:
            raise Failure(f"{scope.path}: a block at {edges} is not known")

    def begins(self, node, scope):
        """Enters what registers, or words of a table, begin with."""
        for one in node.iter():
            if one.tag == "assign":
                # The initial value of a variable in a generate block stands outside of the block, and in its declaration.
                if one[1].tag == "varref" and one[1].get("name") not in scope.names:
                    continue
                for bit, value in zip(self.targets(one[1], scope), self.evaluate(one[0], scope, None)):
                    self.initial[bit] = value
            elif one.tag not in ("initial", "const", "varref", "arraysel", "sel", "begin"):
                raise Failure(f"{scope.path}: a {one.tag} in an initial block is not known")

    # ---- values

    def value(self, name, i):
        """The literal of a bit."""
        bit = name, i
        if bit not in self.values:
            if bit in self.busy:
                raise Failure(f"`{name}` [{i}] depends on itself")
            self.busy.add(bit)
            self.values[bit] = self.driving(bit)
            self.busy.discard(bit)
        return self.values[bit]

    def driving(self, bit):
        if bit not in self.drivers:
            if bit in self.initial:
                return self.initial[bit]
            return self.logic.input("undriven {} {}".format(*bit))
        (kind, of, scope, known), at = self.drivers[bit]
        if kind == "twice":
            raise Failure("`{}` [{}] is driven twice".format(*bit))
        if kind == "variable":
            return self.value(of.name, at)
        if kind == "box":
            return self.logic.input(f"{of} {scope} {at}")
        if kind == "word":
            if of.tag in ("varref", "sel") and (of.tag == "varref" or of[1].tag == "const"):
                # A bit of a word that may depend on other bits of itself.
                bits = self.targets(of, scope)
                return self.value(*bits[at])
            if "bits" not in known:
                known["bits"] = self.evaluate(of, scope, None)
            return known["bits"][at]
        if "bits" not in known:
            known["bits"] = {}
            self.execute(of, scope, known["bits"], known["bits"])
        if known["bits"].get(at) is None:
            raise Failure("`{}` [{}] keeps its value: a latch".format(*at))
        return known["bits"][at]

    def evaluate(self, node, scope, given):
        """The literals of an expression, the lowest first; `given` has those of bits that a block has assigned."""
        logic, tag = self.logic, node.tag
        read = lambda name, i: given[name, i] if given and (name, i) in given else self.value(name, i)
        of = lambda one: self.evaluate(one, scope, given)
        if tag == "const":
            # Undefined values are arbitrary, wherever they stand.
            undefined = lambda: self.logic.input(f"undefined {len(self.logic.nodes)}")
            return [int(digit) if digit in "01" else undefined() for digit in self.digits(node)]
        if tag == "varref":
            variable = scope.find(node.get("name"))
            return [read(variable.name, i) for i in range(variable.width)]
        width = self.width(node)[0]
        if tag == "sel":
            if node[0].tag == "varref" and node[1].tag == "const":
                low = self.number(node[1])
                return [read(*bit) for bit in self.targets(node[0], scope)[low : low + width]]
            word, low = of(node[0]), of(node[1])
            at = self.place(low)
            if at is not None:
                return word[at : at + width]
            return self.shifted(word, low, lambda bits, by: bits[by:] + [FALSE] * min(by, len(bits)))[:width]
        if tag == "arraysel":
            variable, address = scope.find(node[0].get("name")), of(node[1])
            at = self.place(address)
            if at is not None:
                return [read(f"{variable.name}[{at}]", i) for i in range(variable.width)]
            words = [[read(f"{variable.name}[{word}]", i) for i in range(variable.width)] for word in range(variable.words)]
            return self.chosen(words, address)
        if tag == "concat":
            return of(node[1]) + of(node[0])
        if tag == "replicate":
            return of(node[0]) * self.number(node[1])
        if tag in ("extend", "extends"):
            bits = of(node[0])
            return bits + [bits[-1] if tag == "extends" else FALSE] * (width - len(bits))
        if tag == "cond":
            select = self.some(of(node[0]))
            return [logic.choose(select, one, zero) for one, zero in zip(of(node[1]), of(node[2]))]
        operands = [of(one) for one in node]
        first = operands[0]
        if tag == "not":
            return [bit ^ 1 for bit in first]
        if tag == "negate":
            return self.sum([FALSE] * width, [bit ^ 1 for bit in first], TRUE)[:width]
        if tag in ("redor", "redand", "redxor"):
            odd = FALSE
            for bit in first:
                odd = logic.differ(odd, bit)
            return [{"redor": lambda: self.some(first), "redand": lambda: self.some([bit ^ 1 for bit in first]) ^ 1, "redxor": lambda: odd}[tag]()]
        if tag in ("lognot", "logand", "logor"):
            truths = [self.some(word) for word in operands]
            return [{"lognot": lambda: truths[0] ^ 1, "logand": lambda: logic.both(*truths), "logor": lambda: logic.either(*truths)}[tag]()]
        second = operands[1]
        if tag in ("and", "or", "xor", "xnor"):
            gate = {"and": logic.both, "or": logic.either, "xor": logic.differ, "xnor": lambda a, b: logic.differ(a, b) ^ 1}[tag]
            return [gate(one, other) for one, other in zip(first, second, strict=True)]
        if tag in ("add", "sub"):
            return self.sum(first, second if tag == "add" else [bit ^ 1 for bit in second], FALSE if tag == "add" else TRUE)[:width]
        if tag in ("mul", "muls", "moddiv", "moddivs"):
            numbers = [self.place(word) for word in operands]
            if None not in numbers and not (tag == "moddivs" and any(word[-1] for word in operands)):
                number = numbers[0] * numbers[1] if tag.startswith("mul") else numbers[0] % numbers[1]
                return [number >> i & 1 for i in range(width)]
            if tag.startswith("mul"):
                return self.product(scope, first, second)
        if tag in ("eq", "neq", "eqcase", "neqcase"):
            return [self.some([logic.differ(one, other) for one, other in zip(first, second, strict=True)]) ^ tag.startswith("eq")]
        order = re.fullmatch(r"(lt|gt|lte|gte)(s?)", tag)
        if order:
            if order[2]:
                first, second = ([*word[:-1], word[-1] ^ 1] for word in (first, second))
            if order[1] in ("gt", "lte"):
                first, second = second, first
            # The carry of a difference says that the first is not less.
            return [self.sum(first, [bit ^ 1 for bit in second], TRUE)[-1] ^ (order[1] in ("lt", "gt"))]
        if tag in ("shiftl", "shiftr", "shiftrs"):
            fill = first[-1] if tag == "shiftrs" else FALSE
            left = lambda bits, by: ([FALSE] * min(by, len(bits)) + bits)[: len(bits)]
            right = lambda bits, by: bits[by:] + [fill] * min(by, len(bits))
            return self.shifted(first, second, left if tag == "shiftl" else right)[:width]
        raise Failure(f"{scope.path}: the operator {tag} is not known")

    @staticmethod
    def digits(node):
        """The digits of a constant, 0, 1, x and z, the lowest first."""
        found = CONSTANT.fullmatch(node.get("name", ""))
        if not found:
            raise Failure(f"the {node.tag} {node.get('name')} is no constant that is known")
        each = 4 if found[2] == "h" else 1
        places = [f"{int(digit, 16):0{each}b}" if digit in "0123456789abcdefABCDEF" else digit.lower() * each for digit in found[3]]
        return extended([*reversed("".join(places))], int(found[1]), False)

    def place(self, bits):
        """The number that literals are, if they are constant."""
        return sum(bit << i for i, bit in enumerate(bits)) if set(bits) <= {FALSE, TRUE} else None

    def some(self, bits):
        """Whether any bit is 1."""
        found = FALSE
        for bit in bits:
            found = self.logic.either(found, bit)
        return found

    def sum(self, first, second, carry):
        """The sum of two words, and the carry behind it."""
        result, logic = [], self.logic
        for one, other in zip(first, second, strict=True):
            half = logic.differ(one, other)
            result.append(logic.differ(half, carry))
            carry = logic.either(logic.both(one, other), logic.both(half, carry))
        return [*result, carry]

    def shifted(self, word, by, shift):
        """A word shifted by a variable count: place by place."""
        for place, bit in enumerate(by):
            other = shift(word, min(1 << place, len(word)))
            word = [self.logic.choose(bit, one, zero) for one, zero in zip(other, word)]
        return word

    def chosen(self, words, address):
        """The word at an address."""
        if len(words) == 1:
            return words[0]
        half = 1 << (len(words) - 1).bit_length() - 1
        low, high = self.chosen(words[:half], address), self.chosen(words[half:], address)
        return [self.logic.choose(address[half.bit_length() - 1], one, zero) for one, zero in zip(high, low)]

    def product(self, scope, first, second):
        name = f"{scope.path}times"
        if name in self.boxes:
            raise Failure(f"two products in `{scope.path}`")
        self.boxes[name] = (first, second, [self.logic.input(f"{name} Y {i}") for i in range(len(first))])
        return self.boxes[name][2]

    # ---- statements

    def execute(self, nodes, scope, before, after):
        """Runs statements: `before` are values that they read, `after` those that non-blocking assignments give."""
        for node in nodes:
            if node.tag in ("assign", "assigndly"):
                self.assign(node[1], self.evaluate(node[0], scope, before), scope, before, before if node.tag == "assign" else after)
            elif node.tag == "begin":
                self.execute(node, scope, before, after)
            elif node.tag == "if":
                select = self.some(self.evaluate(node[0], scope, before))
                self.branches(select, [node[1]], [*node[2:]], scope, before, after)
            elif node.tag == "case":
                word, items = self.evaluate(node[0], scope, before), [*node[1:]]
                values = {one.get("name") for item in items for one in item if one.tag == "const"}
                # A case that has every value ends with one of its items.
                full = len(values) == 1 << len(word) and not any(set(self.digits(one)) - {"0", "1"} for item in items for one in item if one.tag == "const")
                self.cases(word, items, full, scope, before, after)
            elif node.tag == "while":
                # A loop has statements before the condition, the condition, and a body.
                self.execute(node[0], scope, before, after)
                while (goes := self.place(self.evaluate(node[1][0], scope, before))) == TRUE:
                    self.execute(node[2:], scope, before, after)
                if goes is None:
                    raise Failure(f"{scope.path}: how often a loop runs depends on values")
            else:
                raise Failure(f"{scope.path}: the statement {node.tag} is not known")

    def branches(self, select, then, otherwise, scope, before, after):
        """Runs one of two lists of statements."""
        sides = []
        for run in (then, otherwise):
            own = dict(before)
            later = own if after is before else dict(after)
            run(own, later) if callable(run) else self.execute(run, scope, own, later)
            sides.append((own, later))
        for which, target in enumerate((before, after) if after is not before else (before,)):
            one, zero = sides[0][which], sides[1][which]
            for bit in one.keys() | zero.keys():
                # A side keeps the bits that it has not assigned.
                values = [side[bit] if bit in side else self.kept(bit) for side in (one, zero)]
                target[bit] = None if None in values else self.logic.choose(select, *values)

    def kept(self, bit):
        """The value of a bit that a statement has not assigned: a register's; a wire has none, and a latch is refused where it is read."""
        return self.value(*bit) if bit in self.registers else None

    def cases(self, word, items, full, scope, before, after):
        if not items:
            return
        conditions = [one for one in items[0] if one.tag not in STATEMENTS]
        body = [one for one in items[0] if one.tag in STATEMENTS]
        if not conditions or full and len(items) == 1:
            if len(items) > 1:
                raise Failure(f"{scope.path}: a default is not the last case")
            self.execute(body, scope, before, after)
            return
        select = FALSE
        for one in conditions:
            # An item's z and ? stand for any bit.
            constant = self.digits(one) if one.tag == "const" else []
            bits = [None if digit in "z?" else int(digit) for digit in constant] or self.evaluate(one, scope, before)
            same = [self.logic.differ(bit, other) ^ 1 for bit, other in zip(word, bits, strict=True) if other is not None]
            select = self.logic.either(select, self.some([bit ^ 1 for bit in same]) ^ 1)
        rest = lambda own, later: self.cases(word, items[1:], full, scope, own, later)
        self.branches(select, body, rest, scope, before, after)

    def assign(self, node, bits, scope, before, into):
        """Assigns a word to a left side."""
        if node.tag == "concat":
            low = self.width(node[1])[0]
            self.assign(node[1], bits[:low], scope, before, into)
            self.assign(node[0], bits[low:], scope, before, into)
        elif node.tag == "arraysel" and node[1].tag != "const":
            variable, address = scope.find(node[0].get("name")), self.evaluate(node[1], scope, before)
            for word in range(variable.words):
                here = self.some([bit ^ (word >> place & 1) for place, bit in enumerate(address)]) ^ 1
                self.put([(f"{variable.name}[{word}]", i) for i in range(variable.width)], bits, here, into)
        elif node.tag == "sel" and node[1].tag != "const":
            whole, low = self.targets(node[0], scope), self.evaluate(node[1], scope, before)
            first = self.place(low)
            if first is not None:
                into |= dict(zip(whole[first : first + len(bits)], bits))
                return
            for at in range(len(whole)):
                here = self.some([bit ^ (at >> place & 1) for place, bit in enumerate(low)]) ^ 1
                self.put(whole[at : at + len(bits)], bits[: len(whole) - at], here, into)
        else:
            into |= dict(zip(self.targets(node, scope), bits, strict=True))

    def put(self, targets, bits, here, into):
        """Assigns bits if a literal is 1."""
        if here == FALSE:
            return
        for target, bit in zip(targets, bits, strict=True):
            old = into[target] if target in into else self.kept(target)
            if old is None and here != TRUE:
                raise Failure("`{}` [{}] is assigned in part".format(*target))
            into[target] = bit if here == TRUE else self.logic.choose(here, bit, old)

    def next_states(self):
        """The next state of each register."""
        found = {}
        for body, scope, clock in self.clocked:
            if self.value(*clock[0]) != self.values["clk", 0]:
                raise Failure(f"{scope.path}: a block at another edge than that of `clk`")
            before, after = {}, {}
            self.execute(body, scope, before, after)
            found |= {bit: value for bit, value in (before | after).items() if bit in self.registers}
        return {bit: found.get(bit, self.values[bit]) for bit in self.registers}

    # ---- the netlist

    def netlist(self, parameters):
        """The circuit as yosys would write it as JSON; of cells that are cut out those parameters that yosys' netlist has."""
        logic, following = self.logic, self.next_states()
        boxes = {}
        for name, box in list(self.boxes.items()):
            if len(box) == 3 and isinstance(box[0], list):
                boxes[name] = times(*box)
                continue
            module, instance, scope = box
            pins, directions = {}, {}
            for port in instance.iter("port"):
                if not len(port):
                    continue
                pin = port.get("name")
                if port.get("direction") == "in":
                    pins[pin], directions[pin] = self.evaluate(port[0], scope, None), "input"
                else:
                    pins[pin], directions[pin] = [self.value(*bit) for bit in self.targets(port[0], scope)], "output"
            given = {var.get("name"): self.number(var.find("const")) for var in module.iter("var") if var.get("param")}
            given = {key: f"{given[key]:0{len(text)}b}" for key, text in parameters.get(name, {}).items() if key in given}
            boxes[name] = {"type": module.get("origName"), "parameters": given, "port_directions": directions, "connections": pins}
        ports = {name: [self.value(name, i) for i in range(port.width)] for name, port in self.ports.items()}
        wires = {}
        for name, i in self.registers:
            wires.setdefault(name, {})[i] = self.values[name, i]
        words = [*ports.values(), *(word for box in boxes.values() for word in box["connections"].values())]
        roots = [*following.values(), *(bit for word in words for bit in word), *(self.values[bit] for bit in self.registers)]
        cells = {}

        def net(literal):
            # Nets are numbered from 2: odd ones are variables, even ones their negations.
            if literal in (FALSE, TRUE):
                return str(literal)
            if literal & 1:
                cells[f"not{literal}"] = {"type": "$_NOT_", "connections": {"A": [literal], "Y": [literal + 1]}}
            return literal + 1

        for variable in logic.cone(roots):
            node = logic.nodes[variable]
            if isinstance(node, tuple):
                pins = {"A": [net(literal) for literal in node], "Y": [net(2 * variable)]}
                cells[f"gate{variable}"] = {"type": "$lut", "parameters": {"LUT": "1000"}, "connections": pins}
        nets = {}
        for bit, value in following.items():
            cells["register {} {}".format(*bit)] = {
                "type": "$_DFF_P_", "connections": {"C": [net(self.values["clk", 0])], "D": [net(value)], "Q": [net(self.values[bit])]},
            }
        for name, bits in wires.items():
            at = lambda i: net(bits[i]) if i in bits else "x"
            init = "".join(str(self.initial.get((name, i), "x")) for i in reversed(range(max(bits) + 1)))
            nets[name] = {"bits": [at(i) for i in range(max(bits) + 1)], "attributes": {"init": init}}
        for name, box in boxes.items():
            cells[name] = box | {"connections": {pin: [net(bit) for bit in word] for pin, word in box["connections"].items()}}
        found = {name: {"direction": self.ports[name].direction, "bits": [net(bit) for bit in word]} for name, word in ports.items()}
        return {"attributes": {"top": "1"}, "ports": found, "netnames": nets, "cells": cells}


def verilator_netlist(folder, files, cut, top, parameters, known):
    """Writes `gates.json`: Verilator's reading."""
    command = ["verilator", "--xml-only", "-O0", "-Wno-fatal", "-Wno-lint", "--top-module", top, "--xml-output", "verilator.xml", "--Mdir", "verilator"]
    command += [f"-G{name}={value}" for name, value in parameters.items()]
    done = subprocess.run([*command, *files, *cut], cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise Failure(f"verilator failed in {folder}:\n{done.stderr[-2000:]}")
    modules = {name for file in cut for name in re.findall(r"^module (\w+)", (folder / file).read_text(), re.M)}
    circuit = Circuit(folder / "verilator.xml", top, modules)
    (folder / "gates.json").write_text(json.dumps({"modules": {top: circuit.netlist(known)}}))


# Sizes with which memories are read by themselves.
SIZES = {"INDEX": 3, "DEPTH": 8, "ADDRESS": 3}


class Readings:
    """A machine's core, read twice, and the modules that are cut out of it, each with the parameters that the core gives it."""

    def __init__(self, arguments):
        self.arguments = arguments
        self.folder = Path(arguments.folder)
        self.asked = json.loads((self.folder / "question.json").read_text())
        self.certifier = certifier(self.folder, arguments.certify)
        self.figures = {"circuits": 0, "registers": 0, "outputs": 0, "pins": 0, "structure": 0, "proofs": 0, "seconds": 0, "bytes": 0, "checking": 0}
        self.refuted = 0

    def core(self):
        """Compares the readings of all."""
        asked = self.asked
        boxes, netlists = self.read(asked["top"], asked["read"], asked["cut"], {})
        homes = {name: file for file in asked["cut"] for name in re.findall(r"^module (\w+)", (self.folder / file).read_text(), re.M)}
        sampled = {}
        for kind, given in sorted({(cell["type"], tuple(sorted(cell["parameters"].items()))) for cell in boxes.values() if cell["type"] in homes}):
            parameters = {name: SIZES.get(name, int(bits, 2)) for name, bits in given}
            _, own = self.read(kind, self.needed(homes, kind), [], parameters)
            comparison = self.compared(" ".join([kind, *(f"{name}={value}" for name, value in parameters.items())]), own, set())
            # A pin that no output follows within the cycle is in no loop of the core's logic.
            follows = comparison.logic.inputs([comparison.after(net) for _, net in own[1].bits("output")])
            follows = {comparison.logic.nodes[literal >> 1].rpartition(" ")[0] for literal in follows}
            pins = {f"{kind}.{name}" for name, port in own[1].ports.items() if name not in follows}
            sampled[kind] = sampled.get(kind, pins) & pins
        self.compared(asked["machine"], netlists, set().union(*sampled.values()))

    def needed(self, homes, kind):
        """The files that a module needs."""
        files = [homes[kind]]
        for file in files:
            names = re.findall(r"\btakt_\w+", re.sub(r"//.*", "", (self.folder / file).read_text()))
            files += dict.fromkeys(homes[name] for name in names if name in homes and homes[name] not in files)
        return files

    def read(self, top, files, cut, parameters):
        """Reads a circuit twice; its cells that are cut out, and both netlists."""
        boxes = yosys_netlist(self.folder, files, cut, top, parameters)
        verilator_netlist(self.folder, files, cut, top, parameters, {name: cell["parameters"] for name, cell in boxes.items()})
        return boxes, [mapped.Netlist(self.folder / f"{of}.json") for of in ("source", "gates")]

    def compared(self, name, netlists, clocked):
        comparison = mapped.Comparison(*netlists, clocked)
        found = mapped.prove(comparison, self.certifier, name)
        print("{}: {registers} registers, {outputs} output bits, {pins} inputs of cells cut out: read alike, {proofs} proofs".format(name, **found), flush=True)
        self.figures = {key: value + found.get(key, 1) for key, value in self.figures.items()}
        if self.arguments.mutants:
            planted = mapped.mutants(comparison, self.arguments.mutants, name, self.arguments.verbose)
            self.refuted += sum(of["refuted"] for of in planted.values())
        return comparison


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", help="of the core's files and question.json")
    parser.add_argument("--certify", metavar="CHECKER", help=CERTIFY)
    parser.add_argument("--mutants", type=int, default=0, help="faults to plant of each kind in each circuit of Verilator's reading")
    parser.add_argument("--record", action="store_true")
    parser.add_argument("--verbose", action="store_true")
    arguments = parser.parse_args()
    # The bits of a word may follow one another.
    sys.setrecursionlimit(100_000)
    readings, started = Readings(arguments), time.monotonic()
    machine = readings.asked["machine"]
    try:
        readings.core()
    except Failure as failure:
        sys.exit(f"error: {machine}: {failure}")
    print(
        "{}: Verilator reads {circuits} circuits as yosys does: {registers} registers, {outputs} output bits, {pins} inputs of cells cut out; {structure} "
        "bits by structure, the others by {proofs} proofs, {seconds} s{certified}; {refuted} planted faults refuted; {all:.0f} s".format(
            machine,
            **readings.figures,
            certified=certified(arguments.certify, readings.figures),
            refuted=readings.refuted,
            all=time.monotonic() - started,
        ),
        flush=True,
    )
    if arguments.record:
        remember("reading", machine, refuted=readings.refuted, **readings.figures)


if __name__ == "__main__":
    main()

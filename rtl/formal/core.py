# SPDX-License-Identifier: MIT OR Apache-2.0
"""Proves by induction that a core keeps the rules of issue, for every program and any number of cycles.

`cargo evidence formal` writes the core with a reference of the rules, properties and invariants (tools/evidence/src/formal/core). Each of
their conditions is an output of one graph, which must be 0. After a reset from any state all are 0; and if all are 0 in a cycle, all are
in the next one, whatever the inputs are.
"""

import argparse
import json
import re
import sys
import time
from contextlib import ExitStack
from pathlib import Path

from pysat.solvers import Solver

import induction
import solve
from balance import Unrolled
from circuit import FORMAL, Failure, planted, read_aiger, yosys
from solve import SOLVER, literal

# Faults planted by people who had seen neither properties nor invariants: by machine [module, old, new, how it shows].
FRESH = FORMAL / "fresh.json"
# First words of the reference in the top.
REFERENCE = "    // ---- reference, properties and invariants"
# Input that chooses a planted fault in each module, from 1, and its bits.
CHOICE, CHOICES = "f_planted", 10
# Cycles of reset. The loader is silent in them; in others the core ignores it.
RESET = 6


class Core:
    """A core as gates and latches, its conditions, and the cycles of both questions."""

    def __init__(self, folder, asked, with_faults=False):
        self.asked = asked
        self.graph = graph(folder, asked, with_faults)
        # The literals that choose the fault in the cycles unrolled last, the lowest bit first.
        self.choice = []

    def choices(self):
        """The inputs of all modules that choose the fault."""
        bits = {name: re.search(rf"(?:^|\.){CHOICE}\[(\d+)\]$", name) for name in self.graph.inputs}
        return {name: self.choice[int(bit[1])] for name, bit in bits.items() if bit}

    def unrolled(self, resets):
        """Gates, conditions and issues of cycles that begin in any state, with or without a reset each, and what is assumed of the circuit."""
        gates, cycles, assumed = Unrolled(), [], []
        constants = {name: gates.free() for name in self.graph.inputs if name.partition("[")[0] in self.asked["constants"]}
        self.choice = [gates.free() for _ in range(CHOICES)]
        constants |= self.choices()
        state = {latch: gates.free() for latch in self.graph.latches}
        for reset in resets:
            given = {name: constants[name] if name in constants else gates.free() for name in self.graph.inputs}
            outputs, state = gates.cycle(self.graph, state, {**given, "rst": reset, "load": 0})
            cycles.append(([outputs[f"f_bad[{number}]"] for number in range(len(self.asked["bad"]))], outputs["f_issues"]))
            assumed.append(outputs["f_assumed"])
        return gates, cycles, assumed

    def questions(self):
        """Of the base and of the step: a name, the gates, what is assumed, and the conditions, none of which may be 1."""
        gates, cycles, assumed = self.unrolled([1] * RESET + [0])
        yield "after a reset", gates, assumed, cycles[-1][0]
        gates, cycles, assumed = self.unrolled([0, 0])
        yield "a cycle later", gates, assumed + [one ^ 1 for one in cycles[0][0]], cycles[1][0]

    def issues(self):
        """Whether a bundle can issue as soon as the front end delivers one: if not, what is assumed cannot be."""
        gates, cycles, assumed = self.unrolled([1] * RESET + [0] * (self.asked["refill"] + 1))
        with Solver(name=SOLVER, bootstrap_with=induction.clauses(gates, [*assumed, cycles[-1][1]])) as solver:
            return solver.solve()


def graph(folder, asked, with_faults):
    """The core, reference, properties and invariants as gates and latches."""
    top = asked["top"]
    for file in ("bank.v", "word.v"):
        (folder / file).write_text((FORMAL / file).read_text())
    script = [f"read_verilog -lib {' '.join(asked['cut'])}", f"read_verilog -sv {' '.join(asked['read'])} bank.v"]
    script += [f"hierarchy -check -top {top}", "proc", "flatten", "memory_collect", f"memory_map {top}/sequencer.*"]
    # Each other memory keeps one word, an arbitrary one, as a bank does.
    script += ["techmap -map word.v", f"cd {top}"]
    script += [f"connect -nounset -set {memory}.probe {address}" for memory, address in asked["words"]]
    script += [f"connect -nounset -set {name} {path}" for name, path in asked["inner"]]
    script += ["cd ..", "cutpoint -blackbox", f"delete -port {top}/o:*"]
    script += [f"expose {top}/w:{name}" for name in ("f_bad", "f_assumed", "f_issues")]
    script += [f"expose -input {top}/w:{name}" for name in asked["constants"]]
    script += [f"expose -input {top}/w:*{CHOICE}"] * with_faults
    # Undefined values are arbitrary in each cycle. They are made free before anything is optimised.
    script += ["opt_clean -purge", f"select -assert-none {top}/t:$mem*", "setundef -undriven -anyseq"]
    script += ["opt_expr", "opt_merge", "opt_clean", "dffunmap", "techmap", "opt_expr", "opt_merge", "aigmap", "opt_clean"]
    script += ["write_aiger -ascii -symbols core.aag"]
    yosys(folder, script)
    return read_aiger((folder / "core.aag").read_text())


def decided(core, certifier=None):
    """Seconds of solving, bytes of the proofs, seconds of checking them; raises Refuted if a condition can be 1."""
    try:
        return induction.decided(core.questions(), certifier)
    except induction.Refuted as found:
        raise Refuted(core.asked, found.name, found.numbers) from None


class Refuted(Failure):
    """Conditions that can be 1 together; the text is for the user."""

    def __init__(self, asked, name, numbers):
        lines = [f"{asked['machine']}: not proved; {name} there may be a breach of"]
        lines += [f"  {asked['says'][number]}: {asked['bad'][number][:200]}" for number in numbers]
        super().__init__("\n".join(lines))


def behind_choices(texts, faults):
    """The texts of files by name with faults (module, old, new) behind multiplexers, fault k where `f_planted` is k + 1. Stops before a fault
    whose text overlaps that of one before it; the number of those planted comes second."""
    texts = dict(texts)
    for number, (name, old, new) in enumerate(faults):
        text, *reference = texts[f"{name}.v"].partition(REFERENCE)
        # The right-hand side of an assignment becomes the choice.
        head, arrow, right = old.partition("<= ") if "<= " in old else ("", "", old)
        instead = new.partition("<= ")[2] if arrow else new
        if text.count(old) != 1 or number + 1 >> CHOICES:
            return texts, number
        at = text.index(old)
        text = f"{text[:at]}{head}{arrow}({CHOICE} == {number + 1} ? ({instead}) : ({right})){text[at + len(old) :]}"
        begin = text.index(");\n", [place.end() for place in re.finditer(r"^module ", text[:at], re.M)][-1]) + 3
        declaration = f"    wire [{CHOICES - 1}:0] {CHOICE};\n"
        if not text[begin:].startswith(declaration):
            text = text[:begin] + declaration + text[begin:]
        texts[f"{name}.v"] = "".join([text, *reference])
    return texts, len(faults)


def outcomes(folder, asked, faults):
    """Of each fault (module, old, new): the first condition that it breaks, or None. As many as can stand beside one another are planted in
    one circuit, which yosys reads once, and a solver keeps what it has learnt of it."""
    folder.mkdir(parents=True, exist_ok=True)
    texts = {file: (folder.parent / file).read_text() for file in [*asked["read"], *asked["cut"]]}
    while faults:
        changed, count = behind_choices(texts, faults)
        if not count:
            raise Failure(f"the text of a fault does not stand in {faults[0][0]} once: {faults[0][1]}")
        for file, text in changed.items():
            (folder / file).write_text(text)
        core = Core(folder, asked, with_faults=True)
        with ExitStack() as stack:
            questions = []
            for name, gates, assumed, bad in core.questions():
                solver = stack.enter_context(Solver(name=SOLVER, bootstrap_with=induction.clauses(gates, assumed, bad)))
                questions.append((name, solver, core.choice, bad))
            for number in range(count):
                yield faults[number], next(filter(None, (broken(asked, number + 1, *question) for question in questions)), None)
        faults = faults[count:]


def broken(asked, number, name, solver, choice, bad):
    """The first condition that a question's answer breaks with the fault of a number; None if it breaks none."""
    chosen = [literal(bit) if number >> i & 1 else -literal(bit) for i, bit in enumerate(choice)]
    if not solver.solve(assumptions=chosen):
        return None
    model = set(solver.get_model())
    return f"{name}: {asked['says'][next(i for i, one in enumerate(bad) if literal(one) in model)]}"


def to_plant(folder, asked, count):
    """The faults to plant: of the simulations' lists for this core the first so many of each part; all, and the fresh ones, for 0."""
    fresh = json.loads(FRESH.read_text()).get(asked["machine"], []) if not count else []
    faults = [tuple(fault[:3]) for fault in fresh]
    for file in asked["read"]:
        text, name = (folder / file).read_text().partition(REFERENCE)[0], file[:-2]
        own = [fault for fault in dict.fromkeys(planted("cosim/tests", name, asked["faults"])) if text.count(fault[0]) == 1]
        faults += [(name, *fault) for fault in (own[:count] if count else own)]
    return faults


def mutants(folder, asked, count, verbose):
    """Plants faults in the parts of the core and tells which are refuted; the number that are, and of all."""
    faults, found = to_plant(folder, asked, count), 0
    for (name, old, new), how in outcomes(folder / "mutant", asked, faults):
        found += how is not None
        if how is None or verbose:
            print(f"{asked['machine']}: {name}: `{old}` replaced by `{new}`: {how or 'NOT refuted'}", flush=True)
    print(f"{asked['machine']}: {found} of {len(faults)} planted faults refuted", flush=True)
    return found, len(faults)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", required=True)
    parser.add_argument("--certify", metavar="CHECKER", help=solve.CERTIFY)
    parser.add_argument("--mutants", type=int, help="plant faults, the first so many of each part; 0 for all")
    parser.add_argument("--verbose", action="store_true", help="tell how each planted fault was refuted")
    parser.add_argument("--record", action="store_true", help="write the result down")
    arguments = parser.parse_args()
    folder, started = Path(arguments.folder), time.monotonic()
    asked = json.loads((folder / "question.json").read_text())
    machine = asked["machine"]
    try:
        core = Core(folder, asked)
        solving, size, checking = decided(core, solve.certifier(folder, arguments.certify))
        if not core.issues():
            raise Failure(f"{machine}: no bundle can issue when the front end delivers one: that proves nothing")
        certified = solve.certified(arguments.certify, {"bytes": size, "checking": checking})
        print(
            f"{machine}: {asked['properties']} properties and {len(asked['bad']) - asked['properties']} invariants of {len(core.graph.latches)} registers: "
            f"proved, every program, any number of cycles; a bundle waits for at most {asked['waits']} cycles for rules 2 to 6; "
            f"{solving:.0f} s of solving{certified}; {time.monotonic() - started:.0f} s",
            flush=True,
        )
        what = {"registers": len(core.graph.latches), "gates": len(core.graph.ands), "properties": asked["properties"]}
        what |= {"invariants": len(asked["bad"]) - asked["properties"], "waits": asked["waits"], "seconds": round(solving)}
        what |= {"bytes": size, "checking": round(checking)}
        # The faults take longer than the proof, and may be stopped.
        if arguments.record:
            solve.remember("core", machine, **what)
        if arguments.mutants is not None:
            what["refuted"], what["tried"] = mutants(folder, asked, arguments.mutants, arguments.verbose)
            if arguments.record:
                solve.remember("core", machine, **what)
    except Failure as failure:
        sys.exit(f"error: {failure}")


if __name__ == "__main__":
    main()

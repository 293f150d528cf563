# SPDX-License-Identifier: MIT OR Apache-2.0
"""Proves by induction that a core keeps the rules of issue, for every program and any number of cycles.

`cargo evidence formal` writes the core with a reference of the rules, properties and invariants (tools/evidence/src/formal/core). Each of
their conditions is an output of one graph, which must be 0. After a reset from any state all are 0; and if all are 0 in a cycle, all are
in the next one, whatever the inputs are.
"""

import argparse
import json
import sys
import time
from pathlib import Path

from pysat.solvers import Solver

import induction
from balance import Unrolled
from circuit import FORMAL, Failure, changed, planted, read_aiger, yosys
from solve import SOLVER, Certifier, remember

# File of the planted faults that a proof has not refuted.
LEFT = "left.json"
# Cycles of reset. The loader is silent in them; in others the core ignores it.
RESET = 6


class Core:
    """A core as gates and latches, its conditions, and the cycles of both questions."""

    def __init__(self, folder, asked):
        self.asked = asked
        self.graph = graph(folder, asked)

    def unrolled(self, resets):
        """Gates, conditions and issues of cycles that begin in any state, with or without a reset each, and what is assumed of the circuit."""
        gates, cycles, assumed = Unrolled(), [], []
        constants = {name: gates.free() for name in self.graph.inputs if name.partition("[")[0] in self.asked["constants"]}
        state = {latch: gates.free() for latch in self.graph.latches}
        for reset in resets:
            given = {name: constants.get(name) or gates.free() for name in self.graph.inputs}
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


def graph(folder, asked):
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
        self.first = f"{name}: {asked['says'][numbers[0]]}"
        lines = [f"{asked['machine']}: not proved; {name} there may be a breach of"]
        lines += [f"  {asked['says'][number]}: {asked['bad'][number][:200]}" for number in numbers]
        super().__init__("\n".join(lines))


def refuted(folder, asked, name, fault):
    """The first condition that a fault (old, new) in a part breaks; None if the proof holds with it."""
    folder.mkdir(parents=True, exist_ok=True)
    texts = {file: (folder.parent / file).read_text() for file in [*asked["read"], *asked["cut"]]}
    for file, text in changed(texts, [f"{name}.v"], fault).items():
        (folder / file).write_text(text)
    try:
        decided(Core(folder, asked))
    except Refuted as found:
        return found.first
    return None


def mutants(folder, asked, count, verbose, left):
    """Plants faults in the parts of the core, or those that another core's proof has left, and tells which are refuted; the number that
    are."""
    faults = []
    for file in asked["read"]:
        own = [(file[:-2], fault) for fault in dict.fromkeys(planted("cosim/tests", file[:-2]))]
        text = (folder / file).read_text()
        own = [(name, fault) for name, fault in own if text.count(fault[0]) == 1]
        faults += own[:count] if count else own
    if left:
        others = json.loads(left.read_text())
        faults = [(name, fault) for name, fault in faults if [name, *fault] in others]
    found = []
    for name, fault in faults:
        how = refuted(folder / "mutant", asked, name, fault)
        if how is not None:
            found.append((name, fault))
        if how is None or verbose:
            print(f"{asked['machine']}: {name}: `{fault[0]}` replaced by `{fault[1]}`: {how or 'NOT refuted'}", flush=True)
    unrefuted = [[name, *fault] for name, fault in faults if (name, fault) not in found]
    (folder / LEFT).write_text(json.dumps(unrefuted))
    print(f"{asked['machine']}: {len(found)} of {len(faults)} planted faults refuted", flush=True)
    return len(found), len(faults)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", required=True)
    parser.add_argument("--certify", metavar="CHECKER", help="decide with proofs, and check each by this program's command drat")
    parser.add_argument("--mutants", type=int, help="plant faults, the first so many of each part; 0 for all")
    parser.add_argument("--left", metavar="FOLDER", help="of these faults, plant those alone that the proof in this folder has not refuted")
    parser.add_argument("--verbose", action="store_true", help="tell how each planted fault was refuted")
    parser.add_argument("--record", action="store_true", help="write the result down")
    arguments = parser.parse_args()
    folder, started = Path(arguments.folder), time.monotonic()
    asked = json.loads((folder / "question.json").read_text())
    machine = asked["machine"]
    try:
        core = Core(folder, asked)
        certifier = Certifier(folder, arguments.certify) if arguments.certify else None
        solving, size, checking = decided(core, certifier)
        if not core.issues():
            raise Failure(f"{machine}: no bundle can issue when the front end delivers one: that proves nothing")
        certified = f"; proofs of {size / 1e6:.0f} MB checked in {checking:.0f} s" if certifier else ""
        print(
            f"{machine}: {asked['properties']} properties and {len(asked['bad']) - asked['properties']} invariants of {len(core.graph.latches)} registers: "
            f"proved, every program, any number of cycles; a bundle waits for at most {asked['waits']} cycles for rules 2 to 6; "
            f"{solving:.0f} s of solving{certified}; {time.monotonic() - started:.0f} s",
            flush=True,
        )
        left = Path(arguments.left) / LEFT if arguments.left else None
        found = mutants(folder, asked, arguments.mutants, arguments.verbose, left) if arguments.mutants is not None else None
    except Failure as failure:
        sys.exit(f"error: {failure}")
    if arguments.record:
        what = {"registers": len(core.graph.latches), "gates": len(core.graph.ands), "properties": asked["properties"]}
        what |= {"invariants": len(asked["bad"]) - asked["properties"], "waits": asked["waits"], "seconds": round(solving)}
        what |= {"bytes": size, "checking": round(checking)}
        if found:
            what |= {"refuted": found[0], "tried": found[1]}
        remember("core", machine, **what)


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: MIT OR Apache-2.0
"""Proves, by bounded model checking with CaDiCaL, that what issues around counted loops is what the program means."""

import argparse
import sys
import time
from pathlib import Path

from pysat.solvers import Solver

from balance import Unrolled
from circuit import FORMAL, Failure, changed, planted, read_aiger, yosys
from solve import SOLVER, gate, literal

RESET = 6
CORE = FORMAL.parent / "core"
FILES = ["takt_sequencer.v", "takt_loops.v", "takt_issue.v"]
# A fault that lockstep need not find, since it shows only between addresses that differ in their highest bit; refuted
# in 18 cycles.
OWN = [("fetched == ahead_last", "fetched[PROGRAM-2:0] == ahead_last[PROGRAM-2:0]")]


def graph(folder, mutant=None):
    """The sequencer beside its meaning, as gates and latches. A mutant is (old, new), a text that occurs once."""
    folder.mkdir(parents=True, exist_ok=True)
    texts = {name: (CORE / name).read_text() for name in FILES}
    if mutant:
        texts = changed(texts, FILES, mutant)
    for name, text in texts.items():
        (folder / name).write_text(text)
    (folder / "loops.v").write_text((FORMAL / "loops.v").read_text())
    top = "takt_loops_meaning"
    script = [f"read_verilog {name}" for name in [*FILES, "loops.v"]]
    script += [f"hierarchy -check -top {top}", "proc", "flatten", "opt_clean", "memory -nomap", "memory_map"]
    script += ["opt -full -nodffe -nosdff", "setundef -anyseq", "techmap", "opt_expr", "opt_merge", "opt_clean", "aigmap"]
    script += ["opt_clean", "setundef -zero", "write_aiger -ascii -symbols loops.aag"]
    yosys(folder, script)
    return read_aiger((folder / "loops.aag").read_text())


def check(of, cycles, progress=None):
    """The first cycle after reset in which `bad` can be 1, and the first in which `ends` can; None if neither is before `cycles`."""
    gates = Unrolled()
    program = {name: gates.free() for name in of.inputs if name.startswith(("kinds", "targets"))}
    state = {latch: gates.free() for latch in of.latches}
    known, reached = 0, None
    with Solver(name=SOLVER, bootstrap_with=[[-1]]) as solver:
        for cycle in range(-RESET, cycles):
            started = time.monotonic()
            given = {name: program.get(name) or gates.free() for name in of.inputs}
            outputs, state = gates.cycle(of, state, {**given, "rst": 1 if cycle < 0 else 0, "clk": 0})
            for out, left, right in gates.ands[known:]:
                solver.append_formula(gate(out, left, right))
            known = len(gates.ands)
            if cycle < 0:
                continue
            if reached is None and solver.solve([literal(outputs["ends"])]):
                reached = cycle
            if solver.solve([literal(outputs["bad"])]):
                return cycle, reached
            solver.add_clause([-literal(outputs["bad"])])
            if progress:
                progress(cycle, time.monotonic() - started)
    return None, reached


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", required=True)
    parser.add_argument("--cycles", type=int, required=True)
    parser.add_argument("--mutants", type=int, required=True, help="the first so many; 0 for all")
    parser.add_argument("--verbose", action="store_true")
    arguments = parser.parse_args()
    folder, cycles = Path(arguments.folder), arguments.cycles
    started = time.monotonic()
    tell = lambda cycle, seconds: print(f"cycle {cycle}: {seconds:.1f} s", file=sys.stderr, flush=True)
    try:
        found, reached = check(graph(folder / "loops"), cycles, tell)
    except Failure as failure:
        sys.exit(f"error: {failure}")
    if found is not None:
        sys.exit(f"error: loops: what issues {found} cycles after reset is not what the program means")
    if reached is None:
        sys.exit(f"error: loops: no loop within another ends in {cycles} cycles: that proves little")
    print(
        f"loops: for every program of 8 bundles, what issues is what it means, and its faults: proved for {cycles} cycles after reset; "
        f"a loop within another first ends in cycle {reached}; {time.monotonic() - started:.0f} s",
        flush=True,
    )
    faults = planted("cosim/tests", "takt_loops")
    faults = [*OWN, *(faults[: arguments.mutants] if arguments.mutants else faults)]
    refuted, missed = 0, False
    for old, new in faults:
        found, _ = check(graph(folder / "mutant", (old, new)), cycles)
        missed |= found is None and (old, new) in OWN
        refuted += found is not None
        if found is None or arguments.verbose:
            how = f"refuted in cycle {found}" if found is not None else f"not within {cycles} cycles"
            print(f"loops: `{old}` replaced by `{new}`: {how}", flush=True)
    print(f"loops: {refuted} of {len(faults)} mutants refuted", flush=True)
    # Some faults show only in longer runs, but one must be refuted here.
    if missed or refuted == len(OWN):
        sys.exit("error: loops: a mutant that must be is not refuted")


if __name__ == "__main__":
    main()

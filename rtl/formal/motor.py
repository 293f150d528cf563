# SPDX-License-Identifier: MIT OR Apache-2.0
"""Proves by induction that two switches of a half bridge are never on together, that dead time and least times hold, and that a
trip makes outputs safe in time, for every sequence of duties, trips, resets and enabling, at any carrier; and of memory words' code that
it corrects one wrong bit and tells of two."""

import argparse
import sys
import time
from pathlib import Path

import induction
import solve
from balance import Unrolled
from circuit import FORMAL, Failure, changed, read_aiger, yosys
from solve import remember

# Modules by name, with their folders.
MODULES = {name: FORMAL.parent / "board" / "verilog" for name in ("takt_pwm_phase", "takt_pwm3", "takt_trip", "takt_filter")}
MODULES["takt_ecc_code"] = FORMAL.parent / "ecc"
# Half a carrier's period, dead time, least time; mutants are tried with the last.
PHASES = [(1250, 0, 0), (60, 1, 7), (65535, 1023, 1023), (1250, 25, 50)]
# Filter, dead time, level while tripped, direct or not; mutants are tried with the last two.
TRIPS = [(0, 2, 1, 0), (1, 0, 0, 0), (0, 0, 2, 1), (5, 3, 2, 0), (0, 3, 1, 1)]
# Bits of a word and check bits: of a program with no bit left out, of data; mutants are tried with the last. A shorter word is one whose other
# bits are 0.
CODES = [(48, 8), (32, 7)]
# Statement of each proof, for people.
SHOWN = {
    "phase": "two switches of a half bridge are never on together, dead time and least times hold",
    "trip": "a trip is safe n + 3 cycles after its pin, at once if it is direct, and held until it is cleared",
    "code": "one wrong bit of a memory word with its check bits is corrected, two are told",
}
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
CODE_MUTANTS = [
    ("takt_ecc_code", "found == 3", "found == 2"),
    ("takt_ecc_code", "count < bits && found == 3", "count < bits"),
    ("takt_ecc_code", "] = value[k]", "] = value[k] & k != 2"),
    ("takt_ecc_code", "^{taken, given[k]}", "^taken"),
    ("takt_ecc_code", "&(given | ~COLUMNS[CHECK*i +: CHECK])", "|(given & COLUMNS[CHECK*i +: CHECK])"),
    ("takt_ecc_code", "~COLUMNS[CHECK*i +: CHECK]", "{1'b1, ~COLUMNS[CHECK*i +: CHECK-1]}"),
    ("takt_ecc_code", "|given & ~^given", "|given"),
    ("takt_ecc_code", ", ^given}", ", ^given[CHECK-2:0]}"),
]


def texts(mutant=None):
    """The modules by name, with a mutant (module, old, new) in one of them."""
    found = {name: (folder / f"{name}.v").read_text() for name, folder in MODULES.items()}
    return changed(found, [mutant[0]], mutant[1:]) if mutant else found


def joined(text, properties):
    """A module's text with properties before its end."""
    start, end, rest = text.rpartition("endmodule")
    return f"{start}{properties}{end}{rest}"


def questions(graph, cycles):
    """From the initial values, no assertion fails in so many cycles; after so many cycles in which none fails, none does in the next one."""
    for name, begins, lasts in (("from reset", graph.initial, cycles), ("a cycle later", {}, cycles + 1)):
        gates, assumed, bad = Unrolled(), [], []
        state = {latch: begins[latch] if latch in begins else gates.free() for latch in graph.latches}
        for _ in range(lasts):
            outputs, state = gates.cycle(graph, state, {name: gates.free() for name in graph.inputs})
            assumed += [outputs[name] for name in outputs if name.startswith("assumed[")]
            bad.append([outputs[name] for name in outputs if name.startswith("bad[")])
        if lasts > cycles:
            assumed += [one ^ 1 for earlier in bad[:-1] for one in earlier]
            bad = bad[-1:]
        yield name, gates, assumed, [one for cycle in bad for one in cycle]


def in_order(graph):
    """Of a graph without latches: no assertion fails where those before it hold."""
    gates = Unrolled()
    outputs, _ = gates.cycle(graph, {}, {name: gates.free() for name in graph.inputs})
    assumed = [outputs[name] for name in outputs if name.startswith("assumed[")]
    for number, bad in enumerate(outputs[name] for name in outputs if name.startswith("bad[")):
        yield f"assertion {number}", gates, assumed, [bad]
        assumed = [*assumed, bad ^ 1]


def proved(folder, files, top, parameters, cycles, certifier=None):
    """Shows that the assertions hold for any number of cycles, by induction over `cycles`: seconds of solving, bytes of the proofs, seconds
    of checking them; raises Refuted if one can fail."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        # An undeclared name in a property would otherwise be an arbitrary value.
        (folder / f"{name}.v").write_text(f"`default_nettype none\n{text}")
    script = ["read_verilog -sv -formal " + " ".join(f"{name}.v" for name in files)]
    script += [f"chparam -set {name} {value} {top}" for name, value in parameters.items()]
    script += [f"hierarchy -top {top}", "proc", "flatten", "opt -keepdc", "opt_clean -purge", "memory_map", "chformal -lower", "async2sync"]
    script += ["setundef -undriven -anyseq", "dffunmap", "opt_clean", "techmap", "opt_expr", "opt_merge", "aigmap", "opt_clean"]
    script += ["write_aiger -ascii -symbols motor.aag"]
    yosys(folder, script)
    graph = read_aiger((folder / "motor.aag").read_text())
    return induction.decided(questions(graph, cycles) if graph.latches else in_order(graph), certifier)


def phase(folder, setting, mutant=None, certifier=None):
    """Shows that the properties of `phase.v` hold of a half bridge."""
    text = joined(texts(mutant)["takt_pwm_phase"], (FORMAL / "phase.v").read_text())
    parameters = dict(zip(("HALF", "DEAD", "MINIMUM"), setting))
    return proved(folder, {"takt_pwm_phase": text}, "takt_pwm_phase", parameters, 3, certifier)


def trip(folder, setting, mutant=None, certifier=None):
    """Shows that the properties of `trip.v` and `held.v` hold of a trip with its half bridges."""
    files = texts(mutant) | {"takt_tripped": (FORMAL / "trip.v").read_text()}
    files["takt_trip"] = joined(files["takt_trip"], (FORMAL / "held.v").read_text())
    files["takt_filter"] = joined(files["takt_filter"], COUNTS)
    parameters = dict(zip(("FILTER", "DEAD", "TRIPPED", "DIRECT"), setting))
    return proved(folder, files, "takt_tripped", parameters, setting[0] + setting[1] + 8, certifier)


def code(folder, setting, mutant=None, certifier=None):
    """Shows that the properties of `code.v` hold of a word of so many bits with so many check bits."""
    found = texts(mutant)
    files = {"takt_ecc_code": found["takt_ecc_code"], "takt_code": (FORMAL / "code.v").read_text()}
    return proved(folder, files, "takt_code", dict(zip(("BITS", "CHECK"), setting)), 1, certifier)


def refuted(prove, folder, settings, mutant):
    """The first question that a fault breaks, with one of the settings; None if the proof holds with it."""
    for setting in settings:
        try:
            prove(folder, setting, mutant)
        except induction.Refuted as found:
            return f"{found} with {setting}"
    return None


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", required=True)
    parser.add_argument("--certify", metavar="CHECKER", help=solve.CERTIFY)
    parser.add_argument("--verbose", action="store_true", help="tell how each planted fault was refuted")
    parser.add_argument("--record", action="store_true", help="write the result down")
    arguments = parser.parse_args()
    folder, started = Path(arguments.folder), time.monotonic()
    survivors, tried = 0, 0
    try:
        for name, prove, settings, tries, mutants in [
            ("phase", phase, PHASES, 1, PHASE_MUTANTS),
            ("trip", trip, TRIPS, 2, TRIP_MUTANTS),
            ("code", code, CODES, 1, CODE_MUTANTS),
        ]:
            found = []
            for setting in settings:
                own = folder / f"{name}{'_'.join(map(str, setting))}"
                try:
                    found.append(prove(own, setting, certifier=solve.certifier(own, arguments.certify)))
                except induction.Refuted as refusal:
                    raise Failure(f"motor: {name} with {setting}: not proved: {refusal}") from None
            solving, size, checking = map(sum, zip(*found))
            certified = solve.certified(arguments.certify, {"bytes": size, "checking": checking})
            print(f"motor: {SHOWN[name]}: proved for any number of cycles, {len(settings)} settings; {solving:.0f} s of solving{certified}", flush=True)
            survived = 0
            for mutant in mutants:
                how = refuted(prove, folder / f"{name}_mutant", settings[-tries:], mutant)
                survived += how is None
                if how is None or arguments.verbose:
                    print(f"motor: in {mutant[0]} `{mutant[1]}` replaced by `{mutant[2]}`: {how or 'NOT refuted'}", flush=True)
            if arguments.record:
                what = {"settings": len(settings), "seconds": round(solving), "bytes": size, "checking": round(checking)}
                remember("motor", name, text=SHOWN[name], refuted=len(mutants) - survived, tried=len(mutants), **what)
            survivors, tried = survivors + survived, tried + len(mutants)
    except Failure as failure:
        sys.exit(f"error: {failure}")
    print(f"motor: {tried - survivors} of {tried} mutants refuted; {time.monotonic() - started:.0f} s", flush=True)
    if survivors:
        sys.exit("error: motor: a mutant is not refuted")


if __name__ == "__main__":
    main()

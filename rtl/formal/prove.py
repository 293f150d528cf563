# SPDX-License-Identifier: MIT OR Apache-2.0
"""Proves arithmetic units: `cargo evidence formal --units` runs this. README.md says how, and what is trusted."""

import argparse
import functools
import multiprocessing
import queue
import re
import sys
import time
from pathlib import Path

import balance
import circuit
import enumerated
import solve
import tables
import unrolled
from circuit import Failure, planted
from units import MUTANTS, PROOFS, SHARED_MUTANTS, SLOW, SPLITS, TABLE_MUTANTS

# Seconds after which a mutant counts as not refuted.
PATIENCE = 300


def compared(unit):
    """Whether a proof compares the unit's results with a reference."""
    return any(unit in proof.units for proof in PROOFS)


def words(bits, cut=False):
    """Values of inputs, in hexadecimal: operands, and with a cut the product and its exponent."""
    found = {}
    for name, bit in bits.items():
        word, _, place = name.partition("[")
        found[word] = found.get(word, 0) | bit << int(place.rstrip("]") or 0)
    names = ("op", "a", "b", "c", *(("p", "e") if cut else ()))
    shown = [word for word in sorted(found) if word in names] or sorted(found)
    return ", ".join(f"{word} = 0x{found[word]:08x}" for word in shown)


class Session:
    """What is asked for, and where the results go."""

    def __init__(self, arguments, rows):
        self.arguments = arguments
        self.rows = rows
        self.folder = Path(arguments.folder).resolve()
        self.texts = circuit.sources(rows)
        self.exact = {}
        self.units = {}

    def exact_graph(self, proof):
        """The graph of a proof in which nothing is arbitrary, if there is one."""
        if proof.name not in self.exact:
            folder = self.folder / proof.name / "exact"
            self.exact[proof.name] = self.graph(folder, self.texts, proof, exact=proof.exact)
        return self.exact[proof.name]

    def graph(self, folder, texts, proof, exact=False):
        """The graph of a proof; of a table, its words."""
        if proof.table:
            return tables.read(folder, texts, proof.table)
        if proof.simulated:
            folder.mkdir(parents=True, exist_ok=True)
            return {file: texts[file] for file in circuit.instantiated(texts, proof.top)}
        if proof.enumerated:
            return enumerated.function(self.unit(texts, proof), self.rows[proof.units[0]], proof.units[0], proof.enumerated)
        if not proof.iterative:
            return circuit.compared(folder, texts, proof, exact)
        miter = circuit.with_reference(folder, [], proof)
        return unrolled.beside(self.unit(texts, proof), miter, self.rows[proof.units[0]], proof)

    def unit(self, texts, proof):
        """The graph of a proof's unit with its registers, those kept that any of its proofs looks at."""
        own = tuple(texts[file] for file in circuit.instantiated(texts, proof.top))
        known, graph = self.units.get(proof.top, (None, None))
        if known != own:
            kept = {register for other in PROOFS if other.top == proof.top for register in unrolled.seen(other)}
            graph = circuit.with_registers(self.folder / f"{proof.units[0]}.unit", texts, proof.top, sorted(kept))
            self.units[proof.top] = own, graph
        return graph

    def question(self, folder, graph, proof):
        """A function that asks the question of a proof: the solver's, the enumerator's, or that of a table's words."""
        if proof.table:
            return functools.partial(tables.Comparison, graph)
        if proof.simulated:
            return functools.partial(enumerated.Simulation, proof.units[0], proof.enumerated)
        if proof.enumerated:
            return functools.partial(enumerated.Enumeration, graph, proof.enumerated, folder / "function.aag")
        return functools.partial(solve.Question, graph)

    def timed(self, unit, timing, texts, folder):
        """Raises Failure if a unit's results do not come when they must; the number of its registers."""
        latency, interval = timing
        graph = circuit.with_registers(folder, texts, f"takt_{unit}")
        if interval == 1:
            balance.pipeline(graph, latency)
        else:
            balance.iterative(graph, latency, interval, SPLITS.get(unit))
        return len(graph.latches)

    def balanced(self, unit, timing):
        """Proves when a unit's results come."""
        try:
            registers = self.timed(unit, timing, self.texts, self.folder / f"{unit}.pipeline")
        except Failure as failure:
            raise Failure(f"{unit}: {failure}") from failure
        latency, interval = timing
        if not self.arguments.share:
            solve.remember("timing", unit, registers=registers)
        every = "every cycle" if interval == 1 else f"every {interval} cycles"
        print(
            f"{unit}: {registers} registers; an operation {every}: its result comes {latency - 1} cycles after its operands and "
            "depends on nothing else: proved",
            flush=True,
        )

    def compared(self, proof):
        """Proves one row of the table; raises Failure with the operands of a counterexample."""
        folder = self.folder / proof.name
        graph = self.graph(folder, self.texts, proof)
        kind = tables.Comparison if proof.table else enumerated.Simulation if proof.simulated else enumerated.Enumeration if proof.enumerated else None
        key = kind.key(graph) if kind else graph.key
        record = solve.Record(folder / "cases.json", key, self.arguments.again)
        chosen = self.arguments.cases
        started = time.monotonic()
        # Words of tables and enumerated operands are no questions to a solver.
        is_solved = not (proof.table or proof.enumerated)
        certifier = solve.certifier(folder, self.arguments.certify if is_solved else None)
        ask = self.question(folder, graph, proof)
        found = solve.prove(proof.name, ask, proof.parts, self.arguments.jobs, record, chosen, certifier)
        if found is not None:
            number, operands = found
            cut = True
            if proof.table:
                says, cut = "it holds another word than the specification", False
            elif not proof.exact:
                says = "the circuit, or what was assumed of what is cut out of it, is wrong for"
            elif proof.enumerated or self.exact_graph(proof).evaluate(operands)["bad"]:
                says, cut = "the circuit differs", False
            else:
                says = "not proved: the cut is too coarse, the circuit itself is right for"
            raise Failure(f"{proof.name}: case {number}: {says}: {words(operands, cut)}")
        decided = len([number for number in range(proof.parts) if number in record.seconds])
        seconds = round(sum(record.seconds.values()))
        if not self.arguments.share:
            size, checking = (round(sum(one[i] for one in record.proofs.values())) for i in range(2))
            proofs = {"proofs": len(record.proofs), "bytes": size, "checking": checking} if is_solved else {}
            solve.remember("results", proof.name, units=proof.units, text=proof.text, cases=proof.parts, decided=decided, seconds=seconds, **proofs)
        if certifier:
            megabytes = sum(size for size, _ in record.proofs.values()) / 1e6
            print(f"{proof.name}: {len(record.proofs)} of {proof.parts} proofs checked, {megabytes:.1f} MB", flush=True)
        time_taken = f"{seconds} s of solving, {time.monotonic() - started:.0f} s now"
        if decided == proof.parts:
            print(f"{proof.name}: {proof.text}: proved, {proof.parts} cases, {time_taken}", flush=True)
        else:
            print(f"{proof.name}: {proof.text}: {decided} of {proof.parts} cases proved, none refuted, {time_taken}")

    def refuted(self, mutant, number, timing):
        """How a planted fault was found, or None."""
        unit = mutant[0]
        texts, broken = circuit.sources(self.rows, mutant), None
        about = [proof for proof in PROOFS if unit in proof.units and not proof.simulated]
        # A miter with cuts may differ for values that cannot occur, so prefer exact ones.
        tabled = [proof for proof in about if proof.table]
        about = [proof for proof in about if proof.exact and not proof.table] or [proof for proof in about if not proof.table]
        # The most general proof first: where a fault does not matter, the search takes long. Among miters of a chain,
        # the simplest first.
        for proof in [*tabled, *sorted(about, key=lambda proof: -proof.parts if proof.exact else proof.parts)]:
            boxes = {f"{name}.v" for name in proof.boxed}
            if all(texts[file] == self.texts[file] for file in circuit.instantiated(texts, proof.top) if file not in boxes):
                continue
            folder = self.folder / proof.name / f"mutant{number}"
            try:
                graph = self.graph(folder, texts, proof, exact=proof.exact)
            except Failure as failure:
                # A register that depends on itself becomes a loop of gates, which only the proof of timing can judge.
                broken = failure
                continue
            if graph.key == self.exact_graph(proof).key:
                continue
            operands = with_patience(self.question(folder, graph, proof))
            if operands is not None:
                return f"{proof.name} differs for {words(operands, not proof.exact)}"
        try:
            self.timed(unit, timing, texts, self.folder / f"{unit}.pipeline" / f"mutant{number}")
        except Failure as failure:
            return str(failure)
        if broken:
            raise broken
        return None

    def mutants(self, unit, timing):
        """Refutes the faults planted in a unit; how many survived."""
        own = [*(planted("tests", unit) if compared(unit) else ()), *MUTANTS.get(unit, ())]
        if self.arguments.share and unit not in SHARED_MUTANTS:
            own = []
        lists = [own, TABLE_MUTANTS.get(unit, [])]
        faults = [fault for each in lists for fault in each]
        chosen = [fault for each in lists for fault in each[: self.arguments.mutants or None]]
        survivors = 0
        for number, fault in enumerate((unit, *fault) for fault in chosen):
            how = self.refuted(fault, number, timing)
            if how is None:
                survivors += 1
                print(f"{unit}: NOT refuted: `{fault[1]}` replaced by `{fault[2]}`")
            elif self.arguments.verbose:
                print(f"{unit}: refuted: `{fault[1]}` replaced by `{fault[2]}`: {how}", flush=True)
        if not self.arguments.share:
            solve.remember("mutants", unit, refuted=len(chosen) - survivors, tried=len(chosen), of=len(faults))
        print(f"{unit}: {len(chosen) - survivors} of {len(chosen)} mutants refuted", flush=True)
        return survivors


def _any(ask, answers):
    solve.give_way()
    try:
        answers.put(ask().counterexample())
    except Failure as failure:
        answers.put(failure)


def with_patience(ask):
    """Operands for which a circuit differs, None if there are none or the search takes too long."""
    answers = multiprocessing.Queue()
    process = multiprocessing.Process(target=_any, args=(ask, answers))
    process.start()
    try:
        answer = answers.get(timeout=PATIENCE)
    except queue.Empty:
        return None
    finally:
        process.kill()
        process.join()
    if isinstance(answer, Failure):
        raise answer
    return answer


def cases(text):
    """`7`, `0..50`: the cases that are asked for."""
    first, dots, end = text.partition("..")
    return range(int(first), int(end) if dots else int(first) + 1)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rows", nargs="+", metavar="UNIT=LATENCY/INTERVAL")
    parser.add_argument("--folder", required=True)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--mutants", type=int, default=0, help="the first so many of each unit; all unless stated")
    parser.add_argument("--cases", type=cases)
    parser.add_argument("--only", help="one proof of the unit's, or timing, or mutants")
    parser.add_argument("--certify", metavar="CHECKER", help=solve.CERTIFY)
    parser.add_argument("--share", action="store_true")
    parser.add_argument("--again", action="store_true")
    parser.add_argument("--verbose", action="store_true")
    arguments = parser.parse_args()
    rows = {}
    for row in arguments.rows:
        unit, latency, interval = re.fullmatch(r"(\w+)=(\d+)/(\d+)", row).groups()
        rows[unit] = (int(latency), int(interval))
    session = Session(arguments, rows)
    wrong = 0
    only = arguments.only
    asked = [proof for proof in PROOFS if set(proof.units) & set(rows) and only in (None, proof.name)]
    try:
        if not asked and only not in ("timing", "mutants", None):
            names = ", ".join(proof.name for proof in PROOFS if set(proof.units) & set(rows))
            sys.exit(f"error: there is no proof `{only}`; there are timing, mutants, {names}")
        for unit, timing in rows.items() if only in ("timing", None) else ():
            if not (arguments.share and unit in SLOW):
                session.balanced(unit, timing)
        for proof in asked:
            if proof.share or not arguments.share:
                session.compared(proof)
        for unit, timing in rows.items() if only in ("mutants", None) else ():
            if not arguments.share or unit in SHARED_MUTANTS or unit in TABLE_MUTANTS:
                wrong += session.mutants(unit, timing)
    except Failure as failure:
        sys.exit(f"error: {failure}")
    if wrong:
        sys.exit(f"error: {wrong} mutants are not refuted")


if __name__ == "__main__":
    main()

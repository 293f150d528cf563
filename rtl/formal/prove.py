# SPDX-License-Identifier: MIT OR Apache-2.0
"""Proves arithmetic units: `cargo xtask formal --units` runs this. README.md says how, and what is trusted."""

import argparse
import multiprocessing
import re
import sys
import time
from pathlib import Path

import balance
import circuit
import solve
from circuit import FORMAL, Failure
from units import PROOFS

PLANTED = re.compile(r'^    \("(\w+)", "((?:[^"\\]|\\.)*)", "((?:[^"\\]|\\.)*)"\),$', re.M)
# Seconds after which a mutant counts as not refuted.
PATIENCE = 300


def planted(unit):
    """The faults that the simulation's tests plant in a unit, (unit, old, new)."""
    text = (FORMAL.parent / "tests" / "faults.rs").read_text()
    plain = lambda quoted: quoted.replace('\\"', '"').replace("\\\\", "\\")
    return [(name, plain(old), plain(new)) for name, old, new in PLANTED.findall(text) if name == unit]


def words(bits):
    """Values of inputs, in hexadecimal: op is short, the rest are words."""
    found = {}
    for name, bit in bits.items():
        word, _, place = name.partition("[")
        found[word] = found.get(word, 0) | bit << int(place.rstrip("]") or 0)
    return ", ".join(f"{word} = 0x{found[word]:08x}" for word in sorted(found) if word in ("op", "a", "b", "c"))


class Session:
    """What is asked for, and where the results go."""

    def __init__(self, arguments):
        self.arguments = arguments
        self.folder = Path(arguments.folder).resolve()
        self.texts = circuit.sources()
        self.exact = {}

    def exact_graph(self, proof):
        """The graph of a proof in which nothing is arbitrary."""
        if proof.name not in self.exact:
            folder = self.folder / proof.name / "exact"
            self.exact[proof.name] = circuit.compared(folder, self.texts, proof, exact=True)
        return self.exact[proof.name]

    def balanced(self, unit, latency):
        """Proves that a unit is a pipeline of its latency."""
        graph = circuit.with_registers(self.folder / f"{unit}.pipeline", self.texts, f"takt_{unit}")
        balance.prove(graph, latency)
        print(
            f"{unit}: {len(graph.latches)} registers; a result leaves exactly {latency - 1} cycles after its operands came, and "
            "depends on nothing else: proved"
        )

    def compared(self, proof):
        """Proves one row of the table; raises Failure with the operands of a counterexample."""
        folder = self.folder / proof.name
        graph = circuit.compared(folder, self.texts, proof)
        record = solve.Record(folder / "cases.json", graph, self.arguments.again)
        chosen = self.arguments.cases
        started = time.monotonic()
        found = solve.prove(proof.name, graph, proof.parts, self.arguments.jobs, record, chosen)
        if found is not None:
            number, operands = found
            real = self.exact_graph(proof).evaluate(operands)["bad"]
            says = "the circuit differs" if real else "not proved: the cut is too coarse, the circuit itself is right for"
            raise Failure(f"{proof.name}: case {number}: {says}: {words(operands)}")
        decided = len([number for number in range(proof.parts) if number in record.seconds])
        time_taken = f"{sum(record.seconds.values()):.0f} s of solving, {time.monotonic() - started:.0f} s now"
        if decided == proof.parts:
            print(f"{proof.name}: {proof.text}: proved, {proof.parts} cases, {time_taken}")
        else:
            print(f"{proof.name}: {proof.text}: {decided} of {proof.parts} cases proved, none refuted, {time_taken}")

    def refuted(self, mutant, number, latency):
        """How a planted fault was found, or None."""
        unit = mutant[0]
        texts = circuit.sources(mutant)
        for proof in PROOFS:
            if unit not in proof.units:
                continue
            folder = self.folder / proof.name / f"mutant{number}"
            graph = circuit.compared(folder, texts, proof, exact=True)
            if graph.key == self.exact_graph(proof).key:
                continue
            operands = with_patience(graph)
            if operands is not None:
                return f"{proof.name} differs for {words(operands)}"
        try:
            folder = self.folder / f"{unit}.pipeline" / f"mutant{number}"
            balance.prove(circuit.with_registers(folder, texts, f"takt_{unit}"), latency)
        except Failure as failure:
            return f"no pipeline: {failure}"
        return None

    def mutants(self, unit, latency):
        """Refutes the faults planted in a unit; how many survived."""
        faults = planted(unit)
        chosen = faults[: self.arguments.mutants] if self.arguments.mutants else faults
        survivors = 0
        for number, fault in enumerate(chosen):
            how = self.refuted(fault, number, latency)
            if how is None:
                survivors += 1
                print(f"{unit}: NOT refuted: `{fault[1]}` replaced by `{fault[2]}`")
            elif self.arguments.verbose:
                print(f"{unit}: refuted: `{fault[1]}` replaced by `{fault[2]}`: {how}", flush=True)
        print(f"{unit}: {len(chosen) - survivors} of {len(chosen)} mutants refuted", flush=True)
        return survivors


def _any(graph, queue):
    queue.put(solve.Question(graph).counterexample())


def with_patience(graph):
    """Operands for which a graph differs, None if there are none or the search takes too long."""
    queue = multiprocessing.Queue()
    process = multiprocessing.Process(target=_any, args=(graph, queue))
    process.start()
    try:
        return queue.get(timeout=PATIENCE)
    except Exception:  # of the queue's module, which has no other
        return None
    finally:
        process.kill()
        process.join()


def cases(text):
    """`7`, `0..216`: the cases that are asked for."""
    first, dots, end = text.partition("..")
    return range(int(first), int(end) if dots else int(first) + 1)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rows", nargs="+", metavar="UNIT=LATENCY")
    parser.add_argument("--folder", required=True)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--mutants", type=int, default=0, help="the first so many of each unit; all unless stated")
    parser.add_argument("--cases", type=cases)
    parser.add_argument("--only", help="one proof of the unit's")
    parser.add_argument("--share", action="store_true")
    parser.add_argument("--again", action="store_true")
    parser.add_argument("--verbose", action="store_true")
    arguments = parser.parse_args()
    session = Session(arguments)
    rows = {unit: int(latency) for unit, _, latency in (row.partition("=") for row in arguments.rows)}
    wrong = 0
    asked = [proof for proof in PROOFS if set(proof.units) & set(rows) and arguments.only in (None, proof.name)]
    try:
        for unit, latency in rows.items() if arguments.only is None else ():
            session.balanced(unit, latency)
        for proof in asked:
            if proof.share or not arguments.share:
                session.compared(proof)
        if arguments.only is None:
            for unit, latency in rows.items():
                wrong += session.mutants(unit, latency)
    except Failure as failure:
        sys.exit(f"error: {failure}")
    if wrong:
        sys.exit(f"error: {wrong} mutants are not refuted")


if __name__ == "__main__":
    main()

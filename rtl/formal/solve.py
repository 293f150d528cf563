# SPDX-License-Identifier: MIT OR Apache-2.0
"""Decides with the SAT solver CaDiCaL, case by case, whether the output `bad` of a graph can be 1."""

import datetime
import json
import os
import subprocess
import sys
import time
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait

from pysat.solvers import Solver

from circuit import FORMAL, Failure

SOLVER = "cadical195"
# Help of the option that names the checker.
CERTIFY = "decide with proofs, and check each by this program"
# Proofs with their dates, for docs/verification.md: committed, like rtl/synthesis.json.
RESULTS = FORMAL / "results.json"


def literal(number):
    """A literal of AIGER as one of the solver: variables are counted from 1, and false is the first."""
    return -(number // 2 + 1) if number & 1 else number // 2 + 1


def gate(out, left, right):
    """Tseitin's clauses of a gate."""
    out, left, right = literal(out), literal(left), literal(right)
    return [[-out, left], [-out, right], [out, -left, -right]]


def clauses(graph):
    """Tseitin's clauses of a graph."""
    if graph.latches:
        raise Failure("a register is left in a graph that should have none")
    result = [[-1]]
    for out, left, right in graph.ands:
        result += gate(out, left, right)
    return result


def remember(kind, name, **what):
    """Writes a result down."""
    results = json.loads(RESULTS.read_text()) if RESULTS.is_file() else {}
    what["date"] = datetime.date.today().isoformat()
    results.setdefault(kind, {})[name] = what
    RESULTS.write_text(json.dumps(results, indent=1, sort_keys=True) + "\n")


class Certifier:
    """Decides clauses by the program CaDiCaL, whose proof of an answer `no` the program `rate` checks, which shares no code with it."""

    # Exit codes of SAT solvers.
    SATISFIABLE, UNSATISFIABLE = 10, 20

    def __init__(self, folder, checker):
        self.folder = folder
        self.checker = checker
        # A checker that accepts everything would show nothing: one variable that is true is no contradiction.
        formula, proof = (folder / f"wrong.{kind}" for kind in ("cnf", "drat"))
        folder.mkdir(parents=True, exist_ok=True)
        formula.write_text("p cnf 1 1\n1 0\n")
        proof.write_bytes(b"a\0")
        if self._checked(formula, proof) is None:
            raise Failure(f"{checker} accepts a wrong proof")

    def _checked(self, formula, proof):
        """None if the proof is right, otherwise the checker's words."""
        done = subprocess.run([self.checker, formula, proof], capture_output=True, text=True)
        is_right = done.returncode == 0 and "s VERIFIED" in done.stdout.splitlines()
        return None if is_right else f"{done.stdout}{done.stderr}"

    def refute(self, clauses, name):
        """None if the clauses have a solution; otherwise seconds of solving, bytes of the proof, seconds of checking it."""
        formula, proof = (self.folder / f"{name}.{kind}" for kind in ("cnf", "drat"))
        top = max((abs(one) for clause in clauses for one in clause), default=0)
        with formula.open("w") as file:
            file.write(f"p cnf {top} {len(clauses)}\n")
            file.writelines(" ".join(map(str, clause)) + " 0\n" for clause in clauses)
        started = _used()
        # CaDiCaL's settings for formulas without solution shorten the proofs, and with them the check.
        status = subprocess.run(["cadical", "-q", "--unsat", formula, proof], stdout=subprocess.DEVNULL).returncode
        solved = _used()
        if status == self.SATISFIABLE:
            return None
        if status != self.UNSATISFIABLE:
            raise Failure(f"cadical has not decided {formula} (status {status})")
        wrong = self._checked(formula, proof)
        if wrong is not None:
            raise Failure(f"the proof {proof} is wrong:\n{wrong}")
        size = proof.stat().st_size
        formula.unlink()
        proof.unlink()
        return solved - started, size, _used() - solved


def certifier(folder, checker):
    """A certifier with that checker; None without one."""
    return Certifier(folder, checker) if checker else None


def certified(checker, figures):
    """Size of the proofs and seconds of checking, for people; nothing without a checker."""
    return "; {:.1f} MB of proofs checked in {:.0f} s".format(figures["bytes"] / 1e6, figures["checking"]) if checker else ""


class Question:
    """A graph whose output `bad` must be 0 wherever `assumed` is 1; `part` divides its inputs into cases."""

    def __init__(self, graph):
        self.graph = graph
        self.clauses = clauses(graph)
        self.part = [literal(bit) for bit in graph.word("part")]
        self.assumed = [[literal(graph.outputs["assumed"])]] if "assumed" in graph.outputs else []

    def case(self, number):
        """The clauses that say that the inputs belong to a case."""
        return [[bit if number >> i & 1 else -bit] for i, bit in enumerate(self.part)]

    def beyond(self, parts):
        """The clauses that say that the inputs belong to no case of 0 to parts - 1."""
        # The number exceeds the last case's if both agree above a place where the number has a 1 and the last case a 0.
        last, result = parts - 1, []
        more = lambda place: [bit for i, bit in enumerate(self.part) if i > place and not last >> i & 1]
        for i, bit in enumerate(self.part):
            if last >> i & 1:
                result.append([*more(i), bit])
        result.append(more(-1))
        return result

    def refuted(self, certifier, name, extra):
        """Like Certifier.refute, of the graph with further clauses."""
        return certifier.refute(self.clauses + self.assumed + extra, name)

    def decided(self, name, extra, certifier):
        """The same, but without a certifier by the solver alone: no bytes, no seconds of checking."""
        if certifier:
            return self.refuted(certifier, name, extra)
        started = _used()
        found = self.solve(extra)
        return (_used() - started, 0, 0.0) if found is None else None

    def solve(self, extra):
        """None if there is no solution, or the values of the inputs, name -> 0 or 1."""
        with Solver(name=SOLVER, bootstrap_with=self.clauses + self.assumed + extra) as solver:
            if not solver.solve():
                return None
            model = set(solver.get_model())
        return {name: int(literal(number) in model) for name, number in self.graph.inputs.items()}

    def wrong(self, number=None):
        """The clauses that say that the circuit differs, in a case or in any."""
        return [*([] if number is None else self.case(number)), [literal(self.graph.outputs["bad"])]]

    def counterexample(self, number=None):
        """Operands of a case, or of any, for which the circuit differs; None if there are none."""
        return self.solve(self.wrong(number))

    def uncovered(self, parts):
        """Operands that belong to no case; None if there are none."""
        return self.solve(self.beyond(parts))


_question = _certifier = None


def give_way():
    """Lowers the priority of a process that only computes."""
    os.nice(10)


def _start(ask, certifier):
    global _question, _certifier
    give_way()
    _question, _certifier = ask(), certifier


def _used():
    """Seconds of processor time of this process and of those that it has waited for."""
    return sum(os.times()[:4])


def _work(number):
    """Of a case its number, operands that differ, seconds of solving, and with a certifier the proof's bytes and seconds of checking."""
    if _certifier:
        found = _question.refuted(_certifier, number, _question.wrong(number))
        if found is not None:
            return number, None, found[0], found[1:]
    started = _used()
    return number, _question.counterexample(number), _used() - started, None


class Record:
    """The cases of a graph that have been decided, in a file: a proof that was stopped goes on where it was."""

    def __init__(self, path, key, again):
        self.path = path
        self.key = key
        self.seconds, self.proofs = {}, {}
        if not again and path.is_file():
            stored = json.loads(path.read_text())
            if stored.get("graph") == self.key:
                self.seconds, self.proofs = ({int(number): value for number, value in stored.get(kind, {}).items()} for kind in ("seconds", "proofs"))

    def add(self, number, seconds, proof):
        self.seconds[number] = round(seconds, 2)
        if proof:
            size, checking = proof
            self.proofs[number] = [size, round(checking, 2)]
        text = json.dumps({"graph": self.key, "seconds": self.seconds, "proofs": self.proofs})
        beside = self.path.with_suffix(".new")
        beside.write_text(text)
        os.replace(beside, self.path)


def clock(seconds):
    """A duration for people."""
    return f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"


def prove(name, ask, parts, jobs, record, chosen=None, certifier=None):
    """Decides every case, or the chosen ones, of the question that `ask` makes; with a certifier each with a proof that is checked, as well
    as that the cases are all. Returns (case, operands) of the first that differs, or None."""
    question = ask()
    if not certifier or question.refuted(certifier, "uncovered", question.beyond(parts)) is None:
        missed = question.uncovered(parts)
        if missed is not None:
            raise Failure(f"{name}: the cases do not cover {missed}")
    cases = range(parts) if chosen is None else [number for number in chosen if number < parts]
    left = [number for number in cases if number not in (record.proofs if certifier else record.seconds)]
    if len(left) < len(cases):
        print(f"{name}: {len(cases) - len(left)} of {len(cases)} cases are decided already", file=sys.stderr)
    started = shown = time.monotonic()
    with ProcessPoolExecutor(jobs, initializer=_start, initargs=(ask, certifier)) as pool:
        waiting = {pool.submit(_work, number) for number in left}
        done = 0
        while waiting:
            ready, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            for future in ready:
                number, operands, seconds, proof = future.result()
                if operands is not None:
                    pool.shutdown(wait=False, cancel_futures=True)
                    return number, operands
                record.add(number, seconds, proof)
                done += 1
            now = time.monotonic()
            if now - shown > 10:
                shown = now
                to_go = (now - started) / done * (len(left) - done)
                print(
                    f"{name}: {len(cases) - len(left) + done} of {len(cases)} cases, {clock(now - started)}, "
                    f"about {clock(to_go)} to go",
                    file=sys.stderr,
                    flush=True,
                )
    return None

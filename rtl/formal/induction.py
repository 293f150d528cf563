# SPDX-License-Identifier: MIT OR Apache-2.0
"""Decides the questions of a proof by induction over cycles: whether a condition, a literal of gates over time, can be 1."""

import time

from pysat.solvers import Solver

from circuit import Failure
from solve import SOLVER, gate, literal
from unrolled import needed


class Refuted(Failure):
    """Conditions that can be 1 together, by their numbers, and the question's name."""

    def __init__(self, name, numbers):
        self.name, self.numbers = name, numbers
        super().__init__(f"{name}, {', '.join(f'condition {number}' for number in numbers)}")


def clauses(gates, true, some=()):
    """The clauses that say that some literals are true, and one at least of some others, if there are any."""
    result = [[-1], *([literal(one)] for one in true)]
    if some:
        result.append([literal(one) for one in some])
    for out, left, right in needed(gates.ands, [*true, *some]):
        result += gate(out, left, right)
    return result


def numbered(found):
    """Clauses whose variables are numbered without gaps."""
    numbers = {}
    number = lambda variable: numbers.setdefault(variable, len(numbers) + 1)
    return [[number(one) if one > 0 else -number(-one) for one in clause] for clause in found]


def decided(questions, certifier=None):
    """Of questions (name, gates, what is assumed, conditions) together: seconds of solving, bytes of the proofs, seconds of checking them;
    raises Refuted if a condition can be 1."""
    total = [0.0, 0, 0.0]
    for name, gates, assumed, bad in questions:
        found = clauses(gates, assumed, bad)
        certified = certifier.refute(numbered(found), name.replace(" ", "_")) if certifier else None
        if certified is None:
            started = time.process_time()
            with Solver(name=SOLVER, bootstrap_with=found) as solver:
                if solver.solve():
                    model = set(solver.get_model())
                    raise Refuted(name, [number for number, one in enumerate(bad) if literal(one) in model])
            certified = time.process_time() - started, 0, 0.0
        total = [one + other for one, other in zip(total, certified)]
    return total

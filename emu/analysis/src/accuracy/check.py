#!/usr/bin/env python3
# SPDX-License-Identifier: MIT OR Apache-2.0
"""Checks a certificate that `takt accuracy --certificate` wrote: python3 check.py, in its folder, with Gappa installed.

Every number is a binary64, read as the rational number that it is, and all arithmetic is exact. Gappa proves range and rounding of each
operation that rounds as IEEE 754 says; other roundings (sine, cosine) are hypotheses, which are printed.
"""

import json
import pathlib
import subprocess
import sys
from fractions import Fraction as Q

HERE = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else ".")


def need(holds, text):
    if not holds:
        raise SystemExit(f"refused: {text}")


def pair(ends):
    low, high = map(Q, ends)
    need(low <= high, f"{ends} is no range")
    return low, high


class Form:
    """center + the sum of coefficients times symbols in [-1, 1], to within slack."""

    def __init__(self, data):
        self.center, self.slack = Q(data["center"]), Q(data["slack"])
        self.terms = {symbol: Q(value) for symbol, value in data["terms"]}
        need(self.slack >= 0 and len(self.terms) == len(data["terms"]), "a form's slack or symbols")
        self.size = abs(self.center) + sum(map(abs, self.terms.values())) + self.slack

    def covers(self, parts, rest=Q(0)):
        """The sum of factors times forms, to within rest, lies in this form."""
        rest += abs(self.center - sum(k * form.center for k, form in parts)) + sum(abs(k) * form.slack for k, form in parts)
        for symbol in set(self.terms).union(*(form.terms for _, form in parts)):
            rest += abs(self.terms.get(symbol, 0) - sum(k * form.terms.get(symbol, 0) for k, form in parts))
        return rest <= self.slack


def within(inner, outer):
    return outer[0] <= inner[0] and inner[1] <= outer[1]


def hull(values):
    values = list(values)
    return min(values), max(values)


def product(a, b):
    return hull(x * y for x in a for y in b)


def middle(a):
    return (a[0] + a[1]) / 2, (a[1] - a[0]) / 2


def ranges(rule, x, same):
    """Range of a rule's result on ranges."""
    if rule in ("neg", "abs"):
        negative = (-x[0][1], -x[0][0])
        sure = x[0][0] >= 0 or x[0][1] <= 0
        return negative if rule == "neg" else hull(map(abs, x[0])) if sure else (Q(0), max(map(abs, x[0])))
    if rule == "add":
        return x[0][0] + x[1][0], x[0][1] + x[1][1]
    if rule == "mul":
        low, high = hull(end * end for end in x[0]) if same else product(*x)
        return (Q(0) if same and x[0][0] < 0 < x[0][1] else low), high
    if rule == "div":
        need(not x[1][0] <= 0 <= x[1][1], "a divisor may be zero")
        return product(x[0], (1 / x[1][1], 1 / x[1][0]))
    if rule in ("min", "max"):
        pick = min if rule == "min" else max
        return pick(x[0][0], x[1][0]), pick(x[0][1], x[1][1])
    if rule == "sat":
        limit = x[1][0]
        return tuple(max(-limit, min(limit, end)) for end in x[0])
    if rule == "sign":
        return tuple(Q((end > 0) - (end < 0)) for end in x[0])
    if rule == "integer":
        return x[0]
    if rule == "choose":
        return min(x[0][0], x[1][0]), max(x[0][1], x[1][1])
    return {"sin": (Q(-1), Q(1)), "cos": (Q(-1), Q(1)), "decision": (Q(0), Q(1))}[rule]


def spelled(value):
    above, below = value.numerator, value.denominator
    return f"{above}b{1 - below.bit_length()}"


class Checker:
    def __init__(self, data):
        self.steps, self.symbols, self.hypotheses, self.goals = [], set(), [], 0
        self.promises = [(promise["name"], pair(promise["range"])) for promise in data["promises"]]
        self.integers = [promise["integer"] for promise in data["promises"]]
        for place, step in enumerate(data["steps"]):
            step = dict(step, run=pair(step["run"]), exact=pair(step["exact"]), error=Form(step["error"]))
            need(all(0 <= of < place for of in step["of"]), f"step {place} refers to a later one")
            self.step(place, step, [self.steps[of] for of in step["of"]])
            self.steps.append(step)

    def step(self, place, step, of):
        rule, error = step["rule"], step["error"]
        good = lambda holds: need(holds, f"step {place}, {rule}")
        if rule in ("promise", "constant"):
            run = self.promises[step["promise"]][1] if rule == "promise" else step["run"]
            good(within(run, step["run"]) and within(run, step["exact"]) and error.covers([]))
            good(rule == "promise" or step["run"] == step["exact"] and run[0] == run[1])
        elif rule == "round":
            self.round(place, step, of[0], good)
        elif rule == "cap":
            good(within(of[0]["run"], step["run"]) and within(of[0]["exact"], step["exact"]))
            center, radius = middle((step["run"][0] - step["exact"][1], step["run"][1] - step["exact"][0]))
            good(abs(error.center - center) + radius + sum(map(abs, error.terms.values())) <= error.slack)
        elif rule in ("sqrt", "steep"):
            for kind in ("run", "exact"):
                (low, high), (least, most) = step[kind], of[0][kind]
                good(least >= 0 and most <= high * high and high >= 0 and (low <= 0 or low * low <= least))
            if rule == "steep":
                good(error.center == 0 and not error.terms and of[0]["error"].size <= error.slack**2)
            else:
                slope = pair(step["slope"])
                least, most = hull(of[0]["run"] + of[0]["exact"])
                good(0 <= slope[0] and 4 * slope[0] ** 2 * most <= 1 <= 4 * slope[1] ** 2 * least)
                k, radius = middle(slope)
                good(error.covers([(k, of[0]["error"])], radius * of[0]["error"].size))
        else:
            same = rule == "mul" and step["of"][0] == step["of"][1]
            for kind in ("run", "exact"):
                good(within(ranges(rule, [operand[kind] for operand in of], same), step[kind]))
            good(rule != "integer" or self.whole(of[0]) and within(step["run"], (-(2**31), 2**31 - 1)))
            good(self.error(rule, step, [operand["error"] for operand in of], of))

    def whole(self, step):
        """An integer from a promise, or a sum of such."""
        rule = step["rule"]
        if rule in ("add", "neg"):
            return all(self.whole(self.steps[of]) for of in step["of"])
        return rule == "integer" or rule == "promise" and self.integers[step["promise"]]

    def error(self, rule, step, e, of):
        """The error of a rule's result lies in the step's form."""
        error = step["error"]
        if rule == "decision":
            return error.covers([])
        if rule in ("neg", "add"):
            return error.covers([(-1 if rule == "neg" else 1, form) for form in e])
        if rule in ("sign", "integer"):
            return error.covers([], Q(2) if rule == "sign" and e[0].size else Q(0)) and (rule == "sign" or e[0].size == 0)
        if rule in ("abs", "sin", "cos"):
            return error.covers([], e[0].size if rule == "abs" else min(e[0].size, Q(2)))
        if rule == "mul":
            (a, wide), (b, broad) = middle(of[0]["exact"]), middle(of[1]["exact"])
            return error.covers([(a, e[1]), (b, e[0])], wide * e[1].size + broad * e[0].size + e[0].size * e[1].size)
        if rule == "div":
            inverse = pair(step["slope"])
            low, high = of[1]["run"]
            need(within((1 / high, 1 / low), inverse), "the slope of a quotient")
            (k, wide), (q, broad) = middle(inverse), middle(product(step["exact"], inverse))
            return error.covers([(k, e[0]), (-q, e[1])], wide * e[0].size + broad * e[1].size)
        if rule == "sat":
            limit = of[1]["run"]
            need(limit[0] == limit[1] >= 0 and limit == of[1]["exact"] and e[1].size == 0, "the limit of `sat`")
            return error.covers([(1, e[0])]) and error.covers([])
        return all(error.covers([(1, form)]) for form in e)

    def round(self, place, step, of, good):
        ulps, bound, symbol = Q(step["rounding"]["ulps"]), Q(step["rounding"]["bound"]), step["rounding"]["symbol"]
        good(within(of["exact"], step["exact"]) and symbol not in self.symbols and bound >= 0)
        self.symbols.add(symbol)
        good(step["error"].covers([(1, of["error"]), (1, Form({"center": 0, "slack": 0, "terms": [[symbol, bound]]}))]))
        if ulps == Q(1, 2):
            text = self.goal(step, of, bound)
            path = HERE / f"step-{place}.g"
            need(path.is_file() and path.read_text() == text, f"{path} does not state step {place}")
            done = subprocess.run(["gappa", str(path)], capture_output=True, text=True, timeout=60)
            need(done.returncode == 0, f"Gappa does not prove {path}: {done.stderr.strip()}")
            self.goals += 1
            return
        good(of["rule"] in ("sin", "cos"))
        most = max(map(abs, of["run"]))
        unit = Q(1, 2**149)
        while unit * 2**24 <= most:
            unit *= 2
        good(ulps > 0 and bound >= ulps * unit and within((of["run"][0] - bound, of["run"][1] + bound), step["run"]))
        self.hypotheses.append(f"step {place}: {of['rule']} at {step.get('source', '')} is within {float(ulps)} ulps")

    def goal(self, step, of, bound):
        operands = set()

        def expression(place):
            inner = self.steps[place]
            parts = lambda: [expression(of) for of in inner["of"]]
            if inner["rule"] in ("add", "mul", "div"):
                return "({} {} {})".format(parts()[0], {"add": "+", "mul": "*", "div": "/"}[inner["rule"]], parts()[1])
            if inner["rule"] in ("neg", "sqrt", "steep"):
                return f"(-{parts()[0]})" if inner["rule"] == "neg" else f"sqrt({parts()[0]})"
            operands.add(place)
            return f"v{place}"

        text = expression(step["of"][0])
        ends = lambda low, high: f"[{spelled(low)}, {spelled(high)}]"
        lines = ["@rnd = float<ieee_32, ne>;"]
        for of in sorted(operands):
            lines.append(f"v{of} = {'int<ne>' if self.steps[of]['rule'] == 'integer' else 'rnd'}(u{of});")
        lines.append(f"r = rnd({text});")
        given = " /\\ ".join(f"v{of} in {ends(*self.steps[of]['run'])}" for of in sorted(operands))
        lines.append(f"{{ {given} -> r in {ends(*step['run'])} /\\ |r - ({text})| in {ends(Q(0), bound)} }}")
        if bound == Q(1, 2**150):
            # Half of a subnormal's unit: the product of a value with a constant power of two, by cases.
            a, b = self.steps[step["of"][0]]["of"]
            value, power = (a, b) if self.steps[b]["rule"] == "constant" else (b, a)
            if by := abs(self.steps[power]["run"][0]):
                at = spelled(Q(1, 2**126) / by)
                lines.append(f"$ v{value} in (-{at}, {at});")
        return "\n".join(lines) + "\n"


# Binary digits of the powers of a matrix.
DIGITS = 400


class Matrix:
    """Elements in units of 2^-DIGITS, each to within `error` of these units."""

    def __init__(self, rows, error):
        self.rows, self.error = rows, error

    def __mul__(self, other):
        columns = list(zip(*other.rows))
        size, unit = len(columns), 2**DIGITS
        rows = [[sum(map(int.__mul__, row, column)) // unit for column in columns] for row in self.rows]
        wide = max(sum(map(abs, row)) for row in self.rows) * other.error + max(sum(map(abs, column)) for column in columns) * self.error
        return Matrix(rows, (wide + size * self.error * other.error) // unit + 2)

    def most(self, row, by):
        """Largest magnitude of a row's product with numbers of these magnitudes."""
        return sum((abs(element) + self.error) * value for element, value in zip(self.rows[row], by)) / 2**DIGITS


class Sum:
    """A value of the run: factors of states, and the range of the rest."""

    def __init__(self, terms, rest):
        self.terms, self.rest = terms, rest

    def times(self, factor):
        return Sum({state: factor * by for state, by in self.terms.items()}, product((factor, factor), self.rest))

    def plus(self, other):
        terms = {state: self.terms.get(state, 0) + other.terms.get(state, 0) for state in {**self.terms, **other.terms}}
        return Sum(terms, (self.rest[0] + other.rest[0], self.rest[1] + other.rest[1]))


def sums(steps, states):
    """Each step's value in the run as a sum of states, as far as the steps are linear in them."""
    found = []
    for step in steps:
        of, rule = [found[place] for place in step["of"]], step["rule"]
        point = lambda index: steps[step["of"][index]]["run"][0] == steps[step["of"][index]]["run"][1]
        if rule == "promise" and step["promise"] in states:
            value = Sum({step["promise"]: Q(1)}, (Q(0), Q(0)))
        elif rule == "neg":
            value = of[0].times(Q(-1))
        elif rule == "add":
            value = of[0].plus(of[1])
        elif rule == "mul" and (point(0) or point(1)):
            one, other = (0, 1) if point(0) else (1, 0)
            value = of[other].times(steps[step["of"][one]]["run"][0])
        elif rule == "round":
            bound = Q(step["rounding"]["bound"])
            value = of[0].plus(Sum({}, (-bound, bound)))
        elif rule in ("cap", "integer"):
            value = of[0]
        else:
            value = Sum({}, step["run"])
        found.append(value if value.terms else Sum({}, step["run"]))
    return found


def converges(checker, states):
    """The states' linear map keeps all of them in their ranges for all time: the sum of its powers' magnitudes is small enough."""
    order = [state["promise"] for state in states]
    need(len(set(order)) == len(order), "a state twice")
    found = sums(checker.steps, set(order))
    scale = {promise: middle(checker.promises[promise][1]) for promise in order}
    rows, added, first = [], [], []
    for state in states:
        value, (center, radius) = found[state["step"]], scale[state["promise"]]
        need(radius > 0, "a state without a range")
        rows.append([value.terms.get(promise, Q(0)) * scale[promise][1] / radius for promise in order])
        offset = sum(factor * scale[promise][0] for promise, factor in value.terms.items()) - center
        added.append(max(abs(end + offset) for end in value.rest) / radius)
        first.append(max(abs(end - center) for end in pair(state["first"])) / radius)
    unit = 2**DIGITS
    step = Matrix([[int(element * unit) for element in row] for row in rows], 1)
    powers = [Matrix([[unit * (i == j) for j in range(len(order))] for i in range(len(order))], 0)]
    # Doubling: the powers' errors stay as small as their norms.
    norm = lambda: max(step.most(row, [Q(1)] * len(order)) for row in range(len(order)))
    while norm() > Q(1, 1024):
        need(len(powers) < 2**14 and norm() < 10**9, "the states' linear map does not converge")
        powers += [step * power for power in powers]
        step = step * step
    rest = norm()
    total = [sum(power.most(row, added) for power in powers) for row in range(len(order))]
    left = [max(power.most(row, first) for power in powers) for row in range(len(order))]
    beyond = max(total) * rest / (1 - rest) + max(left) * rest
    for row, promise in enumerate(order):
        need(total[row] + left[row] + beyond <= 1, f"the range of {checker.promises[promise][0]} over all periods")


def main():
    data = json.loads((HERE / "certificate.json").read_text())
    checker = Checker(data)
    for output in data["outputs"]:
        need(checker.steps[output["step"]]["error"].size <= Q(output["bound"]), f"the bound of {output['name']}")
    for kept in data["kept"]:
        name, promised = checker.promises[kept["promise"]]
        need(within(checker.steps[kept["step"]]["run"], promised), f"the range of {name}")
    if data["converging"]:
        converges(checker, data["converging"])
    print(f"{len(checker.steps)} steps and {checker.goals} goals of Gappa hold")
    for output in data["outputs"]:
        print(f"  {output['name']}: the error is at most {output['bound']:.4g}")
    names = [checker.promises[state["promise"]][0] for state in data["converging"]]
    if names:
        print(f"  always in their ranges, as their linear map converges: {', '.join(names)}")
    for name, state in zip(names, data["converging"]):
        low, high = state["first"]
        checker.hypotheses.append(f"{name} is in [{low}, {high}] when the first period begins")
    for text in checker.hypotheses:
        print(f"  hypothesis: {text}")
    for item in data["open"]:
        print(f"  open: {item['name']}: {item['reason']}")


if __name__ == "__main__":
    main()

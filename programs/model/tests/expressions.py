"""Functions of CasADi and SymPy, as instruction lists, with what the tools themselves compute.

    python3 expressions.py FOLDER

writes FOLDER/NAME.json and FOLDER/NAME.values for each: lines of inputs, then outputs, as JSON.
"""

import json
import os
import random
import sys

sys.path.insert(0, os.path.join(os.path.dirname(__file__), "..", "..", "..", "tools", "python"))
import takt_expressions

FOLDER = sys.argv[1]
STATES = 50


def values(name, inputs, compute):
    generator = random.Random(name)
    with open(os.path.join(FOLDER, name + ".values"), "w") as file:
        for _ in range(STATES):
            x = [generator.uniform(-2, 2) for _ in range(inputs)]
            print(json.dumps({"inputs": x, "outputs": compute(x)}), file=file)


def casadi_functions():
    import casadi as ca

    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    each = [
        x + y, x - y, x * y, x / (3 + y), -x, ca.exp(x), ca.log(3 + x), (3 + x) ** 2.5, x ** 3, x ** -2, ca.sqrt(3 + y),
        ca.sin(x), ca.cos(x), ca.tan(x / 2), ca.asin(x / 2), ca.acos(y / 2), ca.atan(x), x < y, x <= y, x == y, x != y,
        ca.logic_not(x < y), ca.logic_and(x < 0, y < 0), ca.logic_or(x < 0, y < 0), ca.fabs(x), ca.sign(x),
        ca.if_else(x < y, ca.sin(x), y * y), ca.fmin(x, y), ca.fmax(x, y), 1 / (3 + x), 2 * x, ca.atan2(x, y),
        ca.hypot(x, y), ca.tanh(x), ca.tanh(-x * y), 1 / (1 + ca.exp(-x)), 1 / (ca.exp(x - y) + 1), ca.floor(3 * x), ca.ceil(3 * x),
        ca.fmod(3 * x, 2 + ca.fabs(y)), (3 + x) ** y, (3 + x) ** 0.3, ca.copysign(y, x),
    ]
    yield ca.Function("every", [x, y], each, ["x", "y"], [f"out{k}" for k in range(len(each))])

    q = ca.SX.sym("q", 2, 3)
    s = ca.SX(3, 3)
    s[0, 1], s[2, 0] = q[0, 2] * q[1, 1], ca.cos(q[1, 0])
    yield ca.Function("matrices", [q], [s, ca.mtimes(q, q.T)], ["q"], ["sparse", "square"])

    a = ca.MX.sym("a", 3)
    yield ca.Function("mx", [a], [ca.mtimes(a, a.T), ca.norm_2(a), ca.dot(a, a) / 4], ["a"], ["outer", "norm", "quarter"])


def main():
    import casadi as ca

    for f in casadi_functions():
        takt_expressions.casadi(f, os.path.join(FOLDER, f.name() + ".json"))

        def compute(x, f=f):
            split, parts = 0, []
            for i in range(f.n_in()):
                rows, columns = f.size_in(i)
                parts.append(ca.reshape(ca.DM(x[split:split + rows * columns]), rows, columns))
                split += rows * columns
            results = f.call(parts)
            return [float(v) for r in results for v in r.nonzeros()]

        values(f.name(), sum(f.numel_in(i) for i in range(f.n_in())), compute)

    x = ca.SX.sym("x")
    takt_expressions.casadi(ca.Function("unknown", [x], [ca.erf(ca.sin(x) + 1)], ["x"], ["y"]), os.path.join(FOLDER, "unknown.json"))

    import sympy as sp

    a, b, c = sp.symbols("a b c")
    outputs = {
        "y": [sp.sin(a + b) * sp.cos(c) - sp.sin(a + b) ** 3, sp.Rational(1, 3) * a / (3 + b), sp.sqrt(a**2 + b**2), sp.pi * c],
        "m": sp.Matrix([[sp.atan2(a, b), sp.exp(c)], [sp.Piecewise((a, a > b), (b * c, True)), sp.Max(a, b, c)]]),
        "l": [sp.tanh(a - b), 1 / (1 + sp.exp(-c)), sp.floor(3 * a), sp.ceiling(3 * b), sp.Mod(3 * a, 2), (3 + a) ** b],
        "n": sp.Abs(a) ** sp.Rational(3, 2) - sp.Min(a, 2 * b) + sp.tan(c / 2) - a,
    }
    takt_expressions.sympy("symbols", {"p": [a, b], "c": c}, outputs, os.path.join(FOLDER, "symbols.json"))
    flat = outputs["y"] + list(outputs["m"].T) + outputs["l"] + [outputs["n"]]
    values("symbols", 3, lambda x: [float(e.subs(dict(zip((a, b, c), x))).evalf()) for e in flat])


main()

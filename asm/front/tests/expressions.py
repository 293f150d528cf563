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
        ca.sinh(x), ca.cosh(y), ca.asinh(x), ca.acosh(3 + x), ca.atanh(x / 3), ca.erf(x), ca.expm1(x), ca.log1p(x / 3),
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
    takt_expressions.casadi(ca.Function("unknown", [x], [ca.erfinv(ca.sin(x) / 2)], ["x"], ["y"]), os.path.join(FOLDER, "unknown.json"))

    import sympy as sp
    from sympy.codegen import cfunctions as cf

    a, b, c = sp.symbols("a b c")
    outputs = {
        "y": [sp.sin(a + b) * sp.cos(c) - sp.sin(a + b) ** 3, sp.Rational(1, 3) * a / (3 + b), sp.sqrt(a**2 + b**2), sp.pi * c],
        "m": sp.Matrix([[sp.atan2(a, b), sp.exp(c)], [sp.Piecewise((a, a > b), (b * c, True)), sp.Max(a, b, c)]]),
        "l": [sp.tanh(a - b), 1 / (1 + sp.exp(-c)), sp.floor(3 * a), sp.ceiling(3 * b), sp.Mod(3 * a, 2), (3 + a) ** b],
        "n": sp.Abs(a) ** sp.Rational(3, 2) - sp.Min(a, 2 * b) + sp.tan(c / 2) - a,
    }
    takt_expressions.sympy("symbols", {"p": [a, b], "c": c}, outputs, os.path.join(FOLDER, "symbols.json"))
    flat = outputs["y"] + list(outputs["m"].T) + outputs["l"] + [outputs["n"]]
    p, q = sp.symbols("p q", real=True)
    every = {
        "heaviside": [sp.Heaviside(p), sp.Heaviside(p - q, 1), sp.Max(p, 0).diff(p), sp.Max(p, q).diff(q)],
        "abs": [sp.Abs(a).diff(a), sp.Abs(a - b), sp.re(a) * sp.im(b) + sp.conjugate(b), sp.sign(a)],
        "hyperbolic": [sp.sinh(a), sp.cosh(a), sp.coth(a), sp.sech(a), sp.csch(a)],
        "inverse": [sp.asinh(a), sp.acosh(3 + a), sp.atanh(a / 3), sp.acoth(3 + a), sp.acoth(a - 4), sp.asech((a + 3) / 6), sp.acsch(a)],
        "angles": [sp.cot(a), sp.sec(a / 2), sp.csc(a), sp.acot(a), sp.asec(3 + a), sp.acsc(a - 4), sp.sinc(a), sp.sinc(a - a)],
        "small": [sp.erf(a), sp.erfc(a), sp.frac(a), sp.cbrt(3 + a), *(f(b / 3) for f in (cf.expm1, cf.log1p)), cf.exp2(a), cf.log2(3 + a), cf.log10(3 + b)],
        "choice": [sp.ITE(a < 0, b < 1, b < -1), sp.Piecewise((a, a > 1), (b, b > 0), (a * b, True)), sp.Xor(a < 0, b < 0), sp.ITE(a < b, a > 1, True)],
    }
    takt_expressions.sympy("kin", {"a": a, "b": b, "p": p, "q": q}, every, os.path.join(FOLDER, "kin.json"))

    def of_reals(e, x):
        r, s = sp.symbols("r s", real=True)
        at = dict(zip((r, s, p, q), x))
        e = e.xreplace({a: r, b: s}).doit().subs(at)
        return float(e == sp.true) if e in (sp.true, sp.false) else float(e.evalf())

    values("kin", 4, lambda x: [of_reals(e, x) for group in every.values() for e in group])
    impulse = {"y": sp.Max(p, 0).diff(p, 2) + p}
    takt_expressions.sympy("impulse", {"p": p}, impulse, os.path.join(FOLDER, "impulse.json"))
    t = sp.Symbol("t")
    angle = sp.Function("angle")(t)
    for inputs, e, said in [
        ({"x": a, "y": [b, a]}, a, "the symbol a is an input twice, in `x` and in `y`"),
        ({"x": [a, a]}, a, "the symbol a is an input twice, in `x` and in `x`"),
        ({"x": sp.Symbol("i", imaginary=True)}, a, "the symbol i of the input `x` is declared not to be real"),
        ({"x": 3}, a, "the input `x` has 3, which is no symbol"),
        ({"x": angle}, angle.diff(t), "Derivative(angle(t), t) is not an input, but angle(t) is one: its derivative needs an input of its own"),
        ({"x": a}, b, "the symbol b is not an input"),
    ]:
        try:
            takt_expressions.sympy_text("wrong", inputs, {"y": e})
        except ValueError as error:
            assert str(error) == said, error
        else:
            raise AssertionError(said)

    values("symbols", 3, lambda x: [float(e.subs(dict(zip((a, b, c), x))).evalf()) for e in flat])


main()

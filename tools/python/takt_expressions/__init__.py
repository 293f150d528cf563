"""CasADi functions and SymPy expressions for `takt model`.

    import takt_expressions
    takt_expressions.casadi(f, "f.json")                      # a casadi.Function; MX functions are expanded
    takt_expressions.sympy("f", {"q": [q1, q2]}, {"tau": [e1, e2]}, "f.json")

and then `takt model f.json`. (The package `takt` goes the same way, without a file.) docs/model.md describes the format, which
anything may write. Nothing is simplified here beyond what the tool itself does: that is `takt model`'s task. This module needs
nothing but the tool whose expressions it reads.
"""

import json
import math

FORMAT = "takt-expressions 1"


def _write(path, text):
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)


def _text(name, source, inputs, outputs, code, notes=()):
    """One instruction a line, so that a message can say where."""
    head = {"format": FORMAT, "name": name, "source": source, "inputs": inputs, "outputs": outputs}
    if notes:
        head["notes"] = list(notes)
    lines = ",\n".join("  " + json.dumps(step, allow_nan=False) for step in code)
    return json.dumps(head)[:-1] + ', "code": [\n' + lines + "\n]}\n"


def _finite(value):
    value = float(value)
    if not math.isfinite(value):
        raise ValueError(f"the constant {value} has no meaning on the machine")
    return value


def casadi(function, path):
    """Writes a `casadi.Function` of version 3.6 to 3.8, expanded to scalars."""
    _write(path, casadi_text(function))


def _expanded(function):
    try:
        return function.expand()
    except RuntimeError as error:
        # CasADi's own message begins with a place in CasADi's sources.
        reason = str(error).splitlines()[-1].rsplit(": ", 1)[-1]
        raise ValueError(f"`{function.name()}` cannot be expanded to scalar operations: {reason}") from None


def _called(function):
    """The functions that are called as a whole, and how each becomes an expression."""
    names = [f"`{called.name()}`" for called in function.find_functions()]
    are = "is a whole that CasADi cannot look into" if len(names) == 1 else "are wholes that CasADi cannot look into"
    return (
        f"`{function.name()}` calls {' and '.join(names) or 'a function'}, which {are}: an integrator of fixed steps becomes an expression "
        "with the option {'simplify': True}, a function of one's own without {'never_inline': True}; an interpolant (a lookup table), a "
        "rootfinder and an external function have none"
    )


def casadi_text(function):
    """The same as text."""
    import casadi as ca

    f = function if function.is_a("SXFunction") else _expanded(function)
    opcodes = {value: name[3:].lower() for name, value in vars(ca).items() if name.startswith("OP_")}

    def argument(name, sparsity):
        rows, columns = sparsity.shape
        nonzeros = [list(place) for place in zip(*sparsity.get_triplet())]
        return {"name": name, "rows": rows, "columns": columns, "nonzeros": nonzeros}

    inputs = [argument(f.name_in(i), f.sparsity_in(i)) for i in range(f.n_in())]
    outputs = [argument(f.name_out(i), f.sparsity_out(i)) for i in range(f.n_out())]
    code = []
    for k in range(f.n_instructions()):
        op = opcodes.get(f.instruction_id(k), str(f.instruction_id(k)))
        if op == "call":
            raise ValueError(_called(f))
        of, to = f.instruction_input(k), f.instruction_output(k)
        if op == "input":
            code.append({"op": op, "to": to[0], "port": of})
        elif op == "output":
            code.append({"op": op, "of": of, "port": to})
        elif op == "const":
            code.append({"op": op, "to": to[0], "value": _finite(f.instruction_constant(k))})
        else:
            code.append({"op": op, "to": to[0], "of": of})
    return _text(f.name(), "CasADi " + ca.__version__, inputs, outputs, code)


def _inputs(sp, arguments):
    """The symbol of each input in a list, all different, and a real one in its place."""
    real, owner = {}, {}
    for name, symbols in arguments:
        for symbol in symbols:
            if isinstance(symbol, sp.Expr) and symbol.is_number or not isinstance(symbol, sp.Basic):
                raise ValueError(f"the input `{name}` has {symbol}, which is no symbol")
            if symbol in owner:
                raise ValueError(f"the symbol {symbol} is an input twice, in `{owner[symbol]}` and in `{name}`")
            if symbol.is_real is False:
                raise ValueError(f"the symbol {symbol} of the input `{name}` is declared not to be real")
            owner[symbol] = name
            real[symbol] = symbol if symbol.is_real else sp.Dummy(str(symbol), real=True)
    return real


def _of_reals(sp, e, real, taken):
    """An expression of real inputs, whose derivatives are carried out; `taken` has what depends on symbols that were not declared real."""
    e = sp.sympify(e)
    for derivative in e.atoms(sp.Derivative):
        functions = derivative.expr.atoms(sp.core.function.AppliedUndef) & real.keys()
        if functions and derivative not in real:
            raise ValueError(f"{derivative} is not an input, but {functions.pop()} is one: its derivative needs an input of its own")
    for part in e.atoms(sp.Abs, sp.re, sp.im, sp.conjugate, sp.arg):
        for symbol in real:
            if real[symbol] is not symbol and part.has(symbol):
                taken.setdefault(symbol, set()).add(type(part).__name__)
    e = e.xreplace(real)
    return e.doit() if e.has(sp.Derivative, sp.Subs) else e


class _Sympy:
    """Expressions to instructions, in places that are written once."""

    # Functions missing here keep their names: `takt model` supports them, or reports the expression as unsupported.
    FUNCTIONS = {"ceiling": "ceil", "Abs": "fabs", "ITE": "if_else"}
    FOLDED = {"Add": "add", "Mul": "mul", "Min": "fmin", "Max": "fmax", "And": "and", "Or": "or", "Xor": "xor"}
    RELATIONS = {
        "StrictLessThan": ("lt", False), "LessThan": ("le", False), "StrictGreaterThan": ("lt", True),
        "GreaterThan": ("le", True), "Equality": ("eq", False), "Unequality": ("ne", False),
    }

    def __init__(self, sympy):
        self.sympy, self.code, self.known = sympy, [], {}

    def step(self, op, of=(), **more):
        to = len(self.code)
        self.code.append({"op": op, "to": to, **({"of": list(of)} if of else {}), **more})
        return to

    def place(self, e):
        if e not in self.known:
            self.known[e] = self.make(e)
        return self.known[e]

    def make(self, e):
        name = type(e).__name__
        if e.is_Number or e.is_NumberSymbol:
            return self.step("const", value=_finite(e))
        if e in (self.sympy.true, self.sympy.false):
            return self.step("const", value=float(e == self.sympy.true))
        if e.is_Symbol:
            raise ValueError(f"the symbol {e} is not an input")
        if name == "Mul":
            above, below = self.sympy.fraction(e)
            if below != 1:
                return self.step("div", [self.place(above), self.place(below)])
            if e.args[0] == -1:
                return self.step("neg", [self.place(self.sympy.Mul(*e.args[1:]))])
        if name == "Pow":
            base, power = e.args
            if power == -1:
                return self.step("inv", [self.place(base)])
            return self.step("pow", [self.place(base), self.place(power)])
        if name == "Mod":
            # The result has the sign of the divisor, like Python's `%`.
            a, b = (self.place(a) for a in e.args)
            return self.step("sub", [a, self.step("mul", [b, self.step("floor", [self.step("div", [a, b])])])])
        if name == "Not":
            return self.step("not", [self.place(e.args[0])])
        if name in self.RELATIONS:
            op, swap = self.RELATIONS[name]
            of = [self.place(a) for a in e.args]
            return self.step(op, of[::-1] if swap else of)
        if name == "Piecewise":
            value = None
            for branch, condition in reversed(e.args):
                if condition == self.sympy.true:
                    value = self.place(branch)
                    continue
                if value is None:
                    raise ValueError(f"{e} has no value where none of its conditions holds")
                value = self.step("if_else", [self.place(condition), self.place(branch), value])
            return value
        if name in self.FOLDED:
            value = self.place(e.args[0])
            for a in e.args[1:]:
                value = self.step(self.FOLDED[name], [value, self.place(a)])
            return value
        if not isinstance(e, (self.sympy.Expr, self.sympy.logic.boolalg.Boolean)):
            raise ValueError(f"{e} ({name}) is not a number")
        return self.step(self.FUNCTIONS.get(name, name), [self.place(a) for a in e.args])


def sympy(name, inputs, outputs, path):
    """Writes SymPy expressions. Inputs and outputs are dictionaries from a name to a symbol or an expression, or to a list or
    Matrix of them."""
    _write(path, sympy_text(name, inputs, outputs))


def sympy_text(name, inputs, outputs):
    """The same as text."""
    import sympy as sp

    def shaped(name, value):
        # Unlike SymPy's matrices, a list has a truth value; handle it separately.
        flat = list(value) if isinstance(value, (list, tuple)) else [value]
        if not isinstance(value, sp.MatrixBase) and not any(isinstance(e, (list, tuple, sp.MatrixBase)) for e in flat):
            return {"name": name, "rows": len(flat), "columns": 1}, flat
        matrix = value if isinstance(value, sp.MatrixBase) else sp.Matrix(value)
        rows, columns = matrix.shape
        return {"name": name, "rows": rows, "columns": columns}, [matrix[i, j] for j in range(columns) for i in range(rows)]

    walk, taken = _Sympy(sp), {}
    ins, outs = [shaped(*item) for item in inputs.items()], [shaped(*item) for item in outputs.items()]
    real = _inputs(sp, [(name["name"], symbols) for name, symbols in ins])
    for i, (_, symbols) in enumerate(ins):
        for k, symbol in enumerate(symbols):
            walk.known[real[symbol]] = walk.step("input", port=[i, k])
    outs = [(shape, [_of_reals(sp, e, real, taken) for e in values]) for shape, values in outs]
    shared, reduced = sp.cse([e for _, values in outs for e in values])
    for symbol, e in shared:
        walk.known[symbol] = walk.place(sp.sympify(e))
    flat = iter(reduced)
    for i, (_, values) in enumerate(outs):
        for k in range(len(values)):
            walk.step("output", [walk.place(sp.sympify(next(flat)))], port=[i, k])
    for step in walk.code:
        if step["op"] == "output":
            del step["to"]
    said = "was taken to be real; a symbol with real=True says so to SymPy"
    notes = [f"`{symbol}` in {', '.join(sorted(taken[symbol]))} {said}" for symbol in real if symbol in taken]
    return _text(name, "SymPy " + sp.__version__, [i for i, _ in ins], [o for o, _ in outs], walk.code, notes)

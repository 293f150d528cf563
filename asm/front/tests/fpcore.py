# SPDX-License-Identifier: MIT OR Apache-2.0
"""Values of the kernels in programs/fpbench at random operands, by an evaluator of its own in 60 digits (mpmath): writes
data/fpbench.json. Run again when the kernels change: `python3 fpcore.py` with mpmath installed.
"""

import json
import pathlib
import random
import re
import struct

import mpmath

mpmath.mp.dps = 60
ROWS = 6
HERE = pathlib.Path(__file__).parent


def trees(text):
    """S-expressions as nested lists of words."""
    stack = [[]]
    for token in re.findall(r'"[^"]*"|[()\[\]]|[^\s()\[\]"]+', re.sub(r";[^\n]*", "", text)):
        if token in "([":
            stack.append([])
        elif token in ")]":
            done = stack.pop()
            stack[-1].append(done)
        else:
            stack[-1].append(token)
    return stack[0]


def number(word):
    if re.fullmatch(r"[-+]?\d+/\d+", word):
        above, below = word.split("/")
        return mpmath.mpf(above) / mpmath.mpf(below)
    return mpmath.mpf(word)


def chain(compare):
    return lambda *x: all(compare(a, b) for a, b in zip(x, x[1:]))


OPERATIONS = {
    "+": lambda a, b: a + b,
    "-": lambda a, b=None: -a if b is None else a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / b,
    "fabs": abs,
    "<": chain(lambda a, b: a < b),
    "<=": chain(lambda a, b: a <= b),
    ">": chain(lambda a, b: a > b),
    ">=": chain(lambda a, b: a >= b),
    "and": lambda *x: all(x),
    "pow": mpmath.power,
    "cast": lambda a: a,
} | {name: getattr(mpmath, name) for name in ("sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "exp", "log")}


def evaluate(tree, scope):
    if isinstance(tree, str):
        return scope[tree] if tree in scope else number(tree)
    head, *rest = tree
    if head in ("let", "let*"):
        inner = dict(scope)
        for name, value in rest[0]:
            inner[name] = evaluate(value, inner if head == "let*" else scope)
        return evaluate(rest[1], inner)
    if head == "if":
        return evaluate(rest[1] if evaluate(rest[0], scope) else rest[2], scope)
    if head == "!":
        while rest[0].startswith(":") if isinstance(rest[0], str) else False:
            rest = rest[2:]
        return evaluate(rest[0], scope)
    return OPERATIONS[head](*(evaluate(operand, scope) for operand in rest))


def single(value):
    return struct.unpack("f", struct.pack("f", value))[0]


def limits(tree, ends):
    """Plain ranges of the arguments in a precondition, to draw from."""
    if isinstance(tree, str):
        return
    head, *rest = tree
    if head in ("and", "let", "let*"):
        for part in rest if head == "and" else rest[1:]:
            limits(part, ends)
    elif head in ("<", "<="):
        for a, b in zip(rest, rest[1:]):
            if isinstance(b, str) and b in ends and isinstance(a, str) and a not in ends:
                ends[b][0] = float(number(a))
            if isinstance(a, str) and a in ends and isinstance(b, str) and b not in ends:
                ends[a][1] = float(number(b))


def main():
    kernels = []
    for path in sorted((HERE / "../../../programs/fpbench").glob("*.fpcore")):
        for _, arguments, *rest in trees(path.read_text()):
            properties = {}
            while len(rest) > 1:
                properties[rest[0]] = rest[1]
                rest = rest[2:]
            name = properties[":name"].strip('"')
            ends = {argument: [None, None] for argument in arguments}
            limits(properties[":pre"], ends)
            draw = random.Random(name)
            rows = []
            while len(rows) < ROWS:
                row = {name: single(draw.uniform(*ends[name])) for name in arguments}
                scope = {name: mpmath.mpf(value) for name, value in row.items()}
                if evaluate(properties[":pre"], scope):
                    rows.append({"operands": list(row.values()), "value": float(evaluate(rest[0], scope))})
            kernels.append({"file": path.name, "name": name, "rows": rows})
    text = ",\n".join(json.dumps(kernel) for kernel in kernels)
    (HERE / "data/fpbench.json").write_text(f"[\n{text}\n]\n")


if __name__ == "__main__":
    main()

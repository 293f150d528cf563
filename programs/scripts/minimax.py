"""The polynomials of library/math.s: minimax in the sense of the relative error of the whole function, coefficients in binary32.

Prints, for each, its coefficients as hexadecimal floats and the error of the function in ulps of a result just below a
power of two (2^-24 relative). Needs mpmath; takes about a minute.

    python3 programs/scripts/minimax.py

Remez's exchange on the weighted error; then the coefficients are rounded one after the other, from the lowest, and the rest are
found again each time, so that they make up for the rounding.
"""

import struct

from mpmath import atan, asin, atanh, chop, cos, erf, exp, expm1, findroot, linspace, log, log1p, lu_solve, matrix, mp, mpf, pi, sin, sqrt, tan, tanh

mp.prec = 120
GRID = 400


def binary32(x):
    return mpf(struct.unpack("f", struct.pack("f", float(x)))[0])


def remez(f, weight, low, high, powers):
    """Coefficients of the sum of c[i]·x^powers[i] with the least maximum of |weight·(sum - f)|."""
    n = len(powers)
    points = [(low + high) / 2 - (high - low) / 2 * cos(pi * i / n) for i in range(n + 1)]
    grid = [(low + high) / 2 - (high - low) / 2 * cos(pi * i / GRID) for i in range(GRID + 1)]
    # A floor for the weight, where the polynomial's term vanishes against the rest.
    least = max(weight(low), weight(high)) / 10**4
    bounded = lambda x: max(weight(x), least)
    targets = [(x, f(x), bounded(x)) for x in grid]
    for _ in range(12):
        rows = matrix(n + 1, n + 1)
        right = matrix(n + 1, 1)
        for i, x in enumerate(points):
            for j, power in enumerate(powers):
                rows[i, j] = x**power
            rows[i, n] = (-1) ** i / bounded(x)
            right[i] = f(x)
        solution = lu_solve(rows, right)
        c = [solution[i] for i in range(n)]
        errors = [(w * (sum(a * x**p for a, p in zip(c, powers)) - y), x) for x, y, w in targets]
        # The largest of each run of one sign.
        extremes = []
        for error, x in errors:
            if extremes and (error > 0) == (extremes[-1][0] > 0):
                if abs(error) > abs(extremes[-1][0]):
                    extremes[-1] = (error, x)
            else:
                extremes.append((error, x))
        while len(extremes) > n + 1:
            extremes.pop(0 if abs(extremes[0][0]) < abs(extremes[-1][0]) else -1)
        if len(extremes) < n + 1:
            break
        points = [x for _, x in extremes]
        if abs(max(abs(e) for e, _ in extremes) / abs(solution[n]) - 1) < 0.01:
            break
    return c, max(abs(e) for e, _ in errors)


def rounded(name, f, weight, low, high, powers):
    low, high = mpf(low), mpf(high)
    fixed = []
    while len(fixed) < len(powers):
        done = list(zip(fixed, powers))
        rest = lambda x: f(x) - sum(c * x**p for c, p in done)
        c, best = remez(rest, weight, low, high, powers[len(fixed):])
        if not fixed:
            ideal = best
        fixed.append(binary32(c[0]))
    grid = linspace(low, high, 3 * GRID)
    error = max(abs(weight(x) * (sum(c * x**p for c, p in zip(fixed, powers)) - f(x))) for x in grid)
    print(f"{name}: {float(error * 2**24):.4f} ulp (unrounded {float(ideal * 2**24):.4f})")
    for c, p in zip(fixed, powers):
        print(f"    x^{p}: {float(c).hex()}")


def rational(name, f, weight, low, high, above, below):
    """P/Q for x·P(x²)/Q(x²) of an odd function f, Q(0) = 1: least squares whose weights grow where the error is large (Lawson),
    coefficients rounded in turn, from the lowest."""
    count = 260
    xs = [mpf(low) + (mpf(high) - low) * (1 - cos(pi * (i + mpf(1) / 2) / count)) / 2 for i in range(count)]
    targets = [(x * x, f(x) / x, weight(x) * x) for x in xs]
    p, q = [], []

    def solve():
        free, lawson, last, best = above - len(p), [mpf(1)] * count, [mpf(1)] * count, None
        total = free + below - len(q)
        for _ in range(40):
            rows, right = matrix(total, total), matrix(total, 1)
            for (z, y, w), growth, divisor in zip(targets, lawson, last):
                row = [z ** (len(p) + i) for i in range(free)] + [-y * z ** (1 + len(q) + i) for i in range(total - free)]
                rest = y * (1 + sum(c * z ** (1 + i) for i, c in enumerate(q))) - sum(c * z**i for i, c in enumerate(p))
                scale = growth * (w / divisor) ** 2
                for i in range(total):
                    right[i] += scale * row[i] * rest
                    for j in range(total):
                        rows[i, j] += scale * row[i] * row[j]
            solution = lu_solve(rows, right)
            over, under = p + list(solution[:free]), q + list(solution[free:])
            last = [1 + sum(c * z ** (1 + i) for i, c in enumerate(under)) for z, _, _ in targets]
            errors = [abs(w * (sum(c * z**i for i, c in enumerate(over)) / d - y)) for (z, y, w), d in zip(targets, last)]
            if best is None or max(errors) < best[0]:
                best = max(errors), over, under
            mean = sum(a * b for a, b in zip(lawson, errors)) / count
            lawson = [a * b / mean + mpf(10) ** -12 for a, b in zip(lawson, errors)]
        return best

    for place in range(max(above, below)):
        for fixed, length, which in ((p, above, 1), (q, below, 2)):
            if place < length:
                fixed.append(binary32(solve()[which][place]))
    error = max(abs(w * (sum(c * z**i for i, c in enumerate(p)) / (1 + sum(c * z ** (1 + i) for i, c in enumerate(q))) - y)) for z, y, w in targets)
    print(f"{name}: {float(error * 2**24):.4f} ulp")
    for side, fixed in (("P", p), ("Q", q)):
        print(f"    {side}: {' '.join(float(c).hex() for c in fixed)}")


def series(f, expansion, at=mpf("0.01")):
    """f, but its expansion (which cancels nothing) where x is small."""
    return lambda x: expansion(x) if abs(x) < at else f(x)


def sum_of(term, count=24):
    return lambda x: sum(term(k) * x**k for k in range(count))


LN2 = log(mpf(2))

if __name__ == "__main__":
    from mpmath import factorial
    # exp: e^r = 1 + r + r²·P(r)
    f = series(lambda r: (exp(r) - 1 - r) / r**2, sum_of(lambda k: 1 / factorial(k + 2)))
    rounded("exp", f, lambda r: r**2 / exp(r), -LN2 / 2 * 1.001, LN2 / 2 * 1.001, range(5))
    # log: log(1 + f) = f - f²/2 + f³·R(f)
    f = series(lambda x: (log1p(x) - x + x * x / 2) / x**3, sum_of(lambda k: mpf(-1) ** k / (k + 3)))
    w = series(lambda x: abs(x**3 / log1p(x)), lambda x: x * x)
    for n in (8, 9):
        rounded("log", f, w, mpf(-1) / 3, mpf(1) / 3, range(n))
    # sin r = r + r³·S(r²), cos r = 1 - r²/2 + r⁴·C(r²), |r| ≤ π/4
    f = sum_of(lambda k: mpf(-1) ** (k + 1) / factorial(2 * k + 3))
    rounded("sin", f, series(lambda z: sqrt(z) ** 3 / sin(sqrt(z)), lambda z: z, mpf("1e-5")), 0, (pi / 4) ** 2 * 1.001, range(3))
    f = sum_of(lambda k: mpf(-1) ** k / factorial(2 * k + 4))
    rounded("cos", f, lambda z: z * z / cos(sqrt(z)), 0, (pi / 4) ** 2 * 1.001, range(3))
    # tan: 2·tan(r/2) = r + r³·P(r²), |r| ≤ π/4
    def over(g):
        return lambda z: g(sqrt(z))
    taylor_tan = [mpf(1) / 3, mpf(2) / 15, mpf(17) / 315, mpf(62) / 2835, mpf(1382) / 155925, mpf(21844) / 6081075]
    f = series(over(lambda r: (2 * tan(r / 2) - r) / r**3), lambda z: sum(c * z**k / 4 ** (k + 1) for k, c in enumerate(taylor_tan)), mpf("1e-5"))
    w = series(over(lambda r: r**3 / (2 * tan(r / 2))), lambda z: z, mpf("1e-5"))
    for n in (4, 5):
        rounded("tan", f, w, 0, (pi / 4) ** 2 * 1.001, range(n))
    # atan on [0, 7/16]
    f = series(over(lambda r: (atan(r) - r) / r**3), sum_of(lambda k: mpf(-1) ** (k + 1) / (2 * k + 3)))
    w = series(over(lambda r: r**3 / atan(r)), lambda z: z, mpf("1e-5"))
    for n in (4, 5, 6):
        rounded("atan", f, w, 0, mpf(7) ** 2 / 16**2, range(n))
    # asin on [0, 1/2]
    def c_asin(k):
        k += 1
        return factorial(2 * k) / (mpf(4) ** k * factorial(k) ** 2 * (2 * k + 1))
    f = series(over(lambda r: (asin(r) - r) / r**3), sum_of(c_asin))
    w = series(over(lambda r: r**3 / asin(r)), lambda z: z, mpf("1e-5"))
    for n in (5, 6):
        rounded("asin", f, w, 0, mpf(1) / 4, range(n))
    # tanh
    taylor_tanh = [c * (-1) ** (k + 1) for k, c in enumerate(taylor_tan)]
    f = series(over(lambda r: (tanh(r) - r) / r**3), lambda z: sum(c * z**k for k, c in enumerate(taylor_tanh)), mpf("1e-5"))
    w = series(over(lambda r: r**3 / tanh(r)), lambda z: z, mpf("1e-5"))
    for t in ("0.82",):
        for n in (5, 6, 7):
            rounded("tanh " + t, f, w, 0, mpf(t) ** 2, range(n))
    # erf: x·P(x²)/Q(x²)
    rational("erf", erf, lambda x: 1 / erf(x), 0, 4, 6, 5)
    # pow: 3/2·log((1 + s)/(1 - s)) = 3s + s³ + s⁵·L(s²)
    f = series(over(lambda s: (3 * atanh(s) - 3 * s - s**3) / s**5), sum_of(lambda k: mpf(3) / (2 * k + 5)))
    w = lambda z: z * z / 3
    for n in (3, 4):
        rounded("pow's log", f, w, 0, mpf("0.0103"), range(n))
    # atan: tangents in binary32 of angles that binary32 all but hits
    for around in ("0.5", "1.0", "1.5"):
        step = mpf(2) ** -24 if around == "0.5" else mpf(2) ** -23
        found = []
        for k in range(-20000, 20000):
            c = mpf(around) + k * step
            angle = atan(c)
            found.append((abs(angle - binary32(angle)), c))
        off, c = min(found)
        print(f"tangent {float(c).hex()} of {float(binary32(atan(c))).hex()}, {float(off * 2**24):.6f} ulp off")

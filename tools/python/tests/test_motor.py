"""The macros of `<motor.s>` against NumPy in binary64, on every machine, period by period."""

import numpy as np
import pytest

import takt

T = 1e-3
PERIODS = 400


@pytest.fixture(params=["t1", "t3", "t4"])
def machine(request):
    return request.param


def run(machine, declared, body, **inputs):
    """Outputs by name, arrays of (periods,), of a program with these declarations and this period."""
    names = ", ".join(
        f"{name}:int" if np.asarray(values).dtype.kind == "i" else name for name, values in inputs.items()
    )
    text = f".include <motor.s>\n.schedule on\n.input {names}\n{declared}\n.once\n wait period\n.period\nperiod:\n{body}\n wait period\n"
    run = takt.assemble(text, machine=machine, warnings=["error"]).run(inputs)
    run.check()
    return {name: np.asarray(values, dtype=float) for name, values in run.outputs.items()}


def signal(seed, low, high, count=PERIODS):
    """Random values as binary32 has them."""
    return np.random.default_rng(seed).uniform(low, high, count).astype(np.float32)


def near(outputs, tolerance, **expected):
    for name, values in expected.items():
        error = np.abs(outputs[name] - values).max()
        assert error <= tolerance, f"{name}: {error}"


def test_clarke_and_park_turn_phases_into_the_rotor_s_axes(machine):
    amplitude, angle, part = signal(1, 0, 30), signal(2, 0, 6.28), signal(3, 0, 1)
    phase = [amplitude * np.cos(angle - shift) for shift in (0.0, 2 * np.pi / 3, 4 * np.pi / 3)]
    out = run(
        machine,
        ".output d, q, al3, be3, a2, b2, c2\n.reg al be sn cs x y",
        """ clarke al, be, a, b
        turn_sincos sn, cs, part
        park d, q, al, be, sn, cs
        clarke3 al3, be3, a, b, c
        inverse_park x, y, d, q, sn, cs
        inverse_clarke a2, b2, c2, x, y""",
        a=phase[0],
        b=phase[1],
        c=phase[2],
        part=part,
    )
    turned = amplitude * np.exp(1j * (angle - 2 * np.pi * part.astype(float)))
    near(out, 3e-5, d=turned.real, q=turned.imag, al3=phase[0], be3=amplitude * np.sin(angle))
    near(out, 3e-5, a2=phase[0], b2=phase[1], c2=phase[2])


def test_pi_stays_within_its_limit_and_does_not_wind_up(machine):
    error = signal(4, -3, 5)
    out = run(
        machine,
        ".output u, integral\n.state s\n.preset s = 0",
        " pi_limited u, s, e, 2.0, 0.05, 6.0, 0.3\n mov integral, s",
        e=error,
    )
    s, u, integral = 0.0, [], []
    for e in error.astype(float):
        wish = 2 * e + s
        u.append(np.clip(wish, -6, 6))
        s += 0.05 * e + 0.3 * (u[-1] - wish)
        integral.append(s)
    near(out, 1e-4, u=u, integral=integral)


def test_voltages_stay_within_the_circle(machine):
    d, q = signal(5, -20, 20), signal(6, -20, 20)
    out = run(
        machine,
        ".output d1, q1, d2, q2",
        " circle_d_first d1, q1, d, q, 9.0, 0.95\n circle_scaled d2, q2, d, q, 9.0",
        d=d,
        q=q,
    )
    first = np.clip(d, -8.55, 8.55)
    rest = np.sqrt(81 - first.astype(float) ** 2)
    scaled = (d + 1j * q) * np.minimum(1, 9 / np.abs(d + 1j * q))
    near(out, 2e-5, d1=first, q1=np.clip(q, -rest, rest), d2=scaled.real, q2=scaled.imag)
    assert (out["d1"] ** 2 + out["q1"] ** 2 <= 81 * (1 + 1e-6)).all()


def test_field_weakening_takes_current_while_voltage_is_short(machine):
    ud, uq = signal(7, 0, 8), signal(8, 0, 8)
    out = run(
        machine,
        ".output id\n.state s\n.preset s = 0",
        " field_weakening id, s, ud, uq, 7.0, 0.2, 5.0",
        ud=ud,
        uq=uq,
    )
    s, expected = 0.0, []
    for a, b in zip(ud.astype(float), uq.astype(float)):
        s = min(max(s + 0.2 * (7 - np.hypot(a, b)), -5), 0)
        expected.append(s)
    near(out, 1e-4, id=expected)


def test_space_vectors_give_the_voltage_between_phases(machine):
    udc, length, angle = signal(9, 20, 60), signal(10, 0, 1), signal(11, 0, 6.28)
    u = (length * udc / np.sqrt(3) * np.exp(1j * angle.astype(float))).astype(np.complex64)
    out = run(
        machine,
        ".output da, db, dc, pa, pb, pc\n.reg va vb",
        " space_vectors da, db, dc, al, be, udc\n va = al/udc\n vb = be/udc\n space_vectors_of_parts pa, pb, pc, va, vb",
        al=u.real,
        be=u.imag,
        udc=udc,
    )
    duties = np.array([out[name] for name in ("da", "db", "dc")])
    of_parts = np.array([out[name] for name in ("pa", "pb", "pc")])
    assert np.abs(duties - of_parts).max() < 1e-6
    assert duties.min() >= -1e-6 and duties.max() <= 1 + 1e-6
    # Equal distances to both rails: the full range of the bridge.
    assert np.abs(duties.max(0) + duties.min(0) - 1).max() < 1e-6
    between = [u.real * 1.5 - np.sqrt(3) / 2 * u.imag, np.sqrt(3) * u.imag]
    assert np.abs((duties[0] - duties[1]) * udc - between[0]).max() < 2e-5
    assert np.abs((duties[1] - duties[2]) * udc - between[1]).max() < 2e-5


def test_dead_time_is_added_in_the_current_s_direction(machine):
    duty, i = signal(12, 0, 1), signal(13, -2, 2)
    out = run(machine, ".output d\n.reg x", " mov x, duty\n dead_time x, i, 0.02, 0.5\n mov d, x", duty=duty, i=i)
    near(out, 1e-6, d=np.clip(duty + 0.02 * np.clip(i / 0.5, -1, 1), 0, 1))


def test_positions_are_exact_over_many_turns(machine):
    count = np.random.default_rng(14).integers(-(2**31), 2**31, PERIODS)
    out = run(
        machine,
        ".output turns:int, part, el, d\n.reg n:int x",
        """ position n, x, count, 17
        mov turns, n
        mov part, x
        electrical el, count, 7, 17
        between d, n, 0.25, n, x""",
        count=count.astype(np.int32),
    )
    near(out, 0, turns=count >> 17, part=(count & 0x1FFFF) / 2**17, el=(count * 7 % 2**17) / 2**17)
    near(out, 0, d=0.25 - (count & 0x1FFFF) / 2**17)


def test_advance_carries_into_turns(machine):
    by = signal(15, -0.99, 0.99)
    # Sums that round up to a whole turn.
    by[::7] = -(2.0**-40)
    out = run(
        machine,
        ".output turns:int, part\n.state n:int x\n.preset n = 0\n.preset x = 0",
        " advance n, x, by\n mov turns, n\n mov part, x",
        by=by,
    )
    assert (out["part"] >= 0).all() and (out["part"] < 1).all()
    assert np.abs(out["turns"] + out["part"] - np.cumsum(by.astype(float))).max() < 1e-5


def test_pll_follows_position_and_speed(machine):
    w = 2 * np.pi * 40
    speed = np.interp(np.arange(4000), [0, 1000, 2000, 4000], [0, 30, 30, -50])
    angle = np.cumsum(speed * 1e-4)
    measured = (angle - np.floor(angle)).astype(np.float32)
    out = run(
        machine,
        ".output part, speed\n.state x v\n.preset x = 0\n.preset v = 0",
        f" pll x, v, measured, {2 * w}, {w * w}, 1e-4\n mov part, x\n mov speed, v",
        measured=measured,
    )
    x = v = 0.0
    expected = []
    for m in measured.astype(float):
        e = m - x
        e -= np.rint(e)
        x, v = x + 1e-4 * (v + 2 * w * e), v + 1e-4 * w * w * e
        x -= np.floor(x)
        expected.append((x, v))
    part, estimate = np.array(expected).T
    turned = out["part"] - part
    assert np.abs(turned - np.rint(turned)).max() < 1e-5
    near(out, 2e-2, speed=estimate)
    # Once settled at constant speed, the observer has no error.
    assert abs(out["speed"][1990] - 30) < 0.05


def test_edge_speed_is_as_fine_at_low_speed_as_at_high(machine):
    period, clock = 1000, 60e6
    edges = []  # cycles of the edges, and their directions
    for speed, duration in ((0, 5), (300, 2_000), (40_000, 100), (900_000, 60), (-7_000, 300), (0, 400)):  # counts/s, periods
        start = (edges[-1][2] if edges else 0) * period
        end = (edges[-1][2] if edges else 0) + duration
        step = clock / abs(speed) if speed else np.inf
        times = np.arange(start + step, end * period, step) if speed else []
        edges.append((np.floor(times).astype(np.int64), np.sign(speed), end))
    count, since = [], []
    position, last, ticks = 0, None, edges[-1][2]
    flat = [(int(time), sign) for times, sign, _ in edges for time in times]
    for tick in range(1, ticks + 1):
        while flat and flat[0][0] < tick * period:
            last, sign = flat.pop(0)
            position += sign
        count.append(position)
        since.append(2**31 - 1 if last is None else tick * period - last)
    out = run(
        machine,
        ".output w\n.state v n:int s:int\n.preset v = 0\n.preset n = 0\n.preset s = 2147483647",
        f" edge_speed v, n, s, count, since, {period}.0, {clock:.1f}\n mov w, v",
        count=np.array(count, dtype=np.int32),
        since=np.array(since, dtype=np.int32),
    )
    w = out["w"]
    assert (w[:5] == 0).all()
    # An edge is known to a cycle. By counts alone, a period at 300 counts/s has 0 or 60,000.
    for speed, (_, _, end) in zip((300, 40_000, 900_000, -7_000), edges[1:]):
        error = np.abs(w[end - 20 : end] / speed - 1).max()
        assert error < 2 * abs(speed) / clock + 1e-6 or error < 2 / period, f"{speed}: {error}"
    # The axis stands still: at most a count in the time since the last edge.
    late = np.array(since[-390:], dtype=float)
    assert (np.abs(w[-390:]) <= clock / late * (1 + 1e-6)).all() and abs(w[-1]) < 200


def test_trapezoid_arrives_exactly_within_its_limits(machine):
    goal = np.repeat(np.array([1.0, -0.7, -0.7, 2.0, 0.3, 0.3], dtype=np.float32), 900)
    goal[5000:] = 0.301
    out = run(
        machine,
        ".output p, v, y\n.state x s k:int\n.array ring[16]\n.preset x = 0\n.preset s = 0\n.preset k = 1",
        " trapezoid x, s, goal, 4.0, 30.0, 1e-3\n mov p, x\n mov v, s\n s_curve y, ring, k, x, 16",
        goal=goal,
    )
    p, v = out["p"], out["v"]
    assert np.abs(v).max() <= 4 and np.abs(np.diff(v, prepend=0)).max() <= 0.03 * (1 + 1e-3)
    for end in (899, 2699, 5399):
        assert p[end] == goal[end] and out["y"][end] == goal[end], end
    # Time-optimal to within a period: 1 at up to 4/s with 30/s² takes 1/4 + 4/30 s.
    assert np.flatnonzero(p[:900] == 1)[0] == pytest.approx((1 / 4 + 4 / 30) * 1000, abs=3)
    # The S-curve is the mean of the last 16 positions.
    padded = np.concatenate([np.zeros(15), p])
    near(out, 1e-6, y=np.convolve(padded, np.ones(16) / 16, "valid"))


def test_cogging_table_closes_at_the_turn_s_end(machine):
    part = signal(16, 0, 1)
    out = run(
        machine,
        ".output y\n.array C[5] = 0.5, 1, -2, 3, 0.5",
        " y = cogging(C, part, 4)",
        part=part,
    )
    near(out, 2e-6, y=np.interp(part.astype(float) * 4, np.arange(5), [0.5, 1, -2, 3, 0.5]))


def test_notch_is_the_prewarped_filter(machine):
    u = signal(17, -1, 1)
    out = run(
        machine,
        ".output y, z\n.state s[2] r[2]\n.preset s = 0\n.preset r = 0",
        " y = notch(u, s, 2*pi*60, 0.2, 1e-3)\n z = notch(u, r, 2*pi*11, 0.05, 1e-3)",
        u=u,
    )

    def filtered(w, zeta):
        k = np.tan(w * 1e-3 / 2)
        a = np.array([1 + 2 * zeta * k + k * k, 2 * (k * k - 1), 1 - 2 * zeta * k + k * k])
        b = np.array([1 + k * k, 2 * (k * k - 1), 1 + k * k])
        x, y = np.zeros(PERIODS + 2), np.zeros(PERIODS + 2)
        x[2:] = u
        for n in range(2, PERIODS + 2):
            y[n] = (b @ x[n : n - 3 if n > 2 else None : -1] - a[1] * y[n - 1] - a[2] * y[n - 2]) / a[0]
        return y[2:]

    near(out, 1e-5, y=filtered(2 * np.pi * 60, 0.2))
    # Poles close to the unit circle retain rounding errors longer.
    near(out, 3e-5, z=filtered(2 * np.pi * 11, 0.05))

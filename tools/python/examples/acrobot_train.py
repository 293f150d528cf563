# SPDX-License-Identifier: MIT OR Apache-2.0
"""Trains acrobot.onnx, the policy of acrobot_mujoco.py: some minutes with NumPy; `onnx` writes the file.

    pip install numpy onnx && python3 acrobot_train.py acrobot.onnx

Spong's Acrobot with a motor at the elbow only has to swing up and to balance. Its expert is smooth, so that a network can learn it: iLQR
finds the torques of a swing-up whose cost to go, at the end, is the linear regulator's; the best of several becomes the one from which
those of all other starts are found. A multi-layer perceptron 6-64-64-1 learns torques and gains along them, by Adam; then, four times,
swings up by itself, and learns what iLQR would have done from where it came (DAgger).
"""
import sys

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

Array = NDArray[np.float64]
STEP, LIMIT, FASTEST, DAMPING = 0.02, 20.0, 8.0, 0.1
#: Spread of the initial states around hanging: angles in rad, velocities in rad/s.
SPREAD = np.array([0.1, 0.1, 0.1, 0.1])
HANGING = np.array([np.pi, 0, 0, 0])
#: Weights of the cost per step: squares of the states, and of the torque.
Q, R = STEP * np.diag([10.0, 10, 1, 1]), STEP * 0.1


def acceleration(x: Array, torque: Array) -> Array:
    """The derivative of q1, q2 (0 upright), v1, v2; masses and lengths are those of acrobot.py, damping 0.1 N m s in both joints."""
    q1, q2, v1, v2 = np.moveaxis(x, -1, 0)
    c2, s2, s12 = np.cos(q2), np.sin(q2), np.sin(q1 + q2)
    m11, m12, m22 = 0.333 + 1.33 + 1 + 2 * c2, 1.33 + c2, 1.33
    f1 = 9.81 * (1.5 * np.sin(q1) + s12) + s2 * (2 * v1 * v2 + v2 * v2) - DAMPING * v1
    f2 = 9.81 * s12 - s2 * v1 * v1 - DAMPING * v2 + torque
    scale = 1 / (m11 * m22 - m12 * m12)
    return np.stack([v1, v2, (m22 * f1 - m12 * f2) * scale, (m11 * f2 - m12 * f1) * scale], -1)


def step(x: Array, torque: Array) -> Array:
    """A step of 0.02 s, as two of fourth order."""
    h = STEP / 2
    for _ in range(2):
        a = acceleration(x, torque)
        b = acceleration(x + h / 2 * a, torque)
        c = acceleration(x + h / 2 * b, torque)
        d = acceleration(x + h * c, torque)
        x = x + h / 6 * (a + 2 * b + 2 * c + d)
    return x


def linear(x: Array, torque: Array, e: float = 1e-5) -> tuple[Array, Array]:
    """A step's derivatives by state and torque."""
    columns = [(step(x + d, torque) - step(x - d, torque)) / (2 * e) for d in e * np.eye(4)]
    return np.stack(columns, -1), (step(x, torque + e) - step(x, torque - e)) / (2 * e)


def regulator() -> tuple[Array, Array]:
    """Cost to go and gains around upright."""
    a, b = linear(np.zeros(4), np.array(0.0))
    p = Q
    for _ in range(5000):
        k = -(b @ p @ a) / (R + b @ p @ b)
        p = Q + a.T @ p @ (a + np.outer(b, k))
    return p, k


def beyond(u: Array) -> Array:
    """What a torque is beyond nine tenths of the limit, which costs more."""
    return np.sign(u) * np.maximum(np.abs(u) - 0.9 * LIMIT, 0)


def costs(x: Array, u: Array, last: Array) -> Array:
    """Of trajectories x[..., time, 4] and torques u[..., time]."""
    every: Array = 0.5 * ((x[..., :-1, :] @ Q * x[..., :-1, :]).sum((-1, -2)) + (R * u**2 + 10 * STEP * beyond(u) ** 2).sum(-1))
    every = every + 0.5 * (x[..., -1, :] @ last * x[..., -1, :]).sum(-1)
    return np.where(np.isfinite(every), every, 1e12)


def follow(start: Array, x: Array, u: Array, k: Array) -> tuple[Array, Array]:
    """Trajectories and torques from `start` that follow x and u by the gains k."""
    to, torques = [start], []
    for t in range(u.shape[-1]):
        torques.append(np.clip(u[..., t] + (k[..., t, :] * (to[-1] - x[..., t, :])).sum(-1), -2 * LIMIT, 2 * LIMIT))
        to.append(step(to[-1], torques[-1]))
    return np.stack(to, -2), np.stack(torques, -1)


def improve(x: Array, u: Array, last: Array, rounds: int) -> tuple[Array, Array, Array, Array]:
    """iLQR of many trajectories at once: trajectories, torques, gains, costs."""
    count, horizon = u.shape
    now, damping = costs(x, u, last), np.full(count, 0.1)
    sizes, every = np.array([1, 0.5, 0.2, 0.05, 0.01])[:, None, None], np.arange(count)
    for _ in range(rounds):
        a, b = linear(x[:, :-1], u)
        by_u, twice_u = R * u + 10 * STEP * beyond(u), R + 10 * STEP * (beyond(u) != 0)
        change, k = np.empty((count, horizon)), np.empty((count, horizon, 4))
        hessian, slope = np.broadcast_to(last, (count, 4, 4)), x[:, -1] @ last
        for t in reversed(range(horizon)):
            at, bt = a[:, t], b[:, t]
            ha = hessian @ at
            uu = twice_u[:, t] + (bt * (hessian @ bt[..., None])[..., 0]).sum(1)
            u1, ux = by_u[:, t] + (bt * slope).sum(1), (bt[:, None] @ ha)[:, 0]
            stiff = uu + damping * R
            change[:, t], k[:, t] = -u1 / stiff, -ux / stiff[:, None]
            kt, moved = k[:, t], (uu * change[:, t] + u1)[:, None]
            slope = x[:, t] @ Q + (slope[:, None] @ at)[:, 0] + kt * moved + ux * change[:, t, None]
            cross = kt[:, :, None] * ux[:, None]
            hessian = Q + at.transpose(0, 2, 1) @ ha + uu[:, None, None] * kt[:, :, None] * kt[:, None] + cross + cross.transpose(0, 2, 1)
        with np.errstate(all="ignore"):
            to, torques = follow(np.repeat(x[None, :, 0], len(sizes), 0), x, u + sizes * change, k)
            found = costs(to, torques, last)
        best = found.argmin(0)
        better = found[best, every] < now
        x = np.where(better[:, None, None], to[best, every], x)
        u = np.where(better[:, None], torques[best, every], u)
        now = np.minimum(now, found[best, every])
        damping = np.clip(np.where(better & (best < 2), damping / 3, damping * 4), 1e-6, 1e6)
    return x, u, k, now


def features(x: Array) -> Array:
    """What the network sees."""
    q1, q2, v1, v2 = np.moveaxis(x, -1, 0)
    return np.stack([np.cos(q1), np.sin(q1), np.cos(q2), np.sin(q2), v1 / FASTEST, v2 / FASTEST], -1)


Layers = list[tuple[NDArray[np.float32], NDArray[np.float32]]]


def torque_of(layers: Layers, x: Array) -> Array:
    y = features(x).astype(np.float32)
    for weights, bias in layers:
        y = np.tanh(y @ weights.T + bias)
    return LIMIT * y[..., 0].astype(float)


def fresh(shape: list[int], random: np.random.Generator) -> Layers:
    return [((random.normal(size=(n, m)) / np.sqrt(m)).astype(np.float32), np.zeros(n, np.float32)) for m, n in zip(shape, shape[1:])]


def train(layers: Layers, x: Array, u: Array, k: Array, steps: int, random: np.random.Generator, rate: float = 3e-3) -> float:
    """Adam on the squared error of torques at, and around, the states x; returns the error's root, N m."""
    moments = [[np.zeros_like(part) for part in layer for _ in range(2)] for layer in layers]
    mean = 0.0
    for t in range(1, steps + 1):
        chosen = random.integers(0, len(x), 1024)
        # Around a trajectory, its gains give the torques; the samples are closer where it is near upright.
        far = np.minimum(0.15, 0.01 + 0.1 * np.abs(x[chosen]).max(1, keepdims=True)) * random.uniform(0, 1, (1024, 1))
        aside = far * random.normal(size=(1024, 4)) * [0.3, 0.3, 1, 1]
        wanted = np.clip((u[chosen] + (k[chosen] * aside).sum(1)) / LIMIT, -0.99, 0.99)[:, None].astype(np.float32)
        values = [features(x[chosen] + aside).astype(np.float32)]
        for weights, bias in layers:
            values.append(np.tanh(values[-1] @ weights.T + bias))
        mean += 0.002 * (float(((values[-1] - wanted) ** 2).mean()) - mean)
        slope = 2 * (values[-1] - wanted) / len(chosen)
        now = rate * 0.5 * (1 + np.cos(np.pi * t / steps))
        for index in reversed(range(len(layers))):
            slope = slope * (1 - values[index + 1] ** 2)
            gradients = [slope.T @ values[index], slope.sum(axis=0)]
            slope = slope @ layers[index][0]
            for part, gradient, m in zip(layers[index], gradients, (0, 2)):
                first, second = moments[index][m : m + 2]
                first += 0.1 * (gradient - first)
                second += 0.001 * (gradient**2 - second)
                part -= (now * (first / (1 - 0.9**t)) / (np.sqrt(second / (1 - 0.999**t)) + 1e-8)).astype(np.float32)
    return LIMIT * float(np.sqrt(mean))


def starts(count: int, random: np.random.Generator) -> Array:
    """Hanging, almost at rest."""
    return HANGING + SPREAD * random.uniform(-1, 1, (count, 4))


def run(layers: Layers, x: Array, seconds: float) -> Array:
    """States [start, time, 4] under the policy."""
    every = [x]
    for _ in range(round(seconds / STEP)):
        every.append(step(every[-1], torque_of(layers, every[-1])))
    return np.stack(every, 1)


def upright(x: Array) -> Array:
    """Which runs have both links within 10° of upright in the last 3 s."""
    last = np.stack([x[:, -150:, 0], x[:, -150:, 0] + x[:, -150:, 1]])
    near: Array = (np.abs((last + np.pi) % (2 * np.pi) - np.pi) < np.radians(10)).all((0, 2))
    return near


def swing_ups(random: np.random.Generator, last: Array, gain: Array) -> tuple[Array, Array, Array]:
    """Trajectories, torques and gains from around rest, 5 s long, the last two of them around upright."""
    # From rest: improve torques made of a few random frequencies, then continue with the best to the end.
    tries, time, more = 64, STEP * np.arange(150), 100
    shape = (6, tries, 1)
    waves = zip(random.normal(size=shape), random.uniform(0.2, 1.5, shape), random.uniform(0, 2 * np.pi, shape))
    u = sum((LIMIT / 5 * size * np.sin(2 * np.pi * rate * time + phase) for size, rate, phase in waves), np.zeros((tries, len(time))))
    still = np.zeros((tries, len(time), 4))
    x, u = follow(np.tile(HANGING, (tries, 1)), still, u, still)
    firm = last + np.diag([500.0, 500, 100, 100])
    for rounds, keep in [(40, 8), (100, 3), (150, 1)]:
        x, u, k, cost = improve(x, u, firm, rounds)
        some = np.argsort(cost)[:keep]
        x, u, k = x[some], u[some], k[some]
    x, u, k = np.pad(x, ((0, 0), (0, more), (0, 0))), np.pad(u, ((0, 0), (0, more))), np.concatenate([k, np.tile(gain, (1, more, 1))], 1)
    x, u, k, cost = improve(*follow(x[:, 0], x, u, k), last, 60)
    print(f"the best swing-up: cost {cost[0]:.1f}, up to {np.abs(u).max():.1f} N m", flush=True)
    count = 48
    x, u, k, cost = towards(starts(count, random), x.repeat(count, 0), u.repeat(count, 0), k.repeat(count, 0), last, [0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 0.85, 1])
    print(f"from around rest: costs {cost.min():.1f} to {cost.max():.1f}", flush=True)
    return x, u, k


def towards(goal: Array, x: Array, u: Array, k: Array, last: Array, shares: list[float]) -> tuple[Array, Array, Array, Array]:
    """Trajectories from other starts: theirs move there by and by."""
    begin = x[:, 0]
    for share in shares:
        x, u, k, cost = improve(*follow(begin + share * (goal - begin), x, u, k), last, 8)
    return x, u, k, cost


def from_seen(seen: Array, x: Array, u: Array, k: Array, last: Array, gain: Array) -> tuple[Array, Array, Array]:
    """What iLQR does from states that a policy came to, beginning with the nearest of its trajectories."""
    horizon, weights = u.shape[1], np.array([3, 3, 1, 1])
    near = np.array([((weights * (x[:, :-1].reshape(-1, 4) - one)) ** 2).sum(1).argmin() for one in seen])
    which, when = near[:, None] // horizon, near[:, None] % horizon + np.arange(horizon + 1)
    inside, at = when[:, :-1] < horizon, np.minimum(when[:, :-1], horizon - 1)
    to, torques = x[which, np.minimum(when, horizon)], u[which, at] * inside
    to, torques, gains, cost = towards(seen, to, torques, np.where(inside[..., None], k[which, at], gain), last, [0.15, 0.4, 0.7, 1])
    # Discard trajectories that found no way up.
    good = (np.abs(to[:, -1]).max(1) < 0.1) & (cost < 300)
    return to[good], torques[good], gains[good]


def main(path: str) -> None:
    random = np.random.default_rng(1)
    last, gain = regulator()
    x, u, k = swing_ups(random, last, gain)
    layers = fresh([6, 64, 64, 1], random)
    for steps in [5000, 5000, 5000, 5000, 25000]:
        error = train(layers, x[:, :-1].reshape(-1, 4), u.ravel(), k.reshape(-1, 4), steps, random)
        runs = run(layers, starts(1000, random), 10)
        print(f"{len(u)} trajectories: error {error:.2f} N m, {upright(runs).mean():.1%} of 1000 upright", flush=True)
        if steps == 5000:
            # States that the policy reaches within its first 3 s.
            seen = runs[random.integers(0, len(runs), 96), random.integers(0, 150, 96)]
            x, u, k = (np.concatenate(both) for both in zip((x, u, k), from_seen(seen, x, u, k, last, gain)))
    write(layers, path)


def write(layers: Layers, path: str) -> None:
    """The policy as ONNX: velocities divided by their largest, layers with tanh, times the largest torque."""
    constants = {"largest": np.array([1, 1, 1, 1, FASTEST, FASTEST]), "limit": np.array([LIMIT])}
    nodes, name = [helper.make_node("Div", ["state", "largest"], ["x0"])], "x0"
    for k, (weights, bias) in enumerate(layers, 1):
        constants |= {f"W{k}": weights, f"b{k}": bias}
        nodes.append(helper.make_node("Gemm", [name, f"W{k}", f"b{k}"], [f"s{k}"], name=f"layer{k}", transB=1))
        nodes.append(helper.make_node("Tanh", [f"s{k}"], [name := f"x{k}"]))
    nodes.append(helper.make_node("Mul", [name, "limit"], ["torque"]))
    ends = [helper.make_tensor_value_info(name, TensorProto.FLOAT, ["batch", n]) for name, n in (("state", 6), ("torque", 1))]
    tensors = [numpy_helper.from_array(value.astype(np.float32), name) for name, value in constants.items()]
    graph = helper.make_graph(nodes, "acrobot", ends[:1], ends[1:], tensors)
    model = helper.make_model(graph, producer_name="acrobot_train.py", ir_version=8, opset_imports=[helper.make_opsetid("", 17)])
    onnx.checker.check_model(model)
    onnx.save(model, path)


if __name__ == "__main__":
    main(sys.argv[1])

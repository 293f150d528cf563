"""Trains pendulum.onnx, the policy of pendulum.py: half a minute with NumPy; `onnx` writes the file.

    pip install numpy onnx && python3 pendulum_train.py pendulum.onnx

A pendulum whose motor lifts half of its weight has to swing up. Value iteration over a grid of states finds the torque that is best
in each; a multi-layer perceptron 3-32-32-1 then learns it, by Adam, from the cosine and sine of the angle and the velocity.
"""
import sys

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

Array = NDArray[np.float64]
STEP, LIMIT, FASTEST, DISCOUNT = 0.05, 0.5, 3.0, 0.98


def step(q: Array, v: Array, torque: Array) -> tuple[Array, Array]:
    """A step of 0.05 s. The angle is 0 upright; weight, length and inertia are 1, damping 0.05."""
    v = np.clip(v + STEP * (np.sin(q) + torque - 0.05 * v), -FASTEST, FASTEST)
    return (q + STEP * v + np.pi) % (2 * np.pi) - np.pi, v


def cost(q: Array, v: Array, torque: Array) -> Array:
    """What value iteration adds up, each step."""
    worst: Array = q**2 + 0.1 * v**2 + 0.1 * torque**2
    return worst


def best_torques() -> tuple[Array, Array, Array]:
    """Angles, velocities, and the best torque at each pair: value iteration on a grid."""
    qs, vs = np.linspace(-np.pi, np.pi, 121)[:-1], np.linspace(-FASTEST, FASTEST, 121)
    torques = np.linspace(-LIMIT, LIMIT, 21)
    q, v, torque = np.meshgrid(qs, vs, torques, indexing="ij")
    to_q, to_v = step(q, v, torque)
    i, j = (to_q + np.pi) / (qs[1] - qs[0]), (to_v + FASTEST) / (vs[1] - vs[0])
    i0, j0 = np.floor(i).astype(int), np.minimum(np.floor(j).astype(int), len(vs) - 2)
    right, up, i0, i1 = i - i0, j - j0, i0 % len(qs), (i0 + 1) % len(qs)
    now, value = cost(q, v, torque), np.zeros((len(qs), len(vs)))
    for _ in range(300):
        low = value[i0, j0] * (1 - right) + value[i1, j0] * right
        high = value[i0, j0 + 1] * (1 - right) + value[i1, j0 + 1] * right
        all_values = now + DISCOUNT * (low * (1 - up) + high * up)
        value = all_values.min(axis=2)
    return qs, vs, torques[all_values.argmin(axis=2)]


def trained(x: Array, y: Array, shape: list[int], steps: int = 6000) -> list[tuple[Array, Array]]:
    """Weights and biases of tanh layers after Adam on the squared error."""
    random = np.random.default_rng(1)
    layers = [(random.normal(size=(n, m)) / np.sqrt(m), np.zeros(n)) for m, n in zip(shape, shape[1:])]
    moments = [[np.zeros_like(part) for part in layer for _ in range(2)] for layer in layers]
    for t in range(1, steps + 1):
        chosen = random.integers(0, len(x), 512)
        values = [x[chosen]]
        for weights, bias in layers:
            values.append(np.tanh(values[-1] @ weights.T + bias))
        slope = 2 * (values[-1] - y[chosen]) / len(chosen)
        rate = 3e-3 * 0.5 * (1 + np.cos(np.pi * t / steps))
        for index in reversed(range(len(layers))):
            slope = slope * (1 - values[index + 1] ** 2)
            gradients = [slope.T @ values[index], slope.sum(axis=0)]
            slope = slope @ layers[index][0]
            for part, gradient, k in zip(layers[index], gradients, (0, 2)):
                first, second = moments[index][k : k + 2]
                first += 0.1 * (gradient - first)
                second += 0.001 * (gradient**2 - second)
                part -= rate * (first / (1 - 0.9**t)) / (np.sqrt(second / (1 - 0.999**t)) + 1e-8)
    return layers


def write(layers: list[tuple[Array, Array]], path: str) -> None:
    """The policy as ONNX: velocities divided by their largest, layers with tanh, times the largest torque."""
    constants = {"largest": np.array([1, 1, FASTEST]), "limit": np.array([LIMIT])}
    nodes, name = [helper.make_node("Div", ["state", "largest"], ["x0"])], "x0"
    for k, (weights, bias) in enumerate(layers, 1):
        constants |= {f"W{k}": weights, f"b{k}": bias}
        nodes.append(helper.make_node("Gemm", [name, f"W{k}", f"b{k}"], [f"s{k}"], name=f"layer{k}", transB=1))
        nodes.append(helper.make_node("Tanh", [f"s{k}"], [name := f"x{k}"]))
    nodes.append(helper.make_node("Mul", [name, "limit"], ["torque"]))
    ends = [helper.make_tensor_value_info(name, TensorProto.FLOAT, ["batch", n]) for name, n in (("state", 3), ("torque", 1))]
    tensors = [numpy_helper.from_array(value.astype(np.float32), name) for name, value in constants.items()]
    graph = helper.make_graph(nodes, "pendulum", ends[:1], ends[1:], tensors)
    model = helper.make_model(graph, producer_name="pendulum_train.py", ir_version=8, opset_imports=[helper.make_opsetid("", 17)])
    onnx.checker.check_model(model)
    onnx.save(model, path)


if __name__ == "__main__":
    qs, vs, best = best_torques()
    q, v = (grid.ravel() for grid in np.meshgrid(qs, vs, indexing="ij"))
    x = np.stack([np.cos(q), np.sin(q), v / FASTEST], axis=1)
    write(trained(x, best.reshape(-1, 1) / LIMIT, [3, 32, 32, 1]), sys.argv[1])

"""Networks in ONNX and what onnxruntime computes of them: every operator by itself, the forms in which exporters write the same, and
policies as torch, stable-baselines3, rsl_rl and skrl export them.

    python3 operators.py FOLDER

writes NAME.onnx, and NAME.in and NAME.out, binary32, a row for each state; and index.json: kind, name, length of input and output.
"""
import json
import sys
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
from onnx import TensorProto, helper, numpy_helper

FLOAT = TensorProto.FLOAT
WIDTH = 16
STATES = 10_000
KINDS = {np.float32: FLOAT, np.float16: TensorProto.FLOAT16, np.float64: TensorProto.DOUBLE, np.int64: TensorProto.INT64}


class Net:
    """Nodes in a row; each method adds some and gives the name of a result."""

    def __init__(self, length, seed=0, opset=17, ir=8, shape=("batch",), kind=np.float32, named=True):
        self.random, self.opset, self.ir, self.shape, self.kind, self.named = np.random.default_rng(seed), opset, ir, shape, kind, named
        self.length, self.first, self.nodes, self.constants = length, length, [], []

    def constant(self, value, kind=None):
        name = f"c{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.asarray(value, kind or self.kind), name))
        return name

    def whole(self, *values):
        return self.constant(values, np.int64)

    def node(self, operator, *inputs, outputs=1, domain="", **attributes):
        results = [f"v{len(self.nodes)}_{i}" for i in range(outputs)]
        name = f"/{operator}_{len(self.nodes)}" if self.named else ""
        self.nodes.append(helper.make_node(operator, list(inputs), results, name, domain=domain, **attributes))
        return results[0] if outputs == 1 else results

    def weights(self, rows):
        weights = self.random.normal(size=(rows, self.length)) / np.sqrt(self.length)
        bias = self.random.uniform(-0.5, 0.5, rows)
        self.length = rows
        return weights, bias

    def gemm(self, x, rows):
        weights, bias = self.weights(rows)
        return self.node("Gemm", x, self.constant(weights), self.constant(bias), alpha=1.0, beta=1.0, transB=1)

    def matmul(self, x, rows):
        weights, bias = self.weights(rows)
        return self.node("Add", self.node("MatMul", x, self.constant(weights.T)), self.constant(bias))

    def turned(self, x, rows):
        """As exporters write a layer whose weight they leave as it is."""
        weights, bias = self.weights(rows)
        turned = self.node("Transpose", self.constant(weights), perm=[1, 0])
        return self.node("Add", self.constant(bias), self.node("MatMul", x, turned))

    def axes(self, operator, x, *axes, **attributes):
        """A reduction, whose axes are an attribute or an operand."""
        if self.opset >= 18 or operator in ("ReduceSum", "Squeeze", "Unsqueeze") and self.opset >= 13:
            return self.node(operator, x, self.whole(*axes), **attributes)
        return self.node(operator, x, axes=list(axes), **attributes)

    def model(self, *outputs):
        kind = KINDS[self.kind]
        # Lengths of the outputs are left open, as in many files.
        ends = [None] * min(len(self.shape) + 1, 2)
        graph = helper.make_graph(
            self.nodes, "policy", [helper.make_tensor_value_info("obs", kind, [*self.shape, self.first])],
            [helper.make_tensor_value_info(name, kind, ends) for name in outputs], self.constants)
        imports = [helper.make_opsetid("", self.opset)]
        imports += [helper.make_opsetid("com.microsoft", 1)] if any(node.domain for node in self.nodes) else []
        return helper.make_model(graph, producer_name="operators.py", ir_version=self.ir, opset_imports=imports)


def operators():
    """Name of the table's row, model, range of the inputs (that of the table). Two operands are two halves of the input."""
    one = "Neg Abs Sign Floor Ceil Sqrt Reciprocal Exp Log Sin Cos Tan Asin Acos Atan Sinh Cosh Asinh Acosh Atanh Erf Relu Tanh Sigmoid HardSwish Softplus Softsign"
    two = "Add Sub Mul Div Sum Mean Min Max PRelu"
    numbers = {"LeakyRelu": {"alpha": 0.2}, "ThresholdedRelu": {"alpha": 0.75}, "HardSigmoid": {"alpha": 0.25, "beta": 0.5}, "Elu": {"alpha": 0.5}, "Selu": {}, "Celu": {"alpha": 2.0}}
    for name in one.split():
        net = Net(WIDTH)
        yield name, net.model(net.node(name, "obs"))
    for name, attributes in numbers.items():
        net = Net(WIDTH)
        yield name, net.model(net.node(name, "obs", **attributes))
    for name in two.split():
        net = Net(2 * WIDTH)
        yield name, net.model(net.node(name, *net.node("Split", "obs", outputs=2, axis=1)))
    net = Net(2 * WIDTH)
    a, b = net.node("Split", "obs", outputs=2, axis=1)
    yield "Pow", net.model(net.node("Pow", a, net.node("Clip", b, net.constant(-2), net.constant(1.5))))
    for name, attributes in {"Gelu": {}, "Gelu tanh": {"approximate": "tanh"}, "Mish": {}}.items():
        net = Net(WIDTH, opset=20, ir=9)
        yield name, net.model(net.node(name.split()[0], "obs", **attributes))
    net = Net(WIDTH)
    yield "Clip", net.model(net.node("Clip", "obs", net.constant(-1), net.constant(2.5)))
    net = Net(WIDTH)
    yield "Swish", net.model(net.node("Mul", "obs", net.node("Sigmoid", "obs")))
    for name in "Less LessOrEqual Greater GreaterOrEqual Equal".split():
        net = Net(2 * WIDTH)
        a, b = (net.node("Floor", half) for half in net.node("Split", "obs", outputs=2, axis=1))
        yield name, net.model(net.node("Cast", net.node(name, a, b), to=FLOAT))
    for name in "And Or".split():
        net = Net(2 * WIDTH)
        a, b = (net.node("Greater", half, net.constant(0)) for half in net.node("Split", "obs", outputs=2, axis=1))
        yield name, net.model(net.node("Cast", net.node(name, a, b), to=FLOAT))
    net = Net(WIDTH)
    yield "Not", net.model(net.node("Cast", net.node("Not", net.node("Less", "obs", net.constant(1))), to=FLOAT))
    net = Net(2 * WIDTH)
    a, b = net.node("Split", "obs", outputs=2, axis=1)
    yield "Where", net.model(net.node("Where", net.node("Less", a, b), a, net.node("Neg", b)))


def silu(net, x):
    return net.node("Mul", x, net.node("Sigmoid", x))


def gelu(net, x):
    error = net.node("Erf", net.node("Div", x, net.constant(np.sqrt(2))))
    return net.node("Mul", net.node("Mul", x, net.node("Add", error, net.constant(1))), net.constant(0.5))


def gelu_tanh(net, x):
    cube = net.node("Mul", net.node("Pow", x, net.constant(3)), net.constant(0.044715))
    inner = net.node("Tanh", net.node("Mul", net.node("Add", x, cube), net.constant(np.sqrt(2 / np.pi))))
    return net.node("Mul", net.node("Mul", net.constant(0.5), x), net.node("Add", inner, net.constant(1)))


def mish(net, x):
    return net.node("Mul", x, net.node("Tanh", net.node("Softplus", x)))


def layer_norm(net, x):
    """As torch wrote it before there was an operator."""
    mean = net.axes("ReduceMean", x, -1)
    centred = net.node("Sub", x, mean)
    variance = net.axes("ReduceMean", net.node("Pow", centred, net.constant(2)), -1)
    scaled = net.node("Div", centred, net.node("Sqrt", net.node("Add", variance, net.constant(1e-5))))
    gain, shift = net.random.uniform(0.5, 1.5, net.length), net.random.uniform(-1, 1, net.length)
    return net.node("Add", net.node("Mul", scaled, net.constant(gain)), net.constant(shift))


def fused_layer_norm(net, x):
    gain, shift = net.random.uniform(0.5, 1.5, net.length), net.random.uniform(-1, 1, net.length)
    return net.node("LayerNormalization", x, net.constant(gain), net.constant(shift), axis=-1, epsilon=1e-5)


def batch_norm(net, x):
    low = [net.constant(net.random.uniform(*ends, net.length)) for ends in ((0.5, 1.5), (-1, 1), (-1, 1), (0.2, 2))]
    return net.node("BatchNormalization", x, *low, epsilon=1e-5)


def same(net, x):
    """What exporters leave that does nothing."""
    x = net.node("Identity", net.node("Flatten", x, axis=1))
    x = net.node("Reshape", x, net.whole(-1, net.length))
    x = net.axes("Squeeze", net.axes("Unsqueeze", x, 1), 1)
    return net.node("Dropout", net.node("Cast", x, to=KINDS[net.kind]))


def dynamic(net, x):
    """A reshape to a shape that is computed of the batch."""
    rows = net.node("Gather", net.node("Shape", x), net.constant(0, np.int64), axis=0)
    shape = net.node("Concat", net.axes("Unsqueeze", rows, 0), net.whole(-1), axis=0)
    return net.node("Reshape", x, shape)


def simple(operator, **attributes):
    return lambda net, x: net.node(operator, x, **attributes)


ACTIVATIONS = {
    "relu": simple("Relu"), "tanh": simple("Tanh"), "elu": simple("Elu", alpha=1.0), "leaky": simple("LeakyRelu", alpha=0.01),
    "silu": silu, "gelu": gelu, "gelu_tanh": gelu_tanh, "mish": mish, "selu": simple("Selu"), "softplus": simple("Softplus"),
    "sigmoid": simple("Sigmoid"), "softsign": simple("Softsign"),
}


def forms():
    """The same networks, as opsets and exporters write them."""
    for opset in (11, 13, 15, 17, 18, 20, 21):
        for layer in ("gemm", "matmul", "turned"):
            net = Net(9, opset=opset, ir=7 if opset < 15 else 8)
            make = getattr(net, layer)
            x = silu(net, make(same(net, "obs"), 20))
            x = layer_norm(net, make(dynamic(net, x), 12))
            yield f"{layer}_{opset}", net.model(make(net.node("Tanh", x), 3))
    for name, part in {"layer_norm": fused_layer_norm, "batch_norm": batch_norm, "decomposed": layer_norm}.items():
        net = Net(12)
        yield name, net.model(net.gemm(part(net, net.node("Elu", part(net, net.gemm("obs", 24)))), 4))
    net = Net(12, kind=np.float64)
    yield "double", net.model(net.gemm(net.node("Tanh", net.gemm("obs", 24)), 4))
    for name, kind in {"half": np.float16, "wide": np.float64}.items():
        net = Net(12)
        weights, bias = net.weights(5)
        cast = [net.node("Cast", net.constant(value, kind), to=FLOAT) for value in (weights.T, bias)]
        yield f"{name}_weights", net.model(net.node("Add", net.node("MatMul", "obs", cast[0]), cast[1]))
    net = Net(4)
    net.length = 6
    yield "concat", net.model(net.matmul(net.node("Concat", "obs", net.constant([[0.5, -1.0]]), axis=1), 3))
    net = Net(11)
    a = net.node("Slice", "obs", net.whole(0), net.whole(4), net.whole(1))
    b = net.node("Gather", "obs", net.whole(10, 5, 7), axis=1)
    net.length = 7
    x = net.gemm(net.node("Concat", net.node("Tanh", a), net.node("Neg", b), axis=1), 8)
    mean, spread = net.node("Split", x, net.whole(5, 3), outputs=2, axis=-1)
    yield "places", net.model(net.node("Concat", net.node("Tanh", mean), net.node("Exp", spread), axis=1))
    net = Net(10, shape=())
    x = net.matmul("obs", 10)
    yield "residual", net.model(net.node("Add", "obs", gelu(net, net.matmul(net.node("Add", x, "obs"), 10))))
    net = Net(40)
    x = net.gemm("obs", 64)
    for _ in range(2):
        x = net.node("Add", x, net.gemm(net.node("Relu", net.gemm(fused_layer_norm(net, x), 96)), 64))
    yield "simba", net.model(net.gemm(fused_layer_norm(net, x), 6))
    net = Net(8)
    x = net.gemm("obs", 5)
    yield "softmax", net.model(net.node("Softmax", x, axis=-1))
    net = Net(8)
    x = net.gemm("obs", 8)
    norm = net.node("ReduceL2", x, axes=[1], keepdims=1)
    yield "unit", net.model(net.node("Div", x, net.node("Max", norm, net.constant(1e-6))))
    net = Net(8, shape=(1, 3))
    net.length = 24
    yield "frames", net.model(net.gemm(net.node("Flatten", "obs"), 4))
    net = Net(7, named=False)
    first = net.node("Tanh", net.gemm("obs", 12))
    again = net.gemm(first, 12)
    yield "twice", net.model(net.gemm(net.node("Mul", net.node("Add", again, first), first), 3))


def torch(seed, name, sizes, layer="gemm", **options):
    """nn.Sequential, as both exporters of torch write it."""
    net = Net(sizes[0], seed, **options)
    x = "obs"
    for rows in sizes[1:-1]:
        x = ACTIVATIONS[name](net, getattr(net, layer)(x, rows))
    return net.model(getattr(net, layer)(x, sizes[-1]))


def stable_baselines(seed, name, kind):
    """PPO's mean, SAC's and TD3's actor, behind FlattenExtractor; with value and log probability as further outputs."""
    net = Net(17, seed)
    x = net.node("Flatten", "obs", axis=1)
    for rows in (64, 64) if kind == "ppo" else (48, 48):
        x = ACTIVATIONS[name](net, net.gemm(x, rows))
    mean = net.gemm(x, 6)
    if kind == "ppo":
        net.length = 64
        return net.model(net.node("Clip", mean, net.constant(-1), net.constant(1)), net.node("Identity", net.constant([0.1] * 6)))
    if kind == "td3":
        return net.model(net.node("Tanh", mean))
    # Scale of the squashed action, back to the limits of the environment.
    low, high = np.full(6, -2.0), np.full(6, 2.0)
    action = net.node("Add", net.node("Tanh", mean), net.constant(1))
    return net.model(net.node("Add", net.constant(low), net.node("Mul", net.constant(0.5 * (high - low)), action)))


def rsl_rl(seed, name, normalised):
    """`_OnnxPolicyExporter`: the empirical normalisation, then the actor."""
    net = Net(48, seed, opset=18 if seed % 2 else 11, shape=(1,))
    x = "obs"
    if normalised:
        deviation = net.node("Add", net.constant(net.random.uniform(0.5, 2, (1, 48))), net.constant(0.01))
        x = net.node("Div", net.node("Sub", x, net.constant(net.random.uniform(-1, 1, (1, 48)))), deviation)
    for rows in (64, 48, 32):
        x = ACTIVATIONS[name](net, net.gemm(x, rows))
    return net.model(net.gemm(x, 12))


def skrl(seed, name, scaled):
    """A Gaussian model: RunningStandardScaler in double, the container, the clipped mean; log_std is another output."""
    net = Net(23, seed)
    x = "obs"
    if scaled:
        mean = net.node("Cast", net.constant(net.random.uniform(-1, 1, 23), np.float64), to=FLOAT)
        variance = net.node("Cast", net.constant(net.random.uniform(0.3, 2, 23), np.float64), to=FLOAT)
        below = net.node("Add", net.node("Sqrt", variance), net.constant(1e-8))
        x = net.node("Clip", net.node("Div", net.node("Sub", x, mean), below), net.constant(-5), net.constant(5))
    for rows in (64, 32):
        x = ACTIVATIONS[name](net, net.gemm(x, rows))
    mean = net.node("Tanh", net.gemm(x, 8)) if seed % 2 else net.gemm(x, 8)
    spread = net.node("Clip", net.constant(np.zeros(8)), net.constant(-20), net.constant(2))
    return net.model(mean, spread)


def policies():
    """60 of them."""
    for seed, name in enumerate(ACTIVATIONS):
        yield f"torch_{name}", torch(seed, name, (11, 32, 24, 3), opset=18)
        yield f"torch_{name}_matmul", torch(seed, name, (11, 40, 3), "matmul", opset=13, shape=(1,), named=False)
    for seed, (name, kind) in enumerate((name, kind) for kind in ("ppo", "sac", "td3") for name in ("relu", "tanh", "elu", "gelu")):
        yield f"sb3_{kind}_{name}", stable_baselines(seed, name, kind)
    for seed, (name, normalised) in enumerate((name, flag) for name in ("elu", "relu", "tanh", "selu", "leaky", "silu") for flag in (False, True)):
        yield f"rsl_rl_{name}_{normalised}", rsl_rl(seed, name, normalised)
    for seed, (name, scaled) in enumerate((name, flag) for name in ("elu", "relu", "tanh", "silu", "mish", "softplus") for flag in (False, True)):
        yield f"skrl_{name}_{scaled}", skrl(seed, name, scaled)


def main(folder):
    ranges = json.loads(sys.stdin.read())
    index = []
    for kind, models in (("operator", operators()), ("form", forms()), ("policy", policies())):
        for name, model in models:
            onnx.checker.check_model(model)
            session = onnxruntime.InferenceSession(model.SerializeToString())
            shape = [dim if isinstance(dim, int) else 1 for dim in session.get_inputs()[0].shape]
            length = int(np.prod(shape))
            low, high = ranges[name] if kind == "operator" else (-2, 2)
            count = -(-STATES // WIDTH) if kind == "operator" else 40
            states = np.random.default_rng(len(index)).uniform(low, high, (count, length)).astype(np.float32)
            double = session.get_inputs()[0].type == "tensor(double)"
            output = session.get_outputs()[0].name
            rows = [session.run([output], {"obs": state.reshape(shape).astype(float if double else np.float32)})[0] for state in states]
            stem = f"{kind}_{name}".replace(" ", "_")
            onnx.save(model, folder / f"{stem}.onnx")
            states.tofile(folder / f"{stem}.in")
            np.array(rows).astype(np.float32).tofile(folder / f"{stem}.out")
            index.append({"kind": kind, "name": name, "file": stem, "ins": length, "outs": int(rows[0].size)})
    (folder / "index.json").write_text(json.dumps(index))


if __name__ == "__main__":
    main(Path(sys.argv[1]))

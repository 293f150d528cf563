"""Writes data/policies: small policies in ONNX, what onnxruntime computes of them (policies.json), and files that are refused.

    pip install numpy onnx onnxruntime && python3 policies.py data/policies
"""
import json
import sys
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
from onnx import TensorProto, helper, numpy_helper

FLOAT = TensorProto.FLOAT


class Graph:
    """A chain of nodes from `obs`, with the constants that they read."""

    def __init__(self, length, seed):
        self.random, self.length, self.now = np.random.default_rng(seed), length, "obs"
        self.nodes, self.constants, self.first = [], [], length

    def constant(self, value, double=False):
        name = f"c{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.asarray(value, np.float64 if double else np.float32), name))
        return name

    def node(self, operator, *more, reverse=False, outputs=None, **attributes):
        operands = [self.now, *more][::-1] if reverse else [self.now, *more]
        result = f"v{len(self.nodes)}"
        self.nodes.append(helper.make_node(operator, operands, outputs or [result], f"/{operator}_{len(self.nodes)}", **attributes))
        self.now = result
        return self

    def vector(self, low=-1.0, high=1.0):
        return self.constant(self.random.uniform(low, high, self.length))

    def gemm(self, rows, transposed=True, **attributes):
        weights = self.random.normal(size=(rows, self.length)) / np.sqrt(self.length)
        self.length = rows
        return self.node("Gemm", self.constant(weights if transposed else weights.T), self.vector(), transB=int(transposed), **attributes)

    def matmul(self, rows):
        weights = self.random.normal(size=(self.length, rows)) / np.sqrt(self.length)
        self.length = rows
        return self.node("MatMul", self.constant(weights))

    def model(self, shape=("batch",), extra_outputs=(), extra_inputs=()):
        node = self.nodes[-1]
        node.output[0] = "action"
        ends = [helper.make_tensor_value_info("obs", FLOAT, [*shape, self.first])]
        ends += [helper.make_tensor_value_info(name, FLOAT, [1, 2]) for name in extra_inputs]
        outs = [helper.make_tensor_value_info(name, FLOAT, [*shape, self.length]) for name in ("action", *extra_outputs)]
        graph = helper.make_graph(self.nodes, "policy", ends, outs, self.constants)
        return helper.make_model(graph, producer_name="policies.py", ir_version=8, opset_imports=[helper.make_opsetid("", 17)])


def good():
    yield "relu", Graph(20, 1).gemm(40).node("Relu").gemm(24).node("Relu").gemm(4).model()
    g = Graph(7, 2)
    g.node("Sub", g.vector()).node("Div", g.vector(0.5, 2)).matmul(9).node("Add", g.vector()).node("Tanh")
    yield "tanh", g.gemm(3, transposed=False).node("Tanh").node("Mul", g.vector()).node("Add", g.vector()).model((1,))
    g = Graph(30, 3)
    g.node("Mul", g.vector()).node("Add", g.vector()).matmul(36).node("Add", g.vector()).node("Elu", alpha=0.75)
    yield "elu", g.matmul(11).node("Elu").matmul(9).node("Sub", g.constant(0.25), reverse=True).model(())
    g = Graph(150, 4)
    g.node("Flatten").node("Sub", g.vector()).gemm(17, alpha=0.5, beta=2.0).node("Sigmoid").gemm(5).node("Sigmoid")
    yield "sigmoid", g.node("Identity").node("Clip", g.constant(0.25), g.constant(0.625)).model()


def external(folder):
    """The same policy with its numbers beside it, in one file as torch writes it, and in a file for each array."""
    for name, one in (("beside", True), ("apart", False)):
        model = Graph(20, 1).gemm(40).node("Relu").gemm(24).node("Relu").gemm(4).model()
        onnx.save(model, folder / f"{name}.onnx", save_as_external_data=True, all_tensors_to_one_file=one, location=f"{name}.onnx.data" if one else None, size_threshold=0)


def elsewhere(**entries):
    model = Graph(8, 1).gemm(3).model()
    tensor = model.graph.initializer[0]
    tensor.ClearField("raw_data")
    tensor.data_location = TensorProto.EXTERNAL
    for key, value in entries.items():
        entry = tensor.external_data.add()
        entry.key, entry.value = key, str(value)
    return model


def bad():
    def weights(g, *shape):
        return g.constant(g.random.normal(size=shape))

    g = Graph(8, 1)
    yield "conv", g.gemm(8).node("Conv", weights(g, 1, 1, 3)).model()
    g = Graph(8, 1)
    yield "lstm", g.node("LSTM", weights(g, 1, 16, 8), weights(g, 1, 16, 4), hidden_size=4).model()
    g = Graph(8, 1)
    yield "gru", g.node("GRU", weights(g, 1, 12, 8), weights(g, 1, 12, 4), hidden_size=4).model()
    yield "index", Graph(8, 1).gemm(8).node("ArgMax", axis=1).model()
    yield "random", Graph(8, 1).gemm(8).node("RandomNormalLike").model()
    yield "unknown", Graph(8, 1).gemm(8).node("Gizmo").model()
    g = Graph(8, 1).gemm(8)
    yield "product", g.node("MatMul", g.now).model()
    yield "outputs", Graph(8, 1).gemm(8).node("Relu").gemm(3).model(extra_outputs=["v1"])
    yield "inputs", Graph(8, 1).gemm(2).node("Add", "task").model(extra_inputs=["task"])
    g = Graph(8, 1)
    yield "width", g.node("MatMul", weights(g, 9, 3)).model()
    g = Graph(8, 1)
    yield "zero", g.node("Div", g.constant([1, 2, 3, 0, 1, 2, 3, 4])).gemm(3).model()
    g = Graph(8, 1)
    yield "bias", g.node("Gemm", weights(g, 8, 3), weights(g, 4)).model()
    yield "shape", Graph(8, 1).gemm(3).model((3, 4))
    yield "integers", Graph(8, 1).gemm(3).node("Cast", to=TensorProto.INT64).model()
    g = Graph(8, 1)
    g.constants.append(helper.make_tensor("words", TensorProto.STRING, [8], [b"x"] * 8))
    yield "words", g.node("Mul", "words").model()
    yield "external", elsewhere()
    yield "missing", elsewhere(location="nowhere.bin")
    yield "outside", elsewhere(location="../beside.onnx.data")
    yield "absolute", elsewhere(location="/etc/passwd")
    yield "inner", elsewhere(location="a/../../b.bin")
    yield "short", elsewhere(location="beside.onnx.data", offset=7650)
    yield "length", elsewhere(location="beside.onnx.data", offset=0, length=20)
    yield "offset", elsewhere(location="beside.onnx.data", offset="many")
    g = Graph(8, 1)
    yield "nan", g.node("MatMul", g.constant(np.full((8, 3), np.nan))).model()
    yield "wide", Graph(8, 1).gemm(40).model()


def main(folder):
    cases = []
    for name, model in good():
        onnx.checker.check_model(model)
        onnx.save(model, folder / f"{name}.onnx")
        session = onnxruntime.InferenceSession(model.SerializeToString())
        shape = session.get_inputs()[0].shape
        inputs = np.random.default_rng(9).uniform(-2, 2, (4, shape[-1])).astype(np.float32)
        rows = [row if len(shape) == 1 else row[None] for row in inputs]
        outputs = [session.run(None, {"obs": row})[0].ravel() for row in rows]
        cases.append({"name": name, "inputs": inputs.tolist(), "outputs": [row.tolist() for row in outputs]})
    text = ",\n".join(json.dumps(case) for case in cases)
    (folder / "policies.json").write_text(f'{{"onnxruntime": "{onnxruntime.__version__}", "policies": [\n{text}\n]}}\n')
    external(folder)
    for name, model in bad():
        (folder / f"bad_{name}.onnx").write_bytes(model.SerializeToString())


if __name__ == "__main__":
    main(Path(sys.argv[1]))

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Operators that are more than elementwise: layers, reductions, normalisations. Also the tables of all operators.

use super::functions::find;
use super::moves::{Operands, attribute, axes, axis, integer, integers, transpose};
use super::onnx::Node;
use super::read::Reader;
use super::tensor::{Value, count};
use super::{Reduction, Step};

/// A supported operator that is not elementwise.
pub struct Operator {
    /// Operator names in ONNX.
    pub names: &'static [&'static str],
    /// Treatment by the reader, for documents.
    pub treatment: &'static str,
}

const fn operator(names: &'static [&'static str], treatment: &'static str) -> Operator {
    Operator { names, treatment }
}

/// Supported operators that are not elementwise.
pub const OPERATORS: &[Operator] = &[
    operator(
        &["Gemm"],
        "a layer; the matrix is a constant, `alpha`, `beta` and `transB` count, the summand may be computed",
    ),
    operator(&["MatMul"], "a layer; one factor is a constant matrix, the other one vector"),
    operator(&["BatchNormalization"], "with the mean and variance of the file; a factor and a summand"),
    operator(
        &["LayerNormalization", "RMSNormalization"],
        "over the last dimensions; its parts (`ReduceMean`, `Sub`, `Pow`, `Sqrt`, `Div`) as well",
    ),
    operator(&["Softmax", "LogSoftmax"], "over the last dimension"),
    operator(
        &["ReduceSum", "ReduceMean", "ReduceMax", "ReduceMin", "ReduceL1", "ReduceL2", "ReduceSumSquare"],
        "over any axes",
    ),
    operator(
        &["Constant", "ConstantOfShape", "Shape"],
        "a constant; whatever is computed of constants alone is one",
    ),
    operator(
        &["Identity", "Dropout", "Cast", "CastLike"],
        "passed over; a `Cast` of computed values to integers is refused",
    ),
    operator(
        &[
            "Reshape",
            "Flatten",
            "Squeeze",
            "Unsqueeze",
            "Expand",
            "Transpose",
            "Slice",
            "Split",
            "Gather",
            "Concat",
        ],
        "other places, which cost nothing but where vectors are put together; places are constants",
    ),
];

const CONVOLUTION: &str = "convolutions and pooling are not read; vectors are, without neighbours";
const RECURRENT: &str = "a recurrent layer keeps a state from period to period, and a program made of a policy has none; a state can be an input and an output of the file";
const RANDOM: &str = "it draws at random; export the deterministic action";
const FLOW: &str = "control flow is not read; export the model for one way through it";
const WHOLE: &str = "its results are indices; take the numbers before it as the output";

/// Refused operators, with reasons. (Names not listed here are refused without a reason.)
pub const REFUSED: &[(&str, &str)] = &[
    ("Conv", CONVOLUTION),
    ("ConvTranspose", CONVOLUTION),
    ("MaxPool", CONVOLUTION),
    ("AveragePool", CONVOLUTION),
    ("GlobalAveragePool", CONVOLUTION),
    ("LSTM", RECURRENT),
    ("GRU", RECURRENT),
    ("RNN", RECURRENT),
    ("RandomNormal", RANDOM),
    ("RandomNormalLike", RANDOM),
    ("RandomUniform", RANDOM),
    ("RandomUniformLike", RANDOM),
    ("Multinomial", RANDOM),
    ("Bernoulli", RANDOM),
    ("If", FLOW),
    ("Loop", FLOW),
    ("Scan", FLOW),
    ("ArgMax", WHOLE),
    ("ArgMin", WHOLE),
    ("TopK", WHOLE),
];

fn float(node: &Node, name: &str, otherwise: f64) -> f64 {
    attribute(node, name).map_or(otherwise, |attribute| f64::from(attribute.float))
}

fn needed<'a>(inputs: &Operands<'a>, position: usize) -> Result<&'a Value, String> {
    inputs.get(position).copied().flatten().ok_or_else(|| format!("it has no operand {}", position + 1))
}

/// A scalar: a value without dimensions.
fn number(value: f64) -> Value {
    Value::new(Vec::new(), [value], super::tensor::FLOAT)
}

impl Reader<'_> {
    /// Result of an operator of this file; `None` for other operators.
    pub(super) fn operator(&mut self, node: &Node, inputs: &Operands<'_>) -> Result<Option<Value>, String> {
        let name = node.operator.as_str();
        Ok(Some(match name {
            "Gemm" => self.gemm(node, inputs)?,
            "MatMul" => {
                let (a, b) = (needed(inputs, 0)?, needed(inputs, 1)?);
                self.matmul(a, b)?
            }
            "BatchNormalization" => self.batch_normalization(node, inputs)?,
            "LayerNormalization" => self.layer_normalization(node, inputs, true)?,
            "RMSNormalization" => self.layer_normalization(node, inputs, false)?,
            "Softmax" | "LogSoftmax" => self.softmax(node, needed(inputs, 0)?, name == "LogSoftmax")?,
            "ReduceSum" | "ReduceMean" | "ReduceMax" | "ReduceMin" | "ReduceL1" | "ReduceL2"
            | "ReduceSumSquare" => self.reduction(node, inputs)?,
            _ => return Ok(None),
        }))
    }

    /// Applies an elementwise operator by name.
    fn of(&mut self, name: &str, operands: &[&Value]) -> Result<Value, String> {
        let function = find(name).ok_or_else(|| format!("there is no function {name}"))?;
        let parameters = function.parameters.iter().map(|(_, value)| *value).collect();
        self.elementwise(function, parameters, operands)
    }

    fn gemm(&mut self, node: &Node, inputs: &Operands<'_>) -> Result<Value, String> {
        let matrix = |value: &Value, flag: &str| match integer(node, flag, 0) {
            0 => Ok(value.clone()),
            _ => transpose(value, &[1, 0]),
        };
        let (a, mut b) = (matrix(needed(inputs, 0)?, "transA")?, matrix(needed(inputs, 1)?, "transB")?);
        let (alpha, beta) = (float(node, "alpha", 1.0), float(node, "beta", 1.0));
        if alpha != 1.0 {
            b = self.of("Mul", &[&b, &number(alpha)])?;
        }
        let product = self.matmul(&a, &b)?;
        let Some(summand) = inputs.get(2).copied().flatten() else { return Ok(product) };
        let summand = if beta == 1.0 { summand.clone() } else { self.of("Mul", &[summand, &number(beta)])? };
        let sum = self.of("Add", &[&product, &summand])?;
        if sum.dims != product.dims {
            return Err(format!("its bias has shape {:?}, and its product {:?}", summand.dims, product.dims));
        }
        Ok(sum)
    }

    fn matmul(&mut self, a: &Value, b: &Value) -> Result<Value, String> {
        if let (Some(a_numbers), Some(b_numbers)) = (a.numbers(), b.numbers()) {
            return product(a, &a_numbers, b, &b_numbers);
        }
        if let (&[ins, outs], Some(numbers)) = (&b.dims[..], b.numbers()) {
            let mut dims = a.dims.clone();
            let last = dims.last_mut().ok_or("its vector is a number")?;
            fits(a, *last, ins)?;
            *last = outs;
            let weights =
                (0..outs).flat_map(|i| (0..ins).map(move |j| j * outs + i)).map(|at| numbers[at]).collect();
            return self.dense(a, weights, outs, dims);
        }
        if let (&[outs, ins], Some(numbers)) = (&a.dims[..], a.numbers()) {
            let dims = match b.dims[..] {
                [length] if length == ins => vec![outs],
                [length, 1] if length == ins => vec![outs, 1],
                _ => return Err(format!("its weights have shape {:?}, and the vector {:?}", a.dims, b.dims)),
            };
            return self.dense(b, numbers, outs, dims);
        }
        if !a.is_constant() && !b.is_constant() {
            return Err("both of its factors are computed, but a layer needs a constant matrix".to_owned());
        }
        let weights = if a.is_constant() { a } else { b };
        Err(format!("its weights have shape {:?}; expected a matrix", weights.dims))
    }

    /// Adds a layer; its bias absorbs the constant elements of the vector.
    fn dense(
        &mut self,
        x: &Value,
        weights: Vec<f64>,
        outs: usize,
        dims: Vec<usize>,
    ) -> Result<Value, String> {
        use super::Element::Number;
        let ins = x.elements.len();
        if ins == 0 || outs == 0 {
            return Err("its weights are empty".to_owned());
        }
        let is_number = |element: &super::Element| matches!(element, Number(_));
        let mut bias = vec![0.0; outs];
        for (bias, row) in bias.iter_mut().zip(weights.chunks(ins)) {
            let product = |(w, x): (&f64, &super::Element)| if let Number(x) = x { w * x } else { 0.0 };
            *bias = row.iter().zip(&x.elements).map(product).sum();
        }
        let computed = x.elements.iter().filter(|element| !is_number(element)).copied().collect();
        let kept = |(_, x): &(&f64, &super::Element)| !is_number(x);
        let weights: Vec<f64> = weights
            .chunks(ins)
            .flat_map(|row| row.iter().zip(&x.elements).filter(kept).map(|(w, _)| *w))
            .collect();
        let (vector, first) = self.stretch(computed)?;
        let vector = self.push(Step::Dense { vector, first, weights, bias }, outs)?;
        Ok(Value::computed(dims, vector, x.kind))
    }

    fn batch_normalization(&mut self, node: &Node, inputs: &Operands<'_>) -> Result<Value, String> {
        if integer(node, "training_mode", 0) != 0 {
            return Err("it is in training mode; export the model after `eval()`".to_owned());
        }
        let x = needed(inputs, 0)?;
        let behind = x.dims.len().saturating_sub(2);
        let channels = |position: usize| {
            let value = needed(inputs, position)?;
            let dims = [&value.dims[..], &vec![1; behind]].concat();
            Ok::<Value, String>(Value { dims, ..value.clone() })
        };
        let [scale, shift, mean, variance] = [channels(1)?, channels(2)?, channels(3)?, channels(4)?];
        let spread = self.of("Add", &[&variance, &number(float(node, "epsilon", 1e-5))])?;
        let deviation = self.of("Sqrt", &[&spread])?;
        let factor = self.of("Div", &[&scale, &deviation])?;
        let centred = self.of("Sub", &[x, &mean])?;
        let scaled = self.of("Mul", &[&centred, &factor])?;
        self.of("Add", &[&scaled, &shift])
    }

    fn layer_normalization(
        &mut self,
        node: &Node,
        inputs: &Operands<'_>,
        centred: bool,
    ) -> Result<Value, String> {
        let x = needed(inputs, 0)?;
        let first = axis(integer(node, "axis", -1), x.dims.len())?;
        let over: Vec<usize> = (first..x.dims.len()).collect();
        let mut y = x.clone();
        if centred {
            let mean = self.reduced(Reduction::Mean, x, &over, true)?;
            y = self.of("Sub", &[x, &mean])?;
        }
        let squares = self.of("Mul", &[&y, &y])?;
        let variance = self.reduced(Reduction::Mean, &squares, &over, true)?;
        let spread = self.of("Add", &[&variance, &number(float(node, "epsilon", 1e-5))])?;
        let deviation = self.of("Sqrt", &[&spread])?;
        let inverse = self.of("Reciprocal", &[&deviation])?;
        y = self.of("Mul", &[&y, &inverse])?;
        y = self.of("Mul", &[&y, needed(inputs, 1)?])?;
        match inputs.get(2).copied().flatten() {
            Some(shift) => self.of("Add", &[&y, shift]),
            None => Ok(y),
        }
    }

    fn softmax(&mut self, node: &Node, x: &Value, logarithm: bool) -> Result<Value, String> {
        let over = [axis(integer(node, "axis", -1), x.dims.len())?];
        let greatest = self.reduced(Reduction::Max, x, &over, true)?;
        let below = self.of("Sub", &[x, &greatest])?;
        let power = self.of("Exp", &[&below])?;
        let sum = self.reduced(Reduction::Sum, &power, &over, true)?;
        if logarithm {
            let logarithm = self.of("Log", &[&sum])?;
            return self.of("Sub", &[&below, &logarithm]);
        }
        let inverse = self.of("Reciprocal", &[&sum])?;
        self.of("Mul", &[&power, &inverse])
    }

    fn reduction(&mut self, node: &Node, inputs: &Operands<'_>) -> Result<Value, String> {
        let x = needed(inputs, 0)?;
        let rank = x.dims.len();
        let over = match integers(node, inputs, 1, "axes")? {
            Some(given) if !given.is_empty() => axes(&given, rank)?,
            _ if integer(node, "noop_with_empty_axes", 0) != 0 => return Ok(x.clone()),
            _ => (0..rank).collect(),
        };
        let kept = integer(node, "keepdims", 1) != 0;
        let (before, reduction) = match node.operator.as_str() {
            "ReduceMean" => (None, Reduction::Mean),
            "ReduceMax" => (None, Reduction::Max),
            "ReduceMin" => (None, Reduction::Min),
            "ReduceL1" => (Some(self.of("Abs", &[x])?), Reduction::Sum),
            "ReduceL2" | "ReduceSumSquare" => (Some(self.of("Mul", &[x, x])?), Reduction::Sum),
            _ => (None, Reduction::Sum),
        };
        let sum = self.reduced(reduction, before.as_ref().unwrap_or(x), &over, kept)?;
        if node.operator == "ReduceL2" { self.of("Sqrt", &[&sum]) } else { Ok(sum) }
    }

    /// Reduces over the axes `over`; with `kept` these axes remain, with length 1.
    fn reduced(
        &mut self,
        reduction: Reduction,
        x: &Value,
        over: &[usize],
        kept: bool,
    ) -> Result<Value, String> {
        let rank = x.dims.len();
        let others: Vec<usize> = (0..rank).filter(|axis| !over.contains(axis)).collect();
        let order: Vec<i64> = others.iter().chain(over).map(|axis| *axis as i64).collect();
        let group = count(&over.iter().map(|axis| x.dims[*axis]).collect::<Vec<_>>())?;
        if group == 0 {
            return Err("it reduces an axis of length 0".to_owned());
        }
        let sorted = transpose(x, &order)?;
        let dims = match kept {
            true => (0..rank).map(|axis| if over.contains(&axis) { 1 } else { x.dims[axis] }).collect(),
            false => others.iter().map(|axis| x.dims[*axis]).collect(),
        };
        if let Some(numbers) = sorted.numbers() {
            let reduced: Vec<f64> = numbers.chunks(group).map(|group| reduction.of(group)).collect();
            return Ok(Value::new(dims, reduced, x.kind));
        }
        let length = sorted.elements.len();
        let vector = self.all(sorted.elements)?;
        let vector = self.push(Step::Reduce { reduction, vector, group }, length / group)?;
        Ok(Value::computed(dims, vector, x.kind))
    }
}

/// Checks that an array is a single vector, with the length that the weights need.
fn fits(x: &Value, length: usize, ins: usize) -> Result<(), String> {
    if length != ins {
        return Err(format!("its weights expect {ins} numbers, and the vector has {length}"));
    }
    if x.elements.len() != length {
        return Err(format!("its left factor has shape {:?}; expected one vector, a batch of 1", x.dims));
    }
    Ok(())
}

/// Product of two constant matrices.
fn product(a: &Value, a_numbers: &[f64], b: &Value, b_numbers: &[f64]) -> Result<Value, String> {
    let (rows, inner, columns, dims) = match (&a.dims[..], &b.dims[..]) {
        (&[rows, inner], &[other, columns]) if inner == other => (rows, inner, columns, vec![rows, columns]),
        (&[inner], &[other, columns]) if inner == other => (1, inner, columns, vec![columns]),
        (&[rows, inner], &[other]) if inner == other => (rows, inner, 1, vec![rows]),
        _ => return Err(format!("its constants have the shapes {:?} and {:?}", a.dims, b.dims)),
    };
    count(&dims)?;
    let element =
        |i: usize, j: usize| (0..inner).map(|k| a_numbers[i * inner + k] * b_numbers[k * columns + j]).sum();
    let numbers: Vec<f64> = (0..rows).flat_map(|i| (0..columns).map(move |j| element(i, j))).collect();
    Ok(Value::new(dims, numbers, a.kind))
}

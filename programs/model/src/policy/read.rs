// SPDX-License-Identifier: MIT OR Apache-2.0
//! From a file of ONNX to the chain of steps that it describes.

use super::onnx::{Attribute, Graph, Model, Node, Tensor, ValueInfo};
use super::{Activation, Network, Step, Vector};
use crate::Error;
use prost::Message;
use std::collections::{HashMap, HashSet};

/// The longest file.
pub const MAX_BYTES: usize = 64 << 20;

/// The most weights of a layer, or elements of a vector: more than any machine has words.
const MAX_NUMBERS: usize = 1 << 16;

/// The operators that are read, for messages.
const OPERATORS: &str =
    "Gemm, MatMul, Add, Sub, Mul, Div, Relu, Tanh, Sigmoid, Elu, Clip, Constant, Flatten and Identity";

/// Numbers of ONNX's types.
const FLOAT: i32 = 1;
const DOUBLE: i32 = 11;

/// A constant of the graph.
#[derive(Clone)]
struct Constant {
    dims: Vec<usize>,
    values: Vec<f64>,
}

/// A value of the graph.
#[derive(Clone)]
enum Value {
    /// What the chain has come to after so many steps.
    Computed(usize),
    Constant(Constant),
}

/// The state of reading.
struct Reader<'a> {
    values: HashMap<&'a str, Value>,
    steps: Vec<Step>,
    /// The length of the vector, if it is known.
    length: Option<usize>,
    /// The number of dimensions of what is computed: a vector has one, a batch of vectors two.
    rank: usize,
    input: &'a str,
}

/// A policy from the bytes of a file.
///
/// # Errors
/// If the file is no model of ONNX, or its graph is not a chain of the operators that are read: with the node's name and operator.
pub fn read(bytes: &[u8], name: &str) -> Result<Network, Error> {
    let model =
        Model::decode(bytes).map_err(|error| Error::plain(format!("this is no model of ONNX: {error}")))?;
    let no_graph = || Error::plain("this is no model of ONNX: it has no graph");
    let graph = model.graph.as_ref().filter(|_| model.ir_version > 0).ok_or_else(no_graph)?;
    let (input, output) = ends(graph)?;
    let (length, rank) = vector(input, "input")?;
    let mut reader = Reader {
        values: HashMap::from([(input.name.as_str(), Value::Computed(0))]),
        steps: Vec::new(),
        length,
        rank,
        input: &input.name,
    };
    let needed = needed(graph, &output.name);
    for tensor in &graph.initializers {
        if needed.contains(tensor.name.as_str()) {
            let constant =
                constant(tensor).map_err(|text| Error::plain(format!("`{}`: {text}", tensor.name)))?;
            reader.values.insert(&tensor.name, Value::Constant(constant));
        }
    }
    for node in &graph.nodes {
        if node.outputs.iter().any(|output| needed.contains(output.as_str())) {
            reader.node(node).map_err(|text| Error::plain(format!("{}: {text}", called(node))))?;
        }
    }
    reader.finished(output, &model, name)
}

/// A node, as messages name it.
fn called(node: &Node) -> String {
    let result =
        || node.outputs.first().map_or_else(String::new, |output| format!(", which computes `{output}`"));
    match node.name.as_str() {
        "" => format!("node {}{}", node.operator, result()),
        name => format!("node `{name}` ({})", node.operator),
    }
}

fn listed<'a>(names: impl Iterator<Item = &'a str>) -> String {
    names.map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}

/// The one input and the one output. (Files of old versions list initial values among the inputs.)
fn ends(graph: &Graph) -> Result<(&ValueInfo, &ValueInfo), Error> {
    let initial: HashSet<&str> = graph.initializers.iter().map(|tensor| tensor.name.as_str()).collect();
    let inputs: Vec<&ValueInfo> =
        graph.inputs.iter().filter(|input| !initial.contains(input.name.as_str())).collect();
    let one = |ends: &[&'_ ValueInfo], what: &str| {
        let names = listed(ends.iter().map(|end| end.name.as_str()));
        Error::plain(format!(
            "a policy with one input and one output is read; this has {} {what}s ({names}). `onnx.utils.extract_model` cuts out a part",
            ends.len()
        ))
    };
    let &[input] = &inputs[..] else { return Err(one(&inputs, "input")) };
    let outputs: Vec<&ValueInfo> = graph.outputs.iter().collect();
    let &[output] = &outputs[..] else { return Err(one(&outputs, "output")) };
    Ok((input, output))
}

/// The length of a vector, if it is stated, and the number of its dimensions: [n], [1, n] or [batch, n].
fn vector(info: &ValueInfo, what: &str) -> Result<(Option<usize>, usize), Error> {
    let wrong = |text: String| Error::plain(format!("{what} `{}`: {text}", info.name));
    let tensor = info.of.as_ref().and_then(|of| of.tensor.as_ref());
    let Some(tensor) = tensor else { return Err(wrong("it is no tensor".to_owned())) };
    if ![FLOAT, DOUBLE].contains(&tensor.element) {
        return Err(wrong(format!("its elements are {}; float is read", type_name(tensor.element))));
    }
    let Some(shape) = &tensor.shape else { return Ok((None, 2)) };
    let text: Vec<String> = shape
        .dims
        .iter()
        .map(|dim| match (&dim.value, &dim.parameter) {
            (Some(value), _) => value.to_string(),
            (None, Some(name)) => name.clone(),
            (None, None) => "?".to_owned(),
        })
        .collect();
    let batch_is_one =
        shape.dims.len() == 1 || shape.dims.first().is_some_and(|dim| dim.value.is_none_or(|n| n == 1));
    if !(1..=2).contains(&shape.dims.len()) || !batch_is_one {
        return Err(wrong(format!("its shape is [{}]; a vector [n], or [1, n], is read", text.join(", "))));
    }
    let length = shape.dims.last().and_then(|dim| dim.value);
    let known = length.map(|length| {
        let length = usize::try_from(length).ok().filter(|length| (1..=MAX_NUMBERS).contains(length));
        length.ok_or_else(|| wrong(format!("its shape is [{}]", text.join(", "))))
    });
    Ok((known.transpose()?, shape.dims.len()))
}

/// A type's name, for messages.
fn type_name(number: i32) -> String {
    const NAMES: [&str; 17] = [
        "undefined",
        "float",
        "uint8",
        "int8",
        "uint16",
        "int16",
        "int32",
        "int64",
        "string",
        "bool",
        "float16",
        "double",
        "uint32",
        "uint64",
        "complex64",
        "complex128",
        "bfloat16",
    ];
    let name = usize::try_from(number).ok().and_then(|number| NAMES.get(number));
    name.map_or_else(|| format!("of type {number}"), |name| (*name).to_owned())
}

/// The names of all that an output depends on.
fn needed<'a>(graph: &'a Graph, output: &'a str) -> HashSet<&'a str> {
    let mut needed = HashSet::from([output]);
    // Each node stands behind those whose results it reads.
    for node in graph.nodes.iter().rev() {
        if node.outputs.iter().any(|output| needed.contains(output.as_str())) {
            needed.extend(node.inputs.iter().map(String::as_str));
        }
    }
    needed
}

/// The numbers of a tensor.
fn constant(tensor: &Tensor) -> Result<Constant, String> {
    if tensor.location == 1 {
        return Err("its numbers lie in another file; `onnx.save(onnx.load(\"policy.onnx\"), \"whole.onnx\")` writes one file"
            .to_owned());
    }
    let dims: Option<Vec<usize>> = tensor.dims.iter().map(|dim| usize::try_from(*dim).ok()).collect();
    let count =
        dims.as_ref().and_then(|dims| dims.iter().try_fold(1_usize, |all, dim| all.checked_mul(*dim)));
    let (Some(dims), Some(count)) = (dims, count) else {
        return Err(format!("its shape is {:?}", tensor.dims));
    };
    if count > MAX_NUMBERS {
        return Err(format!("it has {count} numbers; no machine has more than {MAX_NUMBERS} words of data"));
    }
    let raw = &tensor.raw_data;
    let values: Vec<f64> = match tensor.data_type {
        FLOAT if raw.is_empty() => tensor.float_data.iter().copied().map(f64::from).collect(),
        FLOAT => raw.as_chunks::<4>().0.iter().map(|word| f64::from(f32::from_le_bytes(*word))).collect(),
        DOUBLE if raw.is_empty() => tensor.double_data.clone(),
        DOUBLE => raw.as_chunks::<8>().0.iter().map(|word| f64::from_le_bytes(*word)).collect(),
        other => return Err(format!("its numbers are {}; float and double are read", type_name(other))),
    };
    if values.len() != count {
        return Err(format!(
            "it has {} numbers, its shape {:?} is that of {count}",
            values.len(),
            tensor.dims
        ));
    }
    // What binary32 has no number for has no place in a program.
    match values.iter().find(|value| !(**value as f32).is_finite()) {
        Some(value) => Err(format!("one of its numbers is {value}")),
        None => Ok(Constant { dims, values }),
    }
}

impl Constant {
    /// A number for each of so many elements; `None` if its shape is not that of one number or of a vector.
    fn broadcast(&self, length: usize) -> Option<Vec<f64>> {
        let last = self.dims.last().copied().unwrap_or(1);
        match self.values[..] {
            [one] => Some(vec![one; length]),
            _ if self.values.len() == length && last == length => Some(self.values.clone()),
            _ => None,
        }
    }
}

fn attribute<'a>(node: &'a Node, name: &str) -> Option<&'a Attribute> {
    node.attributes.iter().find(|attribute| attribute.name == name)
}

fn integer(node: &Node, name: &str, otherwise: i64) -> i64 {
    attribute(node, name).map_or(otherwise, |attribute| attribute.integer)
}

fn float(node: &Node, name: &str, otherwise: f64) -> f64 {
    attribute(node, name).map_or(otherwise, |attribute| f64::from(attribute.float))
}

impl<'a> Reader<'a> {
    /// Takes a node into the chain.
    fn node(&mut self, node: &'a Node) -> Result<(), String> {
        if !matches!(node.domain.as_str(), "" | "ai.onnx") {
            return Err(format!("operators of `{}` are not read", node.domain));
        }
        let [output] = &node.outputs[..] else {
            return Err(format!("it has {} results; one is read", node.outputs.len()));
        };
        if node.operator == "Constant" {
            let constant = match &node.attributes[..] {
                [Attribute { tensor: Some(tensor), .. }] => constant(tensor)?,
                [one] if one.name == "value_float" => {
                    Constant { dims: Vec::new(), values: vec![f64::from(one.float)] }
                }
                [one] if one.name == "value_floats" => Constant {
                    dims: vec![one.floats.len()],
                    values: one.floats.iter().copied().map(f64::from).collect(),
                },
                _ => return Err("its value is not an array of float".to_owned()),
            };
            self.values.insert(output, Value::Constant(constant));
            return Ok(());
        }
        let inputs = node.inputs.iter().filter(|name| !name.is_empty());
        let inputs: Vec<&Value> = inputs
            .map(|name| self.values.get(name.as_str()).ok_or_else(|| format!("nothing computes `{name}`")))
            .collect::<Result<_, _>>()?;
        let inputs: Vec<Value> = inputs.into_iter().cloned().collect();
        let known = matches!(
            node.operator.as_str(),
            "Gemm"
                | "MatMul"
                | "Add"
                | "Sub"
                | "Mul"
                | "Div"
                | "Relu"
                | "Tanh"
                | "Sigmoid"
                | "Elu"
                | "Clip"
                | "Flatten"
                | "Identity"
        );
        if !known {
            return Err(format!("this operator is not read; {OPERATORS} are"));
        }
        let computed: Vec<usize> = inputs
            .iter()
            .filter_map(|value| if let Value::Computed(at) = value { Some(*at) } else { None })
            .collect();
        match computed[..] {
            [] if node.operator == "Identity" => {
                let one = inputs.into_iter().next().ok_or("it has no operand")?;
                self.values.insert(output, one);
                return Ok(());
            }
            [] => {
                return Err(
                    "it computes a constant; let the exporter, or `onnxsim`, fold constants".to_owned()
                );
            }
            [at] if at == self.steps.len() => {}
            [_] => return Err(
                "what it reads is also read by a node before it; a chain of layers is read, without branches"
                    .to_owned(),
            ),
            _ => {
                return Err(
                    "it joins two computed values; a chain of layers is read, without branches".to_owned()
                );
            }
        }
        self.operation(node, &inputs)?;
        self.values.insert(output, Value::Computed(self.steps.len()));
        Ok(())
    }

    /// The steps of a node with one computed operand.
    fn operation(&mut self, node: &Node, inputs: &[Value]) -> Result<(), String> {
        use Value::{Computed, Constant};
        let activation = match (node.operator.as_str(), inputs) {
            ("Flatten", _) => {
                return match (self.rank, integer(node, "axis", 1)) {
                    (2, 1 | -1) => Ok(()),
                    (_, axis) => {
                        Err(format!("axis {axis} of {} dimensions: it would not be a vector", self.rank))
                    }
                };
            }
            ("Identity", _) => return Ok(()),
            ("Gemm", [Computed(_), Constant(weights), rest @ ..]) => return self.gemm(node, weights, rest),
            ("MatMul", [Computed(_), Constant(weights)]) => {
                return self.dense(weights, false, 1.0, None);
            }
            ("MatMul", [Constant(weights), Computed(_)]) if self.rank == 1 => {
                return self.dense(weights, true, 1.0, None);
            }
            ("Gemm" | "MatMul", _) => {
                return Err("the vector stands on the left, and a constant matrix on the right".to_owned());
            }
            ("Add" | "Sub" | "Mul" | "Div", [_, _]) => return self.elementwise(node, inputs),
            ("Relu", [_]) => Activation::Relu,
            ("Tanh", [_]) => Activation::Tanh,
            ("Sigmoid", [_]) => Activation::Sigmoid,
            ("Elu", [_]) => Activation::Elu(float(node, "alpha", 1.0)),
            ("Clip", [Computed(_), ..]) => clip(node, inputs)?,
            _ => return Err(format!("it has {} operands", inputs.len())),
        };
        self.steps.push(Step::Activation(activation));
        Ok(())
    }

    fn gemm(&mut self, node: &Node, weights: &Constant, rest: &[Value]) -> Result<(), String> {
        if integer(node, "transA", 0) != 0 {
            return Err("transA is set: the vector would be a column".to_owned());
        }
        let bias = match rest {
            [] => None,
            [Value::Constant(bias)] => Some(bias),
            _ => return Err("its bias is not a constant".to_owned()),
        };
        let beta = float(node, "beta", 1.0);
        let alpha = float(node, "alpha", 1.0);
        self.dense(weights, integer(node, "transB", 0) != 0, alpha, bias.map(|bias| (bias, beta)))
    }

    /// A layer of weights: a row of the matrix for each element of the vector or, if transposed, for each result.
    fn dense(
        &mut self,
        matrix: &Constant,
        transposed: bool,
        alpha: f64,
        bias: Option<(&Constant, f64)>,
    ) -> Result<(), String> {
        let &[rows, columns] = &matrix.dims[..] else {
            return Err(format!("its weights have shape {:?}; a matrix is needed", matrix.dims));
        };
        let (ins, outs) = if transposed { (columns, rows) } else { (rows, columns) };
        if ins == 0 || outs == 0 {
            return Err(format!("its weights have shape {:?}", matrix.dims));
        }
        if let Some(length) = self.length
            && length != ins
        {
            return Err(format!("its weights are those of {ins} numbers, and the vector has {length}"));
        }
        let at = |i: usize, j: usize| if transposed { i * ins + j } else { j * outs + i };
        let weights =
            (0..outs).flat_map(|i| (0..ins).map(move |j| alpha * matrix.values[at(i, j)])).collect();
        let bias = match bias {
            None => vec![0.0; outs],
            Some((bias, beta)) => {
                let wrong = || format!("its bias has shape {:?}, and it has {outs} results", bias.dims);
                bias.broadcast(outs).ok_or_else(wrong)?.into_iter().map(|value| beta * value).collect()
            }
        };
        if self.length.is_none() {
            self.length_is(ins)?;
        }
        self.length = Some(outs);
        self.steps.push(Step::Dense { weights, bias });
        Ok(())
    }

    /// Learns the length of the vector from the first matrix; steps before it had no length.
    fn length_is(&mut self, length: usize) -> Result<(), String> {
        self.length = Some(length);
        for step in &mut self.steps {
            if let Step::Add(by) | Step::Multiply(by) | Step::Divide(by) = step {
                match by[..] {
                    [one] => *by = vec![one; length],
                    _ if by.len() == length => {}
                    _ => {
                        return Err(format!(
                            "constants of {} numbers stand before it, and the vector has {length}",
                            by.len()
                        ));
                    }
                }
            }
        }
        Ok(())
    }

    fn elementwise(&mut self, node: &Node, inputs: &[Value]) -> Result<(), String> {
        let (by, behind) = match inputs {
            [Value::Computed(_), Value::Constant(by)] => (by, false),
            [Value::Constant(by), Value::Computed(_)] => (by, true),
            _ => return Err("one of its operands is a constant".to_owned()),
        };
        let length = self.length.unwrap_or(by.values.len());
        let shape = || format!("its constant has shape {:?}, and the vector has {length} numbers", by.dims);
        let by = by.broadcast(length).ok_or_else(shape)?;
        match (node.operator.as_str(), behind) {
            ("Add", _) => self.steps.push(Step::Add(by)),
            ("Mul", _) => self.steps.push(Step::Multiply(by)),
            ("Sub", false) => self.steps.push(Step::Add(by.into_iter().map(|by| -by).collect())),
            ("Sub", true) => {
                self.steps.push(Step::Multiply(vec![-1.0; length]));
                self.steps.push(Step::Add(by));
            }
            (_, false) if by.contains(&0.0) => return Err("it divides by zero".to_owned()),
            (_, false) => self.steps.push(Step::Divide(by)),
            (_, true) => return Err("it divides by what is computed; constants divide".to_owned()),
        }
        Ok(())
    }

    fn finished(self, output: &ValueInfo, model: &Model, name: &str) -> Result<Network, Error> {
        if !matches!(self.values.get(output.name.as_str()), Some(Value::Computed(at)) if *at == self.steps.len())
        {
            return Err(Error::plain(format!(
                "output `{}` is not the end of the chain of layers",
                output.name
            )));
        }
        let ins = self.steps.iter().find_map(|step| match step {
            Step::Dense { weights, bias } => Some(weights.len() / bias.len()),
            _ => None,
        });
        let (Some(ins), Some(outs)) = (ins, self.length) else {
            return Err(Error::plain("it has no layer of weights (Gemm, MatMul)"));
        };
        let text = [&model.producer, &model.producer_version].map(|text| text.trim().to_owned()).join(" ");
        let notes =
            if text.trim().is_empty() { Vec::new() } else { vec![format!("written by {}", text.trim())] };
        Ok(Network {
            name: name.to_owned(),
            input: Vector { name: self.input.to_owned(), length: ins },
            output: Vector { name: output.name.clone(), length: outs },
            steps: self.steps,
            notes,
            exact: true,
        })
    }
}

/// The bounds of a `Clip`: operands, or in old files attributes.
fn clip(node: &Node, inputs: &[Value]) -> Result<Activation, String> {
    let mut bounds = [float(node, "min", f64::from(f32::MIN)), float(node, "max", f64::from(f32::MAX))];
    // The operand that is left out has an empty name.
    let mut rest = inputs[1..].iter();
    for (bound, name) in bounds.iter_mut().zip(node.inputs.iter().skip(1)) {
        if name.is_empty() {
            continue;
        }
        match rest.next() {
            Some(Value::Constant(Constant { values, .. })) if values.len() == 1 => *bound = values[0],
            _ => return Err("its bounds are not constants, one number each".to_owned()),
        }
    }
    Ok(Activation::Clip(bounds[0], bounds[1]))
}

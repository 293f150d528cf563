// SPDX-License-Identifier: MIT OR Apache-2.0
//! Reads an ONNX file into steps.

use super::functions::{self, Function, REWRITES};
use super::moves::{self, Operands, attribute};
use super::onnx::{Graph, Model, Node, Tensor, ValueInfo};
use super::operators::REFUSED;
use super::tensor::{BOOL, Element, FLOAT, Files, LONG, Value, broadcast, constant, is_float, type_name};
use super::{MAX_NUMBERS, Network, Operand, Step, Vector, expression};
use crate::Error;
use crate::graph::{Graph as Expressions, evaluate};
use prost::Message;
use std::collections::{HashMap, HashSet};
use std::rc::Rc;

/// Maximum length of a file, in bytes.
pub const MAX_BYTES: usize = 64 << 20;

/// State of the reader.
pub(super) struct Reader<'a> {
    constants: HashMap<&'a str, &'a Tensor>,
    values: HashMap<&'a str, Rc<Value>>,
    files: Files<'a>,
    steps: Vec<Step>,
    lengths: Vec<usize>,
}

/// Reads a policy from the bytes of a file. `output` selects one of several outputs; without it, exactly one may depend on the input.
/// `files` reads files in the model's folder.
///
/// # Errors
/// If the file is not an ONNX model, or its graph has an unsupported operator: with the node's name and operator.
pub fn read(bytes: &[u8], name: &str, output: Option<&str>, files: Files<'_>) -> Result<Network, Error> {
    let model =
        Model::decode(bytes).map_err(|error| Error::plain(format!("this is not an ONNX model: {error}")))?;
    let no_graph = || Error::plain("this is not an ONNX model: it has no graph");
    let graph = model.graph.as_ref().filter(|_| model.ir_version > 0).ok_or_else(no_graph)?;
    let mut notes = Vec::new();
    let made_by = [&model.producer, &model.producer_version].map(|text| text.trim()).join(" ");
    if !made_by.trim().is_empty() {
        notes.push(format!("written by {}", made_by.trim()));
    }
    let (input, output) = ends(graph, output, &mut notes)?;
    let needed = needed(graph, &output.name);
    let nodes: Vec<&Node> = graph
        .nodes
        .iter()
        .filter(|node| node.outputs.iter().any(|name| needed.contains(name.as_str())))
        .collect();
    let dims = shape(input, &nodes, graph, files, &mut notes)?;
    let mut reader = Reader::new(graph, files);
    let length = dims.iter().product();
    reader.push(Step::Input, length).map_err(Error::plain)?;
    reader.values.insert(&input.name, Rc::new(Value::computed(dims, 0, FLOAT)));
    for node in nodes {
        reader.node(node).map_err(|text| Error::plain(format!("{}: {text}", called(node))))?;
    }
    let wrong = |text: String| Error::plain(format!("output `{}`: {text}", output.name));
    let value = reader.value(&output.name).map_err(wrong)?;
    if value.is_constant() {
        return Err(wrong("it does not depend on the input".to_owned()));
    }
    let mut result = reader.all(value.elements.clone()).map_err(wrong)?;
    if result == 0 {
        result = reader.push(Step::Gather(value.elements.clone()), length).map_err(wrong)?;
    }
    Ok(Network {
        name: name.to_owned(),
        input: Vector { name: input.name.clone(), length },
        output: Vector { name: output.name.clone(), length: reader.lengths[result] },
        steps: reader.steps,
        lengths: reader.lengths,
        result,
        notes,
        exact: true,
    })
}

/// Name of a node in messages.
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

/// Finds the only input and the only output. (Files of old versions list initial values among the inputs.)
fn ends<'a>(
    graph: &'a Graph,
    wanted: Option<&str>,
    notes: &mut Vec<String>,
) -> Result<(&'a ValueInfo, &'a ValueInfo), Error> {
    let initial: HashSet<&str> = graph.initializers.iter().map(|tensor| tensor.name.as_str()).collect();
    let inputs: Vec<&ValueInfo> =
        graph.inputs.iter().filter(|input| !initial.contains(input.name.as_str())).collect();
    let read_by = |output: &ValueInfo| -> Vec<&'a ValueInfo> {
        let needed = needed(graph, &output.name);
        inputs.iter().copied().filter(|input| needed.contains(input.name.as_str())).collect()
    };
    let names = || listed(graph.outputs.iter().map(|output| output.name.as_str()));
    let mut candidates: Vec<&ValueInfo> = graph.outputs.iter().collect();
    match wanted {
        Some(wanted) => {
            candidates.retain(|output| output.name == wanted);
            if candidates.is_empty() {
                return Err(Error::plain(format!(
                    "it has no output `{wanted}`; its outputs are {}",
                    names()
                )));
            }
        }
        None if candidates.len() > 1 => candidates.retain(|output| !read_by(output).is_empty()),
        None => {}
    }
    let &[output] = &candidates[..] else {
        return Err(Error::plain(format!(
            "expected one output that depends on the input, found {} ({}): name one of them",
            candidates.len(),
            listed(candidates.iter().map(|output| output.name.as_str()))
        )));
    };
    let read = read_by(output);
    let &[input] = &read[..] else {
        return Err(Error::plain(format!(
            "expected one input, but output `{}` depends on {} ({}). `onnx.utils.extract_model` cuts out a part",
            output.name,
            read.len(),
            listed(read.iter().map(|input| input.name.as_str()))
        )));
    };
    let passed = |all: &[&ValueInfo], taken: &ValueInfo, what: &str, notes: &mut Vec<String>| {
        let rest: Vec<&str> =
            all.iter().map(|info| info.name.as_str()).filter(|name| *name != taken.name).collect();
        if !rest.is_empty() {
            notes.push(format!("passed over: {what} {}", listed(rest.into_iter())));
        }
    };
    passed(&inputs, input, "input", notes);
    passed(&graph.outputs.iter().collect::<Vec<_>>(), output, "output", notes);
    Ok((input, output))
}

/// Shape of the input, with a batch of 1.
fn shape(
    input: &ValueInfo,
    nodes: &[&Node],
    graph: &Graph,
    files: Files<'_>,
    notes: &mut Vec<String>,
) -> Result<Vec<usize>, Error> {
    let wrong = |text: String| Error::plain(format!("input `{}`: {text}", input.name));
    let tensor = input.of.as_ref().and_then(|of| of.tensor.as_ref());
    let Some(tensor) = tensor else { return Err(wrong("it is not a tensor".to_owned())) };
    if !is_float(tensor.element) {
        return Err(wrong(format!("its elements are {}; expected float", type_name(tensor.element))));
    }
    if tensor.element != FLOAT {
        let kind = type_name(tensor.element);
        notes.push(format!("computed in binary32; the file's numbers are {kind}"));
    }
    let stated: Vec<Option<i64>> = match &tensor.shape {
        Some(shape) => shape.dims.iter().map(|dim| dim.value).collect(),
        None => vec![None, None],
    };
    let text = || {
        let dims: Vec<String> =
            stated.iter().map(|dim| dim.map_or_else(|| "?".to_owned(), |dim| dim.to_string())).collect();
        format!("its shape is [{}]", dims.join(", "))
    };
    if stated.len() > 1 && stated[0].is_some_and(|batch| batch != 1) || stated.is_empty() {
        return Err(wrong(format!("{}; expected a vector [n], or a batch of one [1, n]", text())));
    }
    let last = stated.len() - 1;
    let mut dims = Vec::new();
    for (axis, dim) in stated.iter().enumerate() {
        dims.push(match dim {
            None if axis == last => Reader::new(graph, files).length_by_layers(nodes).ok_or_else(|| {
                wrong(format!("{}: its length is not stated, and no layer determines it", text()))
            })?,
            None => 1,
            Some(dim) => usize::try_from(*dim)
                .ok()
                .filter(|dim| (1..=MAX_NUMBERS).contains(dim))
                .ok_or_else(|| wrong(text()))?,
        });
    }
    super::tensor::count(&dims).map_err(wrong)?;
    Ok(dims)
}

/// Names of all values on which an output depends.
fn needed<'a>(graph: &'a Graph, output: &'a str) -> HashSet<&'a str> {
    let mut needed = HashSet::from([output]);
    // Nodes are in topological order, so one pass backwards suffices.
    for node in graph.nodes.iter().rev() {
        if node.outputs.iter().any(|output| needed.contains(output.as_str())) {
            needed.extend(node.inputs.iter().map(String::as_str));
        }
    }
    needed
}

impl<'a> Reader<'a> {
    fn new(graph: &'a Graph, files: Files<'a>) -> Reader<'a> {
        let constants = graph.initializers.iter().map(|tensor| (tensor.name.as_str(), tensor)).collect();
        Reader { constants, values: HashMap::new(), files, steps: Vec::new(), lengths: Vec::new() }
    }

    /// Length of the first layer's vector, if the input states no length.
    fn length_by_layers(&mut self, nodes: &[&'a Node]) -> Option<usize> {
        for node in nodes {
            if let ("Gemm" | "MatMul", [vector, matrix, ..]) = (node.operator.as_str(), &node.inputs[..])
                && self.value(vector).is_err()
                && let Ok(matrix) = self.value(matrix)
                && let [rows, columns] = matrix.dims[..]
            {
                let transposed = moves::integer(node, "transB", 0) != 0;
                return Some(if transposed { columns } else { rows }).filter(|length| *length > 0);
            }
            // Nodes that do not depend on the input yield constants; errors of other nodes are expected here.
            let _ = self.node(node);
        }
        None
    }

    fn value(&mut self, name: &str) -> Result<Rc<Value>, String> {
        if let Some(value) = self.values.get(name) {
            return Ok(Rc::clone(value));
        }
        let Some((name, tensor)) = self.constants.get_key_value(name) else {
            return Err(format!("nothing computes `{name}`"));
        };
        let value =
            Rc::new(constant(tensor, self.files).map_err(|text| format!("its constant `{name}`: {text}"))?);
        self.values.insert(name, Rc::clone(&value));
        Ok(value)
    }

    /// Adds a node's results.
    fn node(&mut self, node: &'a Node) -> Result<(), String> {
        let is_microsoft =
            node.domain == "com.microsoft" && matches!(node.operator.as_str(), "Gelu" | "FastGelu");
        if !matches!(node.domain.as_str(), "" | "ai.onnx") && !is_microsoft {
            return Err(format!(
                "operators of `{}` are not supported; `onnx.inliner.inline_local_functions` turns functions into operators of ONNX",
                node.domain
            ));
        }
        let mut inputs = Vec::new();
        for name in &node.inputs {
            inputs.push(if name.is_empty() { None } else { Some(self.value(name)?) });
        }
        let inputs: Vec<Option<&Value>> = inputs.iter().map(Option::as_deref).collect();
        let results = self.results(node, &inputs)?;
        for (name, value) in node.outputs.iter().zip(results) {
            self.values.insert(name, Rc::new(value));
        }
        Ok(())
    }

    fn results(&mut self, node: &'a Node, inputs: &Operands<'_>) -> Result<Vec<Value>, String> {
        if node.operator == "Constant" {
            return Ok(vec![self.stated(node)?]);
        }
        if let Some(results) = moves::moved(node, inputs)? {
            return Ok(results);
        }
        if let Some(result) = self.operator(node, inputs)? {
            return Ok(vec![result]);
        }
        let Some(function) = function(node)? else {
            return Err(match REFUSED.iter().find(|(name, _)| *name == node.operator) {
                Some((_, reason)) => format!("this operator is not supported: {reason}"),
                None => "this operator is not supported; docs/readers.md lists the supported ones".to_owned(),
            });
        };
        let parameter = |(name, otherwise): &(&str, f64)| {
            attribute(node, name).map_or(*otherwise, |attribute| f64::from(attribute.float))
        };
        let parameters = function.parameters.iter().map(parameter).collect();
        let clip = clip(node, inputs);
        let operands: Vec<&Value> = match &clip {
            Some(bounds) if !inputs.is_empty() => {
                inputs[..1].iter().copied().flatten().chain(bounds).collect()
            }
            _ => inputs.iter().copied().flatten().collect(),
        };
        Ok(vec![self.elementwise(function, parameters, &operands)?])
    }

    /// Value of a `Constant` node.
    fn stated(&self, node: &Node) -> Result<Value, String> {
        let [attribute] = &node.attributes[..] else { return Err("it needs exactly one value".to_owned()) };
        let floats = || attribute.floats.iter().copied().map(f64::from);
        let whole = || attribute.integers.iter().map(|value| *value as f64);
        Ok(match (attribute.name.as_str(), &attribute.tensor) {
            ("value", Some(tensor)) => return constant(tensor, self.files),
            ("value_float", _) => Value::new(Vec::new(), [f64::from(attribute.float)], FLOAT),
            ("value_floats", _) => Value::new(vec![attribute.floats.len()], floats(), FLOAT),
            ("value_int", _) => Value::new(Vec::new(), [attribute.integer as f64], LONG),
            ("value_ints", _) => Value::new(vec![attribute.integers.len()], whole(), LONG),
            _ => return Err("its value is not an array of numbers".to_owned()),
        })
    }

    /// Adds a step; an error if a constant exceeds binary32's range.
    pub(super) fn push(&mut self, step: Step, length: usize) -> Result<usize, String> {
        let finite = |values: &[f64]| values.iter().copied().find(|value| !(*value as f32).is_finite());
        let wrong = match &step {
            Step::Dense { weights, bias, .. } => finite(weights).or(finite(bias)),
            Step::Each { operands, .. } => operands.iter().find_map(|operand| match operand {
                Operand::Numbers(values) => finite(values),
                _ => None,
            }),
            _ => None,
        };
        // A program stores constants as binary32.
        if let Some(value) = wrong {
            return Err(format!("one of its constants is {value}; constants must be finite"));
        }
        super::tensor::count(&[length])?;
        self.steps.push(step);
        self.lengths.push(length);
        Ok(self.steps.len() - 1)
    }

    /// A vector and the index from which on it holds these elements; gathers them into a new vector if they are not adjacent.
    pub(super) fn stretch(&mut self, elements: Vec<Element>) -> Result<(usize, usize), String> {
        if let Some(Element::Of { vector, at }) = elements.first().copied() {
            let next =
                |(index, element): (usize, &Element)| *element == Element::Of { vector, at: at + index };
            if elements.iter().enumerate().all(next) {
                return Ok((vector, at));
            }
        }
        let length = elements.len();
        Ok((self.push(Step::Gather(elements), length)?, 0))
    }

    /// A vector that holds exactly these elements.
    pub(super) fn all(&mut self, elements: Vec<Element>) -> Result<usize, String> {
        let length = elements.len();
        let (vector, first) = self.stretch(elements)?;
        if first == 0 && self.lengths[vector] == length {
            return Ok(vector);
        }
        let elements = (first..first + length).map(|at| Element::Of { vector, at }).collect();
        self.push(Step::Gather(elements), length)
    }

    fn operand(&mut self, value: Value) -> Result<Operand, String> {
        if let Some(numbers) = value.numbers() {
            return Ok(Operand::Numbers(numbers));
        }
        if let [Element::Of { vector, at }, ..] = value.elements[..]
            && value.elements.iter().all(|element| *element == value.elements[0])
            && value.elements.len() > 1
        {
            return Ok(Operand::One { vector, at });
        }
        let (vector, first) = self.stretch(value.elements)?;
        Ok(Operand::Vector { vector, first })
    }

    /// Applies an elementwise function, with broadcasting.
    pub(super) fn elementwise(
        &mut self,
        function: &'static Function,
        parameters: Vec<f64>,
        operands: &[&Value],
    ) -> Result<Value, String> {
        let (least, most) = function.operands;
        if !(least..=most).contains(&operands.len()) {
            return Err(format!("it has {} operands; expected {least} to {most}", operands.len()));
        }
        let dims = broadcast(operands.iter().map(|operand| &operand.dims[..]))?;
        let length = dims.iter().product();
        let kind = match function.name {
            "Less" | "LessOrEqual" | "Greater" | "GreaterOrEqual" | "Equal" | "Not" | "And" | "Or" => BOOL,
            "Where" => operands[1].kind,
            _ => operands[0].kind,
        };
        if function.name == "Div" && operands[1].numbers().is_some_and(|by| by.contains(&0.0)) {
            return Err("it divides by zero".to_owned());
        }
        let constant = operands.iter().all(|operand| operand.is_constant());
        let mut of = Vec::new();
        for operand in operands {
            let spread = operand.spread(&dims)?;
            of.push(self.operand(bounded(function, spread))?);
        }
        if !constant {
            let vector = self.push(Step::Each { function, parameters, operands: of }, length)?;
            return Ok(Value::computed(dims, vector, kind));
        }
        let graph = Expressions::new(REWRITES);
        let result = expression(&graph, function, &parameters, &of).id();
        let truncates = function.name == "Div" && !is_float(kind);
        let value = |at: usize| {
            let number =
                |operand: &Operand| if let Operand::Numbers(values) = operand { values[at] } else { 0.0 };
            let inputs: Vec<f64> = of.iter().map(number).collect();
            let value = evaluate(&graph, &[result], &inputs)[0];
            if truncates { value.trunc() } else { value }
        };
        Ok(Value::new(dims, (0..length).map(value), kind))
    }
}

/// Replaces infinite bounds by the largest finite binary32 numbers.
fn bounded(function: &Function, mut value: Value) -> Value {
    if matches!(function.name, "Clip" | "Min" | "Max") {
        for element in &mut value.elements {
            if let Element::Number(number) = element {
                *number = number.clamp(f64::from(f32::MIN), f64::from(f32::MAX));
            }
        }
    }
    value
}

/// Elementwise function that a node applies, if any.
fn function(node: &Node) -> Result<Option<&'static Function>, String> {
    let approximate = attribute(node, "approximate").map_or(&b"none"[..], |attribute| &attribute.text);
    Ok(functions::find(match (node.operator.as_str(), approximate) {
        ("Gelu", b"tanh") | ("FastGelu", _) => "Gelu tanh",
        ("Gelu", b"none") => "Gelu",
        ("Gelu", other) => return Err(format!("its `approximate` is `{}`", String::from_utf8_lossy(other))),
        (name, _) => name,
    }))
}

/// Bounds of a `Clip`, with defaults: operands, or attributes in old files.
fn clip(node: &Node, inputs: &Operands<'_>) -> Option<[Value; 2]> {
    let bound = |position: usize, name: &str, otherwise: f32| {
        let stated = attribute(node, name).map_or(otherwise, |attribute| attribute.float);
        let stated = Value::new(Vec::new(), [f64::from(stated)], FLOAT);
        inputs.get(position).copied().flatten().cloned().unwrap_or(stated)
    };
    (node.operator == "Clip").then(|| [bound(1, "min", f32::MIN), bound(2, "max", f32::MAX)])
}

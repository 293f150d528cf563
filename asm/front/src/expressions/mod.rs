// SPDX-License-Identifier: MIT OR Apache-2.0
//! Expressions of other tools: a list of scalar instructions as JSON, which the Python module `takt_expressions` writes from CasADi
//! functions and SymPy expressions. docs/model.md has the format.

mod operations;

pub use operations::{OPERATIONS, Operation, REFUSED};

use crate::Error;
use crate::graph::{Array, Function, Port};
use crate::graph::{Expr, Graph, Id, Rewrites};
use serde::Deserialize;
use std::collections::HashMap;

/// The format's name and version, the value of its field `format`.
pub const FORMAT: &str = "takt-expressions 1";
/// Maximum length of a file, in bytes.
pub const MAX_BYTES: usize = 64 << 20;
/// Maximum number of scalars of an argument, and of scalar inputs of a function.
pub const MAX_PORTS: usize = 65_536;
/// Largest whole exponent of a power that is written as products.
pub const MAX_POWER: f64 = 64.0;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: String,
    name: String,
    #[serde(default)]
    source: String,
    /// Assumptions of the exporting tool, as sentences.
    #[serde(default)]
    notes: Vec<String>,
    inputs: Vec<Argument>,
    outputs: Vec<Argument>,
    code: Vec<Step>,
}

/// An input or output: a matrix.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Argument {
    name: String,
    rows: usize,
    columns: usize,
    /// Row and column of each scalar, from 0; if absent, the matrix is dense, in column-major order.
    #[serde(default)]
    nonzeros: Option<Vec<[usize; 2]>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Step {
    op: String,
    /// Place that the step writes.
    #[serde(default)]
    to: usize,
    /// Places that the step reads.
    #[serde(default)]
    of: Vec<usize>,
    #[serde(default)]
    value: Option<f64>,
    /// For `input` and `output`: index of the argument, and of the scalar within it.
    #[serde(default)]
    port: Option<[usize; 2]>,
}

impl Argument {
    /// Row and column of each scalar.
    fn places(&self) -> Vec<[usize; 2]> {
        let dense = || (0..self.columns).flat_map(|j| (0..self.rows).map(move |i| [i, j])).collect();
        self.nonzeros.clone().unwrap_or_else(dense)
    }

    /// The argument as an array whose first scalar is port `first`. [`Argument::ports`] has checked that rows and columns lie within it.
    fn array(&self, first: usize) -> Array {
        let shape = match (self.rows, self.columns) {
            (1, 1) => Vec::new(),
            (count, 1) | (1, count) => vec![count],
            (rows, columns) => vec![rows, columns],
        };
        let mut elements = vec![None; self.rows * self.columns];
        for (number, [i, j]) in self.places().into_iter().enumerate() {
            elements[i * self.columns + j] = Some(first + number);
        }
        Array { name: self.name.clone(), shape, elements }
    }

    fn ports(&self) -> Result<Vec<Port>, Error> {
        let wrong = |text: String| Error::plain(format!("`{}`: {text}", self.name));
        if self.rows.saturating_mul(self.columns) > MAX_PORTS {
            return Err(wrong(format!("{} by {} is more than {MAX_PORTS} scalars", self.rows, self.columns)));
        }
        let plain: String =
            self.name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
        let plain = if plain.starts_with(|c: char| c.is_ascii_digit()) || plain.is_empty() {
            format!("_{plain}")
        } else {
            plain
        };
        let port = |[i, j]: [usize; 2]| {
            if i >= self.rows || j >= self.columns {
                return Err(wrong(format!("({i}, {j}) lies outside {} by {}", self.rows, self.columns)));
            }
            let (name, text) = match (self.rows, self.columns) {
                (1, 1) => (plain.clone(), self.name.clone()),
                (_, 1) => (format!("{plain}_{}", i + 1), format!("{}[{i}]", self.name)),
                (1, _) => (format!("{plain}_{}", j + 1), format!("{}[{j}]", self.name)),
                _ => (format!("{plain}_{}_{}", i + 1, j + 1), format!("{}[{i}, {j}]", self.name)),
            };
            Ok(Port::new(name, text))
        };
        self.places().into_iter().map(port).collect()
    }
}

/// Reads a function from the JSON text of an instruction list.
///
/// # Errors
/// If the text is not an instruction list, or an operation has no meaning here; with the line.
pub fn read(source: &str, rewrites: Rewrites) -> Result<Function, Error> {
    if source.len() > MAX_BYTES {
        return Err(Error::plain(format!("the file is longer than {} MiB", MAX_BYTES >> 20)));
    }
    let file: File = serde_json::from_str(source).map_err(|error| {
        let text = error.to_string();
        let text = text.rsplit_once(" at line").map_or(text.as_str(), |(text, _)| text);
        Error::on(error.line(), format!("this is not a list of instructions: {text}"))
    })?;
    if file.format != FORMAT {
        return Err(Error::plain(format!("unknown format `{}`; expected `{FORMAT}`", file.format)));
    }
    let mut ports = Vec::new();
    let mut first = Vec::new();
    for argument in &file.inputs {
        first.push(ports.len());
        ports.extend(argument.ports()?);
        if ports.len() > MAX_PORTS {
            return Err(Error::plain(format!("more than {MAX_PORTS} scalar inputs")));
        }
    }
    first.push(ports.len());
    let starts = first.clone();
    let outputs = file.outputs.iter().map(Argument::ports).collect::<Result<Vec<_>, _>>()?;
    let graph = Graph::new(rewrites);
    let (nodes, notes) = {
        let mut reader = Reader {
            graph: &graph,
            first,
            names: &ports,
            places: HashMap::new(),
            outputs: HashMap::new(),
            notes: file.notes,
        };
        for (number, step) in file.code.iter().enumerate() {
            reader.step(step).map_err(|text| match line_of(source, number) {
                Some(line) => Error::on(line, text),
                None => Error::plain(text),
            })?;
        }
        (reader.outputs, reader.notes)
    };
    let nothing = graph.constant(0.0).id();
    let input_arrays = file.inputs.iter().zip(&starts).map(|(input, first)| input.array(*first)).collect();
    let mut output_arrays = Vec::new();
    let mut named = Vec::new();
    for (i, ports) in outputs.into_iter().enumerate() {
        output_arrays.push(file.outputs[i].array(named.len()));
        for (k, port) in ports.into_iter().enumerate() {
            // An entry that a sparse function does not write is zero.
            named.push((port, nodes.get(&[i, k]).copied().unwrap_or(nothing)));
        }
    }
    unique(ports.iter().chain(named.iter().map(|(port, _)| port)))?;
    let from = if file.source.is_empty() { String::new() } else { format!(", from {}", file.source) };
    let title = format!("{}{from}", file.name);
    Ok(Function { title, notes, input_arrays, output_arrays, ..Function::new(graph, ports, named) })
}

fn unique<'a>(ports: impl Iterator<Item = &'a Port>) -> Result<(), Error> {
    let mut names = std::collections::HashSet::new();
    for port in ports {
        if !names.insert(&port.name) {
            let text = format!("two inputs or outputs would be the port `{}`: rename one", port.name);
            return Err(Error::plain(text));
        }
    }
    Ok(())
}

/// Line of a step, found by its field `op`.
fn line_of(source: &str, number: usize) -> Option<usize> {
    let at = source.match_indices("\"op\"").nth(number)?.0;
    Some(1 + source[..at].matches('\n').count())
}

struct Reader<'g> {
    graph: &'g Graph,
    /// Port number of the first scalar of each input, then the number of all.
    first: Vec<usize>,
    names: &'g [Port],
    /// Value of each place that was written.
    places: HashMap<usize, Expr<'g>>,
    outputs: HashMap<[usize; 2], Id>,
    /// Comment lines for the head of the source.
    notes: Vec<String>,
}

impl<'g> Reader<'g> {
    fn step(&mut self, step: &Step) -> Result<(), String> {
        let op = step.op.as_str();
        let mut operands = Vec::new();
        for place in &step.of {
            let value = self.places.get(place).copied();
            operands.push(value.ok_or_else(|| format!("`{op}` reads place {place}, which nothing wrote"))?);
        }
        let port = || step.port.ok_or_else(|| format!("`{op}` has no `port`"));
        let value = match op {
            "input" => {
                let [i, k] = port()?;
                let index = self.first.get(i).map(|first| first.saturating_add(k));
                let index = index.filter(|index| self.first.get(i + 1).is_some_and(|end| index < end));
                self.graph.input(index.ok_or_else(|| format!("there is no input {i} with a scalar {k}"))?)
            }
            "output" => {
                let [value] = operands[..] else { return Err("`output` has one operand".to_owned()) };
                self.outputs.insert(port()?, value.id());
                return Ok(());
            }
            "const" => {
                let value = step.value.ok_or("`const` has no `value`")?;
                self.graph.constant(value)
            }
            _ => self.operation(op, &operands)?,
        };
        self.places.insert(step.to, value);
        Ok(())
    }

    /// Translates an operation of another tool.
    fn operation(&mut self, op: &str, operands: &[Expr<'g>]) -> Result<Expr<'g>, String> {
        let Some(row) = OPERATIONS.iter().find(|row| row.names.contains(&op)) else {
            return Err(self.unknown(op, operands));
        };
        let (least, most) = row.operands;
        if !(least..=most).contains(&operands.len()) {
            let count = if least == most { least.to_string() } else { format!("{least} to {most}") };
            return Err(format!("`{op}` has {} operands; it takes {count}", operands.len()));
        }
        if let Some(note) = row.note
            && !self.notes.iter().any(|known| known == note)
        {
            self.notes.push(note.to_owned());
        }
        Ok((row.meaning)(operands))
    }

    fn unknown(&self, op: &str, operands: &[Expr<'g>]) -> String {
        let function = |expr: &Expr<'g>| crate::sink::expression(self.graph, self.names, expr.id());
        let operands: Vec<String> = operands.iter().map(function).collect();
        let place = format!("operation `{op}` is not supported; in `{op}({})`", operands.join(", "));
        match REFUSED.iter().find(|(name, _)| *name == op) {
            Some((_, mend)) => format!("{place}: {mend}"),
            None => place,
        }
    }
}

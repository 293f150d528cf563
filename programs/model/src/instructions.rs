// SPDX-License-Identifier: MIT OR Apache-2.0
//! Other tools' expressions: a list of scalar instructions as JSON, which the Python module `takt_expressions` writes from
//! CasADi functions and SymPy expressions. docs/model.md has the format.

use crate::Error;
use crate::functions::{Array, Function, Port};
use crate::graph::{Binary, Expr, Graph, Id, Rewrites, Unary};
use serde::Deserialize;
use std::collections::HashMap;

/// The format's name and version, the value of its field `format`.
pub const FORMAT: &str = "takt-expressions 1";
/// The longest file that is read, bytes.
pub const MAX_BYTES: usize = 64 << 20;
/// The most scalar inputs and outputs that are named.
pub const MAX_PORTS: usize = 65_536;
/// The largest whole power that is made of products.
pub const MAX_POWER: f64 = 64.0;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: String,
    name: String,
    #[serde(default)]
    source: String,
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
    /// Row and column of each scalar that it has, from 0; by columns, if not given.
    #[serde(default)]
    nonzeros: Option<Vec<[usize; 2]>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Step {
    op: String,
    /// The place that is written.
    #[serde(default)]
    to: usize,
    /// The places that are read.
    #[serde(default)]
    of: Vec<usize>,
    #[serde(default)]
    value: Option<f64>,
    /// Of an input or output: which, and which of its scalars.
    #[serde(default)]
    port: Option<[usize; 2]>,
}

impl Argument {
    /// Row and column of each scalar.
    fn places(&self) -> Vec<[usize; 2]> {
        let dense = || (0..self.columns).flat_map(|j| (0..self.rows).map(move |i| [i, j])).collect();
        self.nonzeros.clone().unwrap_or_else(dense)
    }

    /// The array that it is, whose ports begin with that number. (Its ports are known to lie within it.)
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
            Ok(Port { name, text })
        };
        self.places().into_iter().map(port).collect()
    }
}

/// A function from the JSON text of an instruction list.
///
/// # Errors
/// If it is not one, or has an operation without a meaning here, with the line.
pub fn read(source: &str, rewrites: Rewrites) -> Result<Function, Error> {
    if source.len() > MAX_BYTES {
        return Err(Error::plain(format!("the file is longer than {} MiB", MAX_BYTES >> 20)));
    }
    let file: File = serde_json::from_str(source).map_err(|error| {
        let text = error.to_string();
        let text = text.rsplit_once(" at line").map_or(text.as_str(), |(text, _)| text);
        Error::on(error.line(), format!("this is no list of instructions: {text}"))
    })?;
    if file.format != FORMAT {
        return Err(Error::plain(format!("its format is `{}`; `{FORMAT}` is known", file.format)));
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
    let nodes = {
        let mut reader =
            Reader { graph: &graph, first, names: &ports, places: HashMap::new(), outputs: HashMap::new() };
        for (number, step) in file.code.iter().enumerate() {
            reader.step(step).map_err(|text| match line_of(source, number) {
                Some(line) => Error::on(line, text),
                None => Error::plain(text),
            })?;
        }
        reader.outputs
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
    Ok(Function {
        title,
        notes: Vec::new(),
        inputs: ports,
        outputs: named,
        input_arrays,
        output_arrays,
        graph,
    })
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

/// The line of a step: that of its field `op`.
fn line_of(source: &str, number: usize) -> Option<usize> {
    let at = source.match_indices("\"op\"").nth(number)?.0;
    Some(1 + source[..at].matches('\n').count())
}

struct Reader<'g> {
    graph: &'g Graph,
    /// The first scalar of each input.
    first: Vec<usize>,
    names: &'g [Port],
    /// The values in the places.
    places: HashMap<usize, Expr<'g>>,
    outputs: HashMap<[usize; 2], Id>,
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

    /// The operation for one of another tool; the names are CasADi's.
    fn operation(&self, op: &str, operands: &[Expr<'g>]) -> Result<Expr<'g>, String> {
        let number = |value: f64| self.graph.constant(value);
        let truth = |condition: Expr<'g>| condition.select(number(1.0), number(0.0));
        let holds = |a: Expr<'g>| a.binary(Binary::NotEqual, number(0.0));
        Ok(match (op, operands) {
            ("assign" | "lift", &[a, ..]) => a,
            ("add", &[a, b]) => a + b,
            ("sub", &[a, b]) => a - b,
            ("mul", &[a, b]) => a * b,
            ("div", &[a, b]) => a / b,
            ("neg", &[a]) => -a,
            ("sq", &[a]) => a * a,
            ("twice", &[a]) => 2.0 * a,
            ("inv", &[a]) => number(1.0) / a,
            ("sqrt", &[a]) => a.sqrt(),
            ("sin", &[a]) => a.sin(),
            ("cos", &[a]) => a.cos(),
            ("tan", &[a]) => a.unary(Unary::Tan),
            ("asin", &[a]) => a.unary(Unary::Asin),
            ("acos", &[a]) => a.unary(Unary::Acos),
            ("atan", &[a]) => a.unary(Unary::Atan),
            ("exp", &[a]) => a.unary(Unary::Exp),
            ("log", &[a]) => a.unary(Unary::Log),
            ("tanh", &[a]) => a.unary(Unary::Tanh),
            ("sigmoid", &[a]) => a.unary(Unary::Sigmoid),
            ("floor", &[a]) => a.unary(Unary::Floor),
            ("ceil", &[a]) => a.unary(Unary::Ceil),
            ("fmod", &[a, b]) => a.binary(Binary::Fmod, b),
            ("copysign", &[a, b]) => {
                let size = a.unary(Unary::Abs);
                b.binary(Binary::Less, number(0.0)).select(-size, size)
            }
            ("fabs", &[a]) => a.unary(Unary::Abs),
            ("sign", &[a]) => a.unary(Unary::Sign),
            ("atan2", &[a, b]) => a.binary(Binary::Atan2, b),
            ("fmin", &[a, b]) => a.binary(Binary::Min, b),
            ("fmax", &[a, b]) => a.binary(Binary::Max, b),
            ("hypot", &[a, b]) => (a * a + b * b).sqrt(),
            ("lt", &[a, b]) => truth(a.binary(Binary::Less, b)),
            ("le", &[a, b]) => truth(a.binary(Binary::LessEqual, b)),
            ("eq", &[a, b]) => truth(a.binary(Binary::Equal, b)),
            ("ne", &[a, b]) => truth(a.binary(Binary::NotEqual, b)),
            ("not", &[a]) => holds(a).select(number(0.0), number(1.0)),
            ("and", &[a, b]) => holds(a).select(truth(holds(b)), number(0.0)),
            ("or", &[a, b]) => holds(a).select(number(1.0), truth(holds(b))),
            ("if_else_zero", &[a, b]) => holds(a).select(b, number(0.0)),
            ("if_else", &[a, b, c]) => holds(a).select(b, c),
            ("pow" | "constpow", &[a, b]) => match b.value() {
                Some(power) if power.abs() <= MAX_POWER && (2.0 * power).fract() == 0.0 => {
                    self.power(a, power)
                }
                _ => a.binary(Binary::Pow, b),
            },
            _ => return Err(self.unknown(op, operands)),
        })
    }

    /// A power, a multiple of 1/2 up to [`MAX_POWER`], as products and a square root.
    fn power(&self, a: Expr<'g>, power: f64) -> Expr<'g> {
        let size = power.abs();
        let mut result = (size.fract() != 0.0).then(|| a.sqrt());
        let (mut square, mut rest) = (a, size as u32);
        while rest > 0 {
            if rest & 1 == 1 {
                result = Some(result.map_or(square, |result| result * square));
            }
            rest >>= 1;
            if rest > 0 {
                square = square * square;
            }
        }
        let one = self.graph.constant(1.0);
        let result = result.unwrap_or(one);
        if power < 0.0 { one / result } else { result }
    }

    fn unknown(&self, op: &str, operands: &[Expr<'g>]) -> String {
        let function = |expr: &Expr<'g>| crate::write::expression(self.graph, self.names, expr.id());
        let operands: Vec<String> = operands.iter().map(function).collect();
        format!("operation `{op}` has no meaning here; in `{op}({})`", operands.join(", "))
    }
}

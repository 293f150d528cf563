// SPDX-License-Identifier: MIT OR Apache-2.0
//! A function as source: equations, one statement for each value that has a name or is used more than once.
//!
//! Everything that depends on the language that is written stands here.

use crate::Error;
use crate::functions::{Function, Port};
use crate::graph::{Binary, Graph, Id, Node, Unary};
use std::collections::{HashMap, HashSet};
use std::fmt::Write;
use takt_isa::Machine;

/// Columns that a line should not go beyond, and the length from which an expression gets a name of its own.
const WIDTH: usize = 110;
const LONG: usize = 72;

/// The precedence of an operator: an operand of a stronger one needs parentheses.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Binding {
    Choice,
    Comparison,
    Sum,
    Product,
    Sign,
    Atom,
}

/// Part of a statement.
struct Text {
    text: String,
    binding: Binding,
}

impl Text {
    /// In parentheses, if it binds less than that.
    fn at_least(self, binding: Binding) -> String {
        if self.binding >= binding { self.text } else { format!("({})", self.text) }
    }
}

/// A number in the language: with a decimal point or an exponent, to 15 digits, of which binary32 keeps the first seven.
fn number(value: f64) -> String {
    let rounded: f64 = format!("{value:.14e}").parse().unwrap_or(value);
    format!("{rounded:?}")
}

/// Names of the language that none of ours may be.
const RESERVED: [&str; 6] = ["zero", "pi", "PI", "e", "inf", "nan"];

/// The constants among the outputs, which need no port: name and value.
pub fn constants(function: &Function) -> Vec<(&Port, f64)> {
    let outputs = function.outputs.iter();
    outputs.filter_map(|(port, id)| Some((port, function.graph.value(*id)?))).collect()
}

/// Which inputs something depends on.
pub fn inputs_read(function: &Function) -> Vec<bool> {
    let graph = &function.graph;
    let uses = graph.uses(&function.nodes());
    let mut read = vec![false; function.inputs.len()];
    for (index, uses) in uses.into_iter().enumerate() {
        if let (Node::Input(input), true) = (graph.node_at(index), uses > 0) {
            read[input as usize] = true;
        }
    }
    read
}

/// Checks that a machine has the ports for a function.
///
/// # Errors
/// If not, with the numbers.
pub fn fits(function: &Function, machine: &Machine) -> Result<(), Error> {
    let inputs = inputs_read(function).iter().filter(|read| **read).count();
    let outputs = function.outputs.len() - constants(function).len();
    let limits = [
        (inputs, "input", usize::from(machine.input_count())),
        (outputs, "output", usize::from(machine.outputs_per_bank)),
    ];
    match limits.into_iter().find(|(count, _, most)| count > most) {
        Some((count, kind, most)) => Err(Error::plain(format!(
            "it does not fit: it has {count} {kind}s, {} has {most} {kind} ports",
            machine.name
        ))),
        None => Ok(()),
    }
}

struct Writer<'a> {
    function: &'a Function,
    uses: Vec<u32>,
    /// Registers and ports, as they are named.
    names: HashMap<Id, String>,
    taken: HashSet<String>,
    statements: String,
    registers: Vec<String>,
    /// The comment that the statements before have.
    said: String,
    temporaries: usize,
    /// True if an operation is a macro of the library.
    library: bool,
}

/// The source of a function: a program that computes the outputs in every period.
pub fn source(function: &Function) -> String {
    let nodes = function.nodes();
    let ports = function.inputs.iter().chain(function.outputs.iter().map(|(port, _)| port));
    let mut writer = Writer {
        function,
        uses: function.graph.uses(&nodes),
        names: HashMap::new(),
        taken: ports.map(|port| port.name.clone()).chain(RESERVED.map(str::to_owned)).collect(),
        statements: String::new(),
        registers: Vec::new(),
        said: String::new(),
        temporaries: 0,
        library: false,
    };
    let live = writer.uses.iter().enumerate().filter(|(_, uses)| **uses > 0);
    let mut live = live.map(|(index, _)| function.graph.node_at(index));
    writer.library = live.any(|node| matches!(node, Node::Unary(op, _) if of_library(op)));
    writer.equations();
    let mut text = String::new();
    header(function, &mut text);
    if writer.library {
        text.push_str(".include <math.s>\n");
    }
    for line in wrapped(&writer.registers) {
        let _ = writeln!(text, ".reg    {line}");
    }
    let _ = write!(text, "\n.schedule on\n\n.period\nperiod:\n{}        wait    period\n", writer.statements);
    text
}

fn header(function: &Function, text: &mut String) {
    let _ = writeln!(text, "; {}\n; {}", function.title, function.count());
    for note in &function.notes {
        let _ = writeln!(text, "; {note}");
    }
    text.push('\n');
    let comment = |port: &Port| match port.text.as_str() {
        "" => String::new(),
        text => format!(" ; {text}"),
    };
    for (port, read) in function.inputs.iter().zip(inputs_read(function)) {
        match read {
            true => {
                let _ = writeln!(text, ".input  {}{}", port.name, comment(port));
            }
            false => {
                let _ = writeln!(text, "; {} has no effect{}", port.name, comment(port));
            }
        }
    }
    for (port, id) in &function.outputs {
        if function.graph.value(*id).is_none() {
            let _ = writeln!(text, ".output {}{}", port.name, comment(port));
        }
    }
    for (port, value) in constants(function) {
        let _ = writeln!(text, "; {} = {}{}", port.name, number(value), comment(port));
    }
}

/// Names in lines.
fn wrapped(names: &[String]) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for name in names {
        match lines.last_mut() {
            Some(line) if line.len() + name.len() < WIDTH - 10 => {
                line.push(' ');
                line.push_str(name);
            }
            _ => lines.push(name.clone()),
        }
    }
    lines
}

/// An expression as it would be written, for messages; only the beginning of a long one.
pub(crate) fn expression(graph: &Graph, inputs: &[Port], id: Id) -> String {
    /// No deeper and longer than is readable.
    const DEPTH: usize = 6;
    const LENGTH: usize = 160;
    let text = Terms { graph, inputs, names: &HashMap::new(), depth: DEPTH }.operand(id).text;
    match text.char_indices().nth(LENGTH) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}

impl Writer<'_> {
    fn terms(&self) -> Terms<'_> {
        let Function { graph, inputs, .. } = self.function;
        Terms { graph, inputs, names: &self.names, depth: usize::MAX }
    }

    fn unique(&mut self, name: &str) -> String {
        let mut unique = name.to_owned();
        let mut number = 1;
        while !self.taken.insert(unique.clone()) {
            number += 1;
            unique = format!("{name}_{number}");
        }
        unique
    }

    fn equations(&mut self) {
        let function = self.function;
        let graph = &function.graph;
        let mut ports: HashMap<Id, Vec<&Port>> = HashMap::new();
        for (port, id) in &function.outputs {
            if graph.value(*id).is_none() {
                ports.entry(*id).or_default().push(port);
            }
        }
        for index in 0..graph.len() {
            if self.uses[index] == 0 {
                continue;
            }
            let id = graph.id_at(index);
            let outputs = ports.remove(&id).unwrap_or_default();
            let node = graph.node(id);
            if !node.operates() {
                if let Node::Input(input) = node {
                    self.names.insert(id, function.inputs[input as usize].name.clone());
                }
                for port in outputs {
                    let text = self.terms().operand(id).text;
                    self.statement(&port.name, &text, "");
                }
                continue;
            }
            if graph.is_condition(id) {
                continue;
            }
            let label = graph.label_of(id);
            let long = || self.length(id) > LONG;
            if outputs.is_empty() && label.is_none() && self.uses[index] < 2 && !long() {
                continue;
            }
            let expression = self.terms().operation(id).text;
            let mut outputs = outputs.into_iter();
            let (name, text) = match (outputs.next(), label) {
                (Some(port), _) => (port.name.clone(), String::new()),
                (None, Some(label)) => (self.register(&label.name), label.text),
                (None, None) => {
                    self.temporaries += 1;
                    (self.register(&format!("t{}", self.temporaries)), self.said.clone())
                }
            };
            self.statement(&name, &expression, &text);
            for port in outputs {
                self.statement(&port.name, &name, "");
            }
            self.names.insert(id, name);
        }
    }

    fn register(&mut self, name: &str) -> String {
        let name = self.unique(name);
        self.registers.push(name.clone());
        name
    }

    fn statement(&mut self, name: &str, expression: &str, comment: &str) {
        let mut line = format!("        {name} = {expression}");
        if !comment.is_empty() && comment != self.said {
            let pad = 60usize.saturating_sub(line.chars().count());
            let _ = write!(line, "{:pad$} ; {comment}", "");
        }
        self.said = comment.to_owned();
        self.statements.push_str(&line);
        self.statements.push('\n');
    }

    /// About how long an expression would be.
    fn length(&self, id: Id) -> usize {
        match self.names.get(&id) {
            Some(name) => name.len(),
            None => {
                let node = self.function.graph.node(id);
                3 + node.operands().map(|operand| self.length(operand)).sum::<usize>()
            }
        }
    }
}

/// The spelling of values.
struct Terms<'a> {
    graph: &'a Graph,
    inputs: &'a [Port],
    /// The values that have a name.
    names: &'a HashMap<Id, String>,
    /// The depth in operations; what lies below is `…`.
    depth: usize,
}

impl Terms<'_> {
    /// A value that an operation reads: its name, if it has one.
    fn operand(&self, id: Id) -> Text {
        if let Some(name) = self.names.get(&id) {
            return Text { text: name.clone(), binding: Binding::Atom };
        }
        match self.depth {
            0 if self.graph.node(id).operates() => Text { text: "…".to_owned(), binding: Binding::Atom },
            0 => self.operation(id),
            depth => Terms { depth: depth - 1, ..*self }.operation(id),
        }
    }

    fn operation(&self, id: Id) -> Text {
        let call = |name: &str, arguments: &[Id]| {
            let arguments: Vec<String> = arguments.iter().map(|id| self.operand(*id).text).collect();
            Text { text: format!("{name}({})", arguments.join(", ")), binding: Binding::Atom }
        };
        match self.graph.node(id) {
            Node::Constant(bits) => {
                let value = f64::from_bits(bits);
                let binding = if value < 0.0 { Binding::Sign } else { Binding::Atom };
                Text { text: number(value), binding }
            }
            Node::Input(input) => {
                let port = &self.inputs[input as usize];
                Text { text: port.name.clone(), binding: Binding::Atom }
            }
            Node::Unary(Unary::Neg, a) => {
                Text { text: format!("-{}", self.operand(a).at_least(Binding::Atom)), binding: Binding::Sign }
            }
            Node::Unary(op, a) => call(unary_name(op), &[a]),
            Node::Binary(op, a, b) => match op {
                Binary::Add => self.infix("+", Binding::Sum, a, b),
                Binary::Sub => self.infix("-", Binding::Sum, a, b),
                Binary::Mul => self.infix("*", Binding::Product, a, b),
                Binary::Div => self.infix("/", Binding::Product, a, b),
                Binary::Less => self.infix("<", Binding::Comparison, a, b),
                Binary::LessEqual => self.infix("<=", Binding::Comparison, a, b),
                Binary::Equal => self.infix("==", Binding::Comparison, a, b),
                Binary::NotEqual => self.infix("!=", Binding::Comparison, a, b),
                Binary::Atan2 => call("atan2", &[a, b]),
                Binary::Min => call("min", &[a, b]),
                Binary::Max => call("max", &[a, b]),
            },
            Node::Select(condition, yes, no) => {
                let condition = self.operand(condition).at_least(Binding::Comparison);
                let yes = self.operand(yes).at_least(Binding::Sum);
                let no = self.operand(no).at_least(Binding::Sum);
                Text { text: format!("{condition} ? {yes} : {no}"), binding: Binding::Choice }
            }
        }
    }

    /// Left operands may bind alike: operators associate to the left. A number stands first in a product.
    fn infix(&self, operator: &str, binding: Binding, a: Id, b: Id) -> Text {
        let graph = self.graph;
        let (a, b) = if operator == "*" && graph.value(b).is_some() { (b, a) } else { (a, b) };
        let above = match binding {
            Binding::Sum => Binding::Product,
            Binding::Product => Binding::Sign,
            _ => Binding::Sum,
        };
        let left = if binding == Binding::Comparison { above } else { binding };
        let left = self.operand(a).at_least(left);
        let right = self.operand(b).at_least(above);
        let text = match operator {
            "*" | "/" => format!("{left}{operator}{right}"),
            _ => format!("{left} {operator} {right}"),
        };
        Text { text, binding }
    }
}

/// True if an operation is no instruction, but a macro of `<math.s>`.
fn of_library(op: Unary) -> bool {
    matches!(op, Unary::Tan | Unary::Asin | Unary::Exp | Unary::Log)
}

fn unary_name(op: Unary) -> &'static str {
    match op {
        Unary::Neg => "-",
        Unary::Sqrt => "sqrt",
        Unary::Sin => "sin",
        Unary::Cos => "cos",
        Unary::Tan => "tan",
        Unary::Asin => "asin",
        Unary::Acos => "acos",
        Unary::Exp => "exp",
        Unary::Log => "log",
        Unary::Abs => "abs",
        Unary::Sign => "sign",
    }
}

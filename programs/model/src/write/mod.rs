// SPDX-License-Identifier: MIT OR Apache-2.0
//! A function as source: equations, one statement for each value that has a name or is used more than once.
//!
//! Everything that depends on the language that is written stands in this folder.

mod layout;
mod terms;

pub use layout::Layout;
pub(crate) use terms::expression;

use crate::arrays::Names;
use crate::functions::{Function, Port};
use crate::graph::{Id, Node};
use std::collections::HashMap;
use std::fmt::Write;
use terms::{Terms, of_library};

/// Columns that a line should not go beyond, and the length from which an expression gets a name of its own.
const WIDTH: usize = 110;
const LONG: usize = 72;

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

struct Writer<'a> {
    function: &'a Function,
    layout: &'a Layout,
    taken: Names,
    uses: Vec<u32>,
    /// Registers and ports, as they are named.
    names: HashMap<Id, String>,
    statements: String,
    registers: Vec<String>,
    /// The comment that the statements before have.
    said: String,
    temporaries: usize,
}

/// The source of a function: a program that computes the outputs in every period, or a body for `.include` in the period of another.
pub fn source(function: &Function, layout: &Layout) -> String {
    let nodes = function.nodes();
    let uses = function.graph.uses(&nodes);
    let live = uses.iter().enumerate().filter(|(_, uses)| **uses > 0);
    let mut live = live.map(|(index, _)| function.graph.node_at(index));
    let library = live.any(of_library);
    let mut writer = Writer {
        function,
        layout,
        taken: layout.names.clone(),
        uses,
        names: HashMap::new(),
        statements: String::new(),
        registers: Vec::new(),
        said: String::new(),
        temporaries: 0,
    };
    writer.equations();
    let mut text = format!("; {}\n; {}\n", function.title, function.count());
    for note in &function.notes {
        let _ = writeln!(text, "; {note}");
    }
    let program = layout.prefix.is_none();
    if !program {
        text.push_str("; A body: a law sets the inputs, includes it in `.period`, and reads the outputs.\n");
    }
    let _ = write!(text, "\n{}", layout.declarations);
    if library {
        text.push_str(".include <math.s>\n");
    }
    for line in wrapped(&writer.registers) {
        let _ = writeln!(text, ".reg    {line}");
    }
    let _ = match program {
        true => {
            write!(text, "\n.schedule on\n\n.period\nperiod:\n{}        wait    period\n", writer.statements)
        }
        false => write!(text, "\n{}", writer.statements),
    };
    text
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

impl Writer<'_> {
    fn terms(&self) -> Terms<'_> {
        let Function { graph, inputs, .. } = self.function;
        Terms { graph, inputs, names: &self.names, depth: usize::MAX }
    }

    fn equations(&mut self) {
        let function = self.function;
        let graph = &function.graph;
        let mut places: HashMap<Id, Vec<String>> = HashMap::new();
        for ((_, id), outputs) in function.outputs.iter().zip(&self.layout.outputs) {
            if !outputs.is_empty() {
                places.entry(*id).or_default().extend(outputs.iter().cloned());
            }
        }
        for index in 0..graph.len() {
            if self.uses[index] == 0 {
                continue;
            }
            let id = graph.id_at(index);
            let outputs = places.remove(&id).unwrap_or_default();
            let node = graph.node(id);
            if !node.operates() {
                if let Node::Input(input) = node {
                    let name = self.layout.input(input as usize).unwrap_or_default().to_owned();
                    self.names.insert(id, name);
                }
                for output in outputs {
                    let text = self.terms().operand(id).text;
                    self.statement(&output, &text, "");
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
                (Some(output), _) => (output, String::new()),
                (None, Some(label)) => (self.register(&label.name), label.text),
                (None, None) => {
                    self.temporaries += 1;
                    (self.register(&format!("t{}", self.temporaries)), self.said.clone())
                }
            };
            self.statement(&name, &expression, &text);
            for output in outputs {
                self.statement(&output, &name, "");
            }
            self.names.insert(id, name);
        }
    }

    fn register(&mut self, name: &str) -> String {
        let prefix = self.layout.prefix.as_deref().unwrap_or_default();
        let name = self.taken.unique(&format!("{prefix}{name}"));
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

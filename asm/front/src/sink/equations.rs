// SPDX-License-Identifier: MIT OR Apache-2.0
//! Writes a function as equations: one statement for each value that has a name or several uses.

use super::terms::number;
use super::{Head, Layout, Names, Period, Terms, of_library};
use crate::graph::{Bound, Function, Id, Node, Port};
use std::collections::HashMap;
use std::fmt::Write;

/// Length from which an expression gets a register of its own.
const LONG: usize = 72;

/// Constant outputs, which need no port, with their values.
pub fn constants(function: &Function) -> Vec<(&Port, f64)> {
    let outputs = function.outputs.iter();
    outputs.filter_map(|(port, id)| Some((port, function.graph.value(*id)?))).collect()
}

/// By input: an output depends on it.
pub fn inputs_read(function: &Function) -> Vec<bool> {
    let graph = &function.graph;
    let uses = graph.uses(&function.roots());
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
    /// Names of registers and ports by node.
    names: HashMap<Id, String>,
    statements: String,
    registers: Vec<String>,
    /// Comment of the last statement, which is not repeated.
    said: String,
    temporaries: usize,
}

/// Source of a function: a program that computes the outputs every period, or a body for `.include` in another program's period.
pub fn source(function: &Function, layout: &Layout) -> String {
    let nodes = function.roots();
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
    let mut head = Head::default();
    head.comment(&function.title);
    head.comment(&function.count().to_string());
    for note in &function.notes {
        head.comment(note);
    }
    let is_program = layout.prefix.is_none();
    if !is_program {
        head.comment("A body: a law sets the inputs, includes it in `.period`, and reads the outputs.");
    }
    head.blank();
    head.lines(layout.declarations.text());
    if library {
        head.include("math.s");
    }
    head.registers(&writer.registers);
    head.blank();
    match is_program {
        true => head.into_program(&Period { code: &writer.statements, contracted: false }),
        false => {
            head.lines(&writer.statements);
            head.into_text()
        }
    }
}

impl Writer<'_> {
    fn terms(&self) -> Terms<'_> {
        let Function { graph, inputs, .. } = self.function;
        Terms { graph, inputs, names: &self.names, depth: usize::MAX, quick: false }
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
            let assumed = function.assumptions.iter().any(|assumption| assumption.node == id);
            if outputs.is_empty() && label.is_none() && self.uses[index] < 2 && !assumed && !long() {
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
            self.assume(id, &name);
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

    /// Writes what the function assumes of a value, behind the statement that computes it.
    fn assume(&mut self, id: Id, name: &str) {
        for assumption in self.function.assumptions.iter().filter(|assumption| assumption.node == id) {
            let sign = if assumption.bound == Bound::AtLeast { ">=" } else { "<=" };
            let _ = writeln!(self.statements, ".assume {name} {sign} {}", number(assumption.value));
        }
    }

    /// Estimated length of an expression's text.
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

// SPDX-License-Identifier: MIT OR Apache-2.0
//! The spelling of values: operators, functions, numbers and the parentheses between them.

use crate::functions::Port;
use crate::graph::{Binary, Graph, Id, Node, Unary};
use std::collections::HashMap;

/// The precedence of an operator: an operand of a stronger one needs parentheses.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Binding {
    Choice,
    Comparison,
    Sum,
    Product,
    Sign,
    Atom,
}

/// Part of a statement.
pub(super) struct Text {
    pub(super) text: String,
    binding: Binding,
}

impl Text {
    /// In parentheses, if it binds less than that.
    fn at_least(self, binding: Binding) -> String {
        if self.binding >= binding { self.text } else { format!("({})", self.text) }
    }
}

/// A number in the language: with a decimal point or an exponent, to 15 digits, of which binary32 keeps the first seven.
pub(super) fn number(value: f64) -> String {
    let rounded: f64 = format!("{value:.14e}").parse().unwrap_or(value);
    format!("{rounded:?}")
}

/// The spelling of values.
pub(super) struct Terms<'a> {
    pub(super) graph: &'a Graph,
    pub(super) inputs: &'a [Port],
    /// The values that have a name.
    pub(super) names: &'a HashMap<Id, String>,
    /// The depth in operations; what lies below is `…`.
    pub(super) depth: usize,
}

impl Terms<'_> {
    /// A value that an operation reads: its name, if it has one.
    pub(super) fn operand(&self, id: Id) -> Text {
        if let Some(name) = self.names.get(&id) {
            return Text { text: name.clone(), binding: Binding::Atom };
        }
        match self.depth {
            0 if self.graph.node(id).operates() => Text { text: "…".to_owned(), binding: Binding::Atom },
            0 => self.operation(id),
            depth => Terms { depth: depth - 1, ..*self }.operation(id),
        }
    }

    pub(super) fn operation(&self, id: Id) -> Text {
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
                Binary::Pow => call("pow", &[a, b]),
                Binary::Fmod => call("fmod", &[a, b]),
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

/// True if a node is no instruction, but a macro of `<math.s>`.
pub(super) fn of_library(node: Node) -> bool {
    match node {
        Node::Unary(op, _) => matches!(
            op,
            Unary::Tan
                | Unary::Asin
                | Unary::Atan
                | Unary::Exp
                | Unary::Log
                | Unary::Tanh
                | Unary::Sigmoid
                | Unary::Floor
                | Unary::Ceil
        ),
        Node::Binary(op, ..) => matches!(op, Binary::Pow | Binary::Fmod),
        Node::Constant(_) | Node::Input(_) | Node::Select(..) => false,
    }
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
        Unary::Atan => "atan",
        Unary::Exp => "exp",
        Unary::Log => "log",
        Unary::Tanh => "tanh",
        Unary::Sigmoid => "sigmoid",
        Unary::Floor => "floor",
        Unary::Ceil => "ceil",
        Unary::Abs => "abs",
        Unary::Sign => "sign",
    }
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

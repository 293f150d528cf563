// SPDX-License-Identifier: MIT OR Apache-2.0
//! Spelling of values: operators, functions, numbers and parentheses.

use crate::graph::Port;
use crate::graph::{Binary, Graph, Id, Node, Unary};
use std::collections::HashMap;

/// Precedence of an operator: weaker operands need parentheses.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Binding {
    Choice,
    Comparison,
    Sum,
    Product,
    Sign,
    Atom,
}

/// Text of an expression, with its precedence.
pub(crate) struct Text {
    pub(crate) text: String,
    binding: Binding,
}

impl Text {
    /// The text, in parentheses if it binds less than `binding`.
    fn at_least(self, binding: Binding) -> String {
        if self.binding >= binding { self.text } else { format!("({})", self.text) }
    }
}

/// Spells a number with a decimal point or an exponent, to 15 digits. (Binary32 has 7 to 9.)
pub(super) fn number(value: f64) -> String {
    let rounded: f64 = format!("{value:.14e}").parse().unwrap_or(value);
    format!("{rounded:?}")
}

/// Context for spelling values.
pub(crate) struct Terms<'a> {
    pub(crate) graph: &'a Graph,
    pub(crate) inputs: &'a [Port],
    /// Names of values that have one.
    pub(crate) names: &'a HashMap<Id, String>,
    /// Maximum number of levels of operations; deeper ones are spelled `…`.
    pub(crate) depth: usize,
    /// An absolute error suffices for `tanh` and `sigmoid`.
    pub(crate) quick: bool,
}

impl Terms<'_> {
    /// Spells an operand: by name if the value has one.
    pub(crate) fn operand(&self, id: Id) -> Text {
        if let Some(name) = self.names.get(&id) {
            return Text { text: name.clone(), binding: Binding::Atom };
        }
        match self.depth {
            0 if self.graph.node(id).operates() => Text { text: "…".to_owned(), binding: Binding::Atom },
            0 => self.operation(id),
            depth => Terms { depth: depth - 1, ..*self }.operation(id),
        }
    }

    pub(crate) fn operation(&self, id: Id) -> Text {
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
            // Saturation changes nothing: beyond ±10, tanh is ±1 in binary32.
            Node::Unary(Unary::Tanh, a) if self.quick => {
                let operand = self.operand(a).at_least(Binding::Sign);
                let text = format!("1 - 2/(1 + exp(sat(2*{operand}, 20.0)))");
                Text { text, binding: Binding::Sum }
            }
            // Saturation changes nothing: beyond, the value is 1, or 0 to within 10⁻³⁷.
            Node::Unary(Unary::Sigmoid, a) if self.quick => {
                let text = format!("1/(1 + exp(-sat({}, 85.0)))", self.operand(a).text);
                Text { text, binding: Binding::Product }
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

    /// Spells a binary operator. Operators associate to the left, so a left operand of equal precedence needs no parentheses. Constants
    /// come first in a product.
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

/// The node is a macro of `<math.s>` rather than an instruction.
pub(crate) fn of_library(node: Node) -> bool {
    match node {
        Node::Unary(op, _) => matches!(
            op,
            Unary::Tan
                | Unary::Asin
                | Unary::Atan
                | Unary::Exp
                | Unary::Expm1
                | Unary::Log
                | Unary::Log1p
                | Unary::Tanh
                | Unary::Sigmoid
                | Unary::Erf
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
        Unary::Expm1 => "expm1",
        Unary::Log => "log",
        Unary::Log1p => "log1p",
        Unary::Tanh => "tanh",
        Unary::Sigmoid => "sigmoid",
        Unary::Erf => "erf",
        Unary::Floor => "floor",
        Unary::Ceil => "ceil",
        Unary::Abs => "abs",
        Unary::Sign => "sign",
    }
}

/// Spells an expression for messages, shortened if it is long.
pub(crate) fn expression(graph: &Graph, inputs: &[Port], id: Id) -> String {
    /// Limits of depth and length for readability.
    const DEPTH: usize = 6;
    const LENGTH: usize = 160;
    let text = Terms { graph, inputs, names: &HashMap::new(), depth: DEPTH, quick: false }.operand(id).text;
    match text.char_indices().nth(LENGTH) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}

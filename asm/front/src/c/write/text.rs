// SPDX-License-Identifier: MIT OR Apache-2.0
//! Spells values and statements.

use super::plan::Plan;
use crate::c::ir::{Id, Kind, Node, Nodes, Op};
use std::collections::BTreeSet;

/// Precedence of an operator in the language: weaker operands need parentheses.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Binding {
    Choice,
    Comparison,
    Or,
    And,
    Shift,
    Sum,
    Product,
    Sign,
    Atom,
}

struct Text {
    text: String,
    binding: Binding,
}

impl Text {
    fn atom(text: String) -> Text {
        Text { text, binding: Binding::Atom }
    }

    fn at_least(self, binding: Binding) -> String {
        if self.binding >= binding { self.text } else { format!("({})", self.text) }
    }
}

/// Files of the library that the program includes.
pub(super) type Library = BTreeSet<&'static str>;

/// Notation of an operation in Takt's language.
enum Form {
    Infix(&'static str, Binding),
    Prefix(&'static str),
    Same,
    Call(&'static str, Option<&'static str>),
}

fn form(op: Op) -> Form {
    const MATH: Option<&str> = Some("math.s");
    const C: Option<&str> = Some("c.s");
    match op {
        Op::Add | Op::IntAdd => Form::Infix("+", Binding::Sum),
        Op::Sub | Op::IntSub => Form::Infix("-", Binding::Sum),
        Op::Mul | Op::IntMul => Form::Infix("*", Binding::Product),
        Op::Div | Op::IntDiv => Form::Infix("/", Binding::Product),
        Op::IntRem => Form::Infix("%", Binding::Product),
        Op::And => Form::Infix("&", Binding::And),
        Op::Or => Form::Infix("|", Binding::Or),
        Op::ShiftLeft => Form::Infix("<<", Binding::Shift),
        Op::ShiftRight => Form::Infix(">>", Binding::Shift),
        Op::Equal | Op::IntEqual => Form::Infix("==", Binding::Comparison),
        Op::Less | Op::IntLess => Form::Infix("<", Binding::Comparison),
        Op::LessEqual => Form::Infix("<=", Binding::Comparison),
        Op::Copy => Form::Same,
        Op::Neg => Form::Prefix("-"),
        Op::Not => Form::Prefix("!"),
        Op::Xor => Form::Call("xor", None),
        Op::Abs => Form::Call("abs", None),
        Op::Sqrt => Form::Call("sqrt", None),
        Op::Sin => Form::Call("sin", None),
        Op::Cos => Form::Call("cos", None),
        Op::Acos => Form::Call("acos", None),
        Op::Atan2 => Form::Call("atan2", None),
        Op::ToFloat => Form::Call("itof", None),
        Op::Nearest => Form::Call("ftoi", None),
        Op::Tan => Form::Call("tan", MATH),
        Op::Asin => Form::Call("asin", MATH),
        Op::Atan => Form::Call("atan", MATH),
        Op::Exp => Form::Call("exp", MATH),
        Op::Expm1 => Form::Call("expm1", MATH),
        Op::Log => Form::Call("log", MATH),
        Op::Log1p => Form::Call("log1p", MATH),
        Op::Pow => Form::Call("pow", MATH),
        Op::Tanh => Form::Call("tanh", MATH),
        Op::Erf => Form::Call("erf", MATH),
        Op::Fmod => Form::Call("fmod", MATH),
        Op::Floor => Form::Call("floor", MATH),
        Op::Ceil => Form::Call("ceil", MATH),
        Op::Trunc => Form::Call("trunc", MATH),
        Op::Round => Form::Call("round", MATH),
        Op::Rint => Form::Call("rint", MATH),
        Op::ShiftRightLogical => Form::Call("shift_right", C),
        Op::UnsignedDiv => Form::Call("quotient_unsigned", C),
        Op::ProductHigh => Form::Call("product_high", C),
        Op::Below => Form::Call("below", C),
        Op::UnsignedToFloat => Form::Call("unsigned_to_float", C),
        Op::ToInt => Form::Call("to_int", C),
        Op::ToUnsigned => Form::Call("to_unsigned", C),
        Op::BitsOf => Form::Call("bits_of", C),
        Op::FloatOf => Form::Call("float_of", C),
        Op::Select | Op::SelectFloat => Form::Infix("?", Binding::Choice),
    }
}

/// A binary32 number that reads back as the same bits.
pub(super) fn real(bits: u32) -> String {
    let value = f32::from_bits(bits);
    if value.is_nan() {
        return "nan".to_owned();
    }
    if value.is_infinite() {
        return if value > 0.0 { "inf" } else { "-inf" }.to_owned();
    }
    crate::sink::number(f64::from(value)).unwrap_or_default()
}

pub(super) struct Speller<'a> {
    pub(super) nodes: &'a Nodes,
    pub(super) plan: &'a Plan,
    pub(super) library: std::cell::RefCell<Library>,
}

impl Speller<'_> {
    /// A value as an operand: its register, or its expression.
    pub(super) fn operand(&self, id: Id) -> String {
        self.of(id).text
    }

    /// The expression that computes a value.
    pub(super) fn expression(&self, id: Id) -> String {
        self.computed(id).text
    }

    fn of(&self, id: Id) -> Text {
        match self.nodes.node(id) {
            Node::Int(value) => {
                let binding = if value < 0 { Binding::Sign } else { Binding::Atom };
                Text { text: value.to_string(), binding }
            }
            Node::Float(bits) => {
                let text = real(bits);
                let binding = if text.starts_with('-') { Binding::Sign } else { Binding::Atom };
                Text { text, binding }
            }
            Node::Var(var, _) => Text::atom(self.plan.var(var).to_owned()),
            Node::Index(index) => Text::atom(self.nodes.indices[index].clone()),
            _ if self.plan.inlined[id.0 as usize] => self.computed(id),
            _ => Text::atom(self.plan.value(id).unwrap_or("zero").to_owned()),
        }
    }

    fn computed(&self, id: Id) -> Text {
        let (op, operands) = match self.nodes.node(id) {
            Node::Load(array, index, _) => return Text::atom(self.element(array, index)),
            Node::Op(op, operands, count) => (op, operands[..usize::from(count)].to_vec()),
            _ => return self.of(id),
        };
        match (form(op), operands.as_slice()) {
            (_, [condition, yes, no]) => {
                // A comparison of constants' types needs none; alternatives are of one type.
                let condition = self.of(*condition).at_least(Binding::Comparison);
                let (yes, no) = (self.of(*yes).at_least(Binding::Or), self.of(*no).at_least(Binding::Or));
                Text { text: format!("{condition} ? {yes} : {no}"), binding: Binding::Choice }
            }
            (Form::Infix(..), [a, b]) if op == Op::IntMul && self.is_short(*a, *b) => {
                Text::atom(format!("mul24({}, {})", self.operand(*a), self.operand(*b)))
            }
            (_, [a, b]) if matches!(op, Op::IntDiv | Op::UnsignedDiv) && !self.is_power_of_two(*b) => {
                self.library.borrow_mut().insert("c.s");
                Text::atom(self.quotient(op, *a, *b))
            }
            (Form::Infix(operator, binding), [a, b]) => self.infix(operator, binding, *a, *b),
            (Form::Same, [a]) => self.of(*a),
            (Form::Prefix(operator), [a]) => {
                let text = format!("{operator}{}", self.of(*a).at_least(Binding::Atom));
                Text { text, binding: Binding::Sign }
            }
            (Form::Call(name, file), operands) => {
                self.library.borrow_mut().extend(file);
                let operands: Vec<String> = operands.iter().map(|id| self.operand(*id)).collect();
                Text::atom(format!("{name}({})", operands.join(", ")))
            }
            _ => Text::atom("zero".to_owned()),
        }
    }

    /// A product of integers of 24 bits that the machine's instruction computes at once. Factors with two binary digits are left to the
    /// assembler, which shifts and adds.
    fn is_short(&self, a: Id, b: Id) -> bool {
        let fits = |id: Id| self.nodes.range(id).0 >= -(1 << 23) && self.nodes.range(id).1 < 1 << 23;
        let is_plain =
            matches!(self.nodes.node(b), Node::Int(value) if value.unsigned_abs().count_ones() <= 2);
        fits(a) && fits(b) && !is_plain
    }

    /// A quotient by the cheapest macro of `<c.s>` that takes operands of these ranges.
    fn quotient(&self, op: Op, a: Id, b: Id) -> String {
        let within = |id: Id, most: i64| {
            let (low, high) = self.nodes.range(id);
            low >= -most && high <= most
        };
        let (first, second) = (self.operand(a), self.operand(b));
        let Node::Int(by) = self.nodes.node(b) else {
            let name = match op {
                Op::UnsignedDiv => "quotient_unsigned",
                _ if within(a, 1 << 24) && within(b, 1 << 24) => "quotient_short",
                _ => "quotient",
            };
            return format!("{name}({first}, {second})");
        };
        let name = match op {
            // From 2^31 on the divisor fits once or not: the general macro's choice, which is a constant.
            Op::UnsignedDiv if by < 0 => return format!("quotient_unsigned({first}, {second})"),
            Op::UnsignedDiv => "quotient_unsigned_by",
            _ if within(a, 1 << 22) => "quotient_short_by",
            _ => "quotient_by",
        };
        format!("{name}({first}, {second}, {})", real((1.0 / by as f32).to_bits()))
    }

    fn is_power_of_two(&self, id: Id) -> bool {
        matches!(self.nodes.node(id), Node::Int(value) if value > 0 && value.count_ones() == 1)
    }

    fn is_known(&self, id: Id) -> bool {
        matches!(self.nodes.node(id), Node::Int(_) | Node::Float(_))
    }

    fn infix(&self, operator: &str, binding: Binding, a: Id, b: Id) -> Text {
        let above = match binding {
            Binding::Choice => Binding::Comparison,
            // Readers get parentheses next to comparisons, `&` and `|`.
            Binding::Comparison | Binding::Or | Binding::And | Binding::Shift => Binding::Sum,
            Binding::Sum => Binding::Product,
            _ => Binding::Sign,
        };
        let chain = matches!(binding, Binding::Sum | Binding::Or | Binding::And)
            || binding == Binding::Product && self.nodes.kind(a) == Kind::Float;
        // A constant comes first in a product.
        if operator == "*" && self.nodes.kind(a) == Kind::Float && self.is_known(b) {
            let (first, second) = (self.of(b).at_least(Binding::Sign), self.of(a).at_least(above));
            return Text { text: format!("{first}*{second}"), binding };
        }
        let first = self.of(a);
        let first = if chain && first.binding == binding { first.text } else { first.at_least(above) };
        let second = self.of(b).at_least(above);
        let (operator, second) = match self.nodes.node(b) {
            Node::Int(by) if operator == "+" && by < 0 && by > i32::MIN => {
                ("-", by.unsigned_abs().to_string())
            }
            _ => (operator, second),
        };
        let text = match operator {
            "*" | "/" => format!("{first}{operator}{second}"),
            _ => format!("{first} {operator} {second}"),
        };
        Text { text, binding }
    }

    /// An element of an array, whose words count from 1.
    pub(super) fn element(&self, array: usize, index: Id) -> String {
        let name = &self.nodes.arrays[array].name;
        let (mut terms, mut known) = (Vec::new(), 1_i64);
        self.terms(index, 1, &mut terms, &mut known);
        let mut text = String::new();
        for (factor, term) in terms {
            let size = factor.unsigned_abs();
            let term = if size == 1 { term } else { format!("{size}*{term}") };
            let sign = match (text.is_empty(), factor < 0) {
                (true, false) => "",
                (true, true) => "-",
                (false, false) => " + ",
                (false, true) => " - ",
            };
            text.push_str(sign);
            text.push_str(&term);
        }
        match (text.is_empty(), known) {
            (true, known) => text = known.to_string(),
            (false, 0) => {}
            (false, known) if known < 0 => text.push_str(&format!(" - {}", known.unsigned_abs())),
            (false, known) => text.push_str(&format!(" + {known}")),
        }
        format!("{name}[{text}]")
    }

    fn terms(&self, id: Id, factor: i64, terms: &mut Vec<(i64, String)>, known: &mut i64) {
        let inside = self.plan.inlined[id.0 as usize];
        match self.nodes.node(id) {
            Node::Int(value) => *known += factor * i64::from(value),
            Node::Op(Op::IntAdd, [a, b, _], _) if inside => {
                self.terms(a, factor, terms, known);
                self.terms(b, factor, terms, known);
            }
            Node::Op(Op::IntSub, [a, b, _], _) if inside => {
                self.terms(a, factor, terms, known);
                self.terms(b, -factor, terms, known);
            }
            Node::Op(Op::IntMul, [a, b, _], _) if inside && self.is_known(b) => {
                let by = match self.nodes.node(b) {
                    Node::Int(by) => i64::from(by),
                    _ => 1,
                };
                self.terms(a, factor.wrapping_mul(by), terms, known);
            }
            _ => terms.push((factor, self.operand(id))),
        }
    }

    /// The registers that the expression of a value reads.
    pub(super) fn reads(&self, id: Id, found: &mut Vec<String>) {
        match self.nodes.node(id) {
            Node::Var(var, _) => found.push(self.plan.var(var).to_owned()),
            Node::Int(_) | Node::Float(_) | Node::Index(_) => {}
            _ if self.plan.inlined[id.0 as usize] => {
                for operand in self.nodes.operands(id) {
                    self.reads(operand, found);
                }
            }
            _ => found.extend(self.plan.value(id).map(str::to_owned)),
        }
    }
}

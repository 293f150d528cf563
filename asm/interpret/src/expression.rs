// SPDX-License-Identifier: MIT OR Apache-2.0
//! Values of expressions and places of operands.

use crate::expand::{Results, arguments};
use crate::run::Interpreter;
use crate::scope::{Array, DeclarationFilter, Meaning, Scope};
use crate::{Fault, Number, Value};
use std::rc::Rc;
use takt_isa::{Op, Type, compute, fp};
use takt_syntax::ast::*;
use takt_syntax::name::NameRef;

/// A place that holds a value.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Place {
    Cell(usize),
    /// A word of data memory, and its type.
    Word(usize, Type),
}

impl Interpreter {
    /// The value of an expression, given its nodes and the number of the first. In a slice, `slice` selects the element, by its
    /// place from 0 in each direction.
    pub(crate) fn value(
        &self,
        nodes: &[Node],
        first: u32,
        scope: &Rc<Scope>,
        results: &Results,
        slice: &[i64],
    ) -> Result<Value, Fault> {
        let Some((node, before)) = nodes.split_last() else { return Err("an empty expression".to_owned()) };
        let at = before.len();
        let operand = |(from, to): (usize, usize)| {
            self.value(&nodes[from..to], first + from as u32, scope, results, slice)
        };
        let operands = |count| arguments(nodes, at, count);
        match node.kind {
            NodeKind::Int(value) => Ok(Value::Number(Number::Int(value))),
            NodeKind::Real(value) => Ok(Value::Number(Number::Real(value))),
            NodeKind::Name(name) => self.named(name, scope),
            NodeKind::Element(element) => {
                let Element { name, indices } = &self.ast.elements[element as usize];
                self.read(self.element(*name, indices, scope, slice)?)
            }
            NodeKind::Prefix(operator) => prefix(operator, operand((0, at))?),
            NodeKind::Infix(operator) => {
                let parts = operands(2);
                infix(operator, operand(parts[0])?, operand(parts[1])?)
            }
            NodeKind::Choice => {
                let parts = operands(3);
                let (condition, a, b) = (operand(parts[0])?, operand(parts[1])?, operand(parts[2])?);
                match condition {
                    Value::Number(number) => Ok(if number.real() == 0.0 { b } else { a }),
                    Value::Bits(bits, _) => {
                        let (a, b, ty) = same(a, b)?;
                        Ok(Value::Bits(if bits != 0 { a } else { b }, ty))
                    }
                }
            }
            NodeKind::Call(name, count) => {
                if let Some(cell) = results.get(&(first + at as u32)) {
                    return self.read(Place::Cell(*cell));
                }
                let (text, parts) = (self.names.text(name), operands(count as usize));
                if text == "sum" && parts.len() == 4 {
                    return self.sum(nodes, first, &parts, scope, results, slice);
                }
                let values = parts.into_iter().map(operand).collect::<Result<Vec<Value>, Fault>>()?;
                function(text, &values)
            }
            NodeKind::All | NodeKind::Range => Err("expected a value, found a slice".to_owned()),
        }
    }

    /// The sum of a term over every value of an index, in ascending order.
    fn sum(
        &self,
        nodes: &[Node],
        first: u32,
        parts: &[(usize, usize)],
        scope: &Rc<Scope>,
        results: &Results,
        slice: &[i64],
    ) -> Result<Value, Fault> {
        let NodeKind::Name(name) = nodes[parts[0].0].kind else {
            return Err("a sum without a name".to_owned());
        };
        let name = self.spelled(name, scope)?;
        let part = |which: usize| (&nodes[parts[which].0..parts[which].1], first + parts[which].0 as u32);
        let [from, to] = [1, 2].map(|which| self.number(part(which).0, scope).and_then(Number::integer));
        let (mut total, (term, number)) = (None, part(3));
        for value in from?..=to? {
            let turn = Scope::counting(scope, DeclarationFilter::Nothing, &name, value);
            let term = self.value(term, number, &turn, results, slice)?;
            total = Some(match total {
                None => term,
                Some(total) => infix(Operator::Add, total, term)?,
            });
        }
        Ok(total.unwrap_or(Value::Number(Number::Int(0))))
    }

    fn meaning(&self, name: NameRef, scope: &Rc<Scope>) -> Result<Meaning, Fault> {
        let text = self.spelled(name, scope)?;
        match (scope.find(&text), text.as_str()) {
            (Some(meaning), _) => Ok(meaning),
            (None, "pi") => Ok(Meaning::Number(Number::Real(std::f64::consts::PI))),
            (None, "zero") => Ok(Meaning::Cell(Interpreter::ZERO)),
            _ => Err(format!("`{text}` is not declared")),
        }
    }

    /// The value of a name.
    fn named(&self, name: NameRef, scope: &Rc<Scope>) -> Result<Value, Fault> {
        match self.meaning(name, scope)? {
            Meaning::Cell(cell) => self.read(Place::Cell(cell)),
            Meaning::Number(number) => Ok(Value::Number(number)),
            Meaning::Argument(operand, scope) => self.operand(operand, &scope),
            _ => Err("a name that has no value".to_owned()),
        }
    }

    /// The value of an operand.
    pub(crate) fn operand(&self, operand: Operand, scope: &Rc<Scope>) -> Result<Value, Fault> {
        match operand.kind {
            OperandKind::Name(name) => self.named(name, scope),
            OperandKind::Expr(id) => {
                self.value(&self.ast.nodes[id.range()], id.first, scope, &Results::default(), &[])
            }
            _ => self.read(self.place_of(operand, scope, &[])?),
        }
    }

    /// The place of an operand that is written, or that is an element.
    pub(crate) fn place_of(
        &self,
        operand: Operand,
        scope: &Rc<Scope>,
        slice: &[i64],
    ) -> Result<Place, Fault> {
        match operand.kind {
            OperandKind::Name(name) => match self.meaning(name, scope)? {
                Meaning::Cell(cell) => Ok(Place::Cell(cell)),
                Meaning::Argument(operand, scope) => self.place_of(operand, &scope, slice),
                _ => Err("expected a register".to_owned()),
            },
            OperandKind::Element(element) => {
                let Element { name, indices } = &self.ast.elements[element as usize];
                self.element(*name, indices, scope, slice)
            }
            // `x[n]` of an array `x`.
            OperandKind::Memory(memory) => {
                let Memory { offset: Some(offset), base } = self.ast.memories[memory as usize] else {
                    return Err("an address".to_owned());
                };
                let [Node { kind: NodeKind::Name(name), .. }] = self.ast.nodes[offset.id.range()] else {
                    return Err("an address".to_owned());
                };
                let index = integer(self.operand(base, scope)?)?;
                self.at(name, &[index], scope)
            }
            _ => Err("expected a place".to_owned()),
        }
    }

    /// The place of an element.
    fn element(
        &self,
        name: Name,
        indices: &[Vec<Node>],
        scope: &Rc<Scope>,
        slice: &[i64],
    ) -> Result<Place, Fault> {
        let mut slices = slice.iter();
        let mut place = Vec::new();
        for nodes in indices {
            let value =
                |nodes: &[Node]| integer(self.value(nodes, u32::MAX / 2, scope, &Results::default(), &[])?);
            let more =
                |slices: &mut std::slice::Iter<'_, i64>| slices.next().ok_or("too many slices").copied();
            place.push(match nodes[nodes.len() - 1].kind {
                NodeKind::All => 1 + more(&mut slices)?,
                NodeKind::Range => {
                    let (from, to) = arguments(nodes, nodes.len() - 1, 2)[0];
                    value(&nodes[from..to])? + more(&mut slices)?
                }
                _ => value(nodes)?,
            });
        }
        self.at(name.name, &place, scope)
    }

    /// The lengths of a slice in each direction.
    pub(crate) fn lengths(&self, operand: Operand, scope: &Rc<Scope>) -> Result<Vec<i64>, Fault> {
        let OperandKind::Element(element) = operand.kind else { return Ok(Vec::new()) };
        let Element { name, indices } = &self.ast.elements[element as usize];
        let mut lengths = Vec::new();
        for (nodes, size) in indices.iter().zip(self.array(name.name, scope)?.0.sizes) {
            match nodes[nodes.len() - 1].kind {
                NodeKind::All => lengths.push(size),
                NodeKind::Range => {
                    let ends = arguments(nodes, nodes.len() - 1, 2);
                    let end = |which: usize| {
                        let (from, to) = ends[which];
                        self.number(&nodes[from..to], scope).and_then(Number::integer)
                    };
                    lengths.push((end(1)? - end(0)? + 1).max(0));
                }
                _ => {}
            }
        }
        Ok(lengths)
    }

    /// The array with a name, and whether it lies in data memory.
    fn array(&self, name: NameRef, scope: &Rc<Scope>) -> Result<(Array, bool), Fault> {
        match self.meaning(name, scope)? {
            Meaning::Registers(array) => Ok((array, false)),
            Meaning::Memory(array) => Ok((array, true)),
            Meaning::Argument(Operand { kind: OperandKind::Name(name), .. }, scope) => {
                self.array(name, &scope)
            }
            _ => Err("expected an array".to_owned()),
        }
    }

    fn at(&self, name: NameRef, place: &[i64], scope: &Rc<Scope>) -> Result<Place, Fault> {
        let (Array { first, sizes, ty }, is_memory) = self.array(name, scope)?;
        let mut index = 0;
        for (at, size) in place.iter().zip(&sizes) {
            if !(1..=*size).contains(at) || place.len() != sizes.len() {
                return Err(format!("there is no element {place:?} of {sizes:?}"));
            }
            index = index * size + at - 1;
        }
        let at = first + index as usize;
        Ok(if is_memory { Place::Word(at, ty) } else { Place::Cell(at) })
    }
}

/// The value as an index, which must be an integer.
fn integer(value: Value) -> Result<i64, Fault> {
    match value {
        Value::Number(number) => number.integer(),
        Value::Bits(bits, Type::I) => Ok(i64::from(bits.cast_signed())),
        Value::Bits(..) => Err("an index that is not an integer".to_owned()),
    }
}

/// Two values as bits of one type.
fn same(a: Value, b: Value) -> Result<(u32, u32, Type), Fault> {
    let ty = match (a, b) {
        (Value::Bits(_, Type::F), _) | (_, Value::Bits(_, Type::F)) => Type::F,
        (Value::Bits(_, Type::I), _) | (_, Value::Bits(_, Type::I)) => Type::I,
        _ => return Err("numbers alone, or bits".to_owned()),
    };
    Ok((a.bits(ty)?, b.bits(ty)?, ty))
}

fn apply(op: Op, a: u32, b: u32) -> Value {
    Value::Bits(compute::<fp::Host>(op, a, b, 0).bits, op.row().result_type())
}

fn truth(condition: bool) -> Value {
    Value::Bits(u32::from(condition), Type::I)
}

fn prefix(operator: Operator, a: Value) -> Result<Value, Fault> {
    match (operator, a) {
        (Operator::Add, a) => Ok(a),
        (Operator::Sub, Value::Number(Number::Int(a))) => Ok(Value::Number(Number::Int(-a))),
        (Operator::Sub, Value::Number(Number::Real(a))) => Ok(Value::Number(Number::Real(-a))),
        (Operator::Sub, Value::Bits(a, Type::F)) => Ok(apply(Op::fneg, a, 0)),
        (Operator::Sub, Value::Bits(a, Type::I)) => Ok(Value::Bits(a.wrapping_neg(), Type::I)),
        (Operator::Not, Value::Bits(a, Type::I)) => Ok(truth(a == 0)),
        _ => Err(format!("the prefix {} is not known", operator.text())),
    }
}

fn infix(operator: Operator, a: Value, b: Value) -> Result<Value, Fault> {
    use Operator::*;
    if let (Value::Number(a), Value::Number(b)) = (a, b) {
        return numbers(operator, a, b).map(Value::Number);
    }
    let (x, y, ty) = same(a, b)?;
    let float = |op, x, y| Ok(apply(op, x, y));
    let int = |value: u32| Ok(Value::Bits(value, Type::I));
    let (i, j) = (x.cast_signed(), y.cast_signed());
    match (ty, operator) {
        (Type::F, Add) => float(Op::fadd, x, y),
        (Type::F, Sub) => float(Op::fsub, x, y),
        (Type::F, Mul) => float(Op::fmul, x, y),
        (Type::F, Div) => float(Op::fdiv, x, y),
        (Type::F, Eq) => float(Op::feq, x, y),
        (Type::F, Ne) => prefix(Not, apply(Op::feq, x, y)),
        (Type::F, Lt) => float(Op::flt, x, y),
        (Type::F, Le) => float(Op::fle, x, y),
        (Type::F, Gt) => float(Op::flt, y, x),
        (Type::F, Ge) => float(Op::fle, y, x),
        (Type::I, Add) => int(x.wrapping_add(y)),
        (Type::I, Sub) => int(x.wrapping_sub(y)),
        (Type::I, Mul) => int(x.wrapping_mul(y)),
        (Type::I, And) => int(x & y),
        (Type::I, Or) => int(x | y),
        (Type::I, Shl) => int(x << (y & 31)),
        (Type::I, Shr) => int((i >> (y & 31)).cast_unsigned()),
        (Type::I, Eq) => Ok(truth(x == y)),
        (Type::I, Ne) => Ok(truth(x != y)),
        (Type::I, Lt) => Ok(truth(i < j)),
        (Type::I, Le) => Ok(truth(i <= j)),
        (Type::I, Gt) => Ok(truth(i > j)),
        (Type::I, Ge) => Ok(truth(i >= j)),
        _ => Err(format!("{} of {ty:?} is not known", operator.text())),
    }
}

/// Value of an operator between two numbers that are known while assembling.
fn numbers(operator: Operator, a: Number, b: Number) -> Result<Number, Fault> {
    use Operator::*;
    let compared = match operator {
        Eq => Some(a.real() == b.real()),
        Ne => Some(a.real() != b.real()),
        Lt => Some(a.real() < b.real()),
        Le => Some(a.real() <= b.real()),
        Gt => Some(a.real() > b.real()),
        Ge => Some(a.real() >= b.real()),
        _ => None,
    };
    if let Some(compared) = compared {
        return Ok(Number::Int(i64::from(compared)));
    }
    match (operator, a, b) {
        (Add, Number::Int(a), Number::Int(b)) => Ok(Number::Int(a + b)),
        (Sub, Number::Int(a), Number::Int(b)) => Ok(Number::Int(a - b)),
        (Mul, Number::Int(a), Number::Int(b)) => Ok(Number::Int(a * b)),
        (Div, Number::Int(a), Number::Int(b)) if b != 0 && a % b == 0 => Ok(Number::Int(a / b)),
        (Rem, Number::Int(a), Number::Int(b)) if b != 0 => Ok(Number::Int((a % b + b) % b)),
        (Shl, Number::Int(a), Number::Int(b @ 0..=31)) => Ok(Number::Int(a << b)),
        (Shr, Number::Int(a), Number::Int(b @ 0..=31)) => Ok(Number::Int(a >> b)),
        (And, Number::Int(a), Number::Int(b)) => Ok(Number::Int(a & b)),
        (Or, Number::Int(a), Number::Int(b)) => Ok(Number::Int(a | b)),
        (Add, ..) => Ok(Number::Real(a.real() + b.real())),
        (Sub, ..) => Ok(Number::Real(a.real() - b.real())),
        (Mul, ..) => Ok(Number::Real(a.real() * b.real())),
        (Div, ..) if b.real() != 0.0 => Ok(Number::Real(a.real() / b.real())),
        _ => Err(format!("{} of numbers is not known", operator.text())),
    }
}

fn function(name: &str, values: &[Value]) -> Result<Value, Fault> {
    let float = |which: usize| values.get(which).ok_or("too few arguments")?.bits(Type::F);
    let unary = |op| Ok(apply(op, float(0)?, 0));
    match (name, values) {
        ("itof", [n]) => Ok(apply(Op::itof, n.bits(Type::I)?, 0)),
        ("sqrt", [Value::Bits(..)]) => unary(Op::fsqrt),
        ("abs", [Value::Bits(..)]) => unary(Op::fabs),
        ("sign", [Value::Bits(..)]) => unary(Op::fsign),
        ("ftoi", [Value::Bits(..)]) => unary(Op::ftoi),
        ("min", [_, _]) => Ok(apply(Op::fmin, float(0)?, float(1)?)),
        ("max", [_, _]) => Ok(apply(Op::fmax, float(0)?, float(1)?)),
        ("sat", [_, _]) => Ok(apply(Op::fsat, float(0)?, float(1)?)),
        ("mul24", [a, b]) => {
            let of_24_bits = |bits: u32| (bits << 8).cast_signed() >> 8;
            let (a, b) = (of_24_bits(a.bits(Type::I)?), of_24_bits(b.bits(Type::I)?));
            Ok(Value::Bits(a.wrapping_mul(b).cast_unsigned(), Type::I))
        }
        _ => Err(format!("the function `{name}` of this is not known")),
    }
}

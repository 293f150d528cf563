// SPDX-License-Identifier: MIT OR Apache-2.0
//! Makes nodes: simplifies integers and conditions, bounds the values of integers, and puts operations into the block. Operations on
//! floats stay as they are: every one of them rounds.

use super::{Exec, MAX_NODES};
use crate::Error;
use crate::c::ir::{FULL, Id, Kind, Node, Op, Range, Statement};
use crate::c::value::Condition;

fn fits(range: (i128, i128)) -> Range {
    let (low, high) = range;
    if low >= i128::from(FULL.0) && high <= i128::from(FULL.1) { (low as i64, high as i64) } else { FULL }
}

/// Least and greatest value of a result.
fn range_of(op: Op, ranges: &[Range]) -> Range {
    let wide = |index: usize| (i128::from(ranges[index].0), i128::from(ranges[index].1));
    match op {
        Op::Equal | Op::Less | Op::LessEqual | Op::IntEqual | Op::IntLess | Op::Below | Op::Not => (0, 1),
        Op::IntAdd => fits((wide(0).0 + wide(1).0, wide(0).1 + wide(1).1)),
        Op::IntSub => fits((wide(0).0 - wide(1).1, wide(0).1 - wide(1).0)),
        Op::IntMul => {
            let ((a, b), (c, d)) = (wide(0), wide(1));
            let corners = [a * c, a * d, b * c, b * d];
            fits((*corners.iter().min().expect("four"), *corners.iter().max().expect("four")))
        }
        Op::And if ranges[0].0 >= 0 || ranges[1].0 >= 0 => {
            let most = ranges.iter().filter(|range| range.0 >= 0).map(|range| range.1).min();
            (0, most.unwrap_or(FULL.1))
        }
        Op::Or | Op::Xor if ranges[0].0 >= 0 && ranges[1].0 >= 0 => {
            let most = ranges[0].1.max(ranges[1].1) as u64;
            (0, (most + 1).next_power_of_two() as i64 - 1)
        }
        Op::ShiftLeft if ranges[1].0 == ranges[1].1 => {
            let by = 1_i128 << (ranges[1].0 & 31);
            fits((wide(0).0 * by, wide(0).1 * by))
        }
        Op::ShiftRight if ranges[1].0 == ranges[1].1 => {
            let by = ranges[1].0 & 31;
            (ranges[0].0 >> by, ranges[0].1 >> by)
        }
        Op::ShiftRightLogical if ranges[1].0 == ranges[1].1 && ranges[1].0 & 31 > 0 => {
            let by = ranges[1].0 & 31;
            if ranges[0].0 >= 0 { (ranges[0].0 >> by, ranges[0].1 >> by) } else { (0, (1 << (32 - by)) - 1) }
        }
        Op::IntDiv if ranges[1].0 == ranges[1].1 && ranges[1].0 > 0 => {
            (ranges[0].0 / ranges[1].0, ranges[0].1 / ranges[1].0)
        }
        Op::IntDiv => {
            let most = wide(0).0.abs().max(wide(0).1.abs());
            fits((if ranges[0].0 >= 0 && ranges[1].0 >= 0 { 0 } else { -most }, most))
        }
        Op::UnsignedDiv if ranges[1].0 == ranges[1].1 && ranges[1].0 > 0 => {
            fits((0, i128::from(u32::MAX) / wide(1).0))
        }
        Op::IntRem if ranges[1].0 == ranges[1].1 && ranges[1].0 > 0 => {
            let most = ranges[1].0 - 1;
            (if ranges[0].0 >= 0 { 0 } else { -most }, if ranges[0].1 <= 0 { 0 } else { most })
        }
        Op::Copy => ranges[0],
        Op::Select => (ranges[1].0.min(ranges[2].0), ranges[1].1.max(ranges[2].1)),
        _ => FULL,
    }
}

/// The value of an operation on known integers.
fn computed(op: Op, operands: &[i32]) -> Option<i32> {
    let (a, b) = (operands[0], operands.get(1).copied().unwrap_or(0));
    let shift = b as u32 & 31;
    Some(match op {
        Op::IntAdd => a.wrapping_add(b),
        Op::IntSub => a.wrapping_sub(b),
        Op::IntMul => a.wrapping_mul(b),
        Op::ProductHigh => ((u64::from(a as u32) * u64::from(b as u32)) >> 32) as i32,
        Op::IntDiv => a.checked_div(b)?,
        Op::IntRem => a.checked_rem(b)?,
        Op::UnsignedDiv => (a as u32).checked_div(b as u32)? as i32,
        Op::And => a & b,
        Op::Or => a | b,
        Op::Xor => a ^ b,
        Op::ShiftLeft => a << shift,
        Op::ShiftRight => a >> shift,
        Op::ShiftRightLogical => ((a as u32) >> shift) as i32,
        Op::IntEqual => i32::from(a == b),
        Op::IntLess => i32::from(a < b),
        Op::Below => i32::from((a as u32) < b as u32),
        Op::Not => i32::from(a == 0),
        _ => return None,
    })
}

impl Exec<'_> {
    /// Adds an operation, or returns a simpler node of equal value.
    pub(super) fn op(&mut self, op: Op, operands: &[Id]) -> Result<Id, Error> {
        if let Some(simple) = self.simplified(op, operands) {
            return Ok(simple);
        }
        // A counter that an iteration which is written out knows is shifted by the assembler, in 64 bits.
        if op == Op::ShiftLeft && self.nodes.is_counted(operands[0]) {
            let ((least, most), (by, last)) = (self.nodes.range(operands[0]), self.nodes.range(operands[1]));
            let fits =
                |value: i64| (i64::from(i32::MIN)..=i64::from(u32::MAX)).contains(&(value << (by & 31)));
            if by == last && by & 31 > 0 && !(fits(least) && fits(most)) {
                let mask = self.nodes.int((u32::MAX >> (by & 31)) as i32);
                let kept = self.op(Op::And, &[operands[0], mask])?;
                return self.op(Op::ShiftLeft, &[kept, operands[1]]);
            }
        }
        if let Some(sum) = self.offset(op, operands) {
            return self.op(Op::IntAdd, &sum);
        }
        let mut places = [Id(0); 3];
        places[..operands.len()].copy_from_slice(operands);
        let ranges: Vec<Range> = operands.iter().map(|id| self.nodes.range(*id)).collect();
        let range = range_of(op, &ranges);
        let node = Node::Op(op, places, operands.len() as u8);
        self.put(node, op.kind(), range)
    }

    /// Adds a node, with a place in the block.
    pub(in crate::c) fn put(&mut self, node: Node, kind: Kind, range: Range) -> Result<Id, Error> {
        let (id, new) = self.nodes.add(node, kind, range);
        if new {
            if self.nodes.len() > MAX_NODES {
                return self.fail(format!("it computes more than {MAX_NODES} values"));
            }
            self.spend()?;
            self.emit(Statement::Def(id));
        }
        Ok(id)
    }

    fn constant(&self, id: Id) -> Option<i32> {
        match self.nodes.node(id) {
            Node::Int(value) => Some(value),
            _ => None,
        }
    }

    /// Sums with a number in one form, modulo 2³²: a value and a number last, as subscripts are encoded.
    fn offset(&mut self, op: Op, operands: &[Id]) -> Option<[Id; 2]> {
        let &[a, b] = operands else { return None };
        match (op, self.constant(a), self.constant(b)) {
            (Op::IntSub, None, Some(by)) => Some([a, self.nodes.int(by.wrapping_neg())]),
            (Op::IntMul, None, Some(by)) => match self.nodes.node(a) {
                Node::Op(Op::IntAdd, [x, before, _], _) => {
                    let before = self.constant(before)?;
                    let product = self.op(Op::IntMul, &[x, b]).ok()?;
                    Some([product, self.nodes.int(before.wrapping_mul(by))])
                }
                _ => None,
            },
            (Op::IntAdd, Some(_), None) => Some([b, a]),
            (Op::IntAdd, None, Some(by)) => match self.nodes.node(a) {
                Node::Op(Op::IntAdd, [x, before, _], _) => {
                    let before = self.constant(before)?;
                    Some([x, self.nodes.int(before.wrapping_add(by))])
                }
                _ => None,
            },
            _ => None,
        }
    }

    fn simplified(&mut self, op: Op, operands: &[Id]) -> Option<Id> {
        let constants: Vec<i32> = operands.iter().filter_map(|id| self.constant(*id)).collect();
        if constants.len() == operands.len()
            && let Some(value) = computed(op, &constants)
        {
            return Some(self.nodes.int(value));
        }
        let first = operands[0];
        let (a, b) = (self.constant(first), operands.get(1).and_then(|id| self.constant(*id)));
        let second = operands.get(1).copied().unwrap_or(first);
        let bit = |exec: &Self, id| exec.nodes.range(id).0 >= 0 && exec.nodes.range(id).1 <= 1;
        match (op, a, b) {
            (Op::IntAdd | Op::Or | Op::Xor, Some(0), _) => Some(second),
            (
                Op::IntAdd
                | Op::IntSub
                | Op::Or
                | Op::Xor
                | Op::ShiftLeft
                | Op::ShiftRight
                | Op::ShiftRightLogical,
                _,
                Some(0),
            ) => Some(first),
            (Op::IntMul | Op::IntDiv, _, Some(1)) => Some(first),
            (Op::IntMul, Some(1), _) => Some(second),
            (Op::IntMul | Op::ProductHigh | Op::And, Some(0), _)
            | (Op::IntMul | Op::ProductHigh | Op::And, _, Some(0)) => Some(self.nodes.int(0)),
            (Op::And, Some(1), _) if bit(self, second) => Some(second),
            (Op::And, _, Some(1)) if bit(self, first) => Some(first),
            (Op::And | Op::Or, ..) if first == second => Some(first),
            (Op::Xor | Op::IntSub, ..) if first == second => Some(self.nodes.int(0)),
            (Op::IntEqual, ..) if first == second => Some(self.nodes.int(1)),
            (Op::IntLess | Op::Below, ..) if first == second => Some(self.nodes.int(0)),
            (Op::IntEqual | Op::IntLess, ..) => {
                let ((al, ah), (bl, bh)) = (self.nodes.range(first), self.nodes.range(second));
                let known = match op {
                    Op::IntEqual if ah < bl || bh < al => Some(0),
                    Op::IntLess if ah < bl => Some(1),
                    Op::IntLess if al >= bh => Some(0),
                    _ => None,
                };
                known.map(|value| self.nodes.int(value))
            }
            (Op::Not, Some(value), _) => Some(self.nodes.int(i32::from(value == 0))),
            (Op::Not, None, _) => match self.nodes.node(first) {
                Node::Op(Op::Not, [inner, ..], _) if bit(self, inner) => Some(inner),
                _ => None,
            },
            _ => None,
        }
    }

    /// Selects `yes` or `no`; `condition` is 0 or 1.
    pub(super) fn select(&mut self, condition: Id, yes: Id, no: Id) -> Result<Id, Error> {
        if yes == no {
            return Ok(yes);
        }
        if let Some(known) = self.constant(condition) {
            return Ok(if known != 0 { yes } else { no });
        }
        if let Node::Op(Op::Not, [inner, ..], _) = self.nodes.node(condition) {
            return self.select(inner, no, yes);
        }
        if self.nodes.kind(yes) == Kind::Float {
            return self.op(Op::SelectFloat, &[condition, yes, no]);
        }
        let is_bit = |id: Id| self.nodes.range(id).0 >= 0 && self.nodes.range(id).1 <= 1;
        match (self.constant(yes), self.constant(no)) {
            (Some(1), Some(0)) => Ok(condition),
            (Some(0), Some(1)) => self.op(Op::Not, &[condition]),
            (_, Some(0)) if is_bit(yes) => self.op(Op::And, &[condition, yes]),
            (Some(1), _) if is_bit(no) => self.op(Op::Or, &[condition, no]),
            (Some(0), _) if is_bit(no) => {
                let not = self.op(Op::Not, &[condition])?;
                self.op(Op::And, &[not, no])
            }
            (_, Some(1)) if is_bit(yes) => {
                let not = self.op(Op::Not, &[condition])?;
                self.op(Op::Or, &[not, yes])
            }
            _ => self.op(Op::Select, &[condition, yes, no]),
        }
    }

    /// A condition as a node that is 0 or 1.
    pub(super) fn condition_id(&mut self, condition: Condition) -> Id {
        match condition {
            Condition::Known(known) => self.nodes.int(i32::from(known)),
            Condition::Node(id) => id,
        }
    }

    pub(super) fn condition_of(&self, id: Id) -> Condition {
        match self.constant(id) {
            Some(value) => Condition::Known(value != 0),
            None => Condition::Node(id),
        }
    }

    pub(super) fn and(&mut self, a: Condition, b: Condition) -> Result<Condition, Error> {
        Ok(match (a, b) {
            (Condition::Known(false), _) | (_, Condition::Known(false)) => Condition::Known(false),
            (Condition::Known(true), other) | (other, Condition::Known(true)) => other,
            (Condition::Node(a), Condition::Node(b)) => {
                let id = self.op(Op::And, &[a, b])?;
                self.condition_of(id)
            }
        })
    }

    pub(super) fn or(&mut self, a: Condition, b: Condition) -> Result<Condition, Error> {
        Ok(match (a, b) {
            (Condition::Known(true), _) | (_, Condition::Known(true)) => Condition::Known(true),
            (Condition::Known(false), other) | (other, Condition::Known(false)) => other,
            (Condition::Node(a), Condition::Node(b)) => {
                let id = self.op(Op::Or, &[a, b])?;
                self.condition_of(id)
            }
        })
    }

    pub(super) fn not(&mut self, condition: Condition) -> Result<Condition, Error> {
        Ok(match condition {
            Condition::Known(known) => Condition::Known(!known),
            Condition::Node(id) => {
                let id = self.op(Op::Not, &[id])?;
                self.condition_of(id)
            }
        })
    }
}

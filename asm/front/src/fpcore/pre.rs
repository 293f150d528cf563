// SPDX-License-Identifier: MIT OR Apache-2.0
//! Preconditions: ranges of the arguments, and assumptions about expressions of several.

use super::evaluate::Reader;
use super::syntax::Tree;
use super::truth::Truth;
use crate::Error;
use crate::graph::{Assumption, Binary, Bound, Expr, Node, Port, Unary};
use crate::sink::expression;
use std::rc::Rc;

/// Ranges and assumptions that a precondition states.
#[derive(Default)]
pub(super) struct Precondition {
    /// Range of each argument, in the core's order.
    pub(super) ranges: Vec<Option<(f64, f64)>>,
    pub(super) assumptions: Vec<Assumption>,
    pub(super) notes: Vec<String>,
}

/// Ends of an argument's range that are known so far.
type Ends = (Option<f32>, Option<f32>);

/// A bound of an expression by a number.
struct Limit<'g> {
    expr: Expr<'g>,
    bound: Bound,
    value: f64,
    /// The expression may not be the number itself.
    strict: bool,
}

/// Reads a precondition.
///
/// # Errors
/// If it is no condition, or no argument fulfils it.
pub(super) fn read<'a, 't>(
    reader: &mut Reader<'a, 't, '_>,
    condition: Tree<'a, 't>,
    arguments: &[&'a str],
    inputs: &[Port],
) -> Result<Precondition, Error> {
    reader.bind_inputs(arguments);
    let truth = reader.truth(condition)?;
    let mut ends: Vec<Ends> = vec![(None, None); inputs.len()];
    let mut pre = Precondition::default();
    let mut left = Vec::new();
    let mut open = vec![truth];
    while let Some(truth) = open.pop() {
        match &*truth {
            Truth::Known(true) => {}
            Truth::Known(false) => return Err(condition.error("no argument fulfils `:pre`")),
            Truth::All(list) => open.extend(list.of.iter().rev().map(Rc::clone)),
            Truth::Compare(op, a, b) => {
                let limits = limits(*op, *a, *b);
                if limits.is_empty() {
                    left.push(spelled(&truth, inputs));
                }
                for limit in limits {
                    take(limit, &mut ends, &mut pre.assumptions);
                }
            }
            Truth::Any(_) => left.push(spelled(&truth, inputs)),
        }
    }
    for (input, end) in inputs.iter().zip(ends) {
        let range = match end {
            (Some(low), Some(high)) if low > high => {
                return Err(condition.error(format!("`:pre` leaves no number for `{}`", input.name)));
            }
            (Some(low), Some(high)) => Some((f64::from(low), f64::from(high))),
            (Some(low), None) => {
                left.push(format!("{} >= {low:?}", input.name));
                None
            }
            (None, Some(high)) => {
                left.push(format!("{} <= {high:?}", input.name));
                None
            }
            (None, None) => None,
        };
        pre.ranges.push(range);
    }
    if !left.is_empty() {
        pre.notes.push(format!("of the precondition, no range or assumption: {}", left.join("; ")));
    }
    Ok(pre)
}

/// Bounds by numbers that a comparison states.
fn limits<'g>(op: Binary, a: Expr<'g>, b: Expr<'g>) -> Vec<Limit<'g>> {
    let strict = op == Binary::Less;
    let most = |expr: Expr<'g>, value: f64| Limit { expr, bound: Bound::AtMost, value, strict };
    let least = |expr: Expr<'g>, value: f64| Limit { expr, bound: Bound::AtLeast, value, strict };
    match (op, a.value(), b.value()) {
        (Binary::NotEqual, ..) => Vec::new(),
        (Binary::Equal, _, Some(value)) => vec![least(a, value), most(a, value)],
        (Binary::Equal, Some(value), _) => vec![least(b, value), most(b, value)],
        (Binary::Equal, ..) => vec![least(a - b, 0.0), most(a - b, 0.0)],
        (_, _, Some(value)) => vec![most(a, value)],
        (_, Some(value), _) => vec![least(b, value)],
        _ => vec![least(b - a, 0.0)],
    }
}

/// Adds a bound to the ranges of arguments, or to the assumptions.
fn take(limit: Limit<'_>, ends: &mut [Ends], assumptions: &mut Vec<Assumption>) {
    let mut open = vec![limit];
    while let Some(Limit { expr, bound, value, strict }) = open.pop() {
        let graph = expr.graph();
        let turned = if bound == Bound::AtLeast { Bound::AtMost } else { Bound::AtLeast };
        match graph.node(expr.id()) {
            Node::Input(index) => {
                let Some((low, high)) = ends.get_mut(index as usize) else { continue };
                // A real number within the bound is rounded to a binary32 within the rounded bound.
                let rounded = value as f32;
                let is_open = strict && f64::from(rounded) == value;
                match bound {
                    Bound::AtLeast => {
                        let end = if is_open { rounded.next_up() } else { rounded };
                        *low = Some(low.map_or(end, |known| known.max(end)));
                    }
                    Bound::AtMost => {
                        let end = if is_open { rounded.next_down() } else { rounded };
                        *high = Some(high.map_or(end, |known| known.min(end)));
                    }
                }
            }
            Node::Unary(Unary::Neg, inner) => {
                open.push(Limit { expr: graph.expr(inner), bound: turned, value: -value, strict });
            }
            Node::Unary(Unary::Abs, inner) if bound == Bound::AtMost => {
                let expr = graph.expr(inner);
                open.push(Limit { expr, bound: turned, value: -value, strict });
                open.push(Limit { expr, bound, value, strict });
            }
            Node::Constant(_) => {}
            _ => assumptions.push(Assumption { node: expr.id(), bound, value }),
        }
    }
}

/// A condition as the language spells it.
fn spelled(truth: &Truth<'_>, inputs: &[Port]) -> String {
    match truth {
        Truth::Known(known) => known.to_string(),
        Truth::Compare(op, a, b) => {
            let side = |expr: &Expr<'_>| expression(expr.graph(), inputs, expr.id());
            let sign = match op {
                Binary::Less => "<",
                Binary::LessEqual => "<=",
                Binary::Equal => "==",
                _ => "!=",
            };
            format!("{} {sign} {}", side(a), side(b))
        }
        Truth::All(list) => joined(&list.of, " and ", inputs),
        Truth::Any(list) => joined(&list.of, " or ", inputs),
    }
}

fn joined(of: &[Rc<Truth<'_>>], word: &str, inputs: &[Port]) -> String {
    /// Limit on the conditions of a note.
    const MOST: usize = 8;
    let mut parts: Vec<String> = of.iter().take(MOST).map(|truth| spelled(truth, inputs)).collect();
    if of.len() > MOST {
        parts.push("…".to_owned());
    }
    format!("({})", parts.join(word))
}

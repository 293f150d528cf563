// SPDX-License-Identifier: MIT OR Apache-2.0
//! Relations between values that intervals and linear forms do not capture: a component is at most the norm that it is part of.

use super::interval::Interval;
use super::node::{Meaning, Node};
use super::value::Value;
use std::rc::Rc;

/// Limit on the depth of the search for a relation, in operations.
const MAX_DEPTH: u32 = 24;
/// Least norm whose square root is known to be no less than a component: smaller squares may lose digits to underflow.
const LEAST_NORM: f64 = 1.0 / (1u64 << 60) as f64;
/// Largest norm whose inverse is not a subnormal number.
const LARGEST_NORM: f64 = (1u128 << 100) as f64;
/// Ratio of a divisor's magnitudes, or a root's, from which its range is divided into parts.
const STEEP: f64 = 4.0;

/// Operand of an operation.
fn source<'n>(meaning: &Meaning, operands: &'n [Rc<Node>; 3]) -> Option<&'n Rc<Node>> {
    match meaning {
        Meaning::Source(place) => Some(&operands[*place]),
        _ => None,
    }
}

/// Meaning of the operation that gave a node, with its operands.
fn made(node: &Rc<Node>) -> Option<(Meaning, &[Rc<Node>; 3])> {
    let made = node.made.as_ref()?;
    Some((Meaning::of(&made.instruction)?, &made.operands))
}

/// Limit on the magnitude of a result, in the run and exactly: of a component over its norm, or times the norm's inverse.
///
/// In the run the quotient of a component and its norm is at most 1, too: the square root of a rounded square is the number itself (Boldo,
/// 2015), and rounding is monotonic. The inverse is at most half an ulp too large, and a product of at most 1 + 2⁻²⁴ is rounded to 1.
pub(super) fn limit(meaning: &Meaning, operands: &[Rc<Node>; 3]) -> Option<f64> {
    match meaning {
        Meaning::Div(of) => {
            let (a, b) = (source(&of[0], operands)?, source(&of[1], operands)?);
            (is_norm(b) && exceeds(b, a, MAX_DEPTH)).then_some(1.0)
        }
        Meaning::Mul(of) => {
            let (a, b) = (source(&of[0], operands)?, source(&of[1], operands)?);
            let by_inverse = |component: &Rc<Node>, inverse: &Rc<Node>| {
                let (Meaning::Div(of), operands) = made(inverse)? else { return None };
                let (one, norm) = (source(&of[0], operands)?, source(&of[1], operands)?);
                let is_inverse = one.value == Value::bits(1f32.to_bits()) && is_norm(norm);
                (is_inverse && exceeds(norm, component, MAX_DEPTH)).then_some(1.0)
            };
            by_inverse(a, b).or_else(|| by_inverse(b, a))
        }
        _ => None,
    }
}

/// Positive, and large enough for the theorem on roots of squares.
fn is_norm(node: &Rc<Node>) -> bool {
    node.value.float().is_ok_and(|number| {
        let Interval { low, high } = number.actual;
        low >= LEAST_NORM && high <= LARGEST_NORM && number.exact.low > 0.0
    })
}

fn positive(node: &Rc<Node>) -> bool {
    node.value.float().is_ok_and(|number| number.actual.low >= 0.0 && number.exact.low >= 0.0)
}

/// Operand below negations and absolute values, whose magnitude is the same.
fn unsigned(node: &Rc<Node>) -> &Rc<Node> {
    let Some(operation) = &node.made else { return node };
    match Meaning::of(&operation.instruction) {
        Some(Meaning::Neg(of) | Meaning::Abs(of)) => source(&of, &operation.operands).map_or(node, unsigned),
        _ => node,
    }
}

/// The norm is at least the magnitude of the component.
fn exceeds(norm: &Rc<Node>, component: &Rc<Node>, depth: u32) -> bool {
    if depth == 0 {
        return false;
    }
    let component = unsigned(component);
    let Some((meaning, operands)) = made(norm) else { return false };
    match &meaning {
        Meaning::Abs(_) => Rc::ptr_eq(unsigned(norm), component),
        Meaning::Sqrt(of) => source(of, operands).is_some_and(|sum| has_square(sum, component, depth - 1)),
        Meaning::Maximum(of) => of
            .iter()
            .filter_map(|part| source(part, operands))
            .any(|part| Rc::ptr_eq(part, component) && positive(part) || exceeds(part, component, depth - 1)),
        _ => false,
    }
}

/// The sum has the square of the component as a term, and its other terms are not negative.
fn has_square(sum: &Rc<Node>, component: &Rc<Node>, depth: u32) -> bool {
    if depth == 0 {
        return false;
    }
    let Some((meaning, operands)) = made(sum) else { return false };
    let is_square = |part: &Meaning| match part {
        Meaning::Mul(of) => of.iter().all(|factor| {
            source(factor, operands).is_some_and(|factor| Rc::ptr_eq(unsigned(factor), component))
        }),
        _ => false,
    };
    // A square inside a fused sum is not negative, like any square.
    let is_any_square = |part: &Meaning| match part {
        Meaning::Mul(of) => match [source(&of[0], operands), source(&of[1], operands)] {
            [Some(a), Some(b)] => Rc::ptr_eq(a, b),
            _ => false,
        },
        _ => false,
    };
    let adds = |part: &Meaning| source(part, operands).is_some_and(positive) || is_any_square(part);
    let has = |part: &Meaning| {
        is_square(part) || source(part, operands).is_some_and(|part| has_square(part, component, depth - 1))
    };
    match &meaning {
        Meaning::Mul(_) => is_square(&meaning),
        Meaning::Add(of) => has(&of[0]) && adds(&of[1]) || has(&of[1]) && adds(&of[0]),
        Meaning::Maximum(of) => of.iter().any(has),
        _ => false,
    }
}

/// Quotient or root whose operand has very different magnitudes, so the middle of its range says little.
pub(super) fn is_steep(meaning: &Meaning, operands: &[Rc<Node>; 3]) -> bool {
    let range = |meaning: &Meaning| {
        let node = source(meaning, operands)?;
        node.value.float().ok().map(|number| number.actual)
    };
    match meaning {
        Meaning::Div(of) => {
            let depends = source(&of[0], operands).is_some_and(|node| node.made.is_some());
            depends
                && range(&of[1]).is_some_and(|divisor| {
                    !divisor.contains(0.0) && divisor.magnitude() > STEEP * divisor.abs().low
                })
        }
        _ => false,
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Relations between values that intervals and linear forms do not capture: a component is at most the norm that it is part of, and a rotation
//! keeps the norm.

use super::interval::Interval;
use super::node::{Meaning, Node};
use super::number::Number;
use super::rounding;
use super::value::Value;
use std::rc::Rc;
use takt_isa::Op;

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

/// Limits on a result in the run and exactly.
pub(super) struct Limit {
    pub(super) magnitude: f64,
    /// Limit on the error; may be infinite.
    pub(super) error: f64,
}

/// Limits of a component over its norm, or times the norm's inverse; and of a coordinate after a rotation.
pub(super) fn limit(meaning: &Meaning, operands: &[Rc<Node>; 3]) -> Option<Limit> {
    ratio(meaning, operands)
        .map(|magnitude| Limit { magnitude, error: f64::INFINITY })
        .or_else(|| Rotation::of(meaning, operands)?.limit())
}

/// Operand of a limit by a constant, and where the limit does not give the result.
pub(super) fn open(meaning: &Meaning, operands: &[Rc<Node>; 3]) -> Option<(Rc<Node>, Interval)> {
    let limit = |node: &Rc<Node>| {
        let number = node.value.float().ok()?;
        let Interval { low, high } = number.actual;
        (low == high && number.error.is_zero()).then_some(low)
    };
    let either = |of: &[Meaning; 2]| {
        let (a, b) = (source(&of[0], operands)?, source(&of[1], operands)?);
        let found = limit(b).map(|at| (a, at)).or_else(|| limit(a).map(|at| (b, at)))?;
        Some((Rc::clone(found.0), found.1))
    };
    match meaning {
        Meaning::Minimum(of) => either(of).map(|(node, at)| (node, Interval::new(f64::NEG_INFINITY, at))),
        Meaning::Maximum(of) => either(of).map(|(node, at)| (node, Interval::new(at, f64::INFINITY))),
        Meaning::Saturate(of) => {
            let (node, at) = (source(&of[0], operands)?, limit(source(&of[1], operands)?)?.abs());
            Some((Rc::clone(node), Interval::new(-at, at)))
        }
        _ => None,
    }
}

/// Limit on the magnitude of a component over its norm.
///
/// In the run the quotient of a component and its norm is at most 1, too: the square root of a rounded square is the number itself (Boldo,
/// 2015), and rounding is monotonic. The inverse is at most half an ulp too large, and a product of at most 1 + 2⁻²⁴ is rounded to 1.
fn ratio(meaning: &Meaning, operands: &[Rc<Node>; 3]) -> Option<f64> {
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

/// Term of a sum that is a product.
struct Product<'n> {
    factors: [&'n Rc<Node>; 2],
    /// Node of the product, if it is rounded by itself.
    rounded: Option<&'n Rc<Node>>,
}

/// Product that a part of a meaning is, or the operation that gave its source, with either sign.
fn product<'n>(meaning: &Meaning, operands: &'n [Rc<Node>; 3]) -> Option<Product<'n>> {
    match meaning {
        Meaning::Neg(of) => product(of, operands),
        Meaning::Mul(of) => {
            Some(Product { factors: [source(&of[0], operands)?, source(&of[1], operands)?], rounded: None })
        }
        Meaning::Source(place) => {
            let node = &operands[*place];
            let (meaning, operands) = made(node)?;
            let product = match meaning {
                Meaning::Neg(_) | Meaning::Mul(_) => product(&meaning, operands)?,
                _ => return None,
            };
            Some(Product { rounded: product.rounded.or(Some(node)), ..product })
        }
        _ => None,
    }
}

/// The angle of a sine or cosine, and whether it is a sine.
fn angle(node: &Rc<Node>) -> Option<(&Rc<Node>, bool)> {
    let made = node.made.as_ref()?;
    match made.instruction.op {
        Op::fsin => Some((&made.operands[0], true)),
        Op::fcos => Some((&made.operands[0], false)),
        _ => None,
    }
}

/// Coordinate after a rotation: ±x·cos φ ± y·sin φ.
struct Rotation<'n> {
    /// Cosine and sine.
    trig: [&'n Rc<Node>; 2],
    /// Coordinates before the rotation, that of the cosine first.
    before: [&'n Rc<Node>; 2],
    /// Products that are rounded by themselves.
    rounded: Vec<&'n Rc<Node>>,
}

/// Factor that covers the roundings of a cosine, a sine, two products and their sum: a few units of 2⁻²³.
const ROUNDED: f64 = 1.0 + 1.0 / (1u32 << 20) as f64;

impl<'n> Rotation<'n> {
    fn of(meaning: &Meaning, operands: &'n [Rc<Node>; 3]) -> Option<Rotation<'n>> {
        let Meaning::Add(of) = meaning else { return None };
        let terms = [product(&of[0], operands)?, product(&of[1], operands)?];
        // Each factor that is a sine or cosine, with the other one.
        let ways = terms.each_ref().map(|term| {
            let [a, b] = term.factors;
            [(a, b), (b, a)].into_iter().filter_map(|(trig, other)| Some((angle(trig)?, trig, other)))
        });
        let [first, second] = ways.map(Iterator::collect::<Vec<_>>);
        let pairs = first.iter().flat_map(|one| second.iter().map(move |other| (one, other)));
        let ((one, trig, x), (_, other_trig, y)) =
            pairs.into_iter().find(|(one, other)| Rc::ptr_eq(one.0.0, other.0.0) && one.0.1 != other.0.1)?;
        let is_sine = one.1;
        let swap = |pair: [&'n Rc<Node>; 2]| if is_sine { [pair[1], pair[0]] } else { pair };
        Some(Rotation {
            trig: swap([trig, other_trig]),
            before: swap([x, y]),
            rounded: terms.iter().filter_map(|term| term.rounded).collect(),
        })
    }

    /// |x·cos φ + y·sin φ| ≤ √(x² + y²). The error is that of the same rotation applied to the errors of x and y, with the errors of
    /// cosine and sine times the coordinates in the run, and the roundings.
    fn limit(&self) -> Option<Limit> {
        let number = |node: &Rc<Node>| node.value.float().ok();
        let [x, y] = self.before.map(number);
        let [cos, sin] = self.trig.map(number);
        let (x, y, cos, sin) = (x?, y?, cos?, sin?);
        let norm = |a: f64, b: f64| (Interval::point(a).square() + Interval::point(b).square()).sqrt().high;
        let size = |of: fn(&Number) -> Interval| norm(of(&x).magnitude(), of(&y).magnitude());
        let magnitude = size(|number| number.actual).max(size(|number| number.exact)) * ROUNDED;
        let magnitude = magnitude + f64::from(f32::MIN_POSITIVE);
        let by_trig = cos.error_range().magnitude() * x.actual.magnitude()
            + sin.error_range().magnitude() * y.actual.magnitude();
        let products = self.rounded.iter().filter_map(|node| number(node));
        let roundings: f64 = products.map(|product| rounding::bound(0.5, product.actual)).sum();
        let sum = rounding::bound(0.5, Interval::new(-magnitude, magnitude));
        let error = (size(Number::error_range) + by_trig + roundings + sum) * ROUNDED;
        let is_known = self.rounded.iter().all(|node| number(node).is_some());
        Some(Limit { magnitude, error: if is_known { error } else { f64::INFINITY } })
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
            let depends =
                of.iter().any(|part| source(part, operands).is_some_and(|node| node.made.is_some()));
            depends
                && range(&of[1]).is_some_and(|divisor| {
                    !divisor.contains(0.0) && divisor.magnitude() > STEEP * divisor.abs().low
                })
        }
        _ => false,
    }
}

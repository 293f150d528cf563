// SPDX-License-Identifier: MIT OR Apache-2.0
//! Fused multiply-add: finds the instructions that combine a product and a sum, by evaluating the meanings of the rows.

use super::instructions::{Function, Op, ROWS, Row, compute};
use crate::fp;
use crate::shape::Shape;
use std::sync::LazyLock;

/// A product, a sum with the product as a source, and the instruction that computes both with one rounding.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Fusion {
    /// Instruction of the product.
    pub product: Op,
    /// Instruction of the sum or difference.
    pub sum: Op,
    /// Index of the sum's source that is the product.
    pub source: usize,
    /// Instruction that computes both. Its sources are the product's, then the sum's other source.
    pub fused: Op,
}

static FUSIONS: LazyLock<Vec<Fusion>> = LazyLock::new(|| {
    let of = |function: Function, shape: Shape| {
        ROWS.iter().filter(move |row| row.function == function && row.shape == shape)
    };
    let mut fusions = Vec::new();
    for product in of(Function::Multiply, Shape::Dab) {
        for sum in of(Function::Add, Shape::Dab) {
            for source in [0, 1] {
                let fused =
                    of(Function::Fused, Shape::Dabc).find(|fused| does_both(product, sum, source, fused));
                fusions.extend(fused.map(|fused| Fusion {
                    product: product.op,
                    sum: sum.op,
                    source,
                    fused: fused.op,
                }));
            }
        }
    }
    fusions
});

/// `fused` and the two separate instructions give equal results, on operands for which no step rounds.
fn does_both(product: &Row, sum: &Row, source: usize, fused: &Row) -> bool {
    const EXACT: [f32; 7] = [3.0, -5.0, 0.25, 0.0, -0.0, f32::INFINITY, 15.0];
    let value = |row: &Row, [a, b, c]: [u32; 3]| compute::<fp::Host>(row.op, a, b, c);
    let numbers = || EXACT.into_iter().map(f32::to_bits);
    let triples = numbers().flat_map(|a| numbers().flat_map(move |b| numbers().map(move |c| [a, b, c])));
    triples.into_iter().all(|[a, b, c]| {
        let first = value(product, [a, b, 0]);
        let sources = if source == 0 { [first.bits, c, 0] } else { [c, first.bits, 0] };
        let second = value(sum, sources);
        let both = value(fused, [a, b, c]);
        both.bits == second.bits && both.flags == first.flags | second.flags
    })
}

/// All combinations of a product and a sum for which a fused instruction exists.
pub fn fusions() -> &'static [Fusion] {
    &FUSIONS
}

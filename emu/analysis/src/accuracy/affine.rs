// SPDX-License-Identifier: MIT OR Apache-2.0
//! Affine arithmetic: intervals that keep track of linear correlations, so that a value minus itself is exactly zero.
//!
//! A form is `center + Σ coefficient·ε ± slack`. Each noise symbol `ε` lies in [-1, 1] and has the same value in every form that
//! contains it. Rounding errors in the computation of the form itself are added to the slack.

use super::interval::Interval;
use std::cmp::Ordering;
use std::rc::Rc;

/// Bound on the relative error of a few binary64 operations, 2⁻⁵⁰.
const ROUNDING: f64 = 1.0 / (1u64 << 50) as f64;
/// An allowance for underflow in these operations.
const LEAST: f64 = 1e-300;
/// Limit on the terms of a form; beyond it, the smallest are moved to the slack.
const MAX_TERMS: usize = 1024;

/// An affine form.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Affine {
    center: f64,
    /// Symbols and coefficients, by ascending symbol.
    terms: Rc<[(u32, f64)]>,
    slack: f64,
}

impl Affine {
    pub(super) fn constant(value: f64) -> Affine {
        Affine { center: value, terms: Rc::default(), slack: 0.0 }
    }

    pub(super) fn is_zero(&self) -> bool {
        self.center == 0.0 && self.slack == 0.0 && self.terms.is_empty()
    }

    /// True if it is an interval without correlation: it has slack only.
    pub(super) fn is_free(&self) -> bool {
        self.slack > 0.0 && self.terms.is_empty()
    }

    /// The form of an interval, with a new symbol.
    pub(super) fn of(interval: Interval, symbol: u32) -> Affine {
        let radius = interval.radius();
        let terms = if radius == 0.0 { Rc::default() } else { Rc::from([(symbol, radius)]) };
        Affine { center: interval.middle(), terms, slack: 0.0 }
    }

    /// The form of an interval without correlation: all of it is slack.
    pub(super) fn free(interval: Interval) -> Affine {
        Affine { slack: interval.radius(), ..Affine::constant(interval.middle()) }
    }

    /// The radius: the sum of the magnitudes of all coefficients, and the slack.
    pub(super) fn radius(&self) -> f64 {
        let all: f64 = self.terms.iter().map(|(_, coefficient)| coefficient.abs()).sum();
        (all + self.slack) * (1.0 + self.terms.len() as f64 * ROUNDING)
    }

    pub(super) fn range(&self) -> Interval {
        let radius = self.radius();
        if radius == 0.0 {
            Interval::point(self.center)
        } else {
            Interval::point(self.center).widened(radius)
        }
    }

    /// The magnitudes of its terms by symbol, and the slack.
    pub(super) fn shares(&self) -> (impl Iterator<Item = (u32, f64)> + '_, f64) {
        (
            self.terms.iter().map(|(symbol, coefficient)| (*symbol, coefficient.abs())),
            self.slack + self.center.abs(),
        )
    }

    pub(super) fn neg(&self) -> Affine {
        let terms = self.terms.iter().map(|(symbol, coefficient)| (*symbol, -coefficient)).collect();
        Affine { center: -self.center, terms, slack: self.slack }
    }

    /// `a·x + b·y`.
    pub(super) fn combine(x: &Affine, a: f64, y: &Affine, b: f64) -> Affine {
        let mut terms = Vec::with_capacity(x.terms.len() + y.terms.len());
        let mut lost = 0.0;
        let mut mixed = |p: f64, q: f64| {
            let value = p + q;
            // Multiplying by one rounds nothing.
            lost += (p.abs() + q.abs()) * ROUNDING;
            value
        };
        let center = mixed(a * x.center, b * y.center);
        let (mut i, mut j) = (0, 0);
        loop {
            let (p, q) = (x.terms.get(i), y.terms.get(j));
            let order = match (p, q) {
                (None, None) => break,
                (Some(_), None) => Ordering::Less,
                (None, Some(_)) => Ordering::Greater,
                (Some((p, _)), Some((q, _))) => p.cmp(q),
            };
            i += usize::from(order != Ordering::Greater);
            j += usize::from(order != Ordering::Less);
            let (p, q) = (p.filter(|_| order != Ordering::Greater), q.filter(|_| order != Ordering::Less));
            let Some((symbol, _)) = p.or(q) else { break };
            let coefficient = mixed(p.map_or(0.0, |p| a * p.1), q.map_or(0.0, |q| b * q.1));
            if coefficient != 0.0 {
                terms.push((*symbol, coefficient));
            }
        }
        let exact = (a == 1.0 || x.is_zero()) && y.is_zero() || (b == 1.0 || y.is_zero()) && x.is_zero();
        let slack = (a * x.slack).abs() + (b * y.slack).abs();
        let slack = if exact { slack } else { slack * (1.0 + ROUNDING) + lost + LEAST };
        let finite = center.is_finite() && terms.iter().all(|(_, coefficient)| coefficient.is_finite());
        if !finite || slack.is_nan() {
            return Affine { slack: f64::INFINITY, ..Affine::constant(0.0) };
        }
        Affine { center, terms: terms.into(), slack }.short()
    }

    pub(super) fn add(&self, other: &Affine) -> Affine {
        Affine::combine(self, 1.0, other, 1.0)
    }

    pub(super) fn sub(&self, other: &Affine) -> Affine {
        Affine::combine(self, 1.0, other, -1.0)
    }

    /// The form with more slack.
    pub(super) fn widened(&self, by: f64) -> Affine {
        Affine { slack: (self.slack + by) * (1.0 + ROUNDING), ..self.clone() }
    }

    /// The product with an interval.
    pub(super) fn scale(&self, by: Interval) -> Affine {
        if self.is_zero() {
            return self.clone();
        }
        let spread = by.radius() * self.range().magnitude();
        Affine::combine(self, by.middle(), &Affine::constant(0.0), 0.0).widened(spread * (1.0 + ROUNDING))
    }

    pub(super) fn mul(&self, other: &Affine) -> Affine {
        if self.is_zero() || other.is_zero() {
            return Affine::constant(0.0);
        }
        let product = self.center * other.center;
        let mixed = Affine::combine(
            &Affine { center: 0.0, ..self.clone() },
            other.center,
            &Affine { center: 0.0, ..other.clone() },
            self.center,
        );
        let rest = self.radius() * other.radius() + product.abs() * ROUNDING + LEAST;
        if !product.is_finite() || rest.is_nan() {
            return Affine { slack: f64::INFINITY, ..Affine::constant(0.0) };
        }
        Affine { center: product, ..mixed }.widened(rest * (1.0 + ROUNDING))
    }

    /// The form with an additional term.
    pub(super) fn with(&self, symbol: u32, coefficient: f64) -> Affine {
        let term = Affine { center: 0.0, terms: Rc::from([(symbol, coefficient)]), slack: 0.0 };
        self.add(&term)
    }

    /// Hull of two forms, term by term.
    pub(super) fn join(&self, other: &Affine) -> Affine {
        if self == other {
            return self.clone();
        }
        let mean = Affine::combine(self, 0.5, other, 0.5);
        let difference = Affine::combine(self, 0.5, other, -0.5);
        let slack = difference.range().magnitude() + self.slack.max(other.slack);
        Affine { slack: 0.0, ..mean.clone() }.widened(slack + mean.range().magnitude() * ROUNDING + LEAST)
    }

    /// The form with its smallest terms moved to the slack, if there are too many.
    fn short(self) -> Affine {
        if self.terms.len() <= MAX_TERMS {
            return self;
        }
        let mut terms = self.terms.to_vec();
        terms.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
        let rest: f64 = terms.split_off(MAX_TERMS / 2).iter().map(|(_, coefficient)| coefficient.abs()).sum();
        terms.sort_by_key(|(symbol, _)| *symbol);
        let grown = rest * (1.0 + MAX_TERMS as f64 * ROUNDING);
        Affine { terms: terms.into(), ..self }.widened(grown)
    }

    /// The values of the form for given noise.
    #[cfg(test)]
    pub(super) fn at(&self, noise: &dyn Fn(u32) -> f64) -> Interval {
        let terms = self.terms.iter().map(|(symbol, coefficient)| coefficient * noise(*symbol));
        Interval::point(self.center + terms.sum::<f64>()).widened(self.slack)
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Affine arithmetic: intervals that keep track of linear correlations, so that a value minus itself is exactly zero.
//!
//! A form is `center + Σ coefficient·ε ± slack`. Each noise symbol `ε` lies in [-1, 1] and has the same value in every form that
//! contains it. Rounding errors in the computation of the form itself are added to the slack.

use super::interval::Interval;
use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::rc::Rc;

/// Bound on the relative error of a few binary64 operations, 2⁻⁵⁰.
const ROUNDING: f64 = 1.0 / (1u64 << 50) as f64;
/// Allowance for underflow in these operations.
const LEAST: f64 = 1e-300;
/// Share of a form's radius from which slack gets a symbol.
const SLACK: f64 = 0.02;
/// Limit on the terms of a form; beyond it, the smallest are moved to the slack.
const MAX_TERMS: usize = 1024;

/// Affine form of a real value, see the module.
#[derive(Clone, Debug)]
pub(super) struct Affine {
    center: f64,
    /// Symbols and coefficients, by ascending symbol.
    terms: Rc<[(u32, f64)]>,
    slack: f64,
    /// Symbol that most of the slack comes from, if known. Reports name it; the form's values do not depend on it.
    blamed: Option<u32>,
}

impl PartialEq for Affine {
    fn eq(&self, other: &Affine) -> bool {
        (self.center, &self.terms, self.slack) == (other.center, &other.terms, other.slack)
    }
}

impl Affine {
    pub(super) fn constant(value: f64) -> Affine {
        Affine { center: value, terms: Rc::default(), slack: 0.0, blamed: None }
    }

    pub(super) fn is_zero(&self) -> bool {
        self.center == 0.0 && self.slack == 0.0 && self.terms.is_empty()
    }

    /// The form has slack and no symbols: a symbol of its own would let later values be correlated with it.
    pub(super) fn is_free(&self) -> bool {
        self.slack > 0.0 && self.terms.is_empty()
    }

    /// A good part of the form is slack, as in a product: a symbol of its own lets later values be correlated with it.
    pub(super) fn is_slack(&self) -> bool {
        self.is_free() || self.slack.is_finite() && self.slack > SLACK * self.radius()
    }

    /// The form with a new symbol, larger than all of the form, in place of the slack.
    pub(super) fn with_slack_as(&self, symbol: u32) -> Affine {
        let terms = self.terms.iter().copied().chain([(symbol, self.slack)]).collect();
        Affine { terms, slack: 0.0, ..self.clone() }.short()
    }

    /// Form of an interval, with a new symbol.
    pub(super) fn of(interval: Interval, symbol: u32) -> Affine {
        let radius = interval.radius();
        let terms = if radius == 0.0 { Rc::default() } else { Rc::from([(symbol, radius)]) };
        Affine { center: interval.middle(), terms, slack: 0.0, blamed: None }
    }

    /// Form of an interval without correlation, whose radius is all slack.
    pub(super) fn free(interval: Interval) -> Affine {
        Affine { slack: interval.radius(), ..Affine::constant(interval.middle()) }
    }

    /// Radius of the form: the sum of all coefficients' magnitudes and the slack.
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

    /// Magnitudes of the terms by symbol, then the slack with the center's magnitude.
    pub(super) fn shares(&self) -> (impl Iterator<Item = (u32, f64)> + '_, f64) {
        (
            self.terms.iter().map(|(symbol, coefficient)| (*symbol, coefficient.abs())),
            self.slack + self.center.abs(),
        )
    }

    pub(super) fn neg(&self) -> Affine {
        let terms = self.terms.iter().map(|(symbol, coefficient)| (*symbol, -coefficient)).collect();
        Affine { center: -self.center, terms, ..self.clone() }
    }

    /// Linear combination `a·x + b·y`; its own rounding errors go to the slack.
    pub(super) fn combine(x: &Affine, a: f64, y: &Affine, b: f64) -> Affine {
        let mut terms = Vec::with_capacity(x.terms.len() + y.terms.len());
        let mut lost = 0.0;
        let mut mixed = |p: f64, q: f64| {
            let value = p + q;
            // A factor of one adds no rounding error.
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
        let [first, second] = if (a * x.slack).abs() >= (b * y.slack).abs() { [x, y] } else { [y, x] };
        let blamed = first.blamed.or(second.blamed);
        Affine { center, terms: terms.into(), slack, blamed }.short()
    }

    pub(super) fn add(&self, other: &Affine) -> Affine {
        Affine::combine(self, 1.0, other, 1.0)
    }

    pub(super) fn sub(&self, other: &Affine) -> Affine {
        Affine::combine(self, 1.0, other, -1.0)
    }

    /// Adds `by` to the slack.
    pub(super) fn widened(&self, by: f64) -> Affine {
        Affine { slack: (self.slack + by) * (1.0 + ROUNDING), ..self.clone() }
    }

    /// Product with an interval.
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
        let blamed = mixed.blamed.or_else(|| self.main_symbol()).or_else(|| other.main_symbol());
        Affine { center: product, blamed, ..mixed }.widened(rest * (1.0 + ROUNDING))
    }

    /// Parts of [-1, 1] to which symbols are confined if the form is not positive, for symbols where that is narrower than `known`;
    /// `None` if the form is positive everywhere.
    pub(super) fn confines(&self, known: &dyn Fn(u32) -> Option<Interval>) -> Option<Vec<(u32, Interval)>> {
        let of = |symbol: u32| known(symbol).unwrap_or(Interval::new(-1.0, 1.0));
        let least = |(symbol, coefficient): &(u32, f64)| {
            let range = of(*symbol);
            (coefficient * range.low).min(coefficient * range.high)
        };
        let all: f64 = self.terms.iter().map(least).sum();
        let rounding = (self.center.abs() + self.radius()) * (self.terms.len() + 4) as f64 * ROUNDING + LEAST;
        let all = self.center - self.slack + all - rounding;
        if all.is_nan() {
            return Some(Vec::new());
        }
        if all > 0.0 {
            return None;
        }
        let confined = self.terms.iter().filter_map(|term @ (symbol, coefficient)| {
            let bound = (least(term) - all) / coefficient;
            let margin = bound.abs() * ROUNDING + ROUNDING;
            let range = of(*symbol);
            let to = if *coefficient > 0.0 {
                Interval::new(range.low, range.high.min(bound + margin))
            } else {
                Interval::new(range.low.max(bound - margin), range.high)
            };
            (to != range).then_some((*symbol, to))
        });
        Some(confined.collect())
    }

    /// Form with its confined symbols replaced. `by` gives, for each symbol, the middle and radius of its part of [-1, 1], and the new
    /// symbol for that part. New symbols are larger than all old ones, in the same order.
    pub(super) fn replaced(&self, by: &BTreeMap<u32, (f64, f64, u32)>) -> Option<Affine> {
        if !self.terms.iter().any(|(symbol, _)| by.contains_key(symbol)) {
            return None;
        }
        let (mut center, mut lost) = (self.center, 0.0);
        let (mut kept, mut new) = (Vec::new(), Vec::new());
        for (symbol, coefficient) in self.terms.iter() {
            match by.get(symbol) {
                None => kept.push((*symbol, *coefficient)),
                Some((middle, radius, symbol)) => {
                    center += coefficient * middle;
                    lost += coefficient.abs() + center.abs();
                    new.push((*symbol, coefficient * radius));
                }
            }
        }
        kept.extend(new);
        let replaced = Affine { center, terms: kept.into(), ..self.clone() };
        Some(replaced.widened(lost * ROUNDING + LEAST))
    }

    /// Coefficients of `symbols`, and a bound on the magnitude of the rest of the form less the number `from`.
    pub(super) fn apart(&self, symbols: &[u32], from: f64) -> (Vec<f64>, f64) {
        let rest = self.terms.iter().filter(|(symbol, _)| !symbols.contains(symbol));
        let rest: f64 = rest.map(|(_, coefficient)| coefficient.abs()).sum();
        let rest = rest + self.slack + (self.center - from).abs();
        let rounding = (rest + self.center.abs()) * (self.terms.len() + 4) as f64 * ROUNDING;
        (symbols.iter().map(|symbol| self.coefficient(*symbol)).collect(), rest + rounding)
    }

    pub(super) fn center_and_slack(&self) -> (f64, f64) {
        (self.center, self.slack)
    }

    /// Symbols with their coefficients.
    pub(super) fn terms(&self) -> impl Iterator<Item = (u32, f64)> + '_ {
        self.terms.iter().copied()
    }

    /// Coefficient of a symbol.
    pub(super) fn coefficient(&self, symbol: u32) -> f64 {
        self.terms.binary_search_by_key(&symbol, |(symbol, _)| *symbol).map_or(0.0, |at| self.terms[at].1)
    }

    /// Term with the largest coefficient.
    fn largest_term(&self) -> Option<&(u32, f64)> {
        self.terms.iter().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
    }

    /// Symbol with the largest coefficient.
    pub(super) fn largest(&self) -> Option<u32> {
        self.largest_term().map(|(symbol, _)| *symbol)
    }

    /// Symbol that most of the form's radius comes from: of the largest coefficient, or of a larger slack.
    pub(super) fn main_symbol(&self) -> Option<u32> {
        let is_larger = |(_, coefficient): &(u32, f64)| coefficient.abs() >= self.slack;
        let largest = self.largest_term().filter(|term| self.blamed.is_none() || is_larger(term));
        largest.map(|(symbol, _)| *symbol).or(self.blamed)
    }

    /// Symbol that most of the slack comes from, if known.
    pub(super) fn blamed(&self) -> Option<u32> {
        self.blamed
    }

    /// Adds a term to the form.
    pub(super) fn with(&self, symbol: u32, coefficient: f64) -> Affine {
        let term = Affine { terms: Rc::from([(symbol, coefficient)]), ..Affine::constant(0.0) };
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
        let joined = Affine { slack: 0.0, ..mean.clone() };
        let joined = joined.widened(slack + mean.range().magnitude() * ROUNDING + LEAST);
        // Forms that share little are narrower as an interval.
        let wider = if self.radius() >= other.radius() { [self, other] } else { [other, self] };
        let blamed = wider[0].main_symbol().or_else(|| wider[1].main_symbol());
        let hull = Affine { blamed, ..Affine::free(self.range().hull(other.range())) };
        if hull.radius() < 0.9 * joined.radius() { hull } else { joined }
    }

    /// Moves the smallest terms to the slack if there are more than [`MAX_TERMS`].
    fn short(self) -> Affine {
        if self.terms.len() <= MAX_TERMS {
            return self;
        }
        let mut terms = self.terms.to_vec();
        terms.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
        let smallest = terms.split_off(MAX_TERMS / 2);
        let rest: f64 = smallest.iter().map(|(_, coefficient)| coefficient.abs()).sum();
        let blamed = self.blamed.or(smallest.first().map(|(symbol, _)| *symbol));
        terms.sort_by_key(|(symbol, _)| *symbol);
        let grown = rest * (1.0 + MAX_TERMS as f64 * ROUNDING);
        Affine { terms: terms.into(), blamed, ..self }.widened(grown)
    }

    /// Values of the form for given noise.
    #[cfg(test)]
    pub(super) fn at(&self, noise: &dyn Fn(u32) -> f64) -> Interval {
        let terms = self.terms.iter().map(|(symbol, coefficient)| coefficient * noise(*symbol));
        Interval::point(self.center + terms.sum::<f64>()).widened(self.slack)
    }
}

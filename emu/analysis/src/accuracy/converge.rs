// SPDX-License-Identifier: MIT OR Apache-2.0
//! Convergence of states: bounds for all time on the states of a period's linear part, where no single period keeps them in a box.
//!
//! With x' = B·x + w and |w| ≤ v, the states after any number of periods lie within Σ |Bᵏ|·v of the remainder of their first values. This
//! sum of the magnitudes of the impulse response (the l1 norm of control theory) is the least possible bound. Everything in a period that
//! is not linear in the states, inputs and roundings is in v. Powers of B are enclosed by intervals; the sum ends when a power is small,
//! and the rest is a geometric series.

use super::interval::Interval;

/// Limit on the products of a computation.
const MAX_PRODUCTS: usize = 1 << 24;
/// Limit on the powers of B.
const MAX_POWERS: usize = 1 << 14;
/// Power of B whose norm ends the sum.
const SMALL: f64 = 1.0 / 1024.0;

/// Norm of a power of B from which the states count as unstable.
const GROWN: f64 = 1e9;

type Matrix = Vec<Vec<Interval>>;

/// Linear map of a period on its states, which are scaled to their ranges, and the largest magnitudes of the terms added to each.
pub(super) struct Linear {
    pub(super) rows: Matrix,
    pub(super) added: Vec<f64>,
    /// Largest magnitudes of the states when the first period begins.
    pub(super) first: Vec<f64>,
}

/// Sum of numbers that are not negative, rounded up.
fn up(values: impl Iterator<Item = f64>) -> f64 {
    let mut sum = Interval::ZERO;
    for value in values {
        sum = sum + Interval::point(value);
    }
    sum.high
}

impl Linear {
    /// Largest magnitude of each state over all time; `None` if the states are not proved to converge.
    pub(super) fn largest(&self) -> Option<Vec<f64>> {
        let count = self.rows.len();
        let unit =
            |row: usize, column: usize| if row == column { Interval::point(1.0) } else { Interval::ZERO };
        let mut powers: Vec<Matrix> =
            vec![(0..count).map(|row| (0..count).map(|column| unit(row, column)).collect()).collect()];
        // Double the number of powers each time: in single steps, the intervals of a rotation would grow without bound.
        let mut next = self.rows.clone();
        let ones = vec![1.0; count];
        let norm = loop {
            let norm = (0..count).map(|state| magnitude(&next, state, &ones)).fold(0.0, f64::max);
            if norm <= SMALL {
                break norm;
            }
            let products = 2 * powers.len() * count.pow(3);
            if norm.is_nan() || norm > GROWN || powers.len() >= MAX_POWERS || products > MAX_PRODUCTS {
                return None;
            }
            let more: Vec<Matrix> = powers.iter().map(|power| times(&next, power)).collect();
            powers.extend(more);
            next = times(&next, &next);
        };
        let sum = |state: usize| up(powers.iter().map(|power| magnitude(power, state, &self.added)));
        let left = |state: usize| {
            powers.iter().map(|power| magnitude(power, state, &self.first)).fold(0.0, f64::max)
        };
        let (sums, left): (Vec<f64>, Vec<f64>) = (0..count).map(|state| (sum(state), left(state))).unzip();
        // Σ |Bᵏ|·v over all k is at most s + (n + n² + …)·max s, where s is the sum so far and n the norm of the next power.
        let most = |values: &[f64]| Interval::point(values.iter().copied().fold(0.0, f64::max));
        let series = Interval::point(norm) / (Interval::point(1.0) - Interval::point(norm));
        let rest = (most(&sums) * series + most(&left) * Interval::point(norm)).high;
        Some((0..count).map(|state| up([sums[state], left[state], rest].into_iter())).collect())
    }
}

/// Product of two matrices.
fn times(a: &Matrix, b: &Matrix) -> Matrix {
    let element = |row: &Vec<Interval>, column: usize| {
        let products = row.iter().zip(b).filter(|(factor, _)| **factor != Interval::ZERO);
        products.fold(Interval::ZERO, |sum, (factor, other)| sum + *factor * other[column])
    };
    a.iter().map(|row| (0..b.len()).map(|column| element(row, column)).collect()).collect()
}

/// Largest magnitude of a row's product with a vector of such magnitudes.
fn magnitude(power: &Matrix, row: usize, by: &[f64]) -> f64 {
    let products = power[row].iter().zip(by);
    up(products.map(|(factor, by)| (Interval::point(factor.magnitude()) * Interval::point(*by)).high))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accuracy::{Enclosure, enclose};
    use takt_asm::{MemoryLoader, Options, assemble_bytes};
    use takt_isa::F3;

    /// Brute force: the inputs that drive a state of a small system furthest come near the bound, and none exceeds it.
    #[test]
    fn no_input_drives_a_state_beyond_the_bound() {
        let coefficients = [-0.75, -0.25, 0.0, 0.5, 0.875];
        let mut converging = 0;
        for code in 0..625 {
            let digit = |at: u32| coefficients[code / 5usize.pow(at) % 5];
            let matrix = [[digit(0), digit(1)], [digit(2), digit(3)]];
            let added = [0.5, 0.125];
            let rows = matrix.map(|row| row.map(Interval::point).to_vec()).to_vec();
            let linear = Linear { rows, added: added.to_vec(), first: vec![0.25, 1.0] };
            let Some(bound) = linear.largest() else { continue };
            converging += 1;
            // The impulse response gives the signs of the worst input.
            let step = |[a, b]: [f64; 2]| matrix.map(|[p, q]| p * a + q * b);
            for (state, bound) in bound.iter().enumerate() {
                let (mut sum, mut first) = (0.0f64, 0.0f64);
                let mut columns: [[f64; 2]; 2] = [[1.0, 0.0], [0.0, 1.0]];
                for _ in 0..2000 {
                    let row = [columns[0][state], columns[1][state]];
                    sum += row[0].abs() * added[0] + row[1].abs() * added[1];
                    first = first.max(row[0].abs() * 0.25 + row[1].abs());
                    columns = columns.map(step);
                }
                assert!(sum + first <= bound * (1.0 + 1e-12), "{matrix:?}: {sum} {first} {bound}");
                assert!(*bound <= 2.5 * (sum + first) + 1.0, "{matrix:?}: {sum} {first} {bound}");
            }
        }
        assert!(converging > 300, "{converging}");
        // An integrator and an oscillator have no bound.
        for rows in [[[1.0, 0.0], [0.0, 0.5]], [[0.0, 1.0], [-1.0, 0.0]]] {
            let rows = rows.map(|row| row.map(Interval::point).to_vec()).to_vec();
            assert_eq!(Linear { rows, added: vec![1.0; 2], first: vec![0.0; 2] }.largest(), None);
        }
    }

    fn enclosed(text: &str) -> Enclosure {
        let options = Options { machine: &F3, ..Options::default() };
        let assembled = assemble_bytes("test.s", text.into(), &MemoryLoader::new(&[]), &options);
        let program = assembled.unwrap_or_else(|diagnostics| panic!("{}", diagnostics.render(false))).program;
        enclose(&program).unwrap()
    }

    /// Eighth-order low-pass filter, whose states no single period keeps in a box.
    #[test]
    fn a_filter_keeps_its_states_for_all_time() {
        let filter = include_str!("../../../../programs/examples/biquads.s");
        let enclosure = enclosed(filter);
        assert!(enclosure.assumed.is_empty() && enclosure.converging.len() >= 4, "{enclosure:?}");
        let most = enclosure.converging.iter().map(|state| state.found.magnitude()).fold(0.0, f64::max);
        assert!((1.0..5.5).contains(&most), "{most}");
        assert!(enclosure.outputs[0].error.is_some_and(|error| error < 1e-5), "{enclosure:?}");
        // Too narrow ranges are not proved.
        let narrow = filter.replace("= -6, 6", "= -0.5, 0.5");
        assert_ne!(narrow, filter);
        assert!(enclosed(&narrow).later().next().is_some());
    }

    /// Observer of oscillating loads: eight states, whose poles are complex.
    #[test]
    fn an_observer_keeps_its_states_for_all_time() {
        let mut head = ".ports latched\n.input x\n.output y\n.range x = -1, 1\n".to_owned();
        let (mut body, mut start) = (String::new(), String::new());
        for pair in 0..4 {
            let (a, b) = (2 * pair, 2 * pair + 1);
            head += &format!(".state s{a}\n.state s{b}\n.range s{a}, s{b} = -40, 40\n.reg n{a} n{b}\n");
            start += &format!(" s{a} = 0\n s{b} = 0\n");
            // A rotation that shrinks by 3 % per period, driven by the previous pair.
            let angle = 0.3 * f64::from(pair + 1);
            let (cos, sin) = (0.97 * libm::cos(angle), 0.97 * libm::sin(angle));
            let input = if pair == 0 { "x".to_owned() } else { format!("0.1*s{}", a - 1) };
            body +=
                &format!(" n{a} = {cos}*s{a} - {sin}*s{b} + 0.2*{input}\n n{b} = {sin}*s{a} + {cos}*s{b}\n");
        }
        for state in 0..8 {
            body += &format!(" s{state} = n{state}\n");
        }
        let text = format!("{head}.once\n{start} wait p\n.period\np:\n{body} y = s7\n wait p\n");
        let enclosure = enclosed(&text);
        assert!(enclosure.assumed.is_empty() && !enclosure.converging.is_empty(), "{enclosure:?}");
    }
}

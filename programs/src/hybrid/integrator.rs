// SPDX-License-Identifier: MIT OR Apache-2.0
//! Nonlinear integrator of one axis, (29)-(35) and (37).
//!
//! Friction changes sign with the reference velocity; the integrator is boosted for `Tc` after a reversal, so it unwinds the old
//! friction and winds up the new one sooner.

use super::params;
use crate::real::Real;

/// Integrator, boost clock and previous direction of one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Integrator<T> {
    /// Integral of the position error `s`, m·s or rad·s.
    sum: T,
    /// Periods since the reference last changed direction, `t_c/Ts`; stops at its largest value.
    clock: u32,
    /// Direction of the reference in the previous period: -1, 0 or 1.
    direction: i8,
}

impl<T: Real> Default for Integrator<T> {
    /// Power-on state: `s = 0`, `sg = 0`, and a clock past the boost.
    fn default() -> Self {
        Self { sum: T::ZERO, clock: params::BOOST_CLOCK_START, direction: 0 }
    }
}

impl<T: Real> Integrator<T> {
    /// Advances one period: takes the position error `e` (m or rad) and the reference velocity `v_d` (only its sign counts), returns the
    /// updated `s`. `axis` (0..5) picks the threshold and the limit.
    #[inline]
    pub fn step(&mut self, axis: usize, error: T, velocity: T) -> T {
        let direction = i8::from(velocity > T::ZERO) - i8::from(velocity < T::ZERO);
        self.clock = if direction == self.direction { self.clock.saturating_add(1) } else { 0 };
        self.direction = direction;

        let gain = T::ONE + self.boost(axis, error);
        let limit = T::from_f64(params::INTEGRATOR_LIMIT[axis]);
        let sum = self.sum + gain * error * T::from_f64(params::SAMPLE_TIME);
        self.sum = if sum > limit {
            limit
        } else if sum < -limit {
            -limit
        } else {
            sum
        };
        self.sum
    }

    /// Boost `φ_t`: full for the first half of `Tc`, then falling to 0 while the error is large, (31)-(35).
    #[inline]
    fn boost(&self, axis: usize, error: T) -> T {
        const HALF: u32 = params::BOOST_PERIODS / 2;
        const AFTER_HALF: u32 = HALF + 1;
        const LAST: u32 = params::BOOST_PERIODS - 1;
        match self.clock {
            1..=HALF => T::from_f64(params::BOOST - 1.0),
            AFTER_HALF..=LAST if error.abs() >= T::from_f64(params::BOOST_ERROR[axis]) => {
                let left = T::from_i32((params::BOOST_PERIODS - self.clock) as i32);
                T::from_f64(2.0 * (params::BOOST - 1.0) / params::BOOST_PERIODS as f64) * left
            }
            _ => T::ZERO,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Increment of `s` in a period, in units of `e·Ts`.
    fn gain(integrator: &mut Integrator<f64>, error: f64, velocity: f64) -> f64 {
        let before = integrator.sum;
        (integrator.step(0, error, velocity) - before) / (error * 1e-4)
    }

    #[test]
    fn no_boost_before_the_first_motion() {
        let mut integrator = Integrator::default();
        assert!((gain(&mut integrator, 1e-5, 0.0) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn boost_follows_a_change_of_direction() {
        let mut integrator = Integrator::default();
        let gains: Vec<f64> = (0..520).map(|_| gain(&mut integrator, 3e-6, -0.1)).collect();
        assert!((gains[0] - 1.0).abs() < 1e-9, "the boost starts one period late");
        assert!(gains[1..=250].iter().all(|g| (g - 3.0).abs() < 1e-6));
        assert!((gains[251] - (1.0 + 4.0 * (1.0 - 251.0 / 500.0))).abs() < 1e-6);
        assert!((gains[499] - (1.0 + 4.0 * (1.0 - 499.0 / 500.0))).abs() < 1e-6);
        assert!(gains[500..].iter().all(|g| (g - 1.0).abs() < 1e-6));
    }

    #[test]
    fn second_half_needs_a_large_error() {
        let mut integrator = Integrator::default();
        let gains: Vec<f64> = (0..520).map(|_| gain(&mut integrator, 1.9e-6, 0.1)).collect();
        assert!((gains[250] - 3.0).abs() < 1e-6);
        assert!((gains[251] - 1.0).abs() < 1e-6);
    }

    #[test]
    fn the_sum_saturates_at_both_ends() {
        let mut integrator = Integrator::<f64>::default();
        for _ in 0..3 {
            integrator.step(3, 100.0, 0.0);
        }
        assert_eq!(integrator.sum, 1e-3);
        for _ in 0..3 {
            integrator.step(3, -100.0, 0.0);
        }
        assert_eq!(integrator.sum, -1e-3);
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Control law in binary64 from the program's intermediate values: judges the law apart from the rounding of lengths and positions, which
//! the gains magnify.

use super::measure::ulp;
use super::processor::FRICTION;
use takt_programs::hybrid::dynamics::{gravity, reduced_masses, table_gravity};
use takt_programs::hybrid::friction::{coupled_inertia, friction};
use takt_programs::hybrid::integrator::Integrator;
use takt_programs::hybrid::kinematics::{JointReference, forward};
use takt_programs::hybrid::{Reference, params};

/// Source of a program's measured velocity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Velocity {
    /// Differences of counts, which are exact.
    Counts,
    /// Differences of positions in binary32.
    Positions,
}

/// Measured positions and velocities of the five axes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Measurement {
    /// Positions in m and rad.
    pub(crate) position: [f64; 5],
    /// Velocities in m/s and rad/s.
    pub(crate) velocity: [f64; 5],
}

impl Measurement {
    /// Positions and velocities rounded to binary64 only.
    pub(crate) fn exact(previous: [i32; 5], counts: [i32; 5]) -> Measurement {
        let moved = |i: usize| f64::from(counts[i].wrapping_sub(previous[i]));
        Measurement {
            position: std::array::from_fn(|i| f64::from(counts[i]) * params::RESOLUTION[i]),
            velocity: std::array::from_fn(|i| moved(i) * (params::RESOLUTION[i] / params::SAMPLE_TIME)),
        }
    }

    /// Positions and velocities in binary32, each from a conversion and one operation: `l_i = n_i · 0.25e-6`, and `v = Δn · (0.25e-6/Ts)`
    /// or `v = Δl/Ts`.
    pub(crate) fn rounded(previous: [i32; 5], counts: [i32; 5], from: Velocity) -> Measurement {
        let scaled = |count: i32, by: f64| count as f32 * by as f32;
        let position = |i: usize| scaled(counts[i], params::RESOLUTION[i]);
        let velocity = |i: usize| match from {
            Velocity::Counts => {
                scaled(counts[i].wrapping_sub(previous[i]), params::RESOLUTION[i] / params::SAMPLE_TIME)
            }
            Velocity::Positions => {
                (position(i) - scaled(previous[i], params::RESOLUTION[i])) / params::SAMPLE_TIME as f32
            }
        };
        Measurement {
            position: std::array::from_fn(|i| f64::from(position(i))),
            velocity: std::array::from_fn(|i| f64::from(velocity(i))),
        }
    }
}

/// Force or torque of one axis.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Effort {
    /// Force, N, or torque, N·m.
    pub(crate) value: f64,
    /// Largest of its terms `M·a_d`, `M·KP·e`, `M·KV·v_d`, `M·KV·v`, `M·KI·s` and gravity; the coupled inertia enters with the mass of all
    /// moving parts. Gravity enters with the largest over the arms, since the share of an arm that carries little is a difference of
    /// thirds. Both velocity terms enter by themselves, since one can be computed before the other is measured.
    pub(crate) largest: f64,
    /// Force per unit of acceleration: the mass, kg, or inertia, kg·m².
    pub(crate) mass: f64,
}

/// Steps 3 to 8 of the specification, with the state that they keep.
#[derive(Debug, Clone, Default)]
pub(crate) struct Law {
    /// Feeds friction and coupled inertia forward.
    friction: bool,
    integrators: [Integrator<f64>; 5],
    /// Integrator values `s` of the five axes.
    pub(crate) sums: [f64; 5],
    /// Accumulated ulps of each integrator value, one for every period.
    pub(crate) ulps: [f64; 5],
}

impl Law {
    /// Law of a program, before the first period.
    pub(crate) fn new(path: &str) -> Law {
        Law { friction: path == FRICTION, ..Law::default() }
    }

    /// Computes the efforts of one period.
    pub(crate) fn step(
        &mut self,
        measured: &Measurement,
        joint: &JointReference<f64>,
        reference: &Reference<f64>,
    ) -> [Effort; 5] {
        let [l1, l2, l3, tilt, _] = measured.position;
        let [m1, m2, m3] = reduced_masses([l1, l2, l3]);
        let [g1, g2, g3] = gravity([l1, l2, l3], forward([l1, l2, l3]));
        let [g4, g5] = table_gravity(tilt);
        let mass = [m1, m2, m3, params::TILT_INERTIA, params::ROTATION_INERTIA];
        let load = [g1, g2, g3, g4, g5];
        let heaviest = g1.abs().max(g2.abs()).max(g3.abs());

        let (mut ahead, mut scale) = ([0.0; 5], 0.0f64);
        if self.friction {
            ahead = friction(joint);
            for (ahead, force) in ahead.iter_mut().zip(coupled_inertia(reference, joint, [l1, l2, l3])) {
                *ahead += force;
            }
            let norm = |v: [f64; 3]| v.iter().map(|c| c * c).sum::<f64>().sqrt();
            let all = params::PLATFORM_MASS + 3.0 * params::SLIDER_MASS;
            let centripetal = norm(reference.velocity).powi(2) / l1.min(l2).min(l3);
            scale = all * norm(reference.acceleration).max(centripetal);
        }
        let coupled = self.friction;
        let wanted = joint.to_array();
        let axis =
            |row: usize, i: usize| if i < 3 { wanted[3 * row + i] } else { wanted[9 + 2 * row + i - 3] };
        std::array::from_fn(|i| {
            let (q, v, a) = (axis(0, i), axis(1, i), axis(2, i));
            let e = q - measured.position[i];
            let before = self.sums[i];
            self.sums[i] = self.integrators[i].step(i, e, v);
            self.ulps[i] += ulp(before.abs().max(self.sums[i].abs()));
            let terms = [
                if coupled && i < 3 { 0.0 } else { mass[i] * a },
                ahead[i],
                mass[i] * params::KP * e,
                mass[i] * params::KV * (v - measured.velocity[i]),
                mass[i] * params::KI * self.sums[i],
                load[i],
            ];
            let share = if i < 3 { heaviest.max(scale) } else { 0.0 };
            let fastest = mass[i] * params::KV * v.abs().max(measured.velocity[i].abs());
            Effort {
                value: terms.iter().sum(),
                largest: terms.iter().fold(share.max(fastest), |largest, term| largest.max(term.abs())),
                mass: mass[i],
            }
        })
    }
}

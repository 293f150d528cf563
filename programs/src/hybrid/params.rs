// SPDX-License-Identifier: MIT OR Apache-2.0
//! Parameters of the five-axis hybrid robot, in SI units.
//!
//! The paper prints no values; the specification fixes them. Axes 1-3 are the arms of the parallel manipulator, axes 4-5 the tilt and the
//! rotation of the table.
//!
//! | symbol | value | | symbol | value |
//! |---|---|---|---|---|
//! | R | 0.5 m | | KP | (2π·80)² s⁻², all axes |
//! | m_s, m_p | 12, 15 kg | | KV | 1.4·2π·80 s⁻¹ |
//! | J0, c | 1.5 kg·m², 0.35 m | | KI | 0.15·(2π·80)³ s⁻³ |
//! | q | -3.9 kg·m | | ξc, Tc | 3, 0.05 s |
//! | g | 9.80665 m/s² | | ec | 2e-6 m, 3e-5 rad |
//! | J44, J55 | 1.8, 0.6 kg·m² | | smax = -smin | 1e-4 m·s, 1e-3 rad·s |
//! | r4·m4 | 4.0 kg·m | | Ts | 1e-4 s |

use std::f64::consts::{PI, TAU};

/// Sampling period `Ts`, s.
pub const SAMPLE_TIME: f64 = 1e-4;
/// Periods per second, the reciprocal of [`SAMPLE_TIME`].
pub const SAMPLE_RATE: u32 = 10_000;

/// Radius `R` of the circle through the base points, m.
pub const BASE_RADIUS: f64 = 0.5;
/// Mass `m_s` of one arm's slider, kg.
pub const SLIDER_MASS: f64 = 12.0;
/// Mass `m_p` of the platform, kg.
pub const PLATFORM_MASS: f64 = 15.0;
/// Moment of inertia `J0` of one arm without its slider, about the pivot, kg·m².
pub const ARM_INERTIA: f64 = 1.5;
/// Distance `c` from the platform point back to the slider's centre of mass, m.
pub const SLIDER_OFFSET: f64 = 0.35;
/// Static moment `q` of slider, guide and counterweight about the pivot, kg·m.
pub const ARM_BALANCE: f64 = -3.9;
/// Acceleration of gravity `g`, m/s².
pub const GRAVITY: f64 = 9.806_65;

/// Moment of inertia `J44` about the tilt axis, kg·m².
pub const TILT_INERTIA: f64 = 1.8;
/// Moment of inertia `J55` about the rotation axis, kg·m².
pub const ROTATION_INERTIA: f64 = 0.6;
/// Static moment `r4·m4` of the table about the tilt axis, kg·m.
pub const TILT_IMBALANCE: f64 = 4.0;

/// Length of one count of an arm's incremental encoder, m.
pub const ARM_RESOLUTION: f64 = 0.25e-6;
/// Counts per turn of a table encoder (18 bits).
pub const TABLE_COUNTS_PER_TURN: u32 = 1 << 18;
/// Angle of one count of a table encoder, rad.
pub const TABLE_RESOLUTION: f64 = TAU / TABLE_COUNTS_PER_TURN as f64;
/// Value of one encoder count on each axis, m for 1-3 and rad for 4-5.
pub const RESOLUTION: [f64; 5] =
    [ARM_RESOLUTION, ARM_RESOLUTION, ARM_RESOLUTION, TABLE_RESOLUTION, TABLE_RESOLUTION];

/// Natural frequency for which the gains are placed, rad/s.
const OMEGA: f64 = 2.0 * PI * 80.0;
/// Position gain `KP`, s⁻².
pub const KP: f64 = OMEGA * OMEGA;
/// Velocity gain `KV`, s⁻¹.
pub const KV: f64 = 1.4 * OMEGA;
/// Integral gain `KI`, s⁻³.
pub const KI: f64 = 0.15 * OMEGA * OMEGA * OMEGA;

/// Factor `ξc` by which the integrator is boosted just after a reversal.
pub const BOOST: f64 = 3.0;
/// Length `Tc` of the boost in periods (0.05 s); even, since half of it is a threshold too.
pub const BOOST_PERIODS: u32 = 500;
/// Boost clock `t_c` at power-on in periods (1 s), past the boost so that no boost runs.
pub const BOOST_CLOCK_START: u32 = SAMPLE_RATE;
/// Error `ec` from which the second half of the boost acts, m for axes 1-3 and rad for 4-5.
pub const BOOST_ERROR: [f64; 5] = [2e-6, 2e-6, 2e-6, 3e-5, 3e-5];
/// Limit `smax = -smin` of the integrator, m·s for axes 1-3 and rad·s for 4-5.
pub const INTEGRATOR_LIMIT: [f64; 5] = [1e-4, 1e-4, 1e-4, 1e-3, 1e-3];

/// Coulomb friction of one arm, N.
pub const ARM_COULOMB: f64 = 8.0;
/// Speed over which an arm's Coulomb friction changes sign, m/s.
pub const ARM_COULOMB_SPEED: f64 = 2e-4;
/// Viscous friction of one arm, N·s/m.
pub const ARM_VISCOUS: f64 = 20.0;
/// Coulomb friction of the tilt and the rotation axis, N·m.
pub const TABLE_COULOMB: [f64; 2] = [0.3, 0.2];
/// Speed over which the table's Coulomb friction changes sign, rad/s.
pub const TABLE_COULOMB_SPEED: f64 = 1e-3;
/// Time constant of the actuators, s.
pub const ACTUATOR_LAG: f64 = 0.3e-3;
/// Integration steps of the plant in one sampling period.
pub const PLANT_STEPS: u32 = 4;

/// Base points `p_i` of the arms in the plane `z = 0`, `[x, y]` in m, (4)-(6).
pub const BASE_POINTS: [[f64; 2]; 3] = [
    [0.0, BASE_RADIUS],
    [HALF_SQRT_3 * BASE_RADIUS, -0.5 * BASE_RADIUS],
    [-HALF_SQRT_3 * BASE_RADIUS, -0.5 * BASE_RADIUS],
];
/// √3, written out because `sqrt` is not a constant function.
pub(crate) const SQRT_3: f64 = 1.732_050_807_568_877_2;
const HALF_SQRT_3: f64 = 0.5 * SQRT_3;

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Decoupled dynamics of the controller's model: reduced masses and gravity, per axis.

use super::kinematics::arms;
use super::params;
use crate::real::Real;

/// Inertia `κ = (J0 + m_s(l-c)²)/l²` of one arm of length `l`, referred to its end, kg.
#[inline]
#[must_use]
pub fn end_inertia<T: Real>(length: T) -> T {
    end_inertia_of(T::from_f64(params::ARM_INERTIA), T::from_f64(params::SLIDER_MASS), length)
}

/// [`end_inertia`] of an arm with another moment of inertia `J0`, kg·m², and another slider's mass, kg.
#[inline]
pub(super) fn end_inertia_of<T: Real>(inertia: T, slider: T, length: T) -> T {
    let offset = length - T::from_f64(params::SLIDER_OFFSET);
    (inertia + slider * offset * offset) / (length * length)
}

/// Reduced masses `M_11 M_22 M_33` in kg at arm lengths in m, (23).
///
/// Moving along arm `i` at unit speed moves the slider of arm `j` at the cosine of the angle between the two
/// and turns arm `j` at the sine over `l_j`.
#[inline]
#[must_use]
pub fn reduced_masses<T: Real>(length: [T; 3]) -> [T; 3] {
    let slider = T::from_f64(params::SLIDER_MASS);
    let own = T::from_f64(params::SLIDER_MASS + params::PLATFORM_MASS);
    let side = T::from_f64(3.0 * params::BASE_RADIUS * params::BASE_RADIUS);
    let half = T::from_f64(0.5);
    let square = length.map(|l| l * l);
    let inertia = length.map(end_inertia);
    let mut mass = [own; 3];
    for (i, j) in [(0, 1), (0, 2), (1, 2)] {
        let cosine = half * (square[i] + square[j] - side) / (length[i] * length[j]);
        let along = cosine * cosine;
        let across = T::ONE - along;
        let linear = slider * along;
        mass[i] += linear + inertia[j] * across;
        mass[j] += linear + inertia[i] * across;
    }
    mass
}

/// Mass `m_z = m_p + Σ(m_s + q/l_i)` in kg on which gravity acts at the platform, at arm lengths in m.
#[inline]
#[must_use]
pub fn gravity_mass<T: Real>(length: [T; 3]) -> T {
    gravity_mass_of(T::from_f64(params::PLATFORM_MASS + 3.0 * params::SLIDER_MASS), length)
}

/// [`gravity_mass`] with another mass of platform and sliders together, kg.
#[inline]
pub(super) fn gravity_mass_of<T: Real>(fixed: T, length: [T; 3]) -> T {
    let balance = T::from_f64(params::ARM_BALANCE);
    fixed + (balance / length[0] + balance / length[1] + balance / length[2])
}

/// Forces `G_1 G_2 G_3` in N that hold the platform against gravity, in closed form, (24)-(25).
///
/// `length` in m, `point` the tool point in m. `G_i = l_i·λ_i·m_z·g/z` with `λ` the barycentric coordinates of
/// `(x, y)` in the base triangle; equal to [`gravity_general`].
#[inline]
#[must_use]
pub fn gravity<T: Real>(length: [T; 3], point: [T; 3]) -> [T; 3] {
    gravity_of(gravity_mass(length), length, point)
}

/// [`gravity`] for another mass, kg.
#[inline]
pub(super) fn gravity_of<T: Real>(mass: T, length: [T; 3], point: [T; 3]) -> [T; 3] {
    let [x, y, z] = point;
    let third = T::from_f64(1.0 / 3.0);
    let per_x = T::from_f64(params::SQRT_3 / (3.0 * params::BASE_RADIUS));
    let per_y = T::from_f64(1.0 / (3.0 * params::BASE_RADIUS));
    let (along, up) = (x * per_x, y * per_y);
    let share = [third + (up + up), third + (along - up), third - (along + up)];
    let scale = mass * T::from_f64(params::GRAVITY) / z;
    [length[0] * share[0] * scale, length[1] * share[1] * scale, length[2] * share[2] * scale]
}

/// Gravity forces like [`gravity`], from the linear system `Σ u_i·G_i = (0, 0, m_z·g)` of (24).
///
/// Coplanar arm directions (a platform at `z = 0`) give infinite or NaN values.
#[must_use]
pub fn gravity_general(length: [f64; 3], point: [f64; 3]) -> [f64; 3] {
    let mut columns = arms(point);
    for (column, length) in columns.iter_mut().zip(length) {
        *column = column.map(|d| d / length);
    }
    solve(columns, [0.0, 0.0, gravity_mass(length) * params::GRAVITY])
}

/// Moments `G_4 G_5` in N·m that hold the table at a tilt in rad, (27).
#[inline]
#[must_use]
pub fn table_gravity<T: Real>(tilt: T) -> [T; 2] {
    [T::from_f64(params::TILT_IMBALANCE * params::GRAVITY) * tilt.sin(), T::ZERO]
}

/// Solves `Σ columns_i·result_i = right` by Cramer's rule.
pub(crate) fn solve(columns: [[f64; 3]; 3], right: [f64; 3]) -> [f64; 3] {
    let [a, b, c] = columns;
    let (bc, ca, ab) = (cross(b, c), cross(c, a), cross(a, b));
    let scale = 1.0 / dot(a, bc);
    [dot(right, bc) * scale, dot(right, ca) * scale, dot(right, ab) * scale]
}

pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::super::kinematics::{Reference, inverse};
    use super::*;

    fn lengths(point: [f64; 3]) -> [f64; 3] {
        inverse(&Reference { position: point, ..Reference::default() }).length
    }

    #[test]
    fn closed_form_gravity_equals_the_general_solution() {
        for point in [[0.0, 0.0, 0.7], [0.09, -0.03, 0.68], [-0.2, 0.4, 0.5], [0.8, 0.7, 0.3]] {
            let length = lengths(point);
            let (closed, general) = (gravity(length, point), gravity_general(length, point));
            for (a, b) in closed.iter().zip(general) {
                assert!((a - b).abs() < 1e-10, "{point:?}: {closed:?} against {general:?}");
            }
        }
    }

    #[test]
    fn gravity_carries_the_weight_evenly_in_the_middle() {
        let point = [0.0, 0.0, 0.7];
        let length = lengths(point);
        let force = gravity(length, point);
        let lifted: f64 = force.iter().map(|f| f * 0.7 / length[0]).sum();
        let mass = 15.0 + 3.0 * (12.0 - 3.9 / length[0]);
        assert!((lifted - mass * 9.80665).abs() < 1e-9);
        assert!((force[0] - force[1]).abs() < 1e-9 && (force[1] - force[2]).abs() < 1e-9);
    }

    #[test]
    fn reduced_masses_have_their_limits() {
        // Three equal arms of length R·√1.5 meet at right angles (their ends are √3·R apart): moving along an arm drags no other slider,
        // the other arms only swing.
        let l = params::BASE_RADIUS * 1.5_f64.sqrt();
        let swing = (1.5 + 12.0 * (l - 0.35) * (l - 0.35)) / (l * l);
        for mass in reduced_masses([l; 3]) {
            assert!((mass - (27.0 + 2.0 * swing)).abs() < 1e-12, "{mass}");
        }
        // Very long arms are parallel: all three sliders move together.
        for mass in reduced_masses([1e6; 3]) {
            assert!((mass - (27.0 + 2.0 * 12.0)).abs() < 1e-6, "{mass}");
        }
    }

    #[test]
    fn cosines_are_those_of_the_arm_directions() {
        // Equation (23) again, with the angles from the vectors instead of the law of cosines.
        let point = [0.09, -0.03, 0.68];
        let length = lengths(point);
        let directions = arms(point);
        let mass = reduced_masses(length);
        for i in 0..3 {
            let mut expected = 27.0;
            for j in (0..3).filter(|&j| j != i) {
                let cosine = dot(directions[i], directions[j]) / (length[i] * length[j]);
                expected += 12.0 * cosine * cosine + end_inertia(length[j]) * (1.0 - cosine * cosine);
            }
            assert!((mass[i] - expected).abs() < 1e-12);
        }
    }
}

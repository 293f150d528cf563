// SPDX-License-Identifier: MIT OR Apache-2.0
//! Dynamics of the plant's arm in binary64, by recursive Newton-Euler over Denavit-Hartenberg frames. The kinematic core's nominal model
//! differs: it neglects products of velocities, the offsets `a1` and `a3`, couplings of the wrist, and the gravity that the balancing
//! leaves.

use takt_programs::arm::{A1, A2, A3, D1, D4, D6};

/// Number of the arm's joints.
pub const JOINTS: usize = 6;
/// Value for each joint.
pub type Joints = [f64; JOINTS];
/// Mass matrix, N·m s²/rad.
pub type Matrix = [[f64; JOINTS]; JOINTS];
type Vector = [f64; 3];

/// Acceleration of gravity, m/s².
pub const GRAVITY: f64 = 9.81;

/// Link: its frame (docs/arm.md has the convention) and its mass.
#[derive(Clone, Copy, Debug)]
pub struct Link {
    /// Offset along the x axis of its own frame, m.
    pub a: f64,
    /// Offset along the joint's axis, m.
    pub d: f64,
    /// Rotation about x in right angles: -1, 0 or 1.
    pub alpha: i8,
    /// Mass of the link, kg.
    pub mass: f64,
    /// Centre of mass in the link's frame, m.
    pub centre: Vector,
    /// Principal moments of inertia about the centre of mass along the frame's axes, kg·m².
    pub inertia: Vector,
}

/// Arm with its balancing springs.
#[derive(Clone, Debug)]
pub struct Arm {
    /// Links from the base to the hand.
    pub links: [Link; JOINTS],
    /// Acceleration of gravity in the base's frame, m/s².
    pub gravity: Vector,
    /// Fraction of the static moments of upper arm and forearm (with the hand stretched out) that springs carry.
    pub balance: f64,
}

const fn link(a: f64, d: f64, alpha: i8, mass: f64, centre: Vector, inertia: Vector) -> Link {
    Link { a: a / 1000.0, d: d / 1000.0, alpha, mass, centre, inertia }
}

impl Arm {
    /// The arm of docs/arm.md, hanging: its base's z axis points down, which matches the signs of gravity at the wrist in the nominal
    /// model. The masses make that model's constants a fair approximation: a counterweight behind joint 2, motors of the wrist near the
    /// elbow, 4 kg of hand.
    pub const fn hanging() -> Arm {
        Arm {
            links: [
                link(A1, D1, 1, 30.0, [-0.075, -0.1, 0.0], [3.0, 3.3, 3.0]),
                link(A2, 0.0, 0, 45.0, [-0.42, 0.0, 0.0], [0.35, 2.6, 2.8]),
                link(A3, 0.0, 1, 16.0, [-0.07, 0.0, 0.17], [0.45, 0.45, 0.08]),
                link(0.0, D4, -1, 4.0, [0.0, 0.05, 0.0], [0.02, 0.012, 0.02]),
                link(0.0, 0.0, 1, 2.0, [0.0, 0.0, 0.02], [0.01, 0.01, 0.008]),
                link(0.0, D6, 0, 4.0, [0.0, 0.0, 0.013], [0.05, 0.05, 0.04]),
            ],
            gravity: [0.0, 0.0, GRAVITY],
            balance: 0.95,
        }
    }
}

fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn add(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

fn scaled(a: Vector, by: f64) -> Vector {
    [a[0] * by, a[1] * by, a[2] * by]
}

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Rotation of a link relative to its predecessor: sine and cosine of the joint angle and of alpha (0 or ±1).
#[derive(Clone, Copy, Default)]
struct LinkRotation {
    s: f64,
    c: f64,
    sa: f64,
    ca: f64,
}

impl LinkRotation {
    fn of(link: &Link, angle: f64) -> LinkRotation {
        let (s, c) = angle.sin_cos();
        let (sa, ca) = (f64::from(link.alpha), f64::from(1 - link.alpha.abs()));
        LinkRotation { s, c, sa, ca }
    }

    /// Transforms a vector from the link's frame to its predecessor's.
    fn out(self, v: Vector) -> Vector {
        let (y, z) = (self.ca * v[1] - self.sa * v[2], self.sa * v[1] + self.ca * v[2]);
        [self.c * v[0] - self.s * y, self.s * v[0] + self.c * y, z]
    }

    /// Transforms a vector from the predecessor's frame to the link's.
    fn into(self, v: Vector) -> Vector {
        let (x, y) = (self.c * v[0] + self.s * v[1], -self.s * v[0] + self.c * v[1]);
        [x, self.ca * y + self.sa * v[2], -self.sa * y + self.ca * v[2]]
    }
}

/// Rotations of all links in a pose.
struct LinkRotations([LinkRotation; JOINTS]);

impl Arm {
    fn turns(&self, q: &Joints) -> LinkRotations {
        LinkRotations(std::array::from_fn(|i| LinkRotation::of(&self.links[i], q[i])))
    }

    /// Torques for given accelerations, N·m: Newton-Euler outward along the links, then back. Springs are left out.
    fn newton_euler(&self, turns: &LinkRotations, qd: &Joints, qdd: &Joints, gravity: Vector) -> Joints {
        const AXIS: Vector = [0.0, 0.0, 1.0];
        let mut forces = [[0.0; 3]; JOINTS];
        let mut moments = [[0.0; 3]; JOINTS];
        let (mut w, mut wd, mut vd) = ([0.0; 3], [0.0; 3], scaled(gravity, -1.0));
        for (i, link) in self.links.iter().enumerate() {
            let turn = turns.0[i];
            let spin = scaled(AXIS, qd[i]);
            wd = turn.into(add(add(wd, scaled(AXIS, qdd[i])), cross(w, spin)));
            w = turn.into(add(w, spin));
            let arm = offset(link, turn);
            vd = add(turn.into(vd), add(cross(wd, arm), cross(w, cross(w, arm))));
            let vc = add(vd, add(cross(wd, link.centre), cross(w, cross(w, link.centre))));
            forces[i] = scaled(vc, link.mass);
            let inertia = |v: Vector| [0, 1, 2].map(|k| link.inertia[k] * v[k]);
            moments[i] = add(inertia(wd), cross(w, inertia(w)));
        }
        let mut torques = [0.0; JOINTS];
        // Force and moment of the outer links, in this link's frame, about its origin.
        let (mut force, mut moment) = ([0.0; 3], [0.0; 3]);
        for (i, link) in self.links.iter().enumerate().rev() {
            let turn = turns.0[i];
            let arm = offset(link, turn);
            let at_centre = cross(add(arm, link.centre), forces[i]);
            moment = add(add(moment, cross(arm, force)), add(at_centre, moments[i]));
            force = add(force, forces[i]);
            torques[i] = dot(moment, turn.into(AXIS));
            (force, moment) = (turn.out(force), turn.out(moment));
        }
        torques
    }

    /// Mass matrix at a pose.
    pub fn mass_matrix(&self, q: &Joints) -> Matrix {
        let turns = self.turns(q);
        let mut matrix = [[0.0; JOINTS]; JOINTS];
        for (i, row) in matrix.iter_mut().enumerate() {
            let mut unit = [0.0; JOINTS];
            unit[i] = 1.0;
            *row = self.newton_euler(&turns, &[0.0; JOINTS], &unit, [0.0; 3]);
        }
        matrix
    }

    /// Torques that hold these velocities without acceleration: centrifugal and Coriolis terms, gravity and springs; N·m.
    pub fn bias(&self, q: &Joints, qd: &Joints) -> Joints {
        let mut torques = self.newton_euler(&self.turns(q), qd, &[0.0; JOINTS], self.gravity);
        for (torque, spring) in torques.iter_mut().zip(self.springs(q)) {
            *torque += spring;
        }
        torques
    }

    /// Inverse dynamics: torques for given accelerations, springs included, N·m.
    pub fn inverse(&self, q: &Joints, qd: &Joints, qdd: &Joints) -> Joints {
        let mut torques = self.newton_euler(&self.turns(q), qd, qdd, self.gravity);
        for (torque, spring) in torques.iter_mut().zip(self.springs(q)) {
            *torque += spring;
        }
        torques
    }

    /// Static moments, kg·m: of joint 2 along the upper arm; of the forearm along x and along its length. Joints 4 to 6 at 0.
    fn moments(&self) -> [f64; 3] {
        let [_, upper, fore, four, five, six] = &self.links;
        let beyond = four.mass + five.mass + six.mass;
        let upper = upper.mass * (upper.a + upper.centre[0]) + (fore.mass + beyond) * upper.a;
        let across = fore.mass * (fore.a + fore.centre[0]) + beyond * fore.a;
        let reach = four.d;
        let along = fore.mass * fore.centre[2]
            + four.mass * (reach - four.centre[1])
            + five.mass * (reach + five.centre[2])
            + six.mass * (reach + six.d + six.centre[2]);
        [upper, across, along]
    }

    /// Torques of the springs on the drives, N·m: opposite to the balanced part of gravity's moments.
    fn springs(&self, q: &Joints) -> Joints {
        let [upper, across, along] = self.moments();
        let weight = self.balance * self.gravity[2];
        let (s23, c23) = (q[1] + q[2]).sin_cos();
        let fore = weight * (across * c23 + along * s23);
        [0.0, weight * upper * q[1].cos() + fore, fore, 0.0, 0.0, 0.0]
    }

    /// Potential energy of gravity and springs, J, up to a constant.
    pub fn potential(&self, q: &Joints) -> f64 {
        let [upper, across, along] = self.moments();
        let (s23, c23) = (q[1] + q[2]).sin_cos();
        let springs = self.balance * self.gravity[2] * (upper * q[1].sin() + across * s23 - along * c23);
        let turns = self.turns(q);
        let weights = self.links.iter().enumerate().map(|(i, link)| {
            let mut point = link.centre;
            for (link, turn) in self.links[..=i].iter().zip(&turns.0).rev() {
                point = turn.out(add(point, offset(link, *turn)));
            }
            -link.mass * dot(self.gravity, point)
        });
        weights.sum::<f64>() + springs
    }

    /// Kinetic energy of the links, J.
    pub fn kinetic(&self, q: &Joints, qd: &Joints) -> f64 {
        let matrix = self.mass_matrix(q);
        (0..JOINTS).map(|i| (0..JOINTS).map(|j| 0.5 * qd[i] * matrix[i][j] * qd[j]).sum::<f64>()).sum()
    }
}

/// Vector from the predecessor's origin to the link's own, in the link's frame.
fn offset(link: &Link, turn: LinkRotation) -> Vector {
    [link.a, link.d * turn.sa, link.d * turn.ca]
}

/// Solves `matrix · x = right` for a symmetric positive definite matrix, by Cholesky decomposition.
pub fn solve(mut matrix: Matrix, mut right: Joints) -> Joints {
    for j in 0..JOINTS {
        for k in 0..j {
            for i in j..JOINTS {
                matrix[i][j] -= matrix[i][k] * matrix[j][k];
            }
        }
        let root = matrix[j][j].sqrt();
        for row in &mut matrix[j..] {
            row[j] /= root;
        }
    }
    for i in 0..JOINTS {
        for k in 0..i {
            right[i] -= matrix[i][k] * right[k];
        }
        right[i] /= matrix[i][i];
    }
    for i in (0..JOINTS).rev() {
        for k in i + 1..JOINTS {
            right[i] -= matrix[k][i] * right[k];
        }
        right[i] /= matrix[i][i];
    }
    right
}

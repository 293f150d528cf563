// SPDX-License-Identifier: MIT OR Apache-2.0
//! Constant vectors, rotations and poses, known while equations are written.

/// A vector of three numbers.
pub type V3 = [f64; 3];
/// A matrix by rows.
pub type M3 = [V3; 3];

/// Identity matrix, the rotation by 0.
pub const IDENTITY: M3 = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Sum of two vectors.
pub fn add(a: V3, b: V3) -> V3 {
    std::array::from_fn(|i| a[i] + b[i])
}

/// Difference of two vectors.
pub fn sub(a: V3, b: V3) -> V3 {
    std::array::from_fn(|i| a[i] - b[i])
}

/// Product of a number and a vector.
pub fn scale(k: f64, a: V3) -> V3 {
    a.map(|x| k * x)
}

/// Inner product of two vectors.
pub fn dot(a: V3, b: V3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Cross product of two vectors.
pub fn cross(a: V3, b: V3) -> V3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Euclidean length of a vector.
pub fn norm(a: V3) -> f64 {
    dot(a, a).sqrt()
}

/// Product of a matrix and a vector.
pub fn turn(m: &M3, a: V3) -> V3 {
    m.map(|row| dot(row, a))
}

/// Transpose; for a rotation, the inverse.
pub fn transpose(m: &M3) -> M3 {
    std::array::from_fn(|i| std::array::from_fn(|j| m[j][i]))
}

/// Product of two matrices.
pub fn product(a: &M3, b: &M3) -> M3 {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

/// Column `j` of a matrix.
pub fn column(m: &M3, j: usize) -> V3 {
    m.map(|row| row[j])
}

/// Matrix of three columns.
pub fn columns(x: V3, y: V3, z: V3) -> M3 {
    transpose(&[x, y, z])
}

/// Sum of two matrices.
pub fn sum(a: &M3, b: &M3) -> M3 {
    std::array::from_fn(|i| add(a[i], b[i]))
}

/// Symmetric outer product: `a bᵀ + b aᵀ`.
pub fn symmetric(a: V3, b: V3) -> M3 {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i] * b[j] + b[i] * a[j]))
}

/// Scaled outer square: `k a aᵀ`.
pub fn square(k: f64, a: V3) -> M3 {
    std::array::from_fn(|i| std::array::from_fn(|j| k * a[i] * a[j]))
}

/// Sine and cosine, exact at multiples of π/2.
pub fn sin_cos(angle: f64) -> (f64, f64) {
    match quarters(angle) {
        Some(turns) => [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)][turns as usize],
        None => angle.sin_cos(),
    }
}

/// Tolerance within which a computed angle counts as a multiple of π/2, in quarter turns.
const EXACT: f64 = 1e-12;

/// Number of quarter turns of an angle, 0 to 3; `None` if it is not a multiple of π/2.
pub fn quarters(angle: f64) -> Option<u8> {
    let turns = angle / std::f64::consts::FRAC_PI_2;
    let whole = turns.round();
    ((turns - whole).abs() < EXACT).then(|| whole.rem_euclid(4.0) as u8)
}

/// Rotation about axis 0, 1 or 2.
pub fn about(axis: usize, angle: f64) -> M3 {
    let (s, c) = sin_cos(angle);
    let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut m = IDENTITY;
    (m[i][i], m[i][j], m[j][i], m[j][j]) = (c, -s, s, c);
    m
}

/// Rounds entries near 0, 1 or -1, to clean up a computed rotation.
pub fn cleaned(m: &M3) -> M3 {
    m.map(|row| row.map(|x| if (x - x.round()).abs() < 1e-9 { x.round() + 0.0 } else { x }))
}

/// Rounds entries that are negligible relative to `size` to 0.
pub fn cleaned_vector(a: V3, size: f64) -> V3 {
    a.map(|x| if x.abs() < 1e-10 * size { 0.0 } else { x })
}

/// Pose of a frame: the frame's point `x` is `rotation x + origin` outside.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Pose {
    /// Axes of the frame, as columns.
    pub rotation: M3,
    /// Origin of the frame.
    pub origin: V3,
}

impl Pose {
    /// Pose of the base itself.
    pub const IDENTITY: Pose = Pose { rotation: IDENTITY, origin: [0.0; 3] };

    /// Composes this pose with the pose of an inner frame.
    pub fn then(&self, inner: &Pose) -> Pose {
        Pose { rotation: product(&self.rotation, &inner.rotation), origin: self.point(inner.origin) }
    }

    /// Pose of the outer frame in this one.
    pub fn inverse(&self) -> Pose {
        let rotation = transpose(&self.rotation);
        Pose { rotation, origin: scale(-1.0, turn(&rotation, self.origin)) }
    }

    /// Maps a point of this frame to the outer frame.
    pub fn point(&self, x: V3) -> V3 {
        add(turn(&self.rotation, x), self.origin)
    }
}

/// Mass of a body, and its moments about the origin of a frame.
#[derive(Clone, Copy, PartialEq, Default, Debug)]
pub struct Inertia {
    /// Mass of the body, kg.
    pub mass: f64,
    /// First moments `∫ r dm`, kg m.
    pub first: V3,
    /// Second moments `∫ r rᵀ dm`, kg m².
    pub second: M3,
}

impl Inertia {
    /// Moments from a mass, its centre, and the inertia tensor about the centre, all in the frame's axes.
    pub fn new(mass: f64, centre: V3, tensor: &M3) -> Inertia {
        let half = (tensor[0][0] + tensor[1][1] + tensor[2][2]) / 2.0;
        let mut second = square(mass, centre);
        for i in 0..3 {
            for j in 0..3 {
                second[i][j] += if i == j { half } else { 0.0 } - tensor[i][j];
            }
        }
        Inertia { mass, first: scale(mass, centre), second }
    }

    /// Expresses the body in an outer frame, in which its own frame has the pose `pose`.
    pub fn outside(&self, pose: &Pose) -> Inertia {
        let (r, p) = (&pose.rotation, pose.origin);
        let first = turn(r, self.first);
        let second = product(&product(r, &self.second), &transpose(r));
        Inertia {
            mass: self.mass,
            first: add(first, scale(self.mass, p)),
            second: sum(&sum(&second, &symmetric(p, first)), &square(self.mass, p)),
        }
    }

    /// Union of two bodies.
    pub fn plus(&self, other: &Inertia) -> Inertia {
        Inertia {
            mass: self.mass + other.mass,
            first: add(self.first, other.first),
            second: sum(&self.second, &other.second),
        }
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! References of the examples in binary64, written from their equations with matrices, loops and branches, not from their sources.

use std::f64::consts::PI;

/// Controller of an example in binary64.
pub(crate) trait Reference {
    /// Outputs of a period, in the order of the source.
    fn period(&mut self, inputs: &[f64]) -> Vec<f64>;
}

#[derive(Default)]
pub(crate) struct Blink(u32);

impl Reference for Blink {
    fn period(&mut self, _: &[f64]) -> Vec<f64> {
        self.0 += 1;
        vec![f64::from(self.0 / 500 % 2)]
    }
}

pub(crate) struct Pi {
    /// In V·s/rad and V/rad.
    gains: [f64; 2],
    integral: f64,
}

impl Pi {
    /// A controller with gains of the error and of its integral.
    pub(crate) fn new(gains: [f64; 2]) -> Pi {
        Pi { gains, integral: 0.0 }
    }
}

impl Reference for Pi {
    fn period(&mut self, inputs: &[f64]) -> Vec<f64> {
        let [wanted, measured] = inputs else { panic!("two inputs") };
        let error = wanted - measured;
        let [proportional, integral] = self.gains;
        let wish = proportional * error + self.integral;
        let output = wish.clamp(-24.0, 24.0);
        self.integral += 1e-3 * (integral * error + (output - wish) / 0.05);
        vec![output]
    }
}

/// Feedback of the state, with the integral of the position's error.
#[derive(Default)]
pub(crate) struct Pendulum(f64);

impl Reference for Pendulum {
    fn period(&mut self, inputs: &[f64]) -> Vec<f64> {
        let [angle, rate, x, v, wanted] = inputs else { panic!("five inputs") };
        let force = 6.32 * (x - wanted) + 5.65 * v + 29.18 * angle + 4.87 * rate + self.0;
        self.0 += 2e-3 * (x - wanted);
        vec![force.clamp(-20.0, 20.0)]
    }
}

#[derive(Default)]
pub(crate) struct Foc {
    integral: [f64; 2],
}

/// The same law with the angle that the last period predicted, and that period's speed and voltage.
pub(crate) struct FocEarly {
    law: Foc,
    /// Angle, speed and voltage.
    known: [f64; 3],
}

impl Default for FocEarly {
    fn default() -> FocEarly {
        FocEarly { law: Foc::default(), known: [0.0, 0.0, 24.0] }
    }
}

impl Reference for FocEarly {
    fn period(&mut self, inputs: &[f64]) -> Vec<f64> {
        let &[ia, ib, theta, speed, udc, id_ref, iq_ref] = inputs else { panic!("seven inputs") };
        let [angle, last_speed, last_udc] = self.known;
        self.known = [theta + speed * 50e-6, speed, udc];
        self.law.period(&[ia, ib, angle, last_speed, last_udc, id_ref, iq_ref])
    }
}

impl Reference for Foc {
    fn period(&mut self, inputs: &[f64]) -> Vec<f64> {
        let &[ia, ib, theta, speed, udc, id_ref, iq_ref] = inputs else { panic!("seven inputs") };
        let (resistance, ld, lq, flux) = (0.35, 0.9e-3, 1.1e-3, 0.012);
        let bandwidth = 2.0 * PI * 800.0;
        let third = -ia - ib;
        // Park transform straight from the phases.
        let angles = [theta, theta - 2.0 * PI / 3.0, theta + 2.0 * PI / 3.0];
        let sum = |f: fn(f64) -> f64| {
            2.0 / 3.0 * [ia, ib, third].iter().zip(angles).map(|(i, angle)| i * f(angle)).sum::<f64>()
        };
        let current = [sum(f64::cos), -sum(f64::sin)];
        let error = [id_ref - current[0], iq_ref - current[1]];
        let wish = [
            bandwidth * ld * error[0] + self.integral[0] - speed * lq * current[1],
            bandwidth * lq * error[1] + self.integral[1] + speed * (ld * current[0] + flux),
        ];
        let longest = udc / 3.0_f64.sqrt();
        let d = wish[0].clamp(-0.95 * longest, 0.95 * longest);
        let left = (longest * longest - d * d).sqrt();
        let voltage = [d, wish[1].clamp(-left, left)];
        for axis in 0..2 {
            let cut = voltage[axis] - wish[axis];
            self.integral[axis] += resistance * 50e-6 * (bandwidth * error[axis] + cut / [ld, lq][axis]);
        }
        let phases = angles.map(|angle| voltage[0] * angle.cos() - voltage[1] * angle.sin());
        let top = phases.iter().copied().fold(f64::MIN, f64::max);
        let low = phases.iter().copied().fold(f64::MAX, f64::min);
        let duties = phases.map(|v| 0.5 + (v - (top + low) / 2.0) / udc);
        duties.into_iter().chain(current).collect()
    }
}

/// Direct form I, each section with its own two past inputs and outputs.
#[derive(Default)]
pub(crate) struct Biquads {
    past: [[f64; 4]; 4],
}

impl Reference for Biquads {
    fn period(&mut self, inputs: &[f64]) -> Vec<f64> {
        let mut x = inputs[0];
        let k = (PI * 400.0 / 10_000.0).tan();
        for (i, past) in self.past.iter_mut().enumerate() {
            // (1 + z⁻¹)²·K² / ((1 + K/Q + K²) + 2·(K² - 1)·z⁻¹ + (1 - K/Q + K²)·z⁻²)
            let inverse_q = 2.0 * (PI * (2.0 * i as f64 + 1.0) / 16.0).cos();
            let (a0, a1, a2) =
                (1.0 + k * inverse_q + k * k, 2.0 * (k * k - 1.0), 1.0 - k * inverse_q + k * k);
            let [x1, x2, y1, y2] = *past;
            let y = (k * k * (x + 2.0 * x1 + x2) - a1 * y1 - a2 * y2) / a0;
            *past = [x, x1, y, y1];
            x = y;
        }
        vec![x]
    }
}

type Matrix = [[f64; 4]; 4];

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..4).map(|k| a[i][k] * b[k][j]).sum()))
}

fn transposed(a: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

pub(crate) struct Kalman {
    state: [f64; 4],
    covariance: Matrix,
}

impl Default for Kalman {
    fn default() -> Kalman {
        let covariance = std::array::from_fn(|i| std::array::from_fn(|j| if i == j { 10.0 } else { 0.0 }));
        Kalman { state: [0.0; 4], covariance }
    }
}

impl Reference for Kalman {
    fn period(&mut self, inputs: &[f64]) -> Vec<f64> {
        let t = 0.01;
        let model = [[1.0, 0.0, t, 0.0], [0.0, 1.0, 0.0, t], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
        // Effect of an acceleration in each direction on the state.
        let noise = [[t * t / 2.0, 0.0], [0.0, t * t / 2.0], [t, 0.0], [0.0, t]];
        let state: [f64; 4] = std::array::from_fn(|i| (0..4).map(|k| model[i][k] * self.state[k]).sum());
        let mut p = product(&product(&model, &self.covariance), &transposed(&model));
        for i in 0..4 {
            for j in 0..4 {
                p[i][j] += 4.0 * (noise[i][0] * noise[j][0] + noise[i][1] * noise[j][1]);
            }
        }
        let s = [[p[0][0] + 0.04, p[0][1]], [p[1][0], p[1][1] + 0.04]];
        let determinant = s[0][0] * s[1][1] - s[0][1] * s[1][0];
        let inverse = [[s[1][1], -s[0][1]], [-s[1][0], s[0][0]]].map(|row| row.map(|v| v / determinant));
        let gain: [[f64; 2]; 4] = std::array::from_fn(|i| {
            std::array::from_fn(|j| p[i][0] * inverse[0][j] + p[i][1] * inverse[1][j])
        });
        for i in 0..4 {
            self.state[i] = state[i] + (0..2).map(|k| gain[i][k] * (inputs[k] - state[k])).sum::<f64>();
        }
        // Joseph form of the covariance update.
        let rest: Matrix = std::array::from_fn(|i| {
            std::array::from_fn(|j| f64::from(u8::from(i == j)) - if j < 2 { gain[i][j] } else { 0.0 })
        });
        self.covariance = product(&product(&rest, &p), &transposed(&rest));
        for i in 0..4 {
            for j in 0..4 {
                self.covariance[i][j] += 0.04 * (gain[i][0] * gain[j][0] + gain[i][1] * gain[j][1]);
            }
        }
        let variances = [self.covariance[0][0], self.covariance[2][2]];
        self.state.into_iter().chain(variances).collect()
    }
}

/// Controller in state space, with the matrices of its source.
pub(crate) struct StateSpace {
    state: Vec<f64>,
    a: Vec<f64>,
    b: Vec<f64>,
    c: Vec<f64>,
    d: Vec<f64>,
}

impl Default for StateSpace {
    fn default() -> StateSpace {
        let source = super::text("statespace.s").expect("it is an example");
        let matrix = |name: &str| -> Vec<f64> {
            let line = source.lines().find(|line| line.starts_with(&format!(".array  {name}[")));
            let (_, values) = line.and_then(|line| line.split_once('=')).expect("it has values");
            let number = |value: &str| f64::from(value.trim().parse::<f32>().expect("a number"));
            values.split(',').map(number).collect()
        };
        let [a, b, c, d] = ["A", "B", "C", "D"].map(matrix);
        StateSpace { state: vec![0.0; 12], a, b, c, d }
    }
}

impl Reference for StateSpace {
    fn period(&mut self, inputs: &[f64]) -> Vec<f64> {
        let times = |matrix: &[f64], vector: &[f64]| -> Vec<f64> {
            let row = |row: &[f64]| row.iter().zip(vector).map(|(a, x)| a * x).sum();
            matrix.chunks(vector.len()).map(row).collect()
        };
        let sum = |a: Vec<f64>, b: Vec<f64>| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a + b).collect() };
        let outputs = sum(times(&self.c, &self.state), times(&self.d, inputs));
        self.state = sum(times(&self.a, &self.state), times(&self.b, inputs));
        outputs
    }
}

#[derive(Default)]
pub(crate) struct Lu {
    last: [f64; 4],
}

impl Reference for Lu {
    /// Solves by Gauss-Jordan elimination.
    fn period(&mut self, inputs: &[f64]) -> Vec<f64> {
        let mut rows: Vec<Vec<f64>> = inputs.chunks(5).map(<[f64]>::to_vec).collect();
        for k in 0..4 {
            let size = |row: usize| rows[row][k].abs();
            let pivot = (k..4).max_by(|&a, &b| size(a).total_cmp(&size(b))).expect("there are rows");
            rows.swap(k, pivot);
            if rows[k][k] == 0.0 {
                return self.last.into_iter().chain([1.0]).collect();
            }
            for i in (0..4).filter(|&i| i != k) {
                let factor = rows[i][k] / rows[k][k];
                let pivot = rows[k].clone();
                rows[i].iter_mut().zip(&pivot).for_each(|(value, pivot)| *value -= factor * pivot);
            }
        }
        self.last = std::array::from_fn(|i| rows[i][4] / rows[i][i]);
        self.last.into_iter().chain([0.0]).collect()
    }
}

#[derive(Default)]
pub(crate) struct Table;

impl Reference for Table {
    fn period(&mut self, inputs: &[f64]) -> Vec<f64> {
        let place = ((inputs[0] - 0.1) / (3.1 / 64.0)).clamp(0.0, 64.0);
        let entry = |k: f64| {
            let u = 0.1 + k * 3.1 / 64.0;
            1.0 / (1.0 / 298.15 + (u / (3.3 - u)).ln() / 3950.0) - 273.15
        };
        let below = place.floor().min(63.0);
        vec![entry(below) + (place - below) * (entry(below + 1.0) - entry(below))]
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Estimation and control in binary64, with the algorithms of `programs/library/control.s`.

use super::{Arrays, product, solved, times, turned};

/// Sum a + factor·b of vectors.
fn plus(a: &[f64], b: &[f64], factor: f64) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + factor * b).collect()
}

/// State and covariance after a correction, from the predicted ones: `e` is the innovation, `h` the derivatives of the measurement.
fn corrected(m: &[f64], n: &[f64], h: &[f64], r: &[f64], e: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let (states, measured) = (m.len(), e.len());
    let g = product(n, &turned(h, states), states);
    let s = plus(&product(h, &g, states), r, 1.0);
    // Solves K·S = G by rows, since S is symmetric.
    let gain: Vec<f64> = g.chunks(measured).flat_map(|row| solved(&s, row)).collect();
    let correction = product(&gain, &turned(&g, measured), measured);
    (plus(m, &times(&gain, e), 1.0), plus(n, &correction, -1.0))
}

/// Predicted covariance F·P·Fᵀ + Q.
fn predicted(f: &[f64], p: &[f64], q: &[f64], states: usize) -> Vec<f64> {
    plus(&product(&product(f, p, states), &turned(f, states), states), q, 1.0)
}

pub(super) fn kalman(arrays: &mut Arrays, _: &mut Vec<f64>) {
    let [f, h, q, r, p, x, z] = [0, 1, 2, 3, 4, 5, 6].map(|which| arrays[which].clone());
    let m = times(&f, &x);
    let e = plus(&z, &times(&h, &m), -1.0);
    (arrays[5], arrays[4]) = corrected(&m, &predicted(&f, &p, &q, 12), &h, &r, &e);
}

pub(super) fn ekf(arrays: &mut Arrays, _: &mut Vec<f64>) {
    const T: f64 = 0.05;
    let [q, r, p, x, z, beacon] = [0, 1, 2, 3, 4, 5].map(|which| arrays[which].clone());
    let (sine, cosine) = x[2].sin_cos();
    let m = [x[0] + T * x[3] * cosine, x[1] + T * x[3] * sine, x[2] + T * x[4], x[3], x[4]];
    let mut f: Vec<f64> = (0..25).map(|place| f64::from(place % 6 == 0)).collect();
    (f[2], f[3]) = (-T * x[3] * sine, T * cosine);
    (f[7], f[8]) = (T * x[3] * cosine, T * sine);
    f[14] = T;
    let (dx, dy) = (beacon[0] - m[0], beacon[1] - m[1]);
    let distance = dx.hypot(dy);
    let e = [z[0] - distance, z[1] - (dy.atan2(dx) - m[2])];
    let square = distance * distance;
    let h = [-dx / distance, -dy / distance, 0.0, 0.0, 0.0, dy / square, -dx / square, -1.0, 0.0, 0.0];
    (arrays[3], arrays[2]) = corrected(&m, &predicted(&f, &p, &q, 5), &h, &r, &e);
}

pub(super) fn riccati(arrays: &mut Arrays, _: &mut Vec<f64>) {
    let [a, b, q, r, p] = [0, 1, 2, 3, 4].map(|which| arrays[which].clone());
    let (a_turned, b_turned) = (turned(&a, 12), turned(&b, 4));
    let s = plus(&product(&b_turned, &product(&p, &b, 12), 12), &r, 1.0);
    // Matrix Bᵀ·P·A; its columns are solved as rows.
    let g = product(&b_turned, &product(&p, &a, 12), 12);
    let k: Vec<f64> = turned(&g, 12).chunks(4).flat_map(|column| solved(&s, column)).collect();
    let gain = turned(&k, 4);
    let without = predicted(&a_turned, &p, &q, 12);
    arrays[4] = plus(&without, &product(&turned(&gain, 12), &g, 4), -1.0);
    arrays[5] = gain;
}

pub(super) fn qp(arrays: &mut Arrays, _: &mut Vec<f64>) {
    const RHO: f64 = 2.0;
    let [m, q, low, high, mut z, mut y] = [0, 1, 2, 3, 4, 5].map(|which| arrays[which].clone());
    for _ in 0..20 {
        let w: Vec<f64> = (0..20).map(|i| RHO * (z[i] - y[i]) - q[i]).collect();
        for (i, x) in times(&m, &w).into_iter().enumerate() {
            z[i] = (x + y[i]).clamp(low[i], high[i]);
            y[i] += x - z[i];
        }
    }
    (arrays[4], arrays[5]) = (z, y);
}

/// Slack variable of a bounded value: updates its dual and the linear cost.
fn slack(value: f64, bound: f64, dual: &mut f64, cost: &mut f64) {
    let sum = value + *dual;
    let within = sum.clamp(-bound, bound);
    *dual = sum - within;
    *cost = 2.0 * (*dual - within);
}

pub(super) fn mpc(arrays: &mut Arrays, _: &mut Vec<f64>) {
    let [a, b, k, c, m] = [0, 1, 2, 3, 4].map(|which| arrays[which].clone());
    let (b_turned, k_turned) = (turned(&b, 4), turned(&k, 12));
    let mut d = vec![Vec::new(); 9];
    for _ in 0..10 {
        let mut p = arrays[7][108..].to_vec();
        for step in (0..9).rev() {
            let r = arrays[8][4 * step..4 * step + 4].to_vec();
            d[step] = times(&c, &plus(&r, &times(&b_turned, &p), 1.0));
            let q = plus(&arrays[7][12 * step..12 * step + 12], &times(&k_turned, &r), -1.0);
            p = plus(&q, &times(&m, &p), 1.0);
        }
        let mut x = arrays[5].clone();
        for step in 0..10 {
            for (i, value) in x.iter().enumerate() {
                let (costs, duals) = arrays.split_at_mut(9);
                slack(*value, 0.75, &mut duals[0][12 * step + i], &mut costs[7][12 * step + i]);
            }
            if step == 9 {
                break;
            }
            let u: Vec<f64> = plus(&d[step], &times(&k, &x), 1.0).iter().map(|u| -u).collect();
            arrays[6][4 * step..4 * step + 4].copy_from_slice(&u);
            for (i, value) in u.iter().enumerate() {
                let (costs, duals) = arrays.split_at_mut(10);
                slack(*value, 0.25, &mut duals[0][4 * step + i], &mut costs[8][4 * step + i]);
            }
            x = plus(&times(&a, &x), &times(&b, &u), 1.0);
        }
    }
}

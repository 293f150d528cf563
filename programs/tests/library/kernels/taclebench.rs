// SPDX-License-Identifier: MIT OR Apache-2.0
//! Kernels of TACLeBench in binary64, written from the algorithms.

use super::{ALL, Arrays, Kernel, solved, unchanged};

/// Inverse of a 3×3 matrix by cofactors, and its determinant.
fn inverse(a: &[f64]) -> (Vec<f64>, f64) {
    let minor = |i: usize, j: usize| {
        let at = |down: usize, right: usize| a[3 * ((i + down) % 3) + (j + right) % 3];
        at(1, 1) * at(2, 2) - at(1, 2) * at(2, 1)
    };
    let determinant: f64 = (0..3).map(|j| a[j] * minor(0, j)).sum();
    ((0..9).map(|place| minor(place % 3, place / 3) / determinant).collect(), determinant)
}

fn statistics(arrays: &mut Arrays) {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / 1000.0;
    let means = [mean(&arrays[0]), mean(&arrays[1])];
    let product = |p: usize, q: usize| -> f64 {
        let both = arrays[p].iter().zip(&arrays[q]);
        both.map(|(a, b)| (a - means[p]) * (b - means[q])).sum()
    };
    let variances = [product(0, 0) / 1000.0, product(1, 1) / 1000.0];
    let correlation = product(0, 1) / (product(0, 0) * product(1, 1)).sqrt();
    arrays[2] = [
        means.map(|mean| 1000.0 * mean).to_vec(),
        means.to_vec(),
        variances.to_vec(),
        variances.map(f64::sqrt).to_vec(),
        vec![correlation],
    ]
    .concat();
}

fn adaptive(arrays: &mut Arrays) {
    let (x, mut b) = (arrays[0].clone(), [0.0; 21]);
    for i in 0..201 {
        let past = || (0..21).map(|k| x[20 + i - k]);
        let y: f64 = past().zip(b).map(|(x, b)| x * b).sum();
        arrays[1][i] = y;
        let error = (0.02 / 21.0) * (x[21 + i] - y) / 2.0;
        b.iter_mut().zip(past()).for_each(|(b, x)| *b += error * x);
    }
}

pub(super) const LIST: &[Kernel] = &[
    Kernel {
        name: "cosf",
        machines: ALL,
        lengths: &[200, 200],
        filled: &[0],
        results: &[1],
        products: 0,
        prepare: |arrays| arrays[0].iter_mut().for_each(|angle| *angle *= 20.0),
        model: |arrays, _| arrays[1] = arrays[0].iter().map(|angle| angle.cos()).collect(),
    },
    Kernel {
        name: "deg2rad",
        machines: ALL,
        lengths: &[361, 361],
        filled: &[],
        results: &[1],
        products: 361,
        prepare: |arrays| arrays[0] = (0..361).map(f64::from).collect(),
        model: |arrays, _| arrays[1] = arrays[0].iter().map(|angle| angle.to_radians()).collect(),
    },
    Kernel {
        name: "fir2dim",
        machines: ALL,
        lengths: &[9, 16, 16],
        filled: &[0, 1],
        results: &[2],
        products: 144,
        prepare: unchanged,
        model: |arrays, _| {
            let (c, image) = (arrays[0].clone(), arrays[1].clone());
            for (place, y) in arrays[2].iter_mut().enumerate() {
                let near = |k: usize| {
                    let (row, column) = (place / 4 + k / 3, place % 4 + k % 3);
                    let is_inside = (1..5).contains(&row) && (1..5).contains(&column);
                    if is_inside { image[4 * (row - 1) + column - 1] } else { 0.0 }
                };
                *y = (0..9).map(|k| c[k] * near(k)).sum();
            }
        },
    },
    Kernel {
        name: "iir",
        machines: ALL,
        lengths: &[20, 5, 1, 1],
        filled: &[0, 1, 2],
        results: &[3],
        products: 20,
        prepare: unchanged,
        model: |arrays, _| {
            let mut y = arrays[2][0];
            for (c, w) in arrays[0].chunks(5).zip(arrays[1].windows(2)) {
                let inner = y - c[0] * w[0] - c[1] * w[1];
                y = c[2] * inner + c[3] * w[0] + c[4] * w[1];
            }
            arrays[3][0] = y;
        },
    },
    Kernel {
        name: "lms",
        machines: ALL,
        lengths: &[222, 201],
        filled: &[0],
        results: &[1],
        products: 8643,
        prepare: |arrays| arrays[0][..20].fill(0.0),
        model: |arrays, _| adaptive(arrays),
    },
    Kernel {
        name: "ludcmp",
        machines: ALL,
        lengths: &[36, 6, 6],
        filled: &[0, 1],
        results: &[2],
        products: 106,
        prepare: |arrays| (0..6).for_each(|i| arrays[0][7 * i] += 4.0),
        model: |arrays, _| arrays[2] = solved(&arrays[0], &arrays[1]),
    },
    Kernel {
        name: "minver",
        machines: ALL,
        lengths: &[9, 9, 1],
        filled: &[0],
        results: &[1, 2],
        products: 36,
        prepare: |arrays| (0..3).for_each(|i| arrays[0][3 * i + (i + 1) % 3] += 2.0),
        model: |arrays, _| {
            let (of, determinant) = inverse(&arrays[0]);
            (arrays[1], arrays[2]) = (of, vec![determinant]);
        },
    },
    Kernel {
        name: "st",
        machines: ALL,
        lengths: &[1000, 1000, 9],
        filled: &[0, 1],
        results: &[2],
        products: 3000,
        prepare: |arrays| {
            let (a, b) = arrays.split_at_mut(1);
            b[0].iter_mut().zip(&a[0]).for_each(|(b, a)| *b = 0.5 * (*a + *b));
        },
        model: |arrays, _| statistics(arrays),
    },
];

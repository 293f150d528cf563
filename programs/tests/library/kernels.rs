// SPDX-License-Identifier: MIT OR Apache-2.0
//! `programs/kernels`: programs over arrays in memory against the same computation in binary64, and what they cost, in
//! `docs/library.md`.

use crate::common::check_table;
use crate::library::measure::Random;
use takt_asm::{MemoryLoader, Options, Search};
use takt_emu::Emulator;
use takt_isa::{Machine, T1, T3, T4};
use takt_programs::{KERNELS, LIBRARY};

/// An array of a program, as the values that a period finds and leaves.
type Arrays = Vec<Vec<f64>>;

struct Kernel {
    name: &'static str,
    machines: &'static [&'static Machine],
    /// The lengths of the program's first arrays, in the order of their declaration.
    lengths: &'static [usize],
    /// Those that random numbers fill before a period.
    filled: &'static [usize],
    /// Those that are compared behind it.
    results: &'static [usize],
    /// Products that are added to something, in a period.
    products: u32,
    /// Makes random numbers what the program expects.
    prepare: fn(&mut Arrays),
    /// A period; the last argument holds what the program keeps elsewhere.
    model: fn(&mut Arrays, &mut Vec<f64>),
}

const ALL: &[&Machine] = &[&T3, &T1, &T4];

fn as_it_is(_: &mut Arrays) {}

fn times(a: &[f64], x: &[f64]) -> Vec<f64> {
    a.chunks(x.len()).map(|row| row.iter().zip(x).map(|(a, x)| a * x).sum()).collect()
}

/// C = A·B, of rows of A and columns of B.
fn product(a: &[f64], b: &[f64], inner: usize) -> Vec<f64> {
    let columns = b.len() / inner;
    let element = |row: &[f64], j: usize| (0..inner).map(|k| row[k] * b[k * columns + j]).sum();
    a.chunks(inner).flat_map(|row| (0..columns).map(move |j| element(row, j)).collect::<Vec<f64>>()).collect()
}

fn turned(a: &[f64], columns: usize) -> Vec<f64> {
    (0..columns).flat_map(|j| a.iter().skip(j).step_by(columns).copied()).collect()
}

/// The solution of A·x = b, by elimination with pivoting.
fn solved(a: &[f64], b: &[f64]) -> Vec<f64> {
    let n = b.len();
    let mut rows: Vec<Vec<f64>> =
        a.chunks(n).zip(b).map(|(row, b)| row.iter().chain([b]).copied().collect()).collect();
    for k in 0..n {
        let pivot = (k..n).max_by(|&i, &j| rows[i][k].abs().total_cmp(&rows[j][k].abs())).unwrap_or(k);
        rows.swap(k, pivot);
        let (above, below) = rows.split_at_mut(k + 1);
        for row in below {
            let factor = row[k] / above[k][k];
            row.iter_mut().zip(&above[k]).for_each(|(to, from)| *to -= factor * from);
        }
    }
    let mut x = vec![0.0; n];
    for i in (0..n).rev() {
        let rest: f64 = (i + 1..n).map(|j| rows[i][j] * x[j]).sum();
        x[i] = (rows[i][n] - rest) / rows[i][i];
    }
    x
}

/// Makes a matrix symmetric and positive definite.
fn definite(a: &mut Vec<f64>, n: usize) {
    *a = product(a, &turned(a, n), n);
    (0..n).for_each(|i| a[i * n + i] += 1.0);
}

fn layer(w: &[f64], b: &[f64], x: &[f64], activation: fn(f64) -> f64) -> Vec<f64> {
    times(w, x).iter().zip(b).map(|(sum, b)| activation(sum + b)).collect()
}

fn relu(x: f64) -> f64 {
    x.max(0.0)
}

/// The place of x in a table of n values: the interval, and the part of it.
fn place(x: f64, n: usize) -> (usize, f64) {
    let at = x.clamp(0.0, (n - 1) as f64);
    let k = (at as usize).min(n - 2);
    (k, at - k as f64)
}

fn kalman(arrays: &mut Arrays, _: &mut Vec<f64>) {
    let [f, h, q, r, p] = [0, 1, 2, 3, 4].map(|which| arrays[which].clone());
    let (x, z) = (arrays[7].clone(), arrays[9].clone());
    let m = times(&f, &x);
    let mut n = product(&product(&f, &p, 12), &turned(&f, 12), 12);
    n.iter_mut().zip(&q).for_each(|(n, q)| *n += q);
    let g = product(&n, &turned(&h, 12), 12);
    let mut s = product(&h, &g, 12);
    s.iter_mut().zip(&r).for_each(|(s, r)| *s += r);
    let e: Vec<f64> = times(&h, &m).iter().zip(&z).map(|(of, z)| z - of).collect();
    // K·S = G, by rows: S is symmetric.
    let gain: Vec<f64> = g.chunks(3).flat_map(|row| solved(&s, row)).collect();
    let correction = product(&gain, &turned(&g, 3), 3);
    arrays[4] = n.iter().zip(correction).map(|(n, c)| n - c).collect();
    arrays[7] = m.iter().zip(times(&gain, &e)).map(|(m, c)| m + c).collect();
}

/// A value in bounds: its dual, and the linear cost that follows.
fn slack(value: f64, bound: f64, dual: &mut f64, cost: &mut f64) {
    let sum = value + *dual;
    let within = sum.clamp(-bound, bound);
    *dual = sum - within;
    *cost = 2.0 * (*dual - within);
}

fn mpc(arrays: &mut Arrays, _: &mut Vec<f64>) {
    let [a, b, k, c, m] = [0, 1, 2, 3, 4].map(|which| arrays[which].clone());
    let (b_turned, k_turned) = (turned(&b, 4), turned(&k, 12));
    let plus = |a: &[f64], b: &[f64], factor: f64| -> Vec<f64> {
        a.iter().zip(b).map(|(a, b)| a + factor * b).collect()
    };
    for _ in 0..10 {
        let mut p = arrays[7][108..].to_vec();
        for step in (0..9).rev() {
            let r = arrays[8][4 * step..4 * step + 4].to_vec();
            let d = times(&c, &plus(&r, &times(&b_turned, &p), 1.0));
            arrays[11][4 * step..4 * step + 4].copy_from_slice(&d);
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
            let u = plus(&arrays[11][4 * step..4 * step + 4], &times(&k, &x), 1.0);
            let u: Vec<f64> = u.iter().map(|u| -u).collect();
            arrays[6][4 * step..4 * step + 4].copy_from_slice(&u);
            for (i, value) in u.iter().enumerate() {
                let (costs, duals) = arrays.split_at_mut(10);
                slack(*value, 0.25, &mut duals[0][4 * step + i], &mut costs[8][4 * step + i]);
            }
            x = plus(&times(&a, &x), &times(&b, &u), 1.0);
        }
    }
}

const LIST: &[Kernel] = &[
    Kernel {
        name: "dot",
        machines: ALL,
        lengths: &[256, 256, 1],
        filled: &[0, 1],
        results: &[2],
        products: 256,
        prepare: as_it_is,
        model: |arrays, _| arrays[2] = times(&arrays[0], &arrays[1]),
    },
    Kernel {
        name: "matvec",
        machines: ALL,
        lengths: &[144, 12, 12],
        filled: &[0, 1],
        results: &[2],
        products: 144,
        prepare: as_it_is,
        model: |arrays, _| arrays[2] = times(&arrays[0], &arrays[1]),
    },
    Kernel {
        name: "matmul",
        machines: &[&T3, &T4],
        lengths: &[144, 144, 144],
        filled: &[0, 1],
        results: &[2],
        products: 1728,
        prepare: as_it_is,
        model: |arrays, _| arrays[2] = product(&arrays[0], &arrays[1], 12),
    },
    Kernel {
        name: "cholesky",
        machines: ALL,
        lengths: &[144, 12, 12],
        filled: &[0, 1],
        results: &[2],
        products: 508,
        prepare: |arrays| definite(&mut arrays[0], 12),
        model: |arrays, _| arrays[2] = solved(&arrays[0], &arrays[1]),
    },
    Kernel {
        name: "lu",
        machines: ALL,
        lengths: &[36, 6, 6],
        filled: &[0, 1],
        results: &[2],
        products: 106,
        prepare: |arrays| (0..6).for_each(|i| arrays[0][6 * i + (i + 2) % 6] += 3.0),
        model: |arrays, _| arrays[2] = solved(&arrays[0], &arrays[1]),
    },
    Kernel {
        name: "kalman",
        machines: &[&T3],
        lengths: &[144, 36, 144, 9, 144, 144, 36, 12, 12, 3],
        filled: &[0, 1, 2, 3, 4, 7, 9],
        results: &[4, 7],
        products: 4790,
        prepare: |arrays| {
            definite(&mut arrays[2], 12);
            definite(&mut arrays[3], 3);
            definite(&mut arrays[4], 12);
        },
        model: kalman,
    },
    Kernel {
        name: "mpc",
        machines: &[&T3],
        lengths: &[144, 48, 48, 16, 144, 12, 36, 120, 36, 120, 36, 36],
        filled: &[0, 1, 2, 3, 4, 5],
        results: &[6, 9, 10],
        products: 44_640,
        prepare: |arrays| {
            for (array, factor) in arrays.iter_mut().zip([0.25, 0.5, 0.25, 0.25, 0.25]) {
                array.iter_mut().for_each(|value| *value *= factor);
            }
        },
        model: mpc,
    },
    Kernel {
        name: "layers",
        machines: ALL,
        lengths: &[576, 24, 288, 12, 24, 24, 12],
        filled: &[0, 1, 2, 3, 4],
        results: &[5, 6],
        products: 864,
        prepare: as_it_is,
        model: |arrays, _| {
            arrays[5] = layer(&arrays[0], &arrays[1], &arrays[4], relu);
            arrays[6] = layer(&arrays[2], &arrays[3], &arrays[5], |x| x);
        },
    },
    Kernel {
        name: "layers_tanh",
        machines: ALL,
        lengths: &[576, 24, 288, 12, 24, 24, 12],
        filled: &[0, 1, 2, 3, 4],
        results: &[5, 6],
        products: 864,
        prepare: as_it_is,
        model: |arrays, _| {
            arrays[5] = layer(&arrays[0], &arrays[1], &arrays[4], f64::tanh);
            arrays[6] = layer(&arrays[2], &arrays[3], &arrays[5], f64::tanh);
        },
    },
    Kernel {
        name: "policy",
        machines: &[&T3],
        lengths: &[6144, 128, 16384, 128, 1536, 12, 48, 12],
        filled: &[0, 1, 2, 3, 4, 5, 6],
        results: &[7],
        products: 24_064,
        prepare: as_it_is,
        model: |arrays, _| {
            let first = layer(&arrays[0], &arrays[1], &arrays[6], relu);
            let second = layer(&arrays[2], &arrays[3], &first, relu);
            arrays[7] = layer(&arrays[4], &arrays[5], &second, |x| x);
        },
    },
    Kernel {
        name: "fft",
        machines: &[&T3],
        lengths: &[256; 4],
        filled: &[0, 1],
        results: &[0, 1],
        // It has fewer products than sums.
        products: 5248,
        prepare: as_it_is,
        model: |arrays, _| {
            let (r, m) = (arrays[0].clone(), arrays[1].clone());
            let angle = |j: usize, k: usize| std::f64::consts::TAU * (j * k % 256) as f64 / 256.0;
            let sum = |of: &dyn Fn(usize) -> f64| (0..256).map(of).sum();
            arrays[0] =
                (0..256).map(|k| sum(&|j| r[j] * angle(j, k).cos() + m[j] * angle(j, k).sin())).collect();
            arrays[1] =
                (0..256).map(|k| sum(&|j| m[j] * angle(j, k).cos() - r[j] * angle(j, k).sin())).collect();
        },
    },
    Kernel {
        name: "fir",
        machines: ALL,
        lengths: &[64, 1, 1],
        filled: &[1],
        results: &[2],
        products: 64,
        prepare: |arrays| arrays[0] = (1..=64).map(|i| 1.0 / f64::from(i)).collect(),
        model: |arrays, past| {
            past.insert(0, arrays[1][0]);
            arrays[2][0] = past.iter().zip(&arrays[0]).map(|(u, h)| u * h).sum();
        },
    },
    Kernel {
        name: "biquads",
        machines: ALL,
        lengths: &[20, 1, 1],
        filled: &[1],
        results: &[2],
        products: 20,
        prepare: |arrays| arrays[0] = [0.25, 0.5, 0.25, -0.5, 0.125].repeat(4),
        model: |arrays, past| {
            past.resize(8, 0.0);
            let mut v = arrays[1][0];
            for (c, s) in arrays[0].chunks(5).zip(past.chunks_mut(2)) {
                let y = s[0] + c[0] * v;
                (s[0], s[1]) = (s[1] + c[1] * v - c[3] * y, c[2] * v - c[4] * y);
                v = y;
            }
            arrays[2][0] = v;
        },
    },
    Kernel {
        name: "table",
        machines: ALL,
        lengths: &[33, 1, 1],
        filled: &[0, 1],
        results: &[2],
        products: 1,
        prepare: |arrays| arrays[1][0] = 20.0 + 24.0 * arrays[1][0],
        model: |arrays, _| {
            let (k, part) = place(arrays[1][0], 33);
            arrays[2][0] = arrays[0][k] + part * (arrays[0][k + 1] - arrays[0][k]);
        },
    },
    Kernel {
        name: "table2",
        machines: ALL,
        lengths: &[153, 2, 1],
        filled: &[0, 1],
        results: &[2],
        products: 3,
        prepare: |arrays| arrays[1] = vec![8.0 + 10.0 * arrays[1][0], 4.0 + 6.0 * arrays[1][1]],
        model: |arrays, _| {
            let ((k, part), (l, right)) = (place(arrays[1][0], 17), place(arrays[1][1], 9));
            let row = |k: usize| {
                let [low, high] = [0, 1].map(|more| arrays[0][9 * k + l + more]);
                low + right * (high - low)
            };
            arrays[2][0] = row(k) + part * (row(k + 1) - row(k));
        },
    },
];

/// Runs periods with random numbers, compares, and returns the cycles of one.
fn judge(kernel: &Kernel, machine: &'static Machine) -> u64 {
    let file = format!("{}.s", kernel.name);
    let source = KERNELS.iter().find(|(name, _)| *name == file).expect("it is in the folder").1;
    let loader = Search::new(MemoryLoader::of(&file, source)).library(LIBRARY);
    let assembled = takt_asm::assemble(&file, &loader, &Options { machine, ..Options::default() });
    let assembled = assembled.unwrap_or_else(|errors| panic!("{file}: {}", errors.render(false)));
    assert!(assembled.warnings.is_empty(), "{file}: {}", assembled.warnings.render(false));
    let mut emulator = Emulator::new(&assembled.program).expect("it fits");
    let name = emulator.machine().name;
    assert_eq!(name.split(',').next(), Some(machine.name), "{file}");
    let (mut random, mut kept, mut cycles) = (Random(7), Vec::new(), None);
    for period in 0..8 {
        let mut arrays: Arrays = kernel.lengths.iter().map(|length| vec![0.0; *length]).collect();
        for &which in kernel.filled {
            // Binary32 numbers between -1 and 1.
            arrays[which].fill_with(|| f64::from(((random.next() >> 40) as f32) / (1 << 23) as f32 - 1.0));
        }
        (kernel.prepare)(&mut arrays);
        let words = arrays.iter().flatten().map(|value| (*value as f32).to_bits());
        emulator.memory_mut().iter_mut().zip(words).for_each(|(word, value)| *word = value);
        let report = emulator.run_period(&[]).unwrap_or_else(|error| panic!("{file}: {error}"));
        assert_eq!(*cycles.get_or_insert(report.cycles), report.cycles, "{file}");
        (kernel.model)(&mut arrays, &mut kept);
        let mut first = 0;
        for (which, exact) in arrays.iter().enumerate() {
            let scale = exact.iter().fold(1.0, |most: f64, value| most.max(value.abs()));
            let found = emulator.memory()[first..].iter().map(|word| f64::from(f32::from_bits(*word)));
            for (place, (exact, found)) in exact.iter().zip(found).enumerate() {
                let is_near = (exact - found).abs() < 2e-4 * scale;
                assert!(
                    !kernel.results.contains(&which) || is_near,
                    "{file} on {}, period {period}, array {which}, {place}: {found} for {exact}",
                    machine.name
                );
            }
            first += exact.len();
        }
    }
    cycles.unwrap_or(0)
}

#[test]
fn kernels_compute_what_they_should_in_the_documented_cycles() {
    let mut table = String::from(
        "| program | multiply-adds | t3 | × roofline | t1 | × roofline | t4 | × roofline |\n|---|---|---|---|---|---|---|---|\n",
    );
    for kernel in LIST {
        let mut row = format!("| `{}.s` | {}", kernel.name, kernel.products);
        for machine in ALL {
            if !kernel.machines.contains(machine) {
                row += " | - | -";
                continue;
            }
            let cycles = judge(kernel, machine);
            // A product and a sum each take an operation of t1's slot; t4 does two of both in a cycle.
            let least = match machine.name {
                "t1" => 2.0 * f64::from(kernel.products),
                "t4" => f64::from(kernel.products) / 2.0,
                _ => f64::from(kernel.products),
            };
            row += &format!(" | {cycles} | {:.2}", cycles as f64 / least);
        }
        table += &format!("{row} |\n");
    }
    check_table("docs/library.md", "kernels", &table);
}

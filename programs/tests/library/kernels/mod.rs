// SPDX-License-Identifier: MIT OR Apache-2.0
//! Kernels in `programs/kernels` and `programs/taclebench`: programs over arrays in memory against the same computation in binary64, and
//! their costs, in `docs/library.md`.

mod control;
mod taclebench;

use crate::common::check_table;
use crate::library::measure::parallel;
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};
use takt_asm::{MemoryLoader, Options, Search};
use takt_emu::Emulator;
use takt_isa::{Machine, T1, T3, T4};
use takt_programs::{KERNELS, LIBRARY, TACLEBENCH};

/// Arrays of a program, before and after a period.
type Arrays = Vec<Vec<f64>>;

struct Kernel {
    name: &'static str,
    machines: &'static [&'static Machine],
    /// Lengths of the program's first arrays, in the order of their declaration.
    lengths: &'static [usize],
    /// Arrays that random numbers fill before a period.
    filled: &'static [usize],
    /// Arrays to compare after a period.
    results: &'static [usize],
    /// Number of multiply-add pairs in a period.
    products: u32,
    /// Makes valid operands from random numbers.
    prepare: fn(&mut Arrays),
    /// Model of a period; the last argument holds the program's other state.
    model: fn(&mut Arrays, &mut Vec<f64>),
}

const ALL: &[&Machine] = &[&T3, &T1, &T4];

fn unchanged(_: &mut Arrays) {}

fn times(a: &[f64], x: &[f64]) -> Vec<f64> {
    a.chunks(x.len()).map(|row| row.iter().zip(x).map(|(a, x)| a * x).sum()).collect()
}

/// Product C = A·B, both stored by rows; `inner` is the number of A's columns.
fn product(a: &[f64], b: &[f64], inner: usize) -> Vec<f64> {
    let columns = b.len() / inner;
    let element = |row: &[f64], j: usize| (0..inner).map(|k| row[k] * b[k * columns + j]).sum();
    a.chunks(inner).flat_map(|row| (0..columns).map(move |j| element(row, j)).collect::<Vec<f64>>()).collect()
}

fn turned(a: &[f64], columns: usize) -> Vec<f64> {
    (0..columns).flat_map(|j| a.iter().skip(j).step_by(columns).copied()).collect()
}

/// Solution of A·x = b, by elimination with pivoting.
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

/// Position of x in a table of n values: the interval, and the fraction within.
fn place(x: f64, n: usize) -> (usize, f64) {
    let at = x.clamp(0.0, (n - 1) as f64);
    let k = (at as usize).min(n - 2);
    (k, at - k as f64)
}

const LIST: &[Kernel] = &[
    Kernel {
        name: "dot",
        machines: ALL,
        lengths: &[256, 256, 1],
        filled: &[0, 1],
        results: &[2],
        products: 256,
        prepare: unchanged,
        model: |arrays, _| arrays[2] = times(&arrays[0], &arrays[1]),
    },
    Kernel {
        name: "matvec",
        machines: ALL,
        lengths: &[144, 12, 12],
        filled: &[0, 1],
        results: &[2],
        products: 144,
        prepare: unchanged,
        model: |arrays, _| arrays[2] = times(&arrays[0], &arrays[1]),
    },
    Kernel {
        name: "matmul",
        machines: ALL,
        lengths: &[144, 144, 144],
        filled: &[0, 1],
        results: &[2],
        products: 1728,
        prepare: unchanged,
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
        name: "qr",
        machines: ALL,
        lengths: &[128, 16, 8],
        filled: &[0, 1],
        results: &[2],
        products: 1120,
        prepare: |arrays| (0..8).for_each(|i| arrays[0][9 * i] += 3.0),
        model: |arrays, _| {
            // Normal equations of the least-squares problem.
            let turned = turned(&arrays[0], 8);
            let square = product(&turned, &arrays[0], 16);
            arrays[2] = solved(&square, &times(&turned, &arrays[1]));
        },
    },
    Kernel {
        name: "kalman",
        machines: ALL,
        lengths: &[144, 36, 144, 9, 144, 12, 3],
        filled: &[0, 1, 2, 3, 4, 5, 6],
        results: &[4, 5],
        products: 4790,
        prepare: |arrays| {
            definite(&mut arrays[2], 12);
            definite(&mut arrays[3], 3);
            definite(&mut arrays[4], 12);
        },
        model: control::kalman,
    },
    Kernel {
        name: "ekf",
        machines: &[&T3, &T4],
        lengths: &[25, 4, 25, 5, 2, 2],
        filled: &[0, 1, 2, 3, 4, 5],
        results: &[2, 3],
        products: 399,
        prepare: |arrays| {
            definite(&mut arrays[0], 5);
            definite(&mut arrays[1], 2);
            definite(&mut arrays[2], 5);
            arrays[5].iter_mut().for_each(|value| *value += 4.0);
        },
        model: control::ekf,
    },
    Kernel {
        name: "riccati",
        machines: ALL,
        lengths: &[144, 48, 144, 16, 144, 48],
        filled: &[0, 1, 2, 3, 4],
        results: &[4, 5],
        products: 5520,
        prepare: |arrays| {
            definite(&mut arrays[2], 12);
            definite(&mut arrays[3], 4);
            definite(&mut arrays[4], 12);
        },
        model: control::riccati,
    },
    Kernel {
        name: "qp",
        machines: ALL,
        lengths: &[400, 20, 20, 20, 20, 20],
        filled: &[0, 1, 2, 3],
        results: &[4, 5],
        products: 8420,
        prepare: |arrays| {
            arrays[0].iter_mut().for_each(|value| *value *= 0.05);
            (0..20).for_each(|i| arrays[0][21 * i] += 0.25);
            arrays[2].iter_mut().for_each(|value| *value = -value.abs());
            arrays[3].iter_mut().for_each(|value| *value = value.abs());
        },
        model: control::qp,
    },
    Kernel {
        name: "mpc",
        machines: &[&T3, &T4],
        lengths: &[144, 48, 48, 16, 144, 12, 36, 120, 36, 120, 36],
        filled: &[0, 1, 2, 3, 4, 5],
        results: &[6, 9, 10],
        products: 44_640,
        prepare: |arrays| {
            for (array, factor) in arrays.iter_mut().zip([0.25, 0.5, 0.25, 0.25, 0.25]) {
                array.iter_mut().for_each(|value| *value *= factor);
            }
        },
        model: control::mpc,
    },
    Kernel {
        name: "layers",
        machines: ALL,
        lengths: &[576, 24, 288, 12, 24, 24, 12],
        filled: &[0, 1, 2, 3, 4],
        results: &[5, 6],
        products: 864,
        prepare: unchanged,
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
        prepare: unchanged,
        model: |arrays, _| {
            arrays[5] = layer(&arrays[0], &arrays[1], &arrays[4], f64::tanh);
            arrays[6] = layer(&arrays[2], &arrays[3], &arrays[5], f64::tanh);
        },
    },
    Kernel {
        name: "policy",
        machines: &[&T3, &T4],
        lengths: &[6144, 128, 16384, 128, 1536, 12, 48, 12],
        filled: &[0, 1, 2, 3, 4, 5, 6],
        results: &[7],
        products: 24_064,
        prepare: unchanged,
        model: |arrays, _| {
            let first = layer(&arrays[0], &arrays[1], &arrays[6], relu);
            let second = layer(&arrays[2], &arrays[3], &first, relu);
            arrays[7] = layer(&arrays[4], &arrays[5], &second, |x| x);
        },
    },
    Kernel {
        name: "policy_tanh",
        machines: &[&T3, &T4],
        lengths: &[6144, 128, 16384, 128, 1536, 12, 48, 12],
        filled: &[0, 1, 2, 3, 4, 5, 6],
        results: &[7],
        products: 24_064,
        prepare: |arrays| {
            for which in [0, 2, 4] {
                arrays[which].iter_mut().for_each(|weight| *weight *= 0.25);
            }
        },
        model: |arrays, _| {
            let first = layer(&arrays[0], &arrays[1], &arrays[6], f64::tanh);
            let second = layer(&arrays[2], &arrays[3], &first, f64::tanh);
            arrays[7] = layer(&arrays[4], &arrays[5], &second, f64::tanh);
        },
    },
    Kernel {
        name: "activations",
        machines: ALL,
        lengths: &[64; 4],
        filled: &[0, 1, 2, 3],
        results: &[0, 1, 2, 3],
        products: 0,
        prepare: |arrays| arrays.iter_mut().flatten().for_each(|value| *value *= 10.0),
        model: |arrays, _| {
            let activations: [fn(f64) -> f64; 4] = [
                f64::tanh,
                f64::tanh,
                |x| 1.0 / (1.0 + (-x).exp()),
                |x| if x > 0.0 { x } else { x.exp_m1() },
            ];
            for (array, activation) in arrays.iter_mut().zip(activations) {
                array.iter_mut().for_each(|value| *value = activation(*value));
            }
        },
    },
    Kernel {
        name: "fft",
        machines: ALL,
        lengths: &[256; 4],
        filled: &[0, 1],
        results: &[0, 1],
        // The transform has fewer products than sums.
        products: 5248,
        prepare: unchanged,
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

/// Runs periods with random numbers, compares the results, and returns the cycles of a period.
fn judge(kernel: &Kernel, machine: &'static Machine, sources: &[(&str, &str)]) -> u64 {
    let file = format!("{}.s", kernel.name);
    let source = sources.iter().find(|(name, _)| *name == file).expect("it is in the folder").1;
    // Programs with a directive `.machine` name t3.
    let source = source.replace(".machine t3", &format!(".machine {}", machine.name));
    let loader = Search::new(MemoryLoader::of(&file, source)).library(LIBRARY);
    let assembled = takt_asm::assemble(&file, &loader, &Options { machine, ..Options::default() });
    let assembled = assembled.unwrap_or_else(|errors| panic!("{file}: {}", errors.render(false)));
    assert!(assembled.warnings.is_empty(), "{file}: {}", assembled.warnings.render(false));
    let mut emulator = Emulator::new(&assembled.program).expect("it fits");
    let name = emulator.machine().name;
    assert_eq!(name.split(',').next(), Some(machine.name), "{file}");
    let (mut random, mut kept, mut cycles) = (SplitMix64::seed_from_u64(7), Vec::new(), None);
    for period in 0..8 {
        let mut arrays: Arrays = kernel.lengths.iter().map(|length| vec![0.0; *length]).collect();
        for &which in kernel.filled {
            // Random binary32 numbers between -1 and 1.
            arrays[which]
                .fill_with(|| f64::from(((random.next_u64() >> 40) as f32) / (1 << 23) as f32 - 1.0));
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

/// Judges a list of programs in parallel, and returns the table of their costs.
fn table(list: &[Kernel], sources: &[(&str, &str)]) -> String {
    let jobs: Vec<(&Kernel, &'static Machine)> = list
        .iter()
        .flat_map(|kernel| ALL.iter().map(move |machine| (kernel, *machine)))
        .filter(|(kernel, machine)| kernel.machines.contains(machine))
        .collect();
    let count = jobs.len() as u64;
    // Alternates between both ends of the list, because the long jobs are adjacent.
    let job = |index: u64| if index.is_multiple_of(2) { index / 2 } else { count - 1 - index / 2 };
    let work = |range: std::ops::Range<u64>| -> Vec<(u64, u64)> {
        range.map(job).map(|at| (at, judge(jobs[at as usize].0, jobs[at as usize].1, sources))).collect()
    };
    let mut cycles: Vec<(u64, u64)> = parallel(count, work).into_iter().flatten().collect();
    cycles.sort_unstable();
    let mut cycles = cycles.into_iter().map(|(_, cycles)| cycles);
    let mut table = String::from(
        "| program | multiply-adds | t3 | × roofline | t1 | × roofline | t4 | × roofline |\n|---|---|---|---|---|---|---|---|\n",
    );
    for kernel in list {
        let mut row = format!("| `{}.s` | {}", kernel.name, kernel.products);
        for machine in ALL {
            let Some(cycles) = kernel.machines.contains(machine).then(|| cycles.next()).flatten() else {
                row += " | - | -";
                continue;
            };
            // Lower bound: on t1 a product and a sum each take an operation of the slot; t4 performs two of both per cycle.
            let least = match machine.name {
                "t1" => 2.0 * f64::from(kernel.products),
                "t4" => f64::from(kernel.products) / 2.0,
                _ => f64::from(kernel.products),
            };
            row += &match kernel.products {
                0 => format!(" | {cycles} | -"),
                _ => format!(" | {cycles} | {:.2}", cycles as f64 / least),
            };
        }
        table += &format!("{row} |\n");
    }
    table
}

#[test]
fn kernels_compute_expected_values_in_documented_cycles() {
    check_table("docs/library.md", "kernels", &table(LIST, KERNELS));
}

#[test]
fn kernels_of_taclebench_keep_the_documented_cycles() {
    check_table("docs/library.md", "taclebench", &table(taclebench::LIST, TACLEBENCH));
}

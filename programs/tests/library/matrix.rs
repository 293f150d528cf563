// SPDX-License-Identifier: MIT OR Apache-2.0
//! Macros of `programs/library/matrix.s` against the same loops in Rust: bit for bit in binary32, and in binary64 to check the results.

use rand_pcg::Pcg64;
use rand_pcg::rand_core::{Rng as _, SeedableRng as _};
use takt_asm::{MemoryLoader, Options, Search};
use takt_emu::Emulator;
use takt_isa::{MACHINES, Machine};
use takt_programs::LIBRARY;

/// Number types of the loops.
trait Number:
    Copy
    + std::ops::Mul<Output = Self>
    + std::ops::Add<Output = Self>
    + std::ops::Sub<Output = Self>
    + std::ops::Div<Output = Self>
{
    fn of(value: f32) -> Self;
    fn root(self) -> Self;
}

impl Number for f32 {
    fn of(value: f32) -> f32 {
        value
    }
    fn root(self) -> f32 {
        self.sqrt()
    }
}

impl Number for f64 {
    fn of(value: f32) -> f64 {
        value.into()
    }
    fn root(self) -> f64 {
        self.sqrt()
    }
}

/// Matrix stored by rows.
#[derive(Clone)]
struct Matrix<N> {
    columns: usize,
    values: Vec<N>,
}

impl<N: Number> Matrix<N> {
    /// Matrix of `n` rows and `columns` columns, with elements by row and column.
    fn new(n: usize, columns: usize, element: impl Fn(usize, usize) -> N) -> Matrix<N> {
        let values =
            (0..n).flat_map(|i| (0..columns).map(move |j| (i, j))).map(|(i, j)| element(i, j)).collect();
        Matrix { columns, values }
    }

    fn at(&self, i: usize, j: usize) -> N {
        self.values[i * self.columns + j]
    }

    fn rows(&self) -> usize {
        self.values.len() / self.columns
    }
}

/// Sum in order of the index.
fn sum<N: Number>(count: usize, part: impl Fn(usize) -> N) -> N {
    (1..count).fold(part(0), |sum, i| sum + part(i))
}

fn times<N: Number>(a: &Matrix<N>, b: &Matrix<N>) -> Matrix<N> {
    Matrix::new(a.rows(), b.columns, |i, j| sum(a.columns, |k| a.at(i, k) * b.at(k, j)))
}

fn turned<N: Number>(a: &Matrix<N>) -> Matrix<N> {
    Matrix::new(a.columns, a.rows(), |i, j| a.at(j, i))
}

/// Solution of A·x = b by Cholesky factors.
fn solved<N: Number>(a: &Matrix<N>, b: &[N]) -> Vec<N> {
    let n = b.len();
    let less = |value: N, count: usize, part: &dyn Fn(usize) -> N| {
        if count == 0 { value } else { value - sum(count, part) }
    };
    let mut l = Matrix::new(n, n, |_, _| N::of(0.0));
    let mut r = Vec::new();
    for j in 0..n {
        let pivot = less(a.at(j, j), j, &|k| l.at(j, k) * l.at(j, k)).root();
        l.values[j * n + j] = pivot;
        r.push(N::of(1.0) / pivot);
        for i in j + 1..n {
            let value = less(a.at(i, j), j, &|k| l.at(i, k) * l.at(j, k)) * r[j];
            l.values[i * n + j] = value;
        }
    }
    let mut y: Vec<N> = Vec::new();
    for i in 0..n {
        let value = less(b[i], i, &|k| l.at(i, k) * y[k]) * r[i];
        y.push(value);
    }
    let mut x = y.clone();
    for i in (0..n).rev() {
        x[i] = less(y[i], n - 1 - i, &|k| l.at(i + 1 + k, i) * x[i + 1 + k]) * r[i];
    }
    x
}

/// Expected outputs of the program below, in their order, from A (3×4), B (4×2), x (4), y (3).
fn computed<N: Number>(inputs: &[f32]) -> Vec<N> {
    let mut inputs = inputs.iter().map(|value| N::of(*value));
    let mut matrix =
        |n: usize, m: usize| Matrix { columns: m, values: inputs.by_ref().take(n * m).collect() };
    let (a, b, x, y) = (matrix(3, 4), matrix(4, 2), matrix(4, 1), matrix(3, 1));
    let mut all = Vec::new();
    let product = times(&a, &b);
    all.extend(&product.values);
    let ax = times(&a, &x);
    all.extend(&ax.values);
    all.extend(&times(&turned(&a), &y).values);
    let (u, v) = (&ax.values, &y.values);
    let cross = |i: usize, j: usize| u[i] * v[j] - u[j] * v[i];
    all.extend([cross(1, 2), cross(2, 0), cross(0, 1)]);
    all.push(sum(3, |i| u[i] * v[i]));
    all.push(sum(4, |i| x.values[i] * x.values[i]).root());
    all.push(sum(3, |i| v[i] * sum(4, |j| a.at(i, j) * x.values[j])));
    // Matrix A·Aᵀ + 2·1, symmetric and positive definite, and a linear system with it.
    let squared = Matrix::new(3, 3, |i, j| sum(4, |k| a.at(i, k) * a.at(j, k)));
    let one = |i, j| N::of(if i == j { 1.0 } else { 0.0 });
    let definite = Matrix::new(3, 3, |i, j| squared.at(i, j) + N::of(2.0) * one(i, j));
    all.extend(solved(&definite, v));
    // Outputs ½·x·yᵀ, and y + x₁·A·x.
    let outer = Matrix::new(3, 3, |i, j| x.values[i] * v[j]);
    let scaled = Matrix::new(3, 3, |i, j| N::of(0.5) * outer.at(i, j));
    all.extend(&turned(&scaled).values);
    all.push(v[0] + x.values[0] * u[0]);
    all
}

const PROGRAM: &str = "
.include <matrix.s>
.schedule on
.rep i, 1, 27
.input i{i}
.endr
.rep i, 1, 32
.output o{i}
.endr
.reg A[3,4] B[4,2] x[4] y[3] C[3,2] ax[3] aty[4] c[3] S[3,3] E[3,3] L[3,3] r[3] s[3] O[3,3] Q[3,3] T[3,3] z[3]
.once
        wait period
.period
period:
.rep i, 1, 3
.rep j, 1, 4
        A[i,j] = i{4*(i-1)+j}
.endr
.endr
.rep i, 1, 4
        B[i,1], B[i,2], x[i] = i{11+2*i}, i{12+2*i}, i{20+i}
.endr
.rep i, 1, 3
        y[i] = i{24+i}
.endr
        matmul  C, A, B, 3, 4, 2
        matvec  ax, A, x, 3, 4
        matvec_t aty, A, y, 3, 4
        cross   c, ax, y
        o17, o18 = dot(ax, y, 3), norm(x, 4)
        bilinear o19, y, A, x, 3, 4
        matmul_t S, A, A, 3, 4, 3
        identity E, 3
        matadd  S, S, 2, E, 3, 3
        cholesky L, r, S, 3
        cholesky_solve s, L, r, y, 3
        outer   O, x, y, 3, 3
        matscale Q, 0.5, O, 3, 3
        transpose T, Q, 3, 3
        axpy    z, y, x[1], ax, 3
        o32 = z[1]
.rep i, 1, 3
        o{2*i-1}, o{2*i} = C[i,1], C[i,2]
        o{6+i}, o{13+i}, o{19+i} = ax[i], c[i], s[i]
.rep j, 1, 3
        o{19+3*i+j} = T[i,j]
.endr
.endr
.rep i, 1, 4
        o{9+i} = aty[i]
.endr
        wait period
";

/// Random numbers between -2 and 2.
fn numbers(seed: u64, count: usize) -> Vec<f32> {
    let mut random = Pcg64::seed_from_u64(seed);
    (0..count).map(|_| (random.next_u64() >> 40) as f32 / (1 << 22) as f32 - 2.0).collect()
}

fn judge(machine: &'static Machine) {
    let loader = Search::new(MemoryLoader::of("test.s", PROGRAM)).library(LIBRARY);
    let assembled = takt_asm::assemble("test.s", &loader, &Options { machine, ..Options::default() });
    let assembled = assembled.unwrap_or_else(|errors| panic!("{}", errors.render(false)));
    assert!(assembled.warnings.is_empty(), "{}", assembled.warnings.render(false));
    let program = &assembled.program;
    let mut emulator = Emulator::new(program).expect("it fits");
    for seed in 0..50 {
        let inputs = numbers(seed, program.inputs.len());
        for (port, value) in program.inputs.iter().zip(&inputs) {
            emulator.set_input_bits(port.register, value.to_bits()).expect("it is an input");
        }
        emulator.run_period(&[]).expect("it runs");
        let (single, double) = (computed::<f32>(&inputs), computed::<f64>(&inputs));
        assert_eq!(single.len(), program.outputs.len());
        for ((port, single), double) in program.outputs.iter().zip(single).zip(double) {
            let found = emulator.register(port.register).map(f32::from_bits).expect("it is written");
            assert_eq!(found.to_bits(), single.to_bits(), "{} on {}, seed {seed}", port.name, machine.name);
            let off = (f64::from(found) - double).abs();
            assert!(
                off <= 1e-4 * double.abs().max(1.0),
                "{} on {}: {found}, {double}",
                port.name,
                machine.name
            );
        }
    }
}

#[test]
fn matrices_are_the_same_loops_in_binary32() {
    MACHINES.iter().for_each(|machine| judge(machine));
}

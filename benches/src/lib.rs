// SPDX-License-Identifier: MIT OR Apache-2.0
//! Shared code of the benchmarks: measures through criterion and keeps the times, so that a run can end with ratios.
//!
//! Benchmarks run on shared, noisy machines: an absolute time says little, and no test asserts one. Each benchmark prints ratios of fastest
//! samples within one run.

use criterion::{BenchmarkGroup, Criterion, Throughput, measurement::WallTime};
use std::fmt::Write as _;
use std::time::{Duration, Instant};
use takt_isa::{Machine, T3};

/// Group of measurements; records the fastest time of each.
pub struct FastestTimes<'c> {
    group: BenchmarkGroup<'c, WallTime>,
}

impl<'c> FastestTimes<'c> {
    /// Opens a group named `name`.
    pub fn new(criterion: &'c mut Criterion, name: &str) -> FastestTimes<'c> {
        let mut group = criterion.benchmark_group(name);
        group
            .sample_size(10)
            .warm_up_time(Duration::from_millis(500))
            .measurement_time(Duration::from_secs(3));
        FastestTimes { group }
    }

    /// Measures `work` on `elements` elements; returns the seconds of its fastest sample.
    pub fn seconds<T>(&mut self, name: &str, elements: u64, mut work: impl FnMut() -> T) -> f64 {
        let mut fastest = f64::INFINITY;
        self.group.throughput(Throughput::Elements(elements));
        self.group.bench_function(name, |bencher| {
            bencher.iter_custom(|iterations| {
                let start = Instant::now();
                for _ in 0..iterations {
                    std::hint::black_box(work());
                }
                let elapsed = start.elapsed();
                fastest = fastest.min(elapsed.as_secs_f64() / iterations as f64);
                elapsed
            });
        });
        fastest
    }
}

/// t3 with room for a million bundles.
pub static DEEP: Machine = Machine { name: "t3-deep", code_depth: 1 << 21, ..T3 };

/// A source with `lines` lines in a realistic mix: comments, blank lines, labels, bundles, uses of macros, constants.
pub fn source(lines: usize) -> String {
    let mut text = String::from(
        ".const k = 2*pi*80\n.input n:int, x, y\n.output F\n.reg a b c d t\n.macro scale to, by\n fmul to, to, by\n.endm\n\
         .once\n wait period\n.period\nperiod:\n",
    );
    let mut line = text.lines().count();
    let mut label = 0;
    while line + 12 < lines {
        // Each constant occupies a register: limit them to the free registers.
        let constant = label % 64;
        let _ = write!(
            text,
            "; block {label}: a proportional controller\n\n\
             step{label}:\n        fmul    a, x, k\n        fmul    b, y, 0.25e-6         ; m\n\
             \x20       fadd    c, a, b || mov d, x\n        scale   a, 2*k + {constant}\n        fsub    c, c, a\n\
             \x20       sel     d, d, x, y\n        itof    t, n\n        fsqrt   a, x\n        fadd    F, c, t\n"
        );
        label += 1;
        line += 12;
    }
    while line + 1 < lines {
        text.push_str("; rest\n");
        line += 1;
    }
    text.push_str("        wait period\n");
    text
}

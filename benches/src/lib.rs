//! What the benchmarks share: measuring through criterion while keeping the times, so that a run ends with ratios.
//!
//! The machines that this runs on are shared and noisy: a time alone says little, and no test asserts one. Each benchmark
//! prints ratios of things measured in the same run, from the fastest sample of each.

use criterion::{BenchmarkGroup, Criterion, Throughput, measurement::WallTime};
use std::time::{Duration, Instant};

/// A group of measurements that keeps the fastest time of each.
pub struct Measured<'c> {
    group: BenchmarkGroup<'c, WallTime>,
}

impl<'c> Measured<'c> {
    /// A group of this name.
    pub fn new(criterion: &'c mut Criterion, name: &str) -> Measured<'c> {
        let mut group = criterion.benchmark_group(name);
        group
            .sample_size(10)
            .warm_up_time(Duration::from_millis(500))
            .measurement_time(Duration::from_secs(3));
        Measured { group }
    }

    /// Measures `work`, which does `elements` of something; returns the seconds of its fastest sample.
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

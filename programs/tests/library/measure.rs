// SPDX-License-Identifier: MIT OR Apache-2.0
//! Errors in units in the last place, and the operands of their measurement.

use super::batch::{Batch, LANES};
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};
use std::thread;
use takt_emu::Emulator;
use takt_isa::Program;
use takt_isa::fp::Flags;

/// Positive operands at which functions change their algorithm.
const NOTABLE: &[u32] = &[
    0,
    1,
    2,
    0x007f_ffff,
    0x0080_0000,
    0x0080_0001,
    0x3380_0000,
    0x3e80_0000,
    0x3eff_ffff,
    0x3f00_0000,
    0x3f00_0001,
    0x3f7f_ffff,
    0x3f80_0000,
    0x3f80_0001,
    0x3fc0_0000,
    0x4000_0000,
    0x4020_0000,
    0x4040_0000,
    0x4049_0fdb,
    0x42af_0000,
    0x42b1_7217,
    0x42b1_7218,
    0x42b2_0000,
    0x42ce_8ed0,
    0x42cf_f1b5,
    0x42d0_0000,
    0x43c9_0fda,
    0x43c9_0fdb,
    0x4aff_ffff,
    0x4b00_0000,
    0x4b00_0001,
    0x4b7f_ffff,
    0x4b80_0000,
    0x4b80_0001,
    0x4f00_0000,
    0x7f00_0000,
    0x7f7f_ffff,
    0x7f80_0000,
    0x7f80_0001,
    0x7fbf_ffff,
    0x7fc0_0000,
    0x7fff_ffff,
];

/// Notable operands of both signs.
pub(crate) fn notable() -> impl Iterator<Item = u32> + Clone {
    NOTABLE.iter().flat_map(|&x| [x, x | 1 << 31])
}

/// Permits measurements over all operands: `TAKT_FULL=1`.
pub(crate) fn full() -> bool {
    std::env::var_os("TAKT_FULL").is_some_and(|value| value == "1")
}

/// Result of a measurement.
#[derive(Clone, Copy, Default, Debug)]
pub(crate) struct ErrorStatistics {
    pub(crate) operands: u64,
    /// Results other than the nearest binary32.
    missed: u64,
    largest: f64,
    worst: [u32; 2],
}

impl ErrorStatistics {
    /// Records a result other than the nearest.
    pub(crate) fn miss(&mut self, operands: [u32; 2], got: f32, exact: f64) {
        let error = (f64::from(got) - exact).abs() / ulp(exact);
        assert!(error < 16.0, "{operands:08x?} gives {got:e}, not {exact:e}");
        self.missed += 1;
        if error > self.largest {
            (self.largest, self.worst) = (error, operands);
        }
    }

    pub(crate) fn join(self, other: ErrorStatistics) -> ErrorStatistics {
        let worse = if other.largest > self.largest { other } else { self };
        let (operands, missed) = (self.operands + other.operands, self.missed + other.missed);
        ErrorStatistics { operands, missed, ..worse }
    }

    /// Checks the largest error against the documented one: it must not exceed it, and with `tight`, after a run over all operands, must
    /// reach it. Returns the figures of a failure.
    #[must_use]
    pub(crate) fn check(self, name: &str, documented: f64, tight: bool) -> Option<String> {
        let share = 100.0 * self.missed as f64 / self.operands as f64;
        let figures = format!(
            "{name}: {} operands, at most {:.5} ulp at {:08x?}; {share:.3} % not the nearest",
            self.operands, self.largest, self.worst
        );
        println!("{figures}");
        let stale = self.largest > documented || tight && full() && documented - self.largest > 2e-5;
        stale.then(|| format!("{figures}; documented: {documented}"))
    }
}

/// Distance between binary32 numbers at `exact`.
fn ulp(exact: f64) -> f64 {
    let exponent = (exact.abs().to_bits() >> 52) as i64 - 1023;
    2_f64.powi((exponent.max(-126) - 23) as i32)
}

/// Runs the notable operands and every operand, or a sample of one in 4,099 (`TAKT_STRIDE=n`: in n), through a program of one operand.
pub(crate) fn every(
    program: &Program,
    take: impl Fn(&mut ErrorStatistics, u32, u32, Flags) + Sync,
) -> ErrorStatistics {
    let asked = std::env::var("TAKT_STRIDE").ok().map(|text| text.parse().expect("TAKT_STRIDE is a number"));
    let stride = if full() { 1 } else { asked.unwrap_or(4099).max(1_u64) };
    let count = (1_u64 << 32).div_ceil(stride);
    let batch = Batch::new(program);
    let piece = |range: std::ops::Range<u64>| {
        let (mut batch, mut measured) = (batch.clone(), ErrorStatistics::default());
        let mut run = |operands: &[u32; LANES]| {
            let results = *batch.run(std::slice::from_ref(operands));
            for ((&x, result), flags) in operands.iter().zip(results).zip(batch.flags) {
                take(&mut measured, x, result, flags);
            }
        };
        let mut operands = [0; LANES];
        for (x, notable) in operands.iter_mut().zip(notable()) {
            *x = notable;
        }
        run(&operands);
        for first in range.clone().step_by(LANES) {
            let mut index = first;
            let last = range.end - 1;
            run(&operands.map(|_| {
                let x = (index.min(last) * stride) as u32;
                index += 1;
                x
            }));
        }
        measured
    };
    parallel(count, piece).into_iter().fold(ErrorStatistics::default(), ErrorStatistics::join)
}

/// Splits `0..count` into one range per core, runs `work` on each, and returns the results.
pub(crate) fn parallel<T: Send>(count: u64, work: impl Fn(std::ops::Range<u64>) -> T + Sync) -> Vec<T> {
    let pieces = thread::available_parallelism().map_or(1, |n| n.get() as u64);
    thread::scope(|scope| {
        let spawn = |piece| {
            let range = count * piece / pieces..count * (piece + 1) / pieces;
            let work = &work;
            scope.spawn(move || work(range))
        };
        let handles: Vec<_> = (0..pieces).map(spawn).collect();
        let join = |handle: thread::ScopedJoinHandle<'_, T>| {
            handle.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        };
        handles.into_iter().map(join).collect()
    })
}

/// Columns give the emulator's results, flags included, over the notable operands and 2,000 random ones.
pub(crate) fn check_emulator(program: &Program, operands: usize) {
    assert_eq!(program.inputs.len(), operands);
    let mut batch = Batch::new(program);
    let mut emulator = Emulator::new(program).expect("it fits");
    let mut random = SplitMix64::seed_from_u64(1);
    let some: Vec<u32> = notable().chain((0..2000).map(|_| random.next_u64() as u32)).collect();
    let mut partner = SplitMix64::seed_from_u64(2);
    for chunk in some.chunks_exact(LANES) {
        let mut columns = vec![[0; LANES]; operands];
        columns[0].copy_from_slice(chunk);
        for column in &mut columns[1..] {
            let known: Vec<u32> = notable().collect();
            *column = column.map(|_| match partner.next_u64() {
                bits if bits & 1 == 0 => known[(bits >> 8) as usize % known.len()],
                bits => (bits >> 32) as u32,
            });
        }
        let results = *batch.run(&columns);
        for lane in 0..LANES {
            for (port, column) in program.inputs.iter().zip(&columns) {
                emulator.set_input_bits(port.register, column[lane]).expect("it is an input");
            }
            emulator.run_period(&[]).expect("it cannot fault");
            let result = emulator.register(program.outputs[0].register);
            let found = (result, emulator.flags());
            let operands: Vec<u32> = columns.iter().map(|column| column[lane]).collect();
            assert_eq!(found, (Some(results[lane]), batch.flags[lane]), "of {operands:08x?}");
        }
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! The emulator beside the same algorithm compiled natively.

use crate::tracking::{PERIODS, recorded, tracking};
use crate::{Outcome, ROUNDS, Ratios, fastest};
use std::fmt::Write as _;
use std::hint::black_box;
use takt_emu::{Batch, Emulator};
use takt_programs::hybrid::Controller;

/// Samples of each side in a round.
const SAMPLES: usize = 40;
/// Periods of a sample: few, so that some sample is not interrupted.
const STRETCH: usize = 100;

pub(crate) fn measure(text: &mut String) -> Outcome<()> {
    let inputs = recorded()?;
    let (program, registers) = tracking()?;
    // Every lane somewhere else on the path.
    let lanes = Batch::WIDTH;
    let rows: Vec<Vec<Vec<u32>>> = (0..PERIODS)
        .map(|period| {
            let words: Vec<_> =
                (0..lanes).map(|lane| inputs[(period + 97 * lane) % PERIODS].to_words()).collect();
            (0..registers.len()).map(|port| words.iter().map(|words| words[port]).collect()).collect()
        })
        .collect();
    let mut controller = Controller::<f32>::new();
    let [mut single, mut interpreted] = [Emulator::new(&program)?, Emulator::new(&program)?];
    // The compiler's own time is not measured.
    single.set_compile_after(Some(1));
    interpreted.set_compile_after(None);
    let mut batch = Batch::new(&program, lanes)?;
    let [mut singles, mut interpreted_singles, mut batches, mut per_operation] =
        [(); 4].map(|()| Ratios::default());
    let mut operations = 0;
    for _ in 0..ROUNDS {
        let stretch = |sample: usize| {
            let first = sample * STRETCH % PERIODS;
            first..first + STRETCH
        };
        let native = fastest(SAMPLES, |sample| {
            for inputs in &inputs[stretch(sample)] {
                // All outputs are wanted, or the compiler leaves out what computes the others.
                black_box(controller.step(inputs.counts, &inputs.reference));
            }
        });
        let run = |emulator: &mut Emulator| {
            fastest(SAMPLES, |sample| {
                for inputs in &inputs[stretch(sample)] {
                    for (register, bits) in registers.iter().zip(inputs.to_words()) {
                        emulator.set_input_bits(*register, bits).expect("it is an input");
                    }
                    emulator.run_period(&[]).expect("it has no fault");
                }
            })
        };
        let before = single.statistics().total_operations();
        let emulated = run(&mut single);
        operations = (single.statistics().total_operations() - before) / (SAMPLES * STRETCH) as u64;
        let batched = fastest(SAMPLES, |sample| {
            for row in &rows[stretch(sample)] {
                for (register, words) in registers.iter().zip(row) {
                    batch.set_input_bits(*register, words).expect("it is an input");
                }
                batch.run_period();
            }
        }) / lanes as f64;
        singles.0.push(emulated / native);
        interpreted_singles.0.push(run(&mut interpreted) / native);
        batches.0.push(batched / native);
        per_operation.0.push(operations as f64 * STRETCH as f64 / batched / 1e9);
    }
    let apart = batch.periods_apart();
    let how = match Emulator::compiles() {
        true => {
            "One run is compiled to the host's instructions (feature `jit`) once its blocks have run often."
        }
        false => "One run is interpreted in both rows: this build has no compiler (feature `jit`).",
    };
    writeln!(
        text,
        "## Emulator\n\n\
         The hybrid robot's tracking program (`programs/hybrid/tracking.s`, {operations} operations a period on t3), beside the \
         same algorithm in Rust's binary32, compiled natively: time for a period of one robot, on one core, the inputs set \
         each time.\n\n\
         | | times native | rounds |\n|---|---|---|\n| one run | {} |\n| one run, interpreted | {} |\n\
         | in a batch of {lanes}, per robot | {} |\n\n{how}\n\n\
         In the batch a core executed {} thousand million operations a second (median, range of the rounds); {apart} \
         periods of a lane ran apart.\n",
        singles.text(),
        interpreted_singles.text(),
        batches.text(),
        per_operation.text().replace(" | ", ", "),
    )?;
    Ok(())
}

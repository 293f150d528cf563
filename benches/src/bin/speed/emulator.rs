// SPDX-License-Identifier: MIT OR Apache-2.0
//! Speed of the emulator compared with the same algorithm as native code.

use crate::other_build::OtherBuild;
use crate::tracking::{PERIODS, recorded, tracking};
use crate::{Outcome, ROUNDS, Ratios, fastest};
use std::fmt::Write as _;
use std::hint::black_box;
use takt_emu::{Batch, Emulator};
use takt_programs::hybrid::Controller;

/// Samples of each side in a round.
const SAMPLES: usize = 40;
/// Periods in a sample: few, so that some samples are free of interruptions.
const STRETCH: usize = 100;

/// Measures the emulator, alternating with another build if given.
pub(crate) fn measure(text: &mut String, mut other: Option<&mut OtherBuild>) -> Outcome<()> {
    let inputs = recorded()?;
    let (program, registers) = tracking()?;
    // Lanes start at different points of the path.
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
    // Compile in advance: compilation time is not measured.
    single.set_compile_after(Some(1));
    interpreted.set_compile_after(None);
    let mut batch = Batch::new(&program, lanes)?;
    let per_robot = format!("in a batch of {lanes}, per robot");
    let names = ["one run", "one run, interpreted", &per_robot];
    let mut all = names.map(|_| Ratios::default());
    let mut per_operation = Ratios::default();
    let mut operations = 0;
    for _ in 0..ROUNDS {
        let stretch = |sample: usize| {
            let first = sample * STRETCH % PERIODS;
            first..first + STRETCH
        };
        let native = fastest(SAMPLES, |sample| {
            for inputs in &inputs[stretch(sample)] {
                // Use all outputs; otherwise the compiler removes their computation.
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
        let ratios = [emulated, run(&mut interpreted), batched].map(|seconds| seconds / native);
        all.iter_mut().zip(ratios).for_each(|(all, ratio)| all.0.push(ratio));
        if let Some(other) = &mut other {
            let ours: Vec<(&str, f64)> = names.into_iter().zip(ratios).collect();
            other.round(&ours)?;
        }
        per_operation.0.push(operations as f64 * STRETCH as f64 / batched / 1e9);
    }
    let head = match other {
        Some(_) => "| | times native | rounds | times the last release | rounds |\n|---|---|---|---|---|",
        None => "| | times native | rounds |\n|---|---|---|",
    };
    let row = |(name, ratios): (&str, &Ratios)| match &other {
        Some(other) => format!("| {name} | {} | {} |\n", ratios.text(), other.text(name)),
        None => format!("| {name} | {} |\n", ratios.text()),
    };
    let table: String = names.into_iter().zip(&all).map(row).collect();
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
         {head}\n{table}\n{how}\n\n\
         In the batch a core executed {} thousand million operations a second (median, range of the rounds); {apart} \
         periods of a lane ran apart.\n",
        per_operation.text().replace(" | ", ", "),
    )?;
    Ok(())
}

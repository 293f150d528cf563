// SPDX-License-Identifier: MIT OR Apache-2.0
//! Random points of the workspace: all twenty outputs against binary64.

use super::inputs::{Random, pair};
use super::measure::{Comparison, Figures, bounds};
use super::processor::{PROGRAMS, Processor, full};
use takt_isa::{MACHINES, T3};

/// Errors of a program at random points. Each point starts from reset: a first period supplies the previous counts, and a second is
/// measured.
pub(crate) fn measure(path: &str, processor: &Processor, points: u64, seed: u64) -> Figures {
    let mut random = Random::new(seed);
    let mut comparison = Comparison::new(path);
    for _ in 0..points {
        let mut processor = processor.clone();
        comparison.restart();
        for inputs in pair(&mut random) {
            let words = processor.period(&inputs.to_words()).expect("no input makes the program fault");
            comparison.add(&inputs, words, None);
        }
    }
    comparison.figures
}

#[test]
fn outputs_are_right_anywhere_in_the_workspace() {
    for path in PROGRAMS {
        for &machine in MACHINES {
            // Fewer points suffice for the other machines, which compute the same bits as t3 (`agreement`).
            let many = if full() { 100_000 } else { 5_000 };
            let points = if *machine == T3 { many } else { many / 10 };
            let figures = measure(path, &Processor::shipped(path, machine), points, 2026);
            if let Err(wrong) = figures.within(&bounds(path)) {
                panic!("{path} on {}, point = period / 2:\n{wrong}", machine.name);
            }
        }
    }
}

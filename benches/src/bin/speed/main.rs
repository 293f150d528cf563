// SPDX-License-Identifier: MIT OR Apache-2.0
//! Speed of the tools beside things that a reader has: ratios measured in one run, as a Markdown document on standard
//! output. `cargo xtask speed` runs it.
//!
//! The things compared take turns, round after round, so that another load on the machine, or its clock, weighs on both sides.
//! Each round gives a ratio of the fastest samples; shown are the median round and the range of all.
#![allow(clippy::print_stdout, clippy::print_stderr)]

mod assembler;
mod circuit;
mod emulator;
mod tracking;

use std::time::Instant;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// Rounds of each comparison.
const ROUNDS: usize = 5;

/// The fastest of some samples of `work`, in seconds; `work` is given the number of the sample.
fn fastest(samples: usize, mut work: impl FnMut(usize)) -> f64 {
    let mut fastest = f64::INFINITY;
    for sample in 0..samples {
        let start = Instant::now();
        work(sample);
        fastest = fastest.min(start.elapsed().as_secs_f64());
    }
    fastest
}

/// Ratios of rounds.
#[derive(Default)]
struct Ratios(Vec<f64>);

impl Ratios {
    fn text(&self) -> String {
        let mut sorted = self.0.clone();
        sorted.sort_by(f64::total_cmp);
        let digits = |value: f64| if value < 10.0 { format!("{value:.2}") } else { format!("{value:.1}") };
        match sorted[..] {
            [] => "-".to_owned(),
            [least, .., most] => {
                format!("{} | {} to {}", digits(sorted[sorted.len() / 2]), digits(least), digits(most))
            }
            [only] => format!("{} | one round", digits(only)),
        }
    }
}

fn main() -> Outcome<()> {
    // Of the parts only these; all, if none is named.
    let wanted: Vec<String> = std::env::args().skip(1).collect();
    if let [command, file, image] = &wanted[..]
        && command == assembler::ALONE
    {
        return assembler::assemble(file.as_ref(), image.as_ref());
    }
    let mut text = format!(
        "# How fast the tools are\n\n\
         Written by `cargo xtask speed`. Absolute speeds depend on the machine, so each figure is a ratio to something that a \
         reader has, measured in the same run: both sides take turns for {ROUNDS} rounds, a round's ratio is that of the \
         fastest samples, and the table has the median round and the range of all. Larger is slower for times, faster for \
         lines a second.\n\n"
    );
    for (name, measure) in [
        ("emulator", emulator::measure as fn(&mut String) -> Outcome<()>),
        ("assembler", assembler::measure),
        ("lockstep", circuit::measure),
    ] {
        if wanted.is_empty() || wanted.iter().any(|wanted| wanted == name) {
            eprintln!("measuring: {name}");
            measure(&mut text)?;
        }
    }
    print!("{text}");
    Ok(())
}

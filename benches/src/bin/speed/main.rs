// SPDX-License-Identifier: MIT OR Apache-2.0
//! Speed of the tools relative to reference programs: ratios measured in one run, as a Markdown document on standard output. `cargo
//! evidence speed` runs it.
//!
//! The sides of a comparison take turns, round after round, so that other load on the machine, or a change of its clock, affects both. Each
//! round yields a ratio of the fastest samples; the document shows the median round and the range.
#![allow(clippy::print_stdout, clippy::print_stderr)]

mod assembler;
mod circuit;
mod emulator;
mod other_build;
mod tracking;

use std::time::Instant;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;
/// A measurement; appends its part of the document.
type Measurement<'a> = &'a mut dyn FnMut(&mut String) -> Outcome<()>;

/// Rounds of each comparison.
const ROUNDS: usize = 5;

/// Fastest of `samples` runs of `work`, in seconds; `work` receives the sample number.
fn fastest(samples: usize, mut work: impl FnMut(usize)) -> f64 {
    let mut fastest = f64::INFINITY;
    for sample in 0..samples {
        let start = Instant::now();
        work(sample);
        fastest = fastest.min(start.elapsed().as_secs_f64());
    }
    fastest
}

/// Ratios of a comparison, one per round.
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
    // Parts to measure; all if none is named.
    let mut wanted: Vec<String> = std::env::args().skip(1).collect();
    if let [command, file, image] = &wanted[..]
        && command == assembler::ALONE
    {
        return assembler::assemble(file.as_ref(), image.as_ref());
    }
    let mut other = None;
    if let Some(at) = wanted.iter().position(|argument| argument == other_build::AGAINST) {
        let program =
            wanted.get(at + 1).ok_or("--against needs the path of another build of this program")?;
        other = Some(other_build::OtherBuild::new(program.as_ref()));
        wanted.drain(at..at + 2);
    }
    let mut text = format!(
        "# How fast the tools are\n\n\
         <!-- Written by `cargo evidence speed`. -->\n\n\
         Absolute speeds depend on the machine, so each figure is a ratio to something that a \
         reader has, measured in the same run: both sides take turns for {ROUNDS} rounds, a round's ratio is that of the \
         fastest samples, and the table has the median round and the range of all. Larger is slower for times, faster for \
         lines a second.\n\n"
    );
    let parts: [(&str, Measurement<'_>); 3] = [
        ("emulator", &mut |text| emulator::measure(text, other.as_mut())),
        ("assembler", &mut assembler::measure),
        ("lockstep", &mut circuit::measure),
    ];
    for (name, measure) in parts {
        if wanted.is_empty() || wanted.iter().any(|wanted| wanted == name) {
            eprintln!("measuring: {name}");
            measure(&mut text)?;
        }
    }
    print!("{text}");
    Ok(())
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Images of random programs are verified against their sources, after a round trip through their bytes.

#![allow(clippy::print_stdout)]

use crate::common::{build, check, text as words};
use crate::random_source::full_language::whole_source;
use crate::random_source::{source, source_with_loops};
use std::ops::Range;
use takt_asm::{Contract, MemoryLoader, Options, Schedule, image};
use takt_isa::{F1, F3, T1, T3, T4};
use takt_verify::MAX_STEPS;

/// Least ratio of the checker's limit to the steps for an honest image.
pub(crate) const MARGIN: u64 = 2;

/// Number in an environment variable.
pub(crate) fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok().map(|text| text.parse().unwrap_or_else(|_| panic!("{name}={text} is no number")))
}

/// Seeds of random programs: `TAKT_PROGRAMS` of them (by default 300), from `TAKT_SEED` (by default 0) on.
fn seeds() -> Range<u64> {
    let first = number("TAKT_SEED").unwrap_or(0);
    first..first + number("TAKT_PROGRAMS").unwrap_or(300)
}

/// Random source of a seed.
pub(crate) fn text(seed: u64) -> String {
    match seed % 4 {
        0 => source(seed),
        1 => source_with_loops(seed),
        _ => whole_source(seed),
    }
}

#[test]
fn random_programs() {
    let (mut checked, mut cuts, mut fused, mut wrong) = (0, 0, 0, Vec::new());
    let (mut most_steps, mut most_of) = (0, 0);
    let seeds = seeds();
    let programs = seeds.end - seeds.start;
    for seed in seeds {
        let machine = [&T3, &T1, &T4, &F3, &F1][seed as usize % 5];
        let (schedule, contract) = match seed / 5 % 3 {
            0 => (Schedule::All, Contract::All),
            1 => (Schedule::AsWritten, Contract::AsWritten),
            _ => (Schedule::None, Contract::All),
        };
        // The exact search takes long, so only some programs get it, and few of them all of it.
        let effort = if seed % 70 == 0 { 20 } else { u32::from(seed % 7 == 0) };
        let options = Options { machine, schedule, contract, effort, ..Options::default() };
        let loader = MemoryLoader::of("random.s", text(seed));
        let Some((assembled, plain)) = build("random.s", &loader, &options) else { continue };
        checked += 1;
        let debug = assembled.debug_info();
        let bytes = image::write_with(&assembled.program, Some(&debug))
            .unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        let (read, info) = image::read_with(&bytes).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        assert!(read == assembled.program && info == Some(debug), "seed {seed}: read back as another");
        match check(&assembled, &plain) {
            Ok(established) => {
                cuts += established.cuts;
                fused += established.fused.len();
                if established.steps > most_steps {
                    (most_steps, most_of) = (established.steps, seed);
                }
            }
            Err(difference) => {
                wrong.push(format!("seed {seed} on {}: {}", machine.name, words(&plain, &difference)));
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "{} of {checked} refused:\n{}",
        wrong.len(),
        wrong[..wrong.len().min(20)].join("\n")
    );
    println!(
        "figures: programs={checked} cuts={cuts} fused={fused} without_an_image={} most_steps@{most_of}={most_steps}",
        programs - checked
    );
    assert!(most_steps < MAX_STEPS / MARGIN, "seed {most_of} takes {most_steps} of {MAX_STEPS} steps");
    assert!(checked > programs / 2 && cuts > 2 * checked as usize && fused > 0, "{checked} {cuts} {fused}");
}

/// Prints the random source of `TAKT_SEED`.
#[test]
#[ignore = "it prints"]
fn one_source() {
    println!("{}", text(number("TAKT_SEED").unwrap_or(0)));
}

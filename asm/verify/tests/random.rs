// SPDX-License-Identifier: MIT OR Apache-2.0
//! The image of every random program is its source.

#![allow(clippy::print_stdout)]

use crate::common::{build, check, text};
use crate::random_source::{source, source_with_loops};
use std::ops::Range;
use takt_asm::{Contract, MemoryLoader, Options, Schedule};
use takt_isa::{F1, F3, T1, T3, T4};

/// A number that the environment gives.
pub(crate) fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok().map(|text| text.parse().unwrap_or_else(|_| panic!("{name}={text} is no number")))
}

/// The seeds of random programs: `TAKT_PROGRAMS` of them, or else a few, from `TAKT_SEED` on, or else 0.
fn seeds() -> Range<u64> {
    let first = number("TAKT_SEED").unwrap_or(0);
    first..first + number("TAKT_PROGRAMS").unwrap_or(300)
}

#[test]
fn random_programs() {
    let (mut checked, mut cuts, mut fused) = (0, 0, 0);
    let seeds = seeds();
    let programs = seeds.end - seeds.start;
    for seed in seeds {
        let machine = [&T3, &T1, &T4, &F3, &F1][seed as usize % 5];
        let (schedule, contract) = match seed / 5 % 3 {
            0 => (Schedule::All, Contract::All),
            1 => (Schedule::AsWritten, Contract::AsWritten),
            _ => (Schedule::None, Contract::All),
        };
        let options = Options { machine, schedule, contract, effort: 0, ..Options::default() };
        let loader =
            MemoryLoader::of("random.s", if seed % 2 == 0 { source(seed) } else { source_with_loops(seed) });
        let Some((assembled, plain)) = build("random.s", &loader, &options) else { continue };
        checked += 1;
        match check(&assembled, &plain) {
            Ok(established) => {
                cuts += established.cuts;
                fused += established.fused.len();
            }
            Err(difference) => {
                panic!("seed {seed} on {}: {}", machine.name, text(&plain, &difference));
            }
        }
    }
    println!("figures: programs={checked} cuts={cuts} fused={fused} without_an_image={}", programs - checked);
    assert!(checked > programs / 2 && cuts > 2 * checked as usize && fused > 0, "{checked} {cuts} {fused}");
}

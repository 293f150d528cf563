// SPDX-License-Identifier: MIT OR Apache-2.0
//! Table of campaigns: contents of a unit, program to run, and arguments.

use crate::campaign::figures::{Figures, of_output};
use crate::campaign::outputs;
use crate::campaign::plan::Plan;
use anyhow::{Context, Result};
use std::fmt::Write as _;
use std::time::Duration;

/// Parts of the project that `cargo evidence mutants` mutates.
pub(super) const PARTS: [&str; 8] =
    ["units", "core", "board", "timing", "scheduler", "bounds", "accuracy", "emulator"];
/// Names of the fuzz targets in `asm/fuzz`.
pub(super) const TARGETS: [&str; 2] = ["assemble", "image"];

/// Program that a unit runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Runs {
    /// A test of a crate: package, name, and the environment variable for the number of cases; `TAKT_SEED` selects the first case.
    Test(&'static str, &'static str, &'static str),
    /// libFuzzer on a fuzz target.
    Fuzz,
    /// Simulated robots, through `takt track --monte-carlo`.
    Robots,
    /// Place and route with a single seed.
    Seed,
    /// Mutants of a part, through `cargo evidence mutants --part`.
    Mutants,
}

/// A campaign: a row of the table.
#[derive(Debug)]
pub(super) struct Campaign {
    pub(super) name: &'static str,
    /// One-line description.
    pub(super) text: &'static str,
    /// Plural noun for the contents of a unit, such as programs; `size` counts them.
    pub(super) unit: &'static str,
    pub(super) size: u64,
    pub(super) size_is_free: bool,
    /// Default number of units.
    pub(super) units: u64,
    /// Upper bound of a unit's run time in minutes, at this size: a batch job with less time left does not start the unit.
    pub(super) minutes: u32,
    /// Total number of cases, if finite.
    pub(super) most: Option<u64>,
    /// The first unit compiles files that all others use.
    pub(super) compiles: bool,
    pub(super) runs: Runs,
}

impl Campaign {
    const fn of(
        name: &'static str,
        text: &'static str,
        unit: &'static str,
        size: u64,
        units: u64,
        minutes: u32,
        runs: Runs,
    ) -> Campaign {
        Campaign {
            name,
            text,
            unit,
            size,
            size_is_free: true,
            units,
            minutes,
            most: None,
            compiles: false,
            runs,
        }
    }
}

/// Table of all campaigns.
pub(super) const CAMPAIGNS: &[Campaign] = &[
    Campaign {
        compiles: true,
        ..Campaign::of(
            "lockstep",
            "the circuit of every machine against the emulator, on random programs",
            "programs a machine",
            500,
            200,
            2,
            Runs::Test("takt-cosim", "lockstep::random_programs", "TAKT_PROGRAMS"),
        )
    },
    Campaign {
        compiles: true,
        ..Campaign::of(
            "lockstep-latched",
            "the same with latched ports, half as many programs",
            "programs a machine, halved",
            500,
            200,
            2,
            Runs::Test("takt-cosim", "lockstep::random_programs_with_latched_ports", "TAKT_PROGRAMS"),
        )
    },
    Campaign {
        compiles: true,
        ..Campaign::of(
            "flips",
            "every flip-flop and a sample of memory bits of two t1 side by side flipped: the comparison tells of the harmful ones",
            "flips in each of three programs",
            2000,
            60,
            3,
            Runs::Test("takt-cosim", "flips::harmful_flips_are_told", "TAKT_FLIPS"),
        )
    },
    Campaign {
        compiles: true,
        ..Campaign::of(
            "words",
            "one and two bits of random words in memories with error correction flipped: they are corrected, or told before a pin is wrong",
            "words in each of three programs, with one wrong bit and with two",
            500,
            8,
            5,
            Runs::Test("takt-cosim", "flips::wrong_words_are_corrected_or_told", "TAKT_FLIPS"),
        )
    },
    Campaign::of(
        "enclosures",
        "the statements of `takt accuracy` against runs that look for a contradiction",
        "programs",
        5000,
        20,
        3,
        Runs::Test("takt-analysis", "enclosures::no_run_contradicts_an_enclosure", "TAKT_PROGRAMS"),
    ),
    Campaign::of(
        "interpret",
        "random programs on the emulator against the interpreter of the language",
        "programs",
        5000,
        20,
        1,
        Runs::Test("takt-interpret", "random::interpreter_agrees_with_the_emulator", "TAKT_PROGRAMS"),
    ),
    Campaign::of(
        "verify",
        "`takt verify` accepts the image of every random program, read back from its bytes",
        "programs",
        5000,
        20,
        2,
        Runs::Test("takt-verify", "random::random_programs", "TAKT_PROGRAMS"),
    ),
    Campaign::of(
        "bounds",
        "`takt verify` proves the bounds of every random program, and runs keep to them",
        "programs",
        5000,
        20,
        1,
        Runs::Test(
            "takt-verify",
            "bounds::random_programs_have_their_bounds_proved_and_keep_to_them",
            "TAKT_PROGRAMS",
        ),
    ),
    Campaign::of(
        "images",
        "`takt verify` refuses every changed image that does something else on the emulator",
        "mutants",
        2000,
        10,
        1,
        Runs::Test("takt-verify", "mutants::rejects_every_different_mutant", "TAKT_MUTANTS"),
    ),
    Campaign::of(
        "fields",
        "`takt verify` refuses by name every image with a changed field besides its code",
        "mutants",
        10_000,
        10,
        1,
        Runs::Test("takt-verify", "fields::every_changed_field_is_refused_by_name", "TAKT_MUTANTS"),
    ),
    Campaign::of(
        "c",
        "random programs in C, by `takt cc` and the emulator, against gcc",
        "programs",
        5000,
        20,
        10,
        Runs::Test("takt-front", "c99_random::programs_compute_what_gcc_does", "TAKT_PROGRAMS"),
    ),
    Campaign::of(
        "fuzz",
        "assembler and image loader on what libFuzzer makes of the sources and images that there are",
        "inputs, of one target and the other",
        50_000,
        200,
        6,
        Runs::Fuzz,
    ),
    Campaign::of(
        "robots",
        "robots with drawn parameters under the tracking program, `takt track --monte-carlo`",
        "robots",
        96,
        1042,
        1,
        Runs::Robots,
    ),
    Campaign {
        size_is_free: false,
        compiles: true,
        ..Campaign::of(
            "seeds",
            "place and route of a machine with several seeds",
            "seed",
            1,
            20,
            15,
            Runs::Seed,
        )
    },
    Campaign {
        size_is_free: false,
        most: Some(PARTS.len() as u64),
        ..Campaign::of(
            "mutants",
            "tests find the mutants of circuit and sources, `cargo evidence mutants`, one part at a time",
            "part",
            1,
            PARTS.len() as u64,
            60,
            Runs::Mutants,
        )
    },
];

/// Campaign with this name.
pub(super) fn named(name: &str) -> Result<&'static Campaign> {
    let names = || CAMPAIGNS.iter().map(|campaign| campaign.name).collect::<Vec<_>>().join(", ");
    CAMPAIGNS
        .iter()
        .find(|campaign| campaign.name == name)
        .with_context(|| format!("there is no campaign `{name}`; there are {}", names()))
}

/// Text listing all campaigns.
pub(super) fn listed() -> String {
    let mut text = String::new();
    for Campaign { name, text: what, unit, size, units, minutes, .. } in CAMPAIGNS {
        let _ = writeln!(
            text,
            "{name:<17} {what}\n{:17} {units} units of {size} {unit}; 1 CPU, {minutes} min or less",
            ""
        );
    }
    text + "\n`cargo evidence campaign NAME` runs the units, `--units K..L` some of them; docs/campaigns.md tells more\n"
}

/// A call of a program, with arguments and environment variables.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Call {
    pub(super) program: String,
    pub(super) arguments: Vec<String>,
    pub(super) variables: Vec<(&'static str, String)>,
}

impl Campaign {
    /// Programs that the units run, by name.
    pub(super) fn programs(&self) -> Vec<&'static str> {
        match self.runs {
            Runs::Test(package, ..) => vec![package],
            Runs::Fuzz => TARGETS.to_vec(),
            Runs::Robots => vec!["takt"],
            Runs::Seed | Runs::Mutants => Vec::new(),
        }
    }

    /// Limit on concurrent units: mutants share one record file, and each part uses every core.
    pub(super) fn jobs(&self) -> Option<usize> {
        (self.runs == Runs::Mutants).then_some(1)
    }

    /// Upper bound of the run time of a unit of another size.
    pub(super) fn time(&self, size: u64) -> Duration {
        Duration::from_secs((u64::from(self.minutes) * 60).saturating_mul(size).div_ceil(self.size))
    }

    /// Call that runs a unit.
    pub(super) fn call(&self, plan: &Plan, unit: u64) -> Result<Call> {
        let (size, first) = (plan.size, unit * plan.size);
        let texts = |arguments: &[&str]| arguments.iter().map(|&text| text.to_owned()).collect::<Vec<_>>();
        let mut call = match self.runs {
            Runs::Test(package, test, count) => Call {
                program: package.to_owned(),
                arguments: texts(&["--exact", "--nocapture", test]),
                variables: vec![(count, size.to_string()), ("TAKT_SEED", first.to_string())],
            },
            Runs::Fuzz => {
                let target = TARGETS[(unit % 2) as usize];
                let folder = plan.scratch(unit);
                std::fs::create_dir_all(&folder)?;
                let folder = folder.display();
                Call {
                    program: target.to_owned(),
                    arguments: vec![
                        // libFuzzer writes new inputs to the first folder.
                        folder.to_string(),
                        plan.corpus(target).display().to_string(),
                        format!("-artifact_prefix={folder}/"),
                        format!("-runs={size}"),
                        // libFuzzer replaces seed 0 by the time of day.
                        format!("-seed={}", unit + 1),
                        "-max_len=65536".to_owned(),
                        "-rss_limit_mb=4096".to_owned(),
                        "-timeout=60".to_owned(),
                    ],
                    variables: Vec::new(),
                }
            }
            Runs::Robots => Call {
                program: "takt".to_owned(),
                arguments: texts(&["track", "--quiet", "--json", "--monte-carlo", &size.to_string()])
                    .into_iter()
                    .chain(["--seed".to_owned(), (first + 1).to_string()])
                    .collect(),
                variables: Vec::new(),
            },
            Runs::Seed => Call {
                program: "xtask".to_owned(),
                arguments: texts(&["synth", "--seed", &(unit + 1).to_string()]),
                variables: Vec::new(),
            },
            Runs::Mutants => {
                let part = PARTS.get(unit as usize).context("there are no more parts")?;
                Call {
                    program: "xtask".to_owned(),
                    arguments: texts(&["mutants", "--part", part]),
                    variables: Vec::new(),
                }
            }
        };
        call.arguments.extend(plan.rest.iter().cloned());
        Ok(call)
    }

    /// Parses the figures in the output of a unit's program.
    pub(super) fn figures(&self, unit: u64, output: &str) -> Result<Figures> {
        match self.runs {
            Runs::Test(..) => of_output(output).context("the test printed no line `figures: …`"),
            Runs::Fuzz => outputs::fuzzed(TARGETS[(unit % 2) as usize], output),
            Runs::Robots => outputs::robots(output),
            Runs::Mutants => outputs::mutants(PARTS[unit as usize], output),
            Runs::Seed => of_output(output).context("nothing was placed and routed"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_automation::command::root;

    /// The tests named in the table exist, and read the environment variables that select their share.
    #[test]
    fn campaigns_name_existing_tests() {
        let read = |path: &str| {
            std::fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
        };
        let document = read("docs/campaigns.md");
        for campaign in CAMPAIGNS {
            assert!(
                document.contains(&format!("`{}`", campaign.name)),
                "docs/campaigns.md does not tell of {}",
                campaign.name
            );
            let Runs::Test(package, test, count) = campaign.runs else { continue };
            let (module, name) = test.split_once("::").expect("a module and a test");
            let folder = ["rtl/cosim", "emu/analysis", "asm/interpret", "asm/verify", "asm/front"];
            let folder = folder
                .iter()
                .find(|folder| read(&format!("{folder}/Cargo.toml")).contains(&format!("\"{package}\"")));
            let folder = folder.unwrap_or_else(|| panic!("no folder of {package}"));
            let source = read(&format!("{folder}/tests/{module}.rs"));
            for part in [&format!("fn {name}()"), count, "TAKT_SEED", "figures: "] {
                assert!(source.contains(part), "{folder}/tests/{module}.rs has no `{part}`");
            }
        }
        for target in TARGETS {
            assert!(root().join(format!("asm/fuzz/fuzz_targets/{target}.rs")).is_file());
        }
    }

    #[test]
    fn reports_unknown_names() {
        let error = named("lokstep").expect_err("there is none").to_string();
        assert!(error.starts_with("there is no campaign `lokstep`; there are lockstep, "), "{error}");
        assert!(crate::campaign::units("7..3").is_err() && crate::campaign::units("a").is_err());
        assert_eq!((crate::campaign::units("3..7"), crate::campaign::units("4")), (Ok(3..7), Ok(0..4)));
    }
}

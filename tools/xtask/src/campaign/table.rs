// SPDX-License-Identifier: MIT OR Apache-2.0
//! The campaigns: what a unit is, which program runs it, with which arguments.

use crate::campaign::figures::{Figures, of_output};
use crate::campaign::outputs;
use crate::campaign::plan::Plan;
use anyhow::{Context, Result};
use std::fmt::Write as _;

/// The parts of which `cargo xtask mutants` makes mutants.
pub(super) const PARTS: [&str; 8] =
    ["units", "core", "board", "timing", "scheduler", "bounds", "accuracy", "emulator"];
/// The fuzz targets of `asm/fuzz`.
pub(super) const TARGETS: [&str; 2] = ["assemble", "image"];

/// The program that a unit runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Runs {
    /// A test of a crate: package, name, and the variable with the number of cases; `TAKT_SEED` has the first.
    Test(&'static str, &'static str, &'static str),
    /// libFuzzer on a target.
    Fuzz,
    /// `takt track --monte-carlo`.
    Robots,
    /// Place and route with one seed.
    Seed,
    /// The mutants of a part, `cargo xtask mutants --part`.
    Mutants,
}

/// A campaign.
#[derive(Debug)]
pub(super) struct Campaign {
    pub(super) name: &'static str,
    /// The comparison, in a line.
    pub(super) text: &'static str,
    /// The things of which a unit has `size`.
    pub(super) unit: &'static str,
    pub(super) size: u64,
    pub(super) size_is_free: bool,
    /// Units unless stated.
    pub(super) units: u64,
    /// Things that there are, if that is a number.
    pub(super) most: Option<u64>,
    /// True if the first unit compiles something that all use.
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
        runs: Runs,
    ) -> Campaign {
        Campaign { name, text, unit, size, size_is_free: true, units, most: None, compiles: false, runs }
    }
}

/// All campaigns.
pub(super) const CAMPAIGNS: &[Campaign] = &[
    Campaign {
        compiles: true,
        ..Campaign::of(
            "lockstep",
            "the circuit of every machine against the emulator, on random programs",
            "programs a machine",
            500,
            200,
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
            Runs::Test("takt-cosim", "lockstep::random_programs_with_latched_ports", "TAKT_PROGRAMS"),
        )
    },
    Campaign::of(
        "enclosures",
        "the statements of `takt accuracy` against runs that look for a contradiction",
        "programs",
        5000,
        20,
        Runs::Test("takt-analysis", "enclosures::no_run_contradicts_an_enclosure", "TAKT_PROGRAMS"),
    ),
    Campaign::of(
        "verify",
        "`takt verify` accepts the image of every random program",
        "programs",
        5000,
        20,
        Runs::Test("takt-verify", "random::random_programs", "TAKT_PROGRAMS"),
    ),
    Campaign::of(
        "images",
        "`takt verify` refuses every changed image that does something else on the emulator",
        "mutants",
        2000,
        10,
        Runs::Test("takt-verify", "mutants::every_mutant_that_differs_is_refused", "TAKT_MUTANTS"),
    ),
    Campaign::of(
        "fuzz",
        "assembler and image loader on what libFuzzer makes of the sources and images that there are",
        "inputs, of one target and the other",
        50_000,
        200,
        Runs::Fuzz,
    ),
    Campaign::of(
        "robots",
        "robots with drawn parameters under the tracking program, `takt track --monte-carlo`",
        "robots",
        96,
        1042,
        Runs::Robots,
    ),
    Campaign {
        size_is_free: false,
        compiles: true,
        ..Campaign::of("seeds", "place and route of a machine with several seeds", "seed", 1, 20, Runs::Seed)
    },
    Campaign {
        size_is_free: false,
        most: Some(PARTS.len() as u64),
        ..Campaign::of(
            "mutants",
            "tests find the mutants of circuit and sources, `cargo xtask mutants`, one part at a time",
            "part",
            1,
            PARTS.len() as u64,
            Runs::Mutants,
        )
    },
];

/// The campaign of a name.
pub(super) fn named(name: &str) -> Result<&'static Campaign> {
    let names = || CAMPAIGNS.iter().map(|campaign| campaign.name).collect::<Vec<_>>().join(", ");
    CAMPAIGNS
        .iter()
        .find(|campaign| campaign.name == name)
        .with_context(|| format!("there is no campaign `{name}`; there are {}", names()))
}

/// All campaigns in words.
pub(super) fn listed() -> String {
    let mut text = String::new();
    for Campaign { name, text: what, unit, size, units, .. } in CAMPAIGNS {
        let _ = writeln!(text, "{name:<17} {what}\n{:17} {units} units of {size} {unit}", "");
    }
    text + "\n`cargo xtask campaign NAME` runs the units, `--units K..L` some of them; docs/campaigns.md tells more\n"
}

/// A program with its arguments and variables.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Call {
    pub(super) program: String,
    pub(super) arguments: Vec<String>,
    pub(super) variables: Vec<(&'static str, String)>,
}

impl Campaign {
    /// The programs that units run, by name.
    pub(super) fn programs(&self) -> Vec<&'static str> {
        match self.runs {
            Runs::Test(package, ..) => vec![package],
            Runs::Fuzz => TARGETS.to_vec(),
            Runs::Robots => vec!["takt"],
            Runs::Seed | Runs::Mutants => Vec::new(),
        }
    }

    /// The number of units at a time, if there is a most: the mutants' record is one file, and each part uses every core.
    pub(super) fn jobs(&self) -> Option<usize> {
        (self.runs == Runs::Mutants).then_some(1)
    }

    /// The call that does a unit.
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
                        // What is new goes into the first folder.
                        folder.to_string(),
                        plan.corpus(target).display().to_string(),
                        format!("-artifact_prefix={folder}/"),
                        format!("-runs={size}"),
                        // Seed 0 would be the time of day.
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

    /// The figures in what a unit's program printed.
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
    use crate::root;

    /// The test of a row is there, and reads the variables that choose its part.
    #[test]
    fn campaigns_run_what_there_is() {
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
            let folder = ["rtl/cosim", "emu/analysis", "asm/verify"];
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
    fn a_wrong_name_is_told() {
        let error = named("lokstep").expect_err("there is none").to_string();
        assert!(error.starts_with("there is no campaign `lokstep`; there are lockstep, "), "{error}");
        assert!(crate::campaign::units("7..3").is_err() && crate::campaign::units("a").is_err());
        assert_eq!((crate::campaign::units("3..7"), crate::campaign::units("4")), (Ok(3..7), Ok(0..4)));
    }
}

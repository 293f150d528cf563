// SPDX-License-Identifier: MIT OR Apache-2.0
//! Synthesis, place and route: clock and size of the circuit on available devices.
//!
//! yosys produces the netlist; nextpnr places and routes it once per seed. Measurements are recorded in `rtl/synthesis.json`, from which
//! `docs/synthesis.md` and the clock of `takt track` are derived.

mod designs;
mod system;
mod text;
mod tools;

pub(crate) use text::markdown;

use crate::documents as docs;
use anyhow::{Context, Result, ensure};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use takt_automation::command::root;
use takt_automation::venv::{Venv, YOSYS};
use takt_board::place::TARGET_MHZ;
use takt_family::{FAMILIES, Family, Mapping, Part, Place, REFERENCE, Resources};
use takt_isa::UNITS;
use takt_isa::spec::machines::MACHINES;
use takt_rtl::synthesis::{self, Synthesis};

/// File of measurements, which [`takt_rtl::synthesis::committed`] includes.
const RECORD: &str = "rtl/synthesis.json";
/// Default number of seeds per measurement.
const SEEDS: u32 = 5;
/// The designs to measure, and the options of the tools.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The machine, with its memories; recorded if it is a row of the table or a file of this repository.
    #[arg(long, default_value = "t3", conflicts_with = "unit")]
    machine: String,
    /// A second core beside the machine's, CYCLES later.
    #[arg(long, value_name = "CYCLES", num_args = 0..=1, default_missing_value = "2", conflicts_with_all = ["system", "unit"],
        value_parser = clap::value_parser!(u32).range(1..=16))]
    second_core: Option<u32>,
    /// Error correction of the machine's memories.
    #[arg(long, conflicts_with_all = ["system", "unit"])]
    ecc: bool,
    /// A system of several cores instead, with its programs; recorded if it is one of this repository's.
    #[arg(long, value_name = "SYSTEM.toml", conflicts_with_all = ["machine", "unit"])]
    system: Option<PathBuf>,
    /// Units alone between registers instead; `all` for every one.
    #[arg(long, num_args = 1..)]
    unit: Vec<String>,
    /// The family of devices. A design that fits is placed and routed where open tools do it; resources of others are counted.
    #[arg(long, value_parser = family(), default_value = REFERENCE.name)]
    family: &'static Family,
    /// Resources only: no place and route.
    #[arg(long)]
    count: bool,
    /// The device; the family's largest unless stated.
    #[arg(long, value_name = "PART")]
    device: Option<String>,
    /// Speed grade of the device; the fastest unless stated.
    #[arg(long)]
    grade: Option<u8>,
    /// Seeds of place and route, from 1 on. A measurement with fewer seeds than the recorded one of the same circuit does not replace it.
    #[arg(long, default_value_t = SEEDS, value_parser = clap::value_parser!(u32).range(1..=100))]
    seeds: u32,
    /// One seed only, and nothing is recorded.
    #[arg(long, conflicts_with_all = ["seeds", "jobs"])]
    seed: Option<u32>,
    /// The clock that place and route strives for, in MHz; nothing is recorded unless it is the usual 200.
    #[arg(long, default_value_t = TARGET_MHZ, value_parser = clap::value_parser!(u32).range(1..=1000))]
    freq: u32,
    /// Seeds at a time (each takes half a gigabyte); as many as there are cores unless stated.
    #[arg(long)]
    jobs: Option<usize>,
}

impl Arguments {
    /// Seeds to measure.
    fn seeds(&self) -> Vec<u32> {
        self.seed.map_or_else(|| (1..=self.seeds).collect(), |seed| vec![seed])
    }

    /// Device to measure: the given one, or the default of the family.
    fn part(&self) -> Result<&'static Part> {
        let family = self.family;
        let part = match &self.device {
            Some(name) => family.part(name),
            None => family.representative(),
        };
        let parts = || family.parts.iter().map(|part| part.name).collect::<Vec<_>>().join(", ");
        part.with_context(|| format!("{} has no such device; there are {}", family.text, parts()))
    }

    /// Place-and-route tool of the family; `None` if resources are only counted.
    fn place(&self) -> Option<&'static Place> {
        self.family.place.as_ref().filter(|_| !self.count)
    }

    /// Speed grade of the device; an error if the family lacks the given grade.
    fn grade(&self, place: &Place) -> Result<u8> {
        let grade = self.grade.unwrap_or(place.measured.grade);
        let (lowest, highest) = self.family.grades;
        ensure!(
            (lowest..=highest).contains(&grade),
            "grade {grade}: devices of {} have {lowest} to {highest}",
            self.family.text
        );
        Ok(grade)
    }
}

/// Value parser for the name of a family, for clap.
fn family() -> impl TypedValueParser<Value = &'static Family> {
    let names = PossibleValuesParser::new(FAMILIES.iter().map(|family| family.name));
    names.map(|name| Family::from_name(&name).unwrap_or(REFERENCE))
}

/// A design to synthesise: Verilog files by name, the top module, and the size of the measuring wrapper.
struct Design {
    name: String,
    files: BTreeMap<String, String>,
    top: String,
    mapping: Mapping,
    /// The design has the ports that the pin constraints of the measured device name; otherwise nextpnr chooses the pins.
    has_pins: bool,
    wrapper: Resources,
    /// Instances in a system's module `system`, each with the part that its resources are counted for.
    parts: Vec<(String, String)>,
    /// The measurement may be recorded.
    recorded: bool,
}

/// Entry of `cargo evidence synth`.
pub(crate) fn synth(arguments: &Arguments) -> Result<()> {
    let designs = designs::designs(arguments)?;
    let placer = arguments.place().map(|place| place.package);
    let packages: Vec<&str> = [YOSYS].into_iter().chain(placer).collect();
    let venv = Venv::with(&packages)?;
    let mut measured = Vec::new();
    for design in designs {
        let is_ours = design.recorded;
        let row = tools::measure(&venv, design, arguments)?;
        println!("{}", text::in_words(&row, &arguments.seeds()));
        if let (Some(seed), [mhz]) = (arguments.seed, &row.mhz[..]) {
            // Output in the format that `cargo evidence campaign seeds` reads.
            println!("figures: MHz@{seed}={mhz:.2} LUT4@{seed}={}", row.resources.luts);
        }
        if is_ours {
            measured.push(row);
        } else {
            println!(
                "{} not recorded: it is neither a row of the table nor a file of this repository",
                row.design
            );
        }
    }
    if arguments.seed.is_some() || arguments.freq != TARGET_MHZ {
        println!("not recorded: it takes seeds from 1 on, and the target of {TARGET_MHZ} MHz");
        return Ok(());
    }
    let mut rows = recorded()?;
    for new in measured {
        let same =
            |old: &Synthesis| (&new.design, &new.device, new.grade) == (&old.design, &old.device, old.grade);
        if let Some(old) =
            rows.iter().find(|old| same(old) && old.circuit == new.circuit && old.mhz.len() > new.mhz.len())
        {
            eprintln!("{} not recorded: what is recorded has {} seeds", new.design, old.mhz.len());
            continue;
        }
        rows.retain(|old| !same(old));
        rows.push(new);
    }
    rows.sort_by_key(|row| (order(&row.design), row.device.clone(), std::cmp::Reverse(row.grade)));
    fs::write(root().join(RECORD), serde_json::to_string_pretty(&rows)? + "\n")?;
    fs::write(root().join(docs::SYNTHESIS), text::markdown(&rows))?;
    println!("recorded in {RECORD} and {}", docs::SYNTHESIS);
    Ok(())
}

/// Recorded measurements of all designs.
pub(crate) fn recorded() -> Result<Vec<Synthesis>> {
    let text = fs::read_to_string(root().join(RECORD)).with_context(|| format!("cannot read {RECORD}"))?;
    synthesis::parse(&text).with_context(|| format!("cannot read {RECORD}"))
}

/// Sort key of the rows: machines, then units, each in table order, then files.
fn order(design: &str) -> usize {
    let machine = MACHINES.iter().position(|machine| machine.name == design);
    machine
        .or_else(|| Some(MACHINES.len() + UNITS.iter().position(|unit| unit.name == design)?))
        .unwrap_or(usize::MAX)
}

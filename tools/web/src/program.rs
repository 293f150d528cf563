// SPDX-License-Identifier: MIT OR Apache-2.0
//! Assembly of the page's program.

use crate::plant::PlantRequest;
use crate::run::{ZERO_PERIODS, number, prepare};
use crate::{CYCLES, PERIODS, Playground, SOURCE_BYTES, constants, examples, plant, view};
use serde::Deserialize;
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, HashMap};
use std::io::Cursor;
use std::num::NonZeroU64;
use std::sync::Arc;
use takt_analysis::SectionBounds;
use takt_asm::units;
use takt_asm::{AssembledProgram, MemoryLoader, Options, Search};
use takt_debug::console::Console;
use takt_debug::inputs::{self, Table};
use takt_debug::session::{self, Session};
use takt_emu::{Emulator, Row, Rows};
use takt_isa::program::Port;
use takt_isa::timing::{Cycle, Span};
use takt_isa::{BundleAddress, Flow, Machine, Program, Type};
use takt_programs::plants::bits;

/// The loaded program with its inputs.
pub(crate) struct LoadedProgram {
    pub(crate) name: String,
    /// Text and machine from which it was assembled.
    origin: (String, String),
    pub(crate) assembled: AssembledProgram,
    /// Bits of the parameters in the source, in their order.
    defaults: Vec<Option<u32>>,
    /// Inputs by the period; `None`: all ports are 0.
    pub(crate) rows: Option<Arc<Rows>>,
    pub(crate) tick: Option<NonZeroU64>,
}

/// Parameters that change during a run: registers and bits by the period, from 0, from which on they act. A parameter is a register of the
/// inputs' bank, so that a row of inputs sets it.
pub(crate) type Changes = BTreeMap<usize, Row>;

/// Change of a parameter during a run.
#[derive(Deserialize)]
struct Change {
    /// Period from which on the value acts, from 1.
    period: usize,
    name: String,
    value: f64,
}

/// Request to assemble a source.
#[derive(Deserialize)]
pub(crate) struct AssembleRequest {
    name: String,
    source: String,
    machine: String,
    /// Values of parameters (`.param`) that differ from the source's.
    #[serde(default)]
    parameters: BTreeMap<String, f64>,
    /// Changes of parameters during the run, as a host makes them between two periods.
    #[serde(default)]
    changes: Vec<Change>,
    /// Input table in CSV with a column for each input port. If it is blank or made for other ports, all ports rest.
    #[serde(default)]
    inputs: String,
    /// Cycles between ticks; 0: a tick comes as soon as the program waits.
    #[serde(default)]
    tick: u64,
    /// Plant that closes the loop: it fills its input ports, the table all others.
    #[serde(default)]
    plant: Option<PlantRequest>,
    /// Number of periods of a closed loop without a table.
    #[serde(default)]
    periods: Option<usize>,
}

/// Machine given by its name, or by the text of a machine file, which has several lines.
pub(crate) fn machine(wanted: &str) -> Result<&'static Machine, String> {
    match wanted.contains('\n') {
        true => takt_asm::machine::read("machine.toml", wanted).map_err(|mistakes| mistakes.render(false)),
        false => takt_asm::machine(wanted),
    }
}

/// Name of the input table in messages.
const INPUTS: &str = "inputs";

impl Playground {
    /// Assembles a source, bounds its cycles, and opens a debug session.
    pub(crate) fn assemble(&mut self, wanted: AssembleRequest) -> Result<Value, String> {
        let machine = machine(&wanted.machine)?;
        let before = self.loaded.take();
        (self.console, self.run, self.track) = (None, None, None);
        if wanted.source.len() > SOURCE_BYTES {
            return Err(format!("the source has more than {} MiB", SOURCE_BYTES >> 20));
        }
        let name = if wanted.name.is_empty() { "main.s".to_owned() } else { wanted.name };
        let origin = (wanted.source, wanted.machine);
        // Inputs, plants and parameters leave the schedule as it is.
        let before = before.filter(|before| before.name == name && before.origin == origin);
        let (mut assembled, defaults) = match before {
            Some(LoadedProgram { assembled, defaults, .. }) => (assembled, defaults),
            None => {
                let loader = Search::new(MemoryLoader::new(examples::includable_sources()))
                    .library(takt_programs::LIBRARY);
                let options = Options { machine, ..Options::default() };
                let source = origin.0.clone().into_bytes();
                let assembled = match takt_asm::assemble_bytes(&name, source, &loader, &options) {
                    Ok(assembled) => assembled,
                    Err(mistakes) => {
                        return Ok(json!({
                            "assembled": false, "messages": mistakes.messages(), "text": mistakes.render(false),
                        }));
                    }
                };
                let parameters = assembled.program.parameters.iter();
                let defaults = parameters.map(|port| assembled.program.initial(port.register)).collect();
                (assembled, defaults)
            }
        };
        let set = set_parameters(&mut assembled.program, &defaults, &wanted.parameters)
            .and_then(|()| changes(&assembled.program, &wanted.changes));
        let (changes, parameter_error) = match set {
            Ok(changes) => (changes, None),
            Err(error) => {
                set_parameters(&mut assembled.program, &defaults, &BTreeMap::new())?;
                (Changes::new(), Some(error))
            }
        };
        let program = &assembled.program;
        let empty = program.bundles() == 0;
        let table = wanted.inputs.as_bytes();
        let is_blank = wanted.inputs.trim().is_empty();
        // A table with other ports belongs to a previous program, and is ignored.
        let given = plant::given(wanted.plant.as_ref(), program);
        let (optional, needed): (Vec<Port>, Vec<Port>) = program
            .inputs
            .iter()
            .cloned()
            .partition(|port| given.iter().any(|other| other.name == port.name));
        let source = Box::new(Cursor::new(table.to_vec()));
        let table_read = Table::with_optional(INPUTS.to_owned(), source, &needed, &optional);
        let note = table_read.as_ref().ok().and_then(Table::note).map(str::to_owned);
        let others = table_read.err().filter(|_| !is_blank);
        let rows = if is_blank || others.is_some() {
            Ok(None)
        } else {
            inputs::rows(INPUTS, table, &needed, &optional, PERIODS).map(Some)
        };
        let (rows, inputs_error) = match rows {
            Ok(rows) => (rows, None),
            Err(error) => (None, Some(error)),
        };
        let periods = wanted.periods.unwrap_or(ZERO_PERIODS);
        let plant = wanted.plant.filter(|_| inputs_error.is_none());
        let recorded = rows.as_ref();
        let closed =
            plant.map(|plant| (plant::close(&assembled, &plant, recorded, &changes, periods), plant));
        let (rows, plant, plant_error) = match closed {
            Some((Ok(closed), plant)) => (Some(closed), Some(plant), None),
            Some((Err(error), _)) => (open_loop(rows, program, &changes, periods), None, Some(error)),
            None => (open_loop(rows, program, &changes, periods), None, None),
        };
        let rows = rows.map(Arc::new);
        let tick = NonZeroU64::new(wanted.tick);
        let loaded = LoadedProgram { name, origin, assembled, defaults, rows, tick };
        let mut told = facts(&loaded);
        told["plant"] = json!(plant.map(|plant| json!({ "name": plant.name })));
        told["plant_error"] = json!(plant_error);
        told["parameter_error"] = json!(parameter_error);
        told["inputs_error"] = json!(inputs_error);
        told["inputs_of_others"] = json!(others);
        told["inputs_note"] = json!(note);
        if !empty && inputs_error.is_none() {
            self.console = Some(Console::new(loaded.session()?));
        }
        if let Some(console) = &mut self.console {
            told["view"] = view::view(console);
        }
        self.loaded = Some(loaded);
        Ok(told)
    }
}

/// Gives each parameter its value in the source, or the one that is wanted.
fn set_parameters(
    program: &mut Program,
    defaults: &[Option<u32>],
    wanted: &BTreeMap<String, f64>,
) -> Result<(), String> {
    let ports = program.parameters.clone();
    for (port, default) in ports.iter().zip(defaults) {
        if let Some(bits) = default {
            program.set_parameter(&port.name, *bits).map_err(|error| error.to_string())?;
        }
    }
    for (name, value) in wanted {
        let ty = program.parameter(name).map_err(|error| error.to_string())?.ty;
        program.set_parameter(name, bits(ty, *value)).map_err(|error| error.to_string())?;
    }
    Ok(())
}

/// Changes of parameters during a run, by period.
fn changes(program: &Program, wanted: &[Change]) -> Result<Changes, String> {
    let mut changes = Changes::new();
    for Change { period, name, value } in wanted {
        let port = program.parameter(name).map_err(|error| error.to_string())?;
        let bits = bits(port.ty, *value);
        program.check_parameter(port, bits).map_err(|error| error.to_string())?;
        changes.entry(period.saturating_sub(1)).or_default().push((port.register, bits));
    }
    Ok(changes)
}

/// Bits of an input port that nobody gives: 0, or the value of its range that is nearest to it.
fn resting(program: &Program, port: &Port) -> u32 {
    let Some(range) = program.range(port.register) else { return 0 };
    let (low, high) = range.ends();
    bits(port.ty, 0_f64.clamp(low, high))
}

/// Rows of a run without a plant, in which parameters change; without recorded rows, all ports rest. `None` if they rest at 0, as the
/// emulator begins.
fn open_loop(rows: Option<Rows>, program: &Program, changes: &Changes, periods: usize) -> Option<Rows> {
    let rest: Row = program.inputs.iter().map(|port| (port.register, resting(program, port))).collect();
    if changes.is_empty() && rest.iter().all(|(_, bits)| *bits == 0) {
        return rows;
    }
    let mut rows = rows.unwrap_or_else(|| vec![rest; periods.min(PERIODS)]);
    for (period, change) in changes {
        if let Some(row) = rows.get_mut(*period) {
            row.extend(change);
        }
    }
    Some(rows)
}

/// Parameters of the program with their values, for sliders.
fn parameters(program: &Program, sources: &[(String, String)]) -> Vec<Value> {
    let one = |port: &Port| {
        let bits = program.initial(port.register)?;
        let value = match port.ty {
            Type::F => f64::from(f32::from_bits(bits)),
            Type::I | Type::B => f64::from(bits.cast_signed()),
        };
        let (low, high) = program.range(port.register).map(|range| range.ends()).unzip();
        let whole = port.ty != Type::F;
        Some(json!({
            "name": port.name, "value": value, "unit": units::unit(sources, ".param", &port.name), "integer": true,
            "whole": whole, "low": low, "high": high,
        }))
    };
    program.parameters.iter().filter_map(one).collect()
}

impl LoadedProgram {
    /// Debug session at the beginning of the program.
    fn session(&self) -> Result<Session, String> {
        let info = self.assembled.debug_info();
        let options = session::Options {
            inputs: self.rows.clone(),
            tick: self.tick,
            constants: info.constants,
            sources: info.sources,
            names: info.names,
            ..session::Options::default()
        };
        let mut session =
            Session::new(&self.assembled.program, options).map_err(|error| error.to_string())?;
        session.run_limit = CYCLES;
        Ok(session)
    }
}

/// First bundle of a period, and the cycles that no schedule of the blocks and loops on its path falls below; `None` if the path depends on
/// data, or does not end.
fn least_of_path(assembled: &AssembledProgram) -> Option<(BundleAddress, Cycle)> {
    let program = &assembled.program;
    let mut emulator = Emulator::new(program).ok()?;
    // The section from reset, a first period that may be another section's, and the second period.
    let mut issues = Vec::new();
    for _ in 0..3 {
        prepare(&mut emulator, None, 0).ok()?;
        let Ok(trace) = takt_analysis::trace(&mut emulator) else { break };
        issues = trace.issues;
    }
    let blocks = assembled.blocks.iter().map(|block| (block.address, block.bound.cycles()));
    let kernels = assembled.loops.iter().map(|one| (one.address, one.bound.cycles()));
    let bounds: HashMap<BundleAddress, u32> = kernels.chain(blocks).collect();
    let mut least = 0;
    for issue in &issues {
        let bundle = program.bundle(issue.address)?.ok()?;
        if bundle.iter().any(|one| matches!(one.flow(), Flow::Branch { .. })) {
            return None;
        }
        least += bounds.get(&issue.address).copied().map_or(0, Cycle::from);
    }
    Some((issues.first()?.address, least))
}

/// Facts about the assembled program, for the page.
fn facts(loaded: &LoadedProgram) -> Value {
    let LoadedProgram { assembled, name, .. } = loaded;
    let program = &assembled.program;
    let sources = assembled.debug_info().sources;
    let port = |port: &Port, what: &str| {
        json!({
            "name": port.name, "type": port.ty.name(), "unit": units::unit(&sources, what, &port.name),
            "limit": takt_analysis::limit(program, port.register),
            "together": units::declared_together(&sources, what, &port.name),
        })
    };
    let ports = |ports: &[Port], what: &str| ports.iter().map(|one| port(one, what)).collect::<Vec<_>>();
    let span = |span: Span| json!({ "best": span.best, "worst": span.worst });
    let resting = program.inputs.iter().map(|port| (port, resting(program, port)));
    let resting: Map<_, _> = resting
        .filter(|(_, bits)| *bits != 0)
        .map(|(port, bits)| (port.name.clone(), number(port.ty, Some(bits))))
        .collect();
    let path = least_of_path(assembled);
    let section = |section: &SectionBounds| {
        let cycles = if section.once { section.cycles } else { section.in_time };
        // A period of one path takes the same cycles always; its first bundle may have waited for the tick.
        let is_one_path = |(address, _): &(BundleAddress, Cycle)| {
            *address == section.address && section.cycles.best == section.cycles.worst && !section.once
        };
        let least = path.filter(is_one_path).map(|(_, least)| least);
        json!({ "name": section.name, "once": section.once, "cycles": span(cycles), "missed": section.missed.worst, "least": least })
    };
    let (bounds, no_bound) = match takt_analysis::bound(program) {
        Ok(bounds) => (Some(bounds.sections.iter().map(section).collect::<Vec<_>>()), None),
        Err(error) => (None, Some(error.to_string())),
    };
    json!({
        "assembled": true,
        "messages": assembled.warnings.messages(),
        "text": assembled.warnings.render(false),
        "name": name,
        "machine": program.machine.name,
        "bundles": program.bundles(),
        "words": program.code.len(),
        "settable": constants::settable(assembled),
        "parameters": parameters(program, &sources),
        "sampling_period": units::sampling_period(&sources, &assembled.constants),
        "data_words": program.data.len(),
        "inputs": ports(&program.inputs, ".input"),
        "resting": resting,
        "outputs": ports(&program.outputs, ".output"),
        "tick": loaded.tick,
        "rows": loaded.rows.as_ref().map(|rows| rows.len()),
        "bounds": bounds,
        "no_bound": no_bound,
        "plants": plant::fitting(program),
        "tracks": takt_programs::hybrid::Binding::new(program).is_ok(),
    })
}

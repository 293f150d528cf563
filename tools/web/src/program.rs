// SPDX-License-Identifier: MIT OR Apache-2.0
//! Assembly of the page's program.

use crate::plant::PlantRequest;
use crate::run::ZERO_PERIODS;
use crate::{CYCLES, PERIODS, Playground, SOURCE_BYTES, constants, examples, plant, ports, view};
use serde::Deserialize;
use serde_json::{Value, json};
use std::io::Cursor;
use std::num::NonZeroU64;
use std::sync::Arc;
use takt_analysis::SectionBounds;
use takt_asm::schedule::BlockReport;
use takt_asm::units;
use takt_asm::{AssembledProgram, MemoryLoader, Options, Search};
use takt_debug::console::Console;
use takt_debug::inputs::{self, Table};
use takt_debug::session::{self, Session};
use takt_emu::Rows;
use takt_isa::Machine;
use takt_isa::program::Port;
use takt_isa::timing::{Cycle, Span};

/// The loaded program with its inputs.
pub(crate) struct LoadedProgram {
    pub(crate) name: String,
    pub(crate) assembled: AssembledProgram,
    /// Recorded inputs; `None`: all ports are 0.
    pub(crate) rows: Option<Arc<Rows>>,
    pub(crate) tick: Option<NonZeroU64>,
}

/// Request to assemble a source.
#[derive(Deserialize)]
pub(crate) struct AssembleRequest {
    name: String,
    source: String,
    machine: String,
    /// Input table in CSV with a column for each input port. If it is blank or made for other ports, all ports are 0.
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
        (self.loaded, self.console, self.run, self.track) = (None, None, None, None);
        if wanted.source.len() > SOURCE_BYTES {
            return Err(format!("the source has more than {} MiB", SOURCE_BYTES >> 20));
        }
        let name = if wanted.name.is_empty() { "main.s".to_owned() } else { wanted.name };
        let loader =
            Search::new(MemoryLoader::new(examples::includable_sources())).library(takt_programs::LIBRARY);
        let options = Options { machine, ..Options::default() };
        let assembled = match takt_asm::assemble_bytes(&name, wanted.source.into_bytes(), &loader, &options) {
            Ok(assembled) => assembled,
            Err(mistakes) => {
                return Ok(json!({
                    "assembled": false, "messages": mistakes.messages(), "text": mistakes.render(false),
                }));
            }
        };
        let program = &assembled.program;
        let empty = program.bundles() == 0;
        let table = wanted.inputs.as_bytes();
        let is_blank = wanted.inputs.trim().is_empty();
        // A table with other ports belongs to a previous program, and is ignored.
        let others =
            Table::new(INPUTS.to_owned(), Box::new(Cursor::new(table.to_vec())), &program.inputs).err();
        let others = others.filter(|_| !is_blank);
        let rows = if is_blank || others.is_some() {
            Ok(None)
        } else {
            let rows = inputs::rows(INPUTS, table, &program.inputs, PERIODS);
            rows.map(|rows| Some(Arc::new(rows)))
        };
        let (rows, inputs_error) = match rows {
            Ok(rows) => (rows, None),
            Err(error) => (None, Some(error)),
        };
        let recorded = rows.as_deref();
        let periods = wanted.periods.unwrap_or(ZERO_PERIODS);
        let plant = wanted.plant.filter(|_| inputs_error.is_none());
        let closed = plant.map(|plant| (plant::close(&assembled, &plant, recorded, periods), plant));
        let (rows, plant, plant_error) = match closed {
            Some((Ok(closed), plant)) => (Some(Arc::new(closed)), Some(plant), None),
            Some((Err(error), _)) => (rows, None, Some(error)),
            None => (rows, None, None),
        };
        let loaded = LoadedProgram { name, assembled, rows, tick: NonZeroU64::new(wanted.tick) };
        let mut told = facts(&loaded);
        told["plant"] = json!(plant.map(|plant| json!({ "name": plant.name })));
        told["plant_error"] = json!(plant_error);
        told["inputs_error"] = json!(inputs_error);
        told["inputs_of_others"] = json!(others);
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

/// Facts about the assembled program, for the page.
fn facts(loaded: &LoadedProgram) -> Value {
    let LoadedProgram { assembled, name, .. } = loaded;
    let program = &assembled.program;
    let sources = assembled.debug_info().sources;
    let port = |port: &Port, what: &str| {
        json!({
            "name": port.name, "type": port.ty.name(), "unit": units::unit(&sources, what, &port.name),
            "limit": ports::limit(program, port.register),
            "together": units::declared_together(&sources, what, &port.name),
        })
    };
    let ports = |ports: &[Port], what: &str| ports.iter().map(|one| port(one, what)).collect::<Vec<_>>();
    let span = |span: Span| json!({ "best": span.best, "worst": span.worst });
    let section = |section: &SectionBounds| {
        let cycles = if section.once { section.cycles } else { section.in_time };
        // Only of a section that is a single block, the block's bound is the section's.
        let is_whole = |block: &&BlockReport| {
            block.address == section.address && Cycle::from(block.cycles) == section.cycles.worst
        };
        let least = assembled.blocks.iter().find(is_whole).map(|block| block.bound.cycles());
        json!({ "name": section.name, "once": section.once, "cycles": span(cycles), "least": least })
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
        "sampling_period": units::sampling_period(&sources, &assembled.constants),
        "data_words": program.data.len(),
        "inputs": ports(&program.inputs, ".input"),
        "outputs": ports(&program.outputs, ".output"),
        "tick": loaded.tick,
        "rows": loaded.rows.as_ref().map(|rows| rows.len()),
        "bounds": bounds,
        "no_bound": no_bound,
        "plants": plant::fitting(program),
        "tracks": takt_programs::hybrid::Binding::new(program).is_ok(),
    })
}

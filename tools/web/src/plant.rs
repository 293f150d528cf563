// SPDX-License-Identifier: MIT OR Apache-2.0
//! Loops closed by a plant: the inputs of a run, as if they had been recorded. So the plots, the debugger, the pipeline and the test bench
//! show the same periods.

use crate::PERIODS;
use crate::program::Changes;
use crate::run::prepare;
use serde::Deserialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use takt_asm::AssembledProgram;
use takt_asm::units;
use takt_emu::{Emulator, Rows};
use takt_isa::Program;
use takt_isa::program::Port;
use takt_programs::PLANTS;
use takt_programs::plants::{ClosedLoop, Connection, Copies, PlantFile};

/// Request for a plant.
#[derive(Clone, Deserialize)]
pub(crate) struct PlantRequest {
    /// Name of a file of [`PLANTS`], without the extension.
    pub(crate) name: String,
    /// Numbers that differ from the file's.
    #[serde(default)]
    parameters: BTreeMap<String, f64>,
}

/// Plants that the page does not offer: a tank moves too slowly for a run of some hundred periods.
const TOO_SLOW: &str = "tank.toml";

/// Name in requests of a file of [`PLANTS`].
fn name(file: &str) -> &str {
    file.strip_suffix(".toml").unwrap_or(file)
}

/// Connects a plant to a program.
fn connect(file: &PlantFile, program: &Program) -> Result<Connection, String> {
    let interface = file.interface().unwrap_or_default();
    let connection = file.connect(&interface, &program.inputs, &program.outputs, &[]);
    connection.map_err(|mistakes| mistakes.render(false).trim().to_owned())
}

/// Plants whose ports a program has, with the numbers that a user may set.
pub(crate) fn fitting(program: &Program) -> Vec<Value> {
    let told = |(file, text): &(&str, &str)| {
        let plant = PlantFile::read(file, text).ok()?;
        let connection = connect(&plant, program).ok()?;
        // A slider of a positive number begins at a tenth of the value.
        let low = |value: f64, least: f64| if least > 0.0 { value / 10.0 } else { least };
        let parameters = plant.settings().into_iter().map(|one| {
            json!({
                "name": one.name, "value": one.value, "unit": one.unit, "text": one.text,
                "low": one.least.map(|least| low(one.value, least)), "least": one.least,
            })
        });
        Some(json!({
            "name": name(file), "text": plant.model()?.text,
            "gives": connection.driven().map(|port| &port.name).collect::<Vec<_>>(),
            // Inputs that the plant's file states where there is no table.
            "states": connection.optional().iter().map(|port| &port.name).collect::<Vec<_>>(),
            "parameters": parameters.collect::<Vec<_>>(),
        }))
    };
    PLANTS.iter().filter(|(file, _)| *file != TOO_SLOW).filter_map(told).collect()
}

/// Input ports that a plant gives or whose course its file states: a table need not have them.
pub(crate) fn given(wanted: Option<&PlantRequest>, program: &Program) -> Vec<Port> {
    let known = wanted.and_then(|wanted| PLANTS.iter().find(|(file, _)| name(file) == wanted.name));
    let plant = known.and_then(|(file, text)| PlantFile::read(file, text).ok());
    let connection = plant.and_then(|plant| connect(&plant, program).ok());
    connection.map_or_else(Vec::new, |connection| {
        connection.driven().cloned().chain(connection.optional()).collect()
    })
}

/// Message for a plant that takes or gives other ports than a program has, with the plants that it could have.
fn misfit(name: &str, program: &Program) -> String {
    let others = fitting(program);
    let others: Vec<&str> = others.iter().filter_map(|one| one["name"].as_str()).collect();
    let instead = match others.is_empty() {
        true => "no plant has this program's".to_owned(),
        false => format!("for these there is {}, to be chosen above the plots", others.join(", ")),
    };
    format!("the plant {name} is for other ports; {instead}")
}

/// Inputs of the periods of a closed loop. `recorded` gives all inputs but the plant's, and the number of periods; without it, they are
/// those of the plant's file, or 0, for `periods`. `changes` of parameters act from their periods on. The loop ends early where a period does not end, or the plant diverges.
///
/// # Errors
/// If the plant does not fit the program, or has parameters that make no sense.
pub(crate) fn close(
    assembled: &AssembledProgram,
    wanted: &PlantRequest,
    recorded: Option<&Rows>,
    changes: &Changes,
    periods: usize,
) -> Result<Rows, String> {
    let program = &assembled.program;
    let Some((file, text)) = PLANTS.iter().find(|(file, _)| name(file) == wanted.name) else {
        let names: Vec<&str> = PLANTS.iter().map(|(file, _)| name(file)).collect();
        return Err(format!("there is no plant `{}` (plants: {})", wanted.name, names.join(", ")));
    };
    let mut plant = PlantFile::read(file, text).map_err(|mistakes| mistakes.render(false))?;
    wanted.parameters.iter().try_for_each(|(name, value)| plant.set(name, *value))?;
    // The plant of a previous program, as a table for other ports. Mistakes of `connect` are about files and options, which the page has not.
    let connection = connect(&plant, program).map_err(|_| misfit(&wanted.name, program))?;
    let period = units::sampling_period(&assembled.debug_info().sources, &assembled.constants);
    let period = period.ok_or_else(|| {
        format!(
            "the plant `{}` needs the length of a period: `.const T = … ; s` (or `FS`, in Hz)",
            wanted.name
        )
    })?;
    let (simulation, interface) = plant.simulation(period).map_err(|error| error.to_string())?;
    let rest = connection.rest.iter().map(|port| (port.register, 0)).collect::<Vec<_>>();
    let mut closed: ClosedLoop<Copies> = ClosedLoop::new(simulation, interface, connection, period);
    let mut emulator = Emulator::new(program).map_err(|error| error.to_string())?;
    let mut rows = Rows::new();
    for at in 0..recorded.map_or(periods, Vec::len).min(PERIODS) {
        let mut row = match recorded {
            Some(recorded) => recorded.get(at).cloned().unwrap_or_default(),
            None => rest.clone(),
        };
        if closed.begin(&mut row, |register| emulator.output_bits(register)).is_err() {
            break;
        }
        row.extend(changes.get(&at).into_iter().flatten());
        rows.push(row);
        prepare(&mut emulator, Some(&rows), at as u64)?;
        if emulator.run_period(&[]).is_err() {
            break;
        }
    }
    Ok(rows)
}

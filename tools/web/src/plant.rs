// SPDX-License-Identifier: MIT OR Apache-2.0
//! Loops closed by a plant: the inputs of a run, as if they had been recorded. So the plots, the debugger, the pipeline and the test bench
//! show the same periods.

use crate::run::prepare;
use crate::{PERIODS, ports};
use serde::Deserialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use takt_asm::AssembledProgram;
use takt_emu::{Emulator, Rows};
use takt_isa::program::Port;
use takt_isa::{Program, Register, Type};
use takt_programs::plants::{PLANTS, Plant, Simulation};

/// Request for a plant.
#[derive(Clone, Deserialize)]
pub(crate) struct PlantRequest {
    pub(crate) name: String,
    /// Values of parameters that differ from the plant's own.
    #[serde(default)]
    parameters: BTreeMap<String, f64>,
}

/// Plants whose ports a program has, with their parameters.
pub(crate) fn fitting(program: &Program) -> Vec<Value> {
    let fits = |plant: &&&Plant| registers(program, plant).is_ok();
    let told = |plant: &&Plant| {
        let parameters = plant
            .parameters
            .iter()
            .map(|one| json!({ "name": one.name, "value": one.value, "unit": one.unit, "text": one.text }));
        json!({
            "name": plant.name, "text": plant.text, "gives": plant.gives,
            "parameters": parameters.collect::<Vec<_>>(),
        })
    };
    PLANTS.iter().filter(fits).map(told).collect()
}

/// Registers of the outputs that a plant takes and of the inputs that it gives.
fn registers(program: &Program, plant: &Plant) -> Result<(Vec<Register>, Vec<Register>), String> {
    let find = |ports: &[Port], names: &[&str], kind: &str| -> Result<Vec<Register>, String> {
        let of = |name: &&str| {
            let port = ports.iter().find(|port| port.name == *name && port.ty == Type::F);
            port.map(|port| port.register).ok_or_else(|| {
                format!(
                    "{} acts through ports: the program has no {kind} port `{name}` of floats",
                    plant.text
                )
            })
        };
        names.iter().map(of).collect()
    };
    Ok((find(&program.outputs, plant.takes, "output")?, find(&program.inputs, plant.gives, "input")?))
}

/// Inputs of the periods of a closed loop. `recorded` gives all inputs but the plant's, and the number of periods; without it, the others
/// are 0 for `periods`. The loop ends early where a period does not end.
///
/// # Errors
/// If the plant does not fit the program, or has parameters that make no sense.
pub(crate) fn close(
    assembled: &AssembledProgram,
    wanted: &PlantRequest,
    recorded: Option<&Rows>,
    periods: usize,
) -> Result<Rows, String> {
    let program = &assembled.program;
    let plant = Plant::named(&wanted.name)?;
    let (takes, gives) = registers(program, plant)?;
    let period = ports::sampling_period(&assembled.debug_info().sources, &assembled.constants);
    let period = period.ok_or_else(|| {
        format!("{} needs the length of a period: `.const T = … ; s` (or `FS`, in Hz)", plant.text)
    })?;
    let given = wanted.parameters.iter().map(|(name, value)| (name.as_str(), *value));
    let mut simulation = Simulation::new(plant, given, period)?;
    let mut emulator = Emulator::new(program).map_err(|error| error.to_string())?;
    let mut rows = Rows::new();
    for at in 0..recorded.map_or(periods, Vec::len).min(PERIODS) {
        let mut row = match recorded {
            Some(recorded) => recorded.get(at).cloned().unwrap_or_default(),
            None => program.inputs.iter().map(|port| (port.register, 0)).collect(),
        };
        for (register, value) in gives.iter().zip(simulation.sensors()) {
            row.retain(|(other, _)| other != register);
            row.push((*register, (value as f32).to_bits()));
        }
        rows.push(row);
        prepare(&mut emulator, Some(&rows), at as u64)?;
        if emulator.run_period(&[]).is_err() {
            break;
        }
        let outputs = takes.iter().map(|register| emulator.output_bits(*register).unwrap_or_default());
        let outputs: Vec<f64> = outputs.map(|bits| f64::from(f32::from_bits(bits))).collect();
        simulation.advance(&outputs);
    }
    Ok(rows)
}

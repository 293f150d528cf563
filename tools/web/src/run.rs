// SPDX-License-Identifier: MIT OR Apache-2.0
//! Runs of periods on the emulator that record the values of all ports, and the pipeline diagram of a period.

use crate::program::LoadedProgram;
use crate::{CYCLES, PERIODS, Playground};
use serde::Deserialize;
use serde_json::{Map, Value, json};
use takt_analysis::picture::Picture;
use takt_debug::fault::diagnose;
use takt_emu::Rows;
use takt_emu::{Emulator, PeriodError, Status};
use takt_isa::program::Port;
use takt_isa::{Program, Register, Type};

/// Default number of periods without recorded inputs.
pub(crate) const ZERO_PERIODS: usize = 20;
/// Maximum number of cycles in a call.
const SLICE: u64 = 1_000_000;
/// Maximum number of periods in a call.
const SLICE_PERIODS: u64 = 2000;

/// A run in progress.
pub(crate) struct Run {
    emulator: Emulator,
    /// Number of completed periods, and of all periods.
    done: u64,
    all: u64,
}

/// Request to run periods.
#[derive(Deserialize)]
pub(crate) struct RunRequest {
    /// Start again from the beginning, instead of continuing.
    #[serde(default)]
    begin: bool,
    /// Number of periods, if there are no recorded inputs.
    #[serde(default)]
    periods: Option<usize>,
}

impl LoadedProgram {
    fn emulator(&self) -> Result<Emulator, String> {
        let mut emulator = Emulator::new(&self.assembled.program).map_err(|error| error.to_string())?;
        emulator.set_tick_period(self.tick);
        Ok(emulator)
    }

    /// Message for a fault, or another event that ended a period, with its source line.
    pub(crate) fn fault(&self, error: &PeriodError) -> String {
        match error {
            PeriodError::Fault(fault) => {
                diagnose(fault, &self.assembled.program, &self.assembled.debug_info().sources).render(false)
            }
            error => error.to_string(),
        }
    }
}

/// Sets the inputs of a period (from 0), and limits it to [`CYCLES`].
pub(crate) fn prepare(emulator: &mut Emulator, rows: Option<&Rows>, period: u64) -> Result<(), String> {
    let zeros: Vec<(Register, u32)>;
    let row = match rows {
        Some(rows) => rows.get(period as usize).map_or(&[][..], Vec::as_slice),
        None => {
            zeros = emulator.program().inputs.iter().map(|port| (port.register, 0)).collect();
            &zeros
        }
    };
    for &(register, bits) in row {
        emulator.set_input_bits(register, bits).map_err(|error| error.to_string())?;
    }
    emulator.set_cycle_limit(emulator.now() + CYCLES);
    Ok(())
}

/// Value of a port as a JSON number; null if it has none, and `"NaN"`, `"inf"`, `"-inf"` for values that JSON cannot represent.
pub(crate) fn number(ty: Type, bits: Option<u32>) -> Value {
    match (ty, bits) {
        (_, None) => Value::Null,
        (Type::F, Some(bits)) => match f32::from_bits(bits) {
            value if value.is_finite() => json!(value),
            value => json!(value.to_string()),
        },
        (Type::I, Some(bits)) => json!(bits.cast_signed()),
        (Type::B, Some(bits)) => json!(bits),
    }
}

fn has_periods(program: &Program) -> bool {
    program.sections.iter().any(|section| section.name == "period")
}

impl Playground {
    /// Runs a slice of periods; returns the values of the ports in each period.
    pub(crate) fn run(&mut self, wanted: RunRequest) -> Result<Value, String> {
        if wanted.begin {
            let loaded = self.loaded()?;
            let recorded = loaded.rows.as_ref().map(|rows| rows.len());
            let periods = recorded.unwrap_or(wanted.periods.unwrap_or(ZERO_PERIODS));
            if periods > PERIODS {
                return Err(format!("{periods} periods: a run has at most {PERIODS}"));
            }
            self.run = Some(Run { emulator: loaded.emulator()?, done: 0, all: periods as u64 });
        }
        let mut run = self.run.take().ok_or("no run has begun")?;
        let loaded = self.loaded()?;
        let program = &loaded.assembled.program;
        let begin = run.emulator.now();
        let mut inputs: Vec<Vec<Value>> = vec![Vec::new(); program.inputs.len()];
        let mut outputs: Vec<Vec<Value>> = vec![Vec::new(); program.outputs.len()];
        let mut cycles = Vec::new();
        let (mut fault, first) = (None, run.done);
        if !has_periods(program) {
            prepare(&mut run.emulator, loaded.rows.as_deref(), 0)?;
            fault = run.emulator.run().err().map(|fault| loaded.fault(&PeriodError::Fault(fault)));
            run.all = 0;
        }
        while run.done < run.all
            && fault.is_none()
            && run.done - first < SLICE_PERIODS
            && run.emulator.now() - begin < SLICE
        {
            prepare(&mut run.emulator, loaded.rows.as_deref(), run.done)?;
            match run.emulator.run_period(&[]) {
                Ok(report) => cycles.push(report.cycles),
                Err(error) => {
                    fault = Some(format!("period {}: {}", run.done + 1, loaded.fault(&error)));
                    break;
                }
            }
            run.done += 1;
            let emulator = &run.emulator;
            for (column, port) in inputs.iter_mut().zip(&program.inputs) {
                column.push(number(port.ty, emulator.register(port.register)));
            }
            for (column, port) in outputs.iter_mut().zip(&program.outputs) {
                column.push(number(port.ty, emulator.output_bits(port.register)));
            }
        }
        let columns = |ports: &[Port], columns: Vec<Vec<Value>>| -> Value {
            let named = ports.iter().zip(columns);
            Value::Object(
                named.map(|(port, column)| (port.name.clone(), column.into())).collect::<Map<_, _>>(),
            )
        };
        let statistics = run.emulator.statistics();
        let told = json!({
            "first": first,
            "done": run.done,
            "all": run.all,
            "over": run.done >= run.all || fault.is_some(),
            "halted": matches!(run.emulator.status(), Status::Halted { .. }),
            "cycles": cycles,
            "inputs": columns(&program.inputs, inputs),
            "outputs": columns(&program.outputs, outputs),
            "total": run.emulator.now(),
            "operations": statistics.total_operations(),
            "missed": statistics.missed,
            "nan_writes": statistics.nan_writes,
            "flags": run.emulator.flags().to_string(),
            "fault": fault,
        });
        self.run = Some(run);
        Ok(told)
    }
}

/// Request for the diagram of a period.
#[derive(Deserialize)]
pub(crate) struct PeriodRequest {
    /// Period, from 1; 0 stands for the code from reset to the first `wait`.
    period: u64,
}

impl Playground {
    /// Pipeline diagram of a period, as data.
    pub(crate) fn picture(&self, wanted: PeriodRequest) -> Result<Value, String> {
        let loaded = self.loaded()?;
        let program = &loaded.assembled.program;
        let mut emulator = loaded.emulator()?;
        let rows = loaded.rows.as_deref();
        let last = rows.map_or(PERIODS, Vec::len) as u64;
        let wanted = if has_periods(program) { wanted.period.min(last) } else { 0 };
        let trace =
            |emulator: &mut Emulator| takt_analysis::trace(emulator).map_err(|error| error.to_string());
        prepare(&mut emulator, rows, 0)?;
        let mut found = trace(&mut emulator)?;
        for period in 1..=wanted {
            prepare(&mut emulator, rows, period - 1)?;
            if period < wanted {
                emulator.run_period(&[]).map_err(|error| loaded.fault(&error))?;
            } else {
                found = trace(&mut emulator)?;
            }
        }
        let picture = Picture::new(program, &*loaded.name, wanted, found);
        Ok(json!({ "picture": picture.json(), "period": wanted, "cycles": picture.trace.cycles }))
    }
}

//! `takt cosim SYSTEM.toml`: a system on its circuit and on the emulator, in lockstep.

use super::host::Host;
use super::{LoadedSystem, circuit, load, told};
use crate::files::{self, Out};
use crate::output::{self, Failure};
use crate::ports::Inputs;
use crate::run::PERIOD_LIMIT;
use crate::select::SourceArguments;
use anyhow::{Result, bail};
use serde_json::{Value, json};
use std::io::Write;
use std::path::Path;
use takt_cosim::system::{SystemLockstep, SystemModel, SystemSimulation};
use takt_cosim::{Difference, LockstepError, cache_folder};
use takt_emu::Row;
use takt_isa::timing::Cycle;
use takt_rtl::SystemDesign;
use takt_system::SystemFault;

/// What a system takes of `takt cosim`.
pub(crate) struct Arguments<'a> {
    pub(crate) file: &'a Path,
    pub(crate) source: &'a SourceArguments,
    pub(crate) inputs: Option<&'a Path>,
    pub(crate) periods: Option<u64>,
    pub(crate) waveform: &'a Path,
    pub(crate) json: bool,
}

/// Base ticks without `--inputs`.
const TICKS: u64 = 100;
/// Cycles before a difference from which the waveform shows it, and after it.
const SHOWN: (Cycle, Cycle) = (64, 16);

struct Ran {
    ticks: u64,
    cycles: Cycle,
    compared: u64,
    fault: Option<SystemFault>,
}

pub(crate) fn run(arguments: &Arguments<'_>, color: bool, out: &mut Out) -> Result<()> {
    let loaded = load(arguments.file, arguments.source, color)?;
    let design = circuit(&loaded, arguments.file)?;
    let host = Host::new(&loaded.description);
    let rows = rows(arguments, &host, &loaded)?;
    let model = SystemModel::build(&design, &cache_folder(), false)?;
    let simulation = model.start(&design.image.text, &[])?;
    let ran = match run_rows(&loaded, &design, &host, &rows, simulation) {
        Ok(ran) => ran,
        Err(error) => match error.downcast::<LockstepError>() {
            Ok(LockstepError::Difference(difference)) => {
                return report(arguments, &loaded, &design, &host, &rows, &difference, out);
            }
            Ok(other) => return Err(other.into()),
            Err(error) => return Err(error),
        },
    };
    let stopped = ran.fault.as_ref().map(|fault| told(fault, &loaded, color));
    if arguments.json {
        let value = json!({
            "system": files::input_name(arguments.file),
            "ticks": ran.ticks,
            "cycles": ran.cycles,
            "compared": ran.compared,
            "stopped": ran.fault.as_ref().map(ToString::to_string),
            "difference": Value::Null,
        });
        return output::json(&value, out);
    }
    writeln!(
        out,
        "{} base ticks, {} cycles of {} cores: {} events and pins, no difference",
        ran.ticks,
        ran.cycles,
        loaded.description.cores.len(),
        ran.compared
    )?;
    if let Some(fault) = stopped {
        writeln!(out, "  a fault stopped the system:")?;
        writeln!(out, "{fault}")?;
    }
    Ok(())
}

/// The rows of the inputs: zeros if there are none.
fn rows(arguments: &Arguments<'_>, host: &Host, loaded: &LoadedSystem) -> Result<Vec<Row>> {
    let columns = host.columns(&loaded.description);
    let mut inputs = Inputs::open(arguments.inputs, &columns)?;
    let most = arguments.periods.unwrap_or(if arguments.inputs.is_some() { u64::MAX } else { TICKS });
    let mut rows = Vec::new();
    while (rows.len() as u64) < most {
        let Some(row) = inputs.next()? else { break };
        rows.push(row.clone());
    }
    Ok(rows)
}

fn run_rows(
    loaded: &LoadedSystem,
    design: &SystemDesign,
    host: &Host,
    rows: &[Row],
    simulation: SystemSimulation,
) -> Result<Ran> {
    let description = &loaded.description;
    let mut lockstep = SystemLockstep::new(description, &design.plan, simulation)?;
    let mut ticks = 0;
    if let Some(start) = lockstep.run_to_start(PERIOD_LIMIT)? {
        let mut next = start - description.lead();
        let mut running = lockstep.run_until(next)?;
        for row in rows {
            if !running {
                break;
            }
            host.write(&mut lockstep, row)?;
            next += description.tick;
            running = lockstep.run_until(next)?;
            if running {
                host.read(&mut lockstep)?;
                ticks += 1;
            }
        }
    } else if lockstep.fault().is_none() && !lockstep.system().halted() {
        bail!("the system has run for {PERIOD_LIMIT} cycles, and a core has not waited yet");
    }
    lockstep.finish()?;
    let ran = Ran {
        ticks,
        cycles: lockstep.system().now(),
        compared: lockstep.compared(),
        fault: lockstep.fault().cloned(),
    };
    lockstep.into_simulation().finish();
    Ok(ran)
}

/// Tells of a difference, and runs again for its waveform.
fn report(
    arguments: &Arguments<'_>,
    loaded: &LoadedSystem,
    design: &SystemDesign,
    host: &Host,
    rows: &[Row],
    difference: &Difference,
    out: &mut Out,
) -> Result<()> {
    let model = SystemModel::build(design, &cache_folder(), true)?;
    // Beside the image, the simulation would not be where the name is meant.
    let path = std::path::absolute(arguments.waveform)?;
    let mut simulation = model.start(&design.image.text, &[path.as_os_str()])?;
    simulation.trace(difference.cycle.saturating_sub(SHOWN.0), difference.cycle + SHOWN.1)?;
    let again = run_rows(loaded, design, host, rows, simulation).is_err();
    let name = arguments.waveform.display();
    if arguments.json {
        let value = json!({
            "system": files::input_name(arguments.file),
            "difference": {
                "cycle": difference.cycle,
                "place": difference.place,
                "instruction": difference.instruction,
                "text": difference.to_string(),
                "waveform": again.then(|| name.to_string()),
            },
        });
        output::json(&value, out)?;
        return Err(Failure::Reported.into());
    }
    let shown = if again { format!("\n  waveform: {name}") } else { String::new() };
    bail!("circuit and emulator differ in {difference}{shown}")
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt accuracy`: errors of the outputs against binary64, measured by source line or proved as bounds.

mod bound_report;
mod certificate;
mod comparison;
mod lines;
mod lost;
mod measurement;

use crate::run::application::Application;
use crate::run::load::{Load, folder_of, is_system};
use crate::run::loaded_program::LoadedProgram;
use crate::run::system::observers::Observer;
use crate::run::system::run::SystemRun;
use crate::run::table_run::{TableApplication, Tables};
use crate::terminal::files::{self, Out};
use crate::terminal::number;
use crate::terminal::options::{OptionalMachine, SourceArguments};
use crate::terminal::output::Failure;
use crate::terminal::progress::DelayedActivity;
use anyhow::{Context, Result, anyhow, bail};
use bound_report::BoundReport;
use clap::{Args, ValueEnum};
use comparison::Comparison;
pub(crate) use measurement::MeasurementReport;
use serde_json::{Map, Value, json};
use std::io::Write;
use std::path::{Path, PathBuf};
use takt_analysis::accuracy::{Reals, Shadow, enclose_in_boxes};
use takt_analysis::period::PERIOD_LIMIT;
use takt_emu::{Emulator, Row};
use takt_isa::Program;
use takt_isa::program::Port;
use takt_system::{Core, Description, Recording, Replay};

/// Measure the outputs' errors against binary64, or bound them for every run, and name the lines that they come from.
///
/// With --inputs, runs the program on recorded inputs, and beside it the same operations in binary64. Without, follows every path through a
/// period for all inputs and states within their `.range`: bounds each output's error, and shows that there is no NaN, no overflow, no
/// division by zero, no conversion out of range, no integer that wraps and no index out of its array, or names the operations where there
/// may be (status 1).
///
/// For a system it does so for each core: bounded under the ranges in the core's own source, measured on the inputs that the core
/// had in a run of the system.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Accuracy {
    /// Source or image, `-` being standard input; or a system, a `.toml` file.
    file: PathBuf,
    #[command(flatten)]
    machine: OptionalMachine,
    #[command(flatten)]
    source: SourceArguments,
    /// CSV with one named column for each input port and one row for each period; `-` is standard input.
    #[arg(long, value_name = "CSV")]
    inputs: Option<PathBuf>,
    /// Run at most this many periods.
    #[arg(long, value_name = "N", requires = "inputs", value_parser = number::count, allow_hyphen_values = true)]
    periods: Option<u64>,
    /// Let each period begin with exact values: errors that states carry from period to period are left out.
    #[arg(long, requires = "inputs")]
    each_period: bool,
    /// Put the bound beside each measured error, with the factor between the two, and say what makes bounds that are far larger. Each period
    /// begins with exact values, as for bounds.
    #[arg(long, requires = "inputs")]
    bound: bool,
    /// Write into this folder what other makers' programs check: a goal for Gappa for each operation, and the derivation of the bounds with
    /// the script that adds it up (`check.py`). It says which bounds it proves.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["inputs", "json"])]
    certificate: Option<PathBuf>,
    /// Constants of the source as they are in the program, or as the real numbers that they stand for: with `real`, that a constant 0.1 is not
    /// exactly 0.1 in binary32 counts as an error in the bounds.
    #[arg(long, value_name = "KIND", conflicts_with_all = ["inputs", "certificate"])]
    constants: Option<Constants>,
    /// Print the result as JSON.
    #[arg(long)]
    json: bool,
}

/// Meaning of the constants in a source.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Constants {
    /// The binary32 number is meant.
    Exact,
    /// The real number in the source is meant.
    Real,
}

const EXAMPLES: &str = "\
Examples:
  takt accuracy prog.s                                bounds that no run exceeds, from the ranges in the source
  takt accuracy prog.s --inputs in.csv                errors against binary64, and the lines that they come from
  takt accuracy prog.s --inputs in.csv --each-period  without what states carry from period to period
  takt accuracy prog.s --inputs in.csv --bound        both, and the factor between them
  takt accuracy prog.s --constants real               bounds that count the rounding of constants such as 0.1
  takt accuracy prog.s --certificate proof            bounds, and their derivation for `python3 proof/check.py proof`
  takt accuracy system.toml --inputs in.csv           of each core, in a run of the system";

pub(crate) fn run(arguments: &Accuracy, color: bool, out: &mut Out) -> Result<()> {
    let mut reads = vec![("FILE", arguments.file.as_path())];
    reads.extend(arguments.inputs.as_deref().map(|path| ("--inputs", path)));
    files::check(&reads, &[])?;
    if arguments.constants == Some(Constants::Real) {
        let (application, reals) = with_reals(arguments, color)?;
        return bounded(arguments, &application, &reals, out);
    }
    let application = Application::load(&arguments.file, &arguments.machine, &arguments.source, color)?;
    match &arguments.inputs {
        Some(inputs) => {
            let shadows = match &application {
                Application::Program(loaded) => measure(arguments, inputs, &loaded.program),
                Application::System(system) => measure_cores(arguments, inputs, &system.description),
            };
            let shadows = shadows.map_err(|error| application.located_error(error, color))?;
            measured(arguments, &application, &shadows, out)
        }
        None => bounded(arguments, &application, &Reals::default(), out),
    }
}

/// Assembles a source, with the real numbers that its constants stand for, which an image does not have.
fn with_reals(arguments: &Accuracy, color: bool) -> Result<(Application, Reals)> {
    if is_system(&arguments.file) {
        let text = "--constants applies to a program; name the source of one core";
        return Err(Failure::Usage(text.to_owned()).into());
    }
    let load = Load::new(arguments.machine.machine, color).with(&arguments.source);
    let assembled = load.finish(load.assemble(&arguments.file, Load::source(&arguments.file)?))?;
    let reals = Reals { inputs: false, constants: assembled.reals.clone() };
    let loaded = LoadedProgram { folder: folder_of(&arguments.file), ..LoadedProgram::from(assembled) };
    Ok((Application::Program(Box::new(loaded)), reals))
}

/// Progress of an enclosure, which takes half a minute for a program of many branches.
fn bounding(program: &Program) -> DelayedActivity {
    let file = program.files.first().map_or("the program", String::as_str);
    DelayedActivity::new(format!("bounding the errors of {file}"))
}

/// Prints proved error bounds of each core, from the ranges in its source.
fn bounded(arguments: &Accuracy, application: &Application, reals: &Reals, out: &mut Out) -> Result<()> {
    if arguments.certificate.is_some() && application.system().is_some() {
        let text = "--certificate applies to a program; name the source of one core";
        return Err(Failure::Usage(text.to_owned()).into());
    }
    let mut safe = true;
    let mut cores = Vec::new();
    for (core, loaded) in application.programs().iter().enumerate() {
        let program = &loaded.program;
        let found = {
            let _waiting = bounding(program);
            enclose_in_boxes(program, reals)
        };
        let enclosure = match (found, application.system()) {
            (Ok(enclosure), _) => Ok(enclosure),
            (Err(error), None) if !arguments.json => bail!("no bound: {error}"),
            (Err(error), _) => Err(format!("no bound: {error}")),
        };
        safe &=
            enclosure.as_ref().is_ok_and(|found| found.hazards.is_empty() && found.first().next().is_none());
        if arguments.json {
            cores.push(match &enclosure {
                Ok(enclosure) => BoundReport { program, enclosure }.json(),
                Err(error) => json!({ "machine": program.machine.name, "error": error }),
            });
            continue;
        }
        title(application, core, out)?;
        match &enclosure {
            Ok(enclosure) => BoundReport { program, enclosure }.text(out)?,
            Err(error) => writeln!(out, "{error}")?,
        }
    }
    if arguments.json {
        files::json(&whole_json(arguments, application, cores), out)?;
    }
    if let (Some(folder), Application::Program(loaded)) = (&arguments.certificate, application) {
        certificate::write(&loaded.program, folder, out)?;
    }
    if safe { Ok(()) } else { Err(Failure::Reported.into()) }
}

/// Prints measured errors of each core.
fn measured(
    arguments: &Accuracy,
    application: &Application,
    shadows: &[Shadow],
    out: &mut Out,
) -> Result<()> {
    let cores = application.programs().iter().zip(shadows);
    let each_period = arguments.each_period || arguments.bound;
    let mut values = Vec::new();
    for (core, (loaded, shadow)) in cores.enumerate() {
        let program = &loaded.program;
        let measured = MeasurementReport::new(program, shadow);
        let enclosure = match arguments.bound {
            true => {
                let _waiting = bounding(program);
                Some(
                    enclose_in_boxes(program, &Reals::default())
                        .map_err(|error| anyhow!("no bound: {error}"))?,
                )
            }
            false => None,
        };
        let enclosure = enclosure.as_ref();
        let comparison = enclosure.map(|enclosure| Comparison { loaded, shadow, enclosure });
        if arguments.json {
            let mut value = measured.json();
            comparison.inspect(|comparison| comparison.add_to(&mut value));
            values.push(value);
            continue;
        }
        title(application, core, out)?;
        measured.text(each_period, out)?;
        comparison.map_or(Ok(()), |comparison| comparison.text(out))?;
    }
    if arguments.json {
        let mut value = whole_json(arguments, application, values);
        value["each_period"] = json!(each_period);
        files::json(&value, out)?;
    }
    Ok(())
}

/// Prints the heading of a core's results in a system.
fn title(application: &Application, core: usize, out: &mut Out) -> Result<()> {
    let Some(system) = application.system() else { return Ok(()) };
    let core_of = &system.description.cores[core];
    let blank = if core > 0 { "\n" } else { "" };
    writeln!(out, "{blank}{}, {}:", core_of.name, core_of.path)?;
    Ok(())
}

/// JSON of a program's results; for a system, an object with each core's results by name.
fn whole_json(arguments: &Accuracy, application: &Application, cores: Vec<Value>) -> Value {
    let file = files::input_name(&arguments.file);
    match application.system() {
        None => {
            let mut value = cores.into_iter().next().unwrap_or_default();
            value["program"] = file.into();
            value
        }
        Some(system) => {
            let names = system.description.cores.iter().map(|core| core.name.clone());
            json!({ "system": file, "cores": names.zip(cores).collect::<Map<_, _>>() })
        }
    }
}

/// A program on the emulator, with a binary64 shadow.
struct Shadowed<'a> {
    program: &'a Program,
    emulator: Emulator,
    shadow: Shadow,
    /// The code from reset to the first `wait` has not run yet.
    once: bool,
}

impl TableApplication for Shadowed<'_> {
    const ROWS: &'static str = "periods";

    fn inputs(&self) -> Vec<Port> {
        self.program.inputs.clone()
    }

    fn row(&mut self, row: &Row) -> Result<bool> {
        for &(register, bits) in row {
            self.emulator.set_input_bits(register, bits)?;
        }
        // The code before the first `wait` also reads the first period's inputs.
        for _ in 0..if self.once { 2 } else { 1 } {
            self.emulator.set_cycle_limit(self.emulator.now() + PERIOD_LIMIT);
            let goes_on = self.shadow.run_period(&mut self.emulator);
            if !goes_on.with_context(|| format!("period {}", self.shadow.periods()))? {
                return Ok(false);
            }
        }
        self.once = false;
        Ok(true)
    }
}

fn shadow(arguments: &Accuracy, program: &Program) -> Shadow {
    let shadow = Shadow::new(program);
    if arguments.each_period || arguments.bound { shadow.each_period_afresh() } else { shadow }
}

fn measure(arguments: &Accuracy, inputs: &Path, program: &Program) -> Result<Vec<Shadow>> {
    let (emulator, shadow) = (Emulator::new(program)?, shadow(arguments, program));
    let mut shadowed = Shadowed { program, emulator, shadow, once: true };
    Tables { inputs: Some(inputs), outputs: None, curves: None, most: arguments.periods }
        .drive(&mut shadowed)?;
    Ok(vec![shadowed.shadow])
}

/// Runs a system, then replays each core alone, with its recorded inputs and a binary64 shadow.
fn measure_cores(arguments: &Accuracy, inputs: &Path, description: &Description) -> Result<Vec<Shadow>> {
    let mut run = SystemRun::new(description)?;
    run.observer = Observer::Recording(Recording::new(&mut run.system));
    Tables { inputs: Some(inputs), outputs: None, curves: None, most: arguments.periods }.drive(&mut run)?;
    let Observer::Recording(recording) = &run.observer else { return Ok(Vec::new()) };
    let measure = |(number, core): (usize, &Core)| -> Result<Shadow> {
        let Replay { mut emulator, mut inputs, end } = recording.replay(&run.system, number)?;
        let mut shadow = shadow(arguments, &core.program);
        while emulator.now() < end {
            if !shadow.run_period_with(&mut emulator, |emulator| inputs.set(emulator))? {
                break;
            }
        }
        Ok(shadow)
    };
    description.cores.iter().enumerate().map(measure).collect()
}

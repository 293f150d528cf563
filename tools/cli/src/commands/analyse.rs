// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt analyse`: cycle account of one period, bundle by bundle, and changes that would shorten it; for a system, the cycle
//! account of each core.

use crate::commands::accuracy::MeasurementReport;
use crate::run::application::{Application, refuse};
use crate::run::cache::CacheEntry;
use crate::run::fault;
use crate::run::load::Load;
use crate::run::loaded_program::LoadedProgram;
use crate::run::parameters::ParameterArguments;
use crate::run::ports;
use crate::run::system;
use crate::run::table_run::Tables;
use crate::terminal::files::{self, Out};
use crate::terminal::number;
use crate::terminal::options::{OptionalMachine, SourceArguments};
use crate::terminal::progress::DelayedProgress;
use anyhow::{Result, bail};
use clap::Args;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use takt_analysis::period::{MOST_PERIODS, PERIODS, PeriodRun, run_to_period};
use takt_analysis::picture::Picture;
use takt_analysis::what_if::{Candidate, faster_machines, what_if};
use takt_emu::Rows;
use takt_isa::{Machine, Program};

/// Show where the cycles of a period went: every bundle, every stall, the chain that sets the time.
///
/// For a system it shows the account of each core's cycles, over all its periods.
///
/// Runs the program and analyses its last period; a program without periods is analysed from reset to `halt`. Input ports
/// are 0 unless --inputs says otherwise.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Analyse {
    /// Source or image, `-` being standard input; or a system, a `.toml` file.
    file: PathBuf,
    #[command(flatten)]
    machine: OptionalMachine,
    #[command(flatten)]
    source: SourceArguments,
    /// CSV with one named column for each input port and one row for each period; `-` is standard input.
    #[arg(long, value_name = "CSV")]
    inputs: Option<PathBuf>,
    #[command(flatten)]
    parameters: ParameterArguments,
    /// Run N periods and analyse the last; 0 is what runs once [default: the rows of --inputs, else 2].
    #[arg(long, value_name = "N", value_parser = number::natural, allow_hyphen_values = true)]
    periods: Option<u64>,
    /// Show also what one cycle less would gain with the source assembled again for each faster machine, which takes as
    /// long as assembling it as often.
    #[arg(long)]
    reassemble: bool,
    /// Write the picture of the pipeline as a self-contained page for a browser; of a system, that of all cores and
    /// links in the last period of its slowest core. `-` is standard output.
    #[arg(long, value_name = "OUT")]
    html: Option<PathBuf>,
    /// Print the result as JSON.
    #[arg(long)]
    json: bool,
}

const EXAMPLES: &str = "\
Examples:
  takt analyse prog.s                     the second period: stalls, critical path, what a faster unit would bring
  takt analyse prog.s --reassemble        and what it would bring to the program assembled again for it
  takt analyse prog.s --html prog.html    the pipeline as a picture
  takt analyse prog.s --periods 0         what runs once
  takt analyse system.toml --inputs in.csv   each core's cycles, over all rows
  takt analyse system.toml --html all.html   all cores and links on one axis of time
  takt analyse prog.s --inputs in.csv     the last period of recorded inputs";

pub(crate) fn run(arguments: &Analyse, color: bool, out: &mut Out) -> Result<()> {
    let mut reads = vec![("FILE", arguments.file.as_path())];
    reads.extend(arguments.inputs.as_deref().map(|path| ("--inputs", path)));
    let mut writes: Vec<_> = arguments.html.as_deref().map(|path| ("--html", path)).into_iter().collect();
    if arguments.json {
        writes.push(("--json", Path::new("-")));
    }
    files::check(&reads, &writes)?;
    let mut application = Application::load(&arguments.file, &arguments.machine, &arguments.source, color)?;
    arguments.parameters.apply(&mut application)?;
    let system = match &application {
        Application::Program(loaded) => return of_program(arguments, loaded, color, out),
        Application::System(system) => system,
    };
    let once = arguments.periods == Some(0);
    refuse(&[
        ("--periods 0", once, "its cycles are counted from reset, with what runs once"),
        ("--reassemble", arguments.reassemble, "no faster units are tried for its cores"),
    ])?;
    let (inputs, html, name) =
        (arguments.inputs.as_deref(), arguments.html.as_deref(), files::input_name(&arguments.file));
    let tables = Tables { inputs, outputs: None, curves: None, most: arguments.periods };
    let analysed = system::analyse::analyse(&system.description, tables, html, &name);
    let (json, text) = analysed.map_err(|error| application.located_error(error, color))?;
    if arguments.json {
        files::json(&json, out)
    } else if html.is_some_and(files::is_dash) {
        Ok(())
    } else {
        Ok(out.write_all(&text)?)
    }
}

fn of_program(arguments: &Analyse, loaded: &LoadedProgram, color: bool, out: &mut Out) -> Result<()> {
    let load = Load::new(arguments.machine.machine, color).with(&arguments.source);
    let program = &loaded.program;
    let again = source_again(arguments)?;
    let rows = read_inputs(arguments, program)?;
    let name = files::input_name(&arguments.file);
    let followed = run_to_period(program, &rows, arguments.periods);
    let PeriodRun { trace, period, shadow } =
        followed.map_err(|error| fault::located_error(error.into(), loaded, color))?;
    let accuracy = Some(MeasurementReport::new(program, &shadow).json());
    let sources = loaded.sources.clone();
    let mut picture = Picture { accuracy, sources, ..Picture::new(program, name, period, trace) };
    let prints = !arguments.json && !arguments.html.as_deref().is_some_and(files::is_dash);
    // With --html, print only after the page is written, so that its errors come first.
    let is_early = prints && arguments.html.is_none();
    if is_early {
        // Print the account first: trying other machines takes far longer.
        out.write_all(picture.account().as_bytes())?;
        out.flush()?;
    }
    let run = |program: &Program| Some(run_to_period(program, &rows, arguments.periods).ok()?.trace);
    let faster = faster_machines(program, &picture.trace);
    let candidates = again.map(|source| candidates(arguments, &load, &source, &faster)).unwrap_or_default();
    let assembled = |machine: &'static Machine| candidates.get(&address(machine)).cloned();
    picture.faster = what_if(program, &picture.trace, &assembled, &run);
    if let Some(path) = &arguments.html {
        files::write(path, picture.html().as_bytes())?;
    }
    if arguments.json {
        let mut json = picture.json();
        json["spilled"] = loaded.spilled.clone().into();
        files::json(&json, out)?;
    } else if prints {
        let text = if is_early { picture.faster_units() } else { picture.text() };
        out.write_all(text.as_bytes())?;
        for line in &loaded.spilled {
            writeln!(out, "{line}")?;
        }
        let can_again = !files::is_live(&arguments.file) && Load::source(&arguments.file).is_ok();
        if can_again && !arguments.reassemble {
            writeln!(out, "--reassemble adds the cycles of the program assembled again for each of them")?;
        }
    }
    Ok(())
}

/// Reads the source text for --reassemble, if requested.
fn source_again(arguments: &Analyse) -> Result<Option<Vec<u8>>> {
    match arguments.reassemble {
        true if files::is_live(&arguments.file) => {
            bail!("--reassemble reads the source again: name its file")
        }
        true => Load::source(&arguments.file).map(Some),
        false => Ok(None),
    }
}

/// Assembles the program for other machines in parallel, with a progress bar.
fn candidates(
    arguments: &Analyse,
    load: &Load,
    source: &[u8],
    machines: &[&'static Machine],
) -> BTreeMap<usize, Candidate> {
    let bar = DelayedProgress::new(Some(machines.len() as u64), "machines with a faster unit tried");
    let candidate = |machine: &&'static Machine| {
        let load = Load { machine: Some(machine), ..load.clone() };
        let kept = load.assembled_program(&arguments.file, source.to_vec(), true).ok();
        bar.add(1);
        let CacheEntry { mut loaded, spare } = kept?;
        arguments.parameters.set(&mut loaded.program).ok()?;
        Some((address(machine), Candidate { program: loaded.program, spare }))
    };
    machines.par_iter().filter_map(candidate).collect()
}

/// Address of a machine, which identifies it.
fn address(machine: &'static Machine) -> usize {
    std::ptr::from_ref(machine).addr()
}

/// Reads the inputs up to the analysed period.
fn read_inputs(arguments: &Analyse, program: &Program) -> Result<Rows> {
    let wanted = arguments.periods;
    if let Some(wanted) = wanted.filter(|wanted| *wanted > MOST_PERIODS) {
        bail!("{wanted} periods: at most {MOST_PERIODS} are run to reach the selected period");
    }
    let path = arguments.inputs.as_deref();
    // The code before the first `wait` also reads the first period's inputs.
    let most = wanted.map(|wanted| wanted.max(1)).or(path.map(|_| MOST_PERIODS));
    let rows = ports::rows(path, most, PERIODS, &program.inputs)?;
    if let (Some(path), Some(wanted)) = (path, wanted)
        && (rows.len() as u64) < wanted
    {
        let plural = if rows.len() == 1 { "" } else { "s" };
        bail!("{} has {} row{plural}, so there is no such period", files::input_name(path), rows.len());
    }
    Ok(rows)
}

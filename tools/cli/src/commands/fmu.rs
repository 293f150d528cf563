// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt fmu`: writes a program as a functional mock-up unit.

use crate::run::load::{Load, is_system};
use crate::run::parameters::ParameterArguments;
use crate::terminal::files::{self, Out};
use crate::terminal::number::{self, Time};
use crate::terminal::options::{self, OptionalMachine, SourceArguments};
use crate::terminal::output::Failure;
use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};
use std::io::Write;
use std::path::{Path, PathBuf};
use takt_emu::LONGEST_TICK;
use takt_fmu::description::Fmi;
use takt_fmu::{Causality, Fmu, Model, Settings};

/// Write a program as an FMU, for simulators that speak FMI (co-simulation, Linux on x86-64).
///
/// A step is a period. Ports are variables with the ranges of the source (`.range`), parameters (`.param`) tunable ones; `cycles`, `missed`
/// and `flags` say how the period went. The emulator is inside of the FMU; neither Takt nor Python is needed to run it (docs/fmi.md).
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct ToFmu {
    /// Source or image, `-` being standard input.
    file: PathBuf,
    #[command(flatten)]
    machine: OptionalMachine,
    #[command(flatten)]
    source: SourceArguments,
    /// Write the FMU here.
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// Time from tick to tick, the FMU's step: `100us`, `0.1ms`, or a number of cycles.
    #[arg(long, value_name = "TIME", value_parser = number::time, allow_hyphen_values = true)]
    period: Time,
    /// Clock in MHz: a period that has no end before the next tick counts as missed.
    #[arg(long, value_name = "MHZ", default_value_t = options::PAPER_CLOCK, value_parser = number::clock, allow_hyphen_values = true)]
    clock: f64,
    /// Version of the standard.
    #[arg(long, value_enum, value_name = "VERSION", default_value_t = Version::Two)]
    fmi: Version,
    #[command(flatten)]
    parameters: ParameterArguments,
    /// Library to put into the FMU [default: `libtakt_fmu.so` beside `takt`, in `deps` there, or in `../lib/takt`].
    #[arg(long, value_name = "FILE")]
    library: Option<PathBuf>,
}

const EXAMPLES: &str = "\
Examples:
  takt fmu pi.s --period 1ms -o pi.fmu           FMI 2.0
  takt fmu foc.s --period 50us --fmi 3 -o foc.fmu
  takt fmu law.s --period 1ms --param kp=3 -o law.fmu   kp starts with 3
  fmpy validate pi.fmu                           check what was written, with FMPy";

#[derive(Clone, Copy, ValueEnum)]
enum Version {
    /// FMI 2.0.
    #[value(name = "2")]
    Two,
    /// FMI 3.0.
    #[value(name = "3")]
    Three,
}

/// File name of the library, as cargo writes it.
const LIBRARY: &str = "libtakt_fmu.so";

pub(crate) fn run(arguments: &ToFmu, color: bool, out: &mut Out) -> Result<()> {
    let ToFmu { file, output, parameters, library, .. } = arguments;
    let mut reads = vec![("FILE", file.as_path())];
    reads.extend(parameters.file.as_deref().map(|path| ("--params", path)));
    reads.extend(library.as_deref().map(|path| ("--library", path)));
    files::check(&reads, &[("--output", output.as_path())])?;
    if is_system(file) {
        return Err(Failure::Usage(
            "an FMU holds one program: write one for each core's program, and let the master connect them"
                .to_owned(),
        )
        .into());
    }
    let settings = arguments.settings()?;
    let mut loaded = Load::new(arguments.machine.machine, color).with(&arguments.source).with_source(file)?;
    parameters.set(&mut loaded.program)?;
    let model = Model::new(&loaded.program, settings)?;
    let fmi = match arguments.fmi {
        Version::Two => Fmi::Two,
        Version::Three => Fmi::Three,
    };
    let library = arguments.library()?;
    // A master shows the name; the model is what the file is called.
    let name = match file.file_stem() {
        Some(stem) if !files::is_dash(file) => stem.to_string_lossy().into_owned(),
        _ => "program".to_owned(),
    };
    let bytes = Fmu { model: &model, name: &name, fmi, library: &library }.to_bytes()?;
    files::write(output, &bytes)?;
    if files::is_dash(output) {
        return Ok(());
    }
    let count =
        |causality| model.variables().iter().filter(|variable| variable.causality == causality).count();
    let version = match fmi {
        Fmi::Two => "2.0",
        Fmi::Three => "3.0",
    };
    writeln!(
        out,
        "{}: FMI {version} for co-simulation, {} inputs, {} parameters, {} outputs, a step of {} s or {} cycles",
        output.display(),
        count(Causality::Input),
        count(Causality::Parameter),
        count(Causality::Output),
        settings.period,
        settings.tick
    )?;
    Ok(())
}

impl ToFmu {
    /// Period in seconds and in cycles.
    fn settings(&self) -> Result<Settings> {
        let hertz = self.clock * 1e6;
        let (period, cycles) = match self.period {
            Time::Cycles(cycles) => (number::shortest(cycles as f64 / hertz), cycles),
            // A tick between two cycles is seen in the second; the product's rounding error is less than a thousandth of a cycle.
            Time::Seconds(seconds) => {
                (number::shortest(seconds), (seconds * hertz - 1e-3).ceil().max(0.0) as u64)
            }
        };
        if cycles == 0 || cycles > LONGEST_TICK {
            return Err(Failure::Usage(format!(
                "--period: {cycles} cycles at {} MHz; a period has 1 to {LONGEST_TICK}",
                self.clock
            ))
            .into());
        }
        Ok(Settings { period, tick: cycles })
    }

    /// Bytes of the library.
    fn library(&self) -> Result<Vec<u8>> {
        if let Some(path) = &self.library {
            return std::fs::read(path).with_context(|| format!("cannot read --library {}", path.display()));
        }
        let program = std::env::current_exe().context("cannot find takt's own folder")?;
        // A link, as package managers make them, leads to the folder.
        let program = program.canonicalize().unwrap_or(program);
        let folder = program.parent().unwrap_or(Path::new("."));
        for place in [folder.to_owned(), folder.join("deps"), folder.join("../lib/takt")] {
            if let Ok(bytes) = std::fs::read(place.join(LIBRARY)) {
                return Ok(bytes);
            }
        }
        bail!(
            "the library of an FMU, {LIBRARY}, is not in {0}, {0}/deps or {0}/../lib/takt: `cargo build --release -p takt-fmu` in Takt's \
             sources makes target/release/{LIBRARY}; give it with --library",
            folder.display()
        )
    }
}

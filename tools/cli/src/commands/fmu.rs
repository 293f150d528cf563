// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt fmu`: writes a program as a functional mock-up unit.

#[cfg(unix)]
mod circuit;

use crate::run::application::{Application, refuse};
use crate::run::parameters::ParameterArguments;
use crate::terminal::files::{self, Out};
use crate::terminal::number::{self, Time};
use crate::terminal::options::{self, OptionalMachine, SourceArguments};
use crate::terminal::output::Failure;
use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};
use std::io::Write;
use std::path::{Path, PathBuf};
use takt_asm::units;
use takt_emu::LONGEST_TICK;
use takt_fmu::description::Fmi;
use takt_fmu::{Causality, Fmu, Library, Model, Settings};

/// Write a program or a system as an FMU, for simulators that speak FMI (co-simulation, x86-64).
///
/// A step is a period, of a system (a file whose name ends in `.toml`) a base tick. Ports are variables with the units and ranges of the
/// source (`.range`), parameters (`.param`) tunable ones; `cycles`, `missed` and `flags` say how the period went. The emulator is inside
/// of the FMU; neither Takt nor Python is needed to run it (docs/fmi.md).
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct ToFmu {
    /// Source or image, `-` being standard input, or a system.
    file: PathBuf,
    #[command(flatten)]
    machine: OptionalMachine,
    #[command(flatten)]
    source: SourceArguments,
    /// Write the FMU here.
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// Time from tick to tick, the FMU's step: `100us`, `0.1ms`, or a number of cycles [default: the constant `T` if its comment begins
    /// with `s`, or `FS` in `Hz`; of a system, the `tick` of its file].
    #[arg(long, value_name = "TIME", value_parser = number::time, allow_hyphen_values = true)]
    period: Option<Time>,
    /// Put the circuit of a board, simulated by Verilator, in place of the emulator: variables are the pins of the top level, a step is a
    /// period of the board, and the FMU's own host starts the program (Linux).
    #[arg(long, requires = "wiring")]
    circuit: bool,
    /// With --circuit: which peripherals are at which pins (docs/board.md).
    #[arg(long, value_name = "TOML", requires = "circuit")]
    wiring: Option<PathBuf>,
    /// With --circuit: a name from `takt board list`, or a file of the same form [default: the one that the wiring names].
    #[arg(long, value_name = "BOARD", requires = "circuit")]
    board: Option<String>,
    /// Clock in MHz: a period that has no end before the next tick counts as missed [default: 125; with --circuit that of the wiring].
    #[arg(long, value_name = "MHZ", value_parser = number::clock, allow_hyphen_values = true)]
    clock: Option<f64>,
    /// Version of the standard.
    #[arg(long, value_enum, value_name = "VERSION", default_value_t = Version::Two)]
    fmi: Version,
    #[command(flatten)]
    parameters: ParameterArguments,
    /// Library to put into the FMU, for Linux or for Windows; given twice, the FMU runs on both [default: `libtakt_fmu.so` and, if it is
    /// there, `takt_fmu.dll`, beside `takt`, in `deps` there, or in `../lib/takt`].
    #[arg(long, value_name = "FILE")]
    library: Vec<PathBuf>,
}

const EXAMPLES: &str = "\
Examples:
  takt fmu pi.s --period 1ms -o pi.fmu           FMI 2.0
  takt fmu foc.s --period 50us --fmi 3 -o foc.fmu
  takt fmu law.s --period 1ms --param kp=3 -o law.fmu   kp starts with 3
  takt fmu system.toml -o system.fmu             several cores, a step for each base tick
  takt fmu limit.s --circuit --wiring limit.toml -o board.fmu   the circuit of a board, with its pins
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

impl Version {
    fn number(self) -> &'static str {
        match self {
            Version::Two => "2.0",
            Version::Three => "3.0",
        }
    }
}

impl From<Version> for Fmi {
    fn from(version: Version) -> Fmi {
        match version {
            Version::Two => Fmi::Two,
            Version::Three => Fmi::Three,
        }
    }
}

/// Number of variables with a role.
fn count(model: &Model, causality: Causality) -> usize {
    model.variables().iter().filter(|variable| variable.causality == causality).count()
}

#[cfg(not(unix))]
mod circuit {
    pub(super) fn run(_: &super::ToFmu, _: bool, _: &mut super::Out) -> anyhow::Result<()> {
        anyhow::bail!("--circuit: an FMU with the circuit of a board is written on Linux, where it runs")
    }
}

/// File names of the libraries, as cargo writes them: for Linux, which is always there, and for Windows.
const LIBRARIES: [&str; 2] = ["libtakt_fmu.so", "takt_fmu.dll"];

pub(crate) fn run(arguments: &ToFmu, color: bool, out: &mut Out) -> Result<()> {
    let ToFmu { file, output, parameters, library, .. } = arguments;
    let mut reads = vec![("FILE", file.as_path())];
    reads.extend(parameters.file.as_deref().map(|path| ("--params", path)));
    reads.extend(library.iter().map(|path| ("--library", path.as_path())));
    reads.extend(arguments.wiring.as_deref().map(|path| ("--wiring", path)));
    files::check(&reads, &[("--output", output.as_path())])?;
    if arguments.circuit {
        return circuit::run(arguments, color, out);
    }
    let mut application = Application::load(file, &arguments.machine, &arguments.source, color)?;
    let settings = arguments.settings(&application)?;
    parameters.apply(&mut application)?;
    let model = match &application {
        Application::Program(loaded) => Model::new(&loaded.program, settings)?,
        Application::System(system) => Model::of_system(&system.description, settings)?,
    };
    let sources: Vec<_> = application.programs().iter().map(|program| program.sources.as_slice()).collect();
    let model = model.with_units(&sources);
    let fmi = arguments.fmi.into();
    let libraries = arguments.libraries()?;
    let bytes = Fmu { model: &model, name: &arguments.name(), fmi, libraries: &libraries }.to_bytes()?;
    files::write(output, &bytes)?;
    if files::is_dash(output) {
        return Ok(());
    }
    let platforms: Vec<&str> = libraries.iter().map(|library| library.platform().name()).collect();
    writeln!(
        out,
        "{}: FMI {} for co-simulation on {}, {} inputs, {} parameters, {} outputs, a step of {} s or {} cycles",
        output.display(),
        arguments.fmi.number(),
        platforms.join(" and "),
        count(&model, Causality::Input),
        count(&model, Causality::Parameter),
        count(&model, Causality::Output),
        settings.period,
        settings.tick
    )?;
    Ok(())
}

impl ToFmu {
    /// Period in seconds and in cycles.
    fn settings(&self, application: &Application) -> Result<Settings> {
        let clock = self.clock.unwrap_or(options::PAPER_CLOCK);
        let hertz = clock * 1e6;
        let time = match (application, self.period) {
            (Application::System(system), period) => {
                refuse(&[(
                    "--period",
                    period.is_some(),
                    "a step is its file's `tick`, in cycles at --clock",
                )])?;
                Time::Cycles(system.description.tick)
            }
            (Application::Program(_), Some(time)) => time,
            (Application::Program(loaded), None) => {
                let stated = units::sampling_period(&loaded.sources, &loaded.constants);
                let missing = || {
                    let mend = "`--period 100us`, or in the source `.const T = 100e-6 ; s`";
                    Failure::Usage(format!("--period is missing, and no constant states it: {mend}"))
                };
                Time::Seconds(stated.ok_or_else(missing)?)
            }
        };
        let (period, cycles) = match time {
            Time::Cycles(cycles) => (number::shortest(cycles as f64 / hertz), cycles),
            // A tick between two cycles is seen in the second; the product's rounding error is less than a thousandth of a cycle.
            Time::Seconds(seconds) => {
                (number::shortest(seconds), (seconds * hertz - 1e-3).ceil().max(0.0) as u64)
            }
        };
        if cycles == 0 || cycles > LONGEST_TICK {
            return Err(Failure::Usage(format!(
                "a period of {cycles} cycles at {} MHz; a period has 1 to {LONGEST_TICK}",
                clock
            ))
            .into());
        }
        Ok(Settings { period, tick: cycles })
    }

    /// Name that a master shows: that of the file without its ending.
    fn name(&self) -> String {
        match self.file.file_stem() {
            Some(stem) if !files::is_dash(&self.file) => stem.to_string_lossy().into_owned(),
            _ => "program".to_owned(),
        }
    }

    /// Libraries to put into the FMU.
    fn libraries(&self) -> Result<Vec<Library>> {
        let library =
            |path: &Path, bytes| Library::new(bytes).with_context(|| format!("--library {}", path.display()));
        if !self.library.is_empty() {
            let libraries = self.library.iter().map(|path| {
                let bytes = std::fs::read(path);
                library(path, bytes.with_context(|| format!("cannot read --library {}", path.display()))?)
            });
            return libraries.collect();
        }
        let program = std::env::current_exe().context("cannot find takt's own folder")?;
        // A link, as package managers make them, leads to the folder.
        let program = program.canonicalize().unwrap_or(program);
        let folder = program.parent().unwrap_or(Path::new("."));
        for place in [folder.to_owned(), folder.join("deps"), folder.join("../lib/takt")] {
            let [linux, windows] = LIBRARIES.map(|name| place.join(name));
            let Ok(bytes) = std::fs::read(&linux) else { continue };
            let mut libraries = vec![library(&linux, bytes)?];
            if let Ok(bytes) = std::fs::read(&windows) {
                libraries.push(library(&windows, bytes)?);
            }
            return Ok(libraries);
        }
        bail!(
            "the library of an FMU, {1}, is not in {0}, {0}/deps or {0}/../lib/takt: `cargo build --release -p takt-fmu` in Takt's \
             sources makes target/release/{1}; give it with --library",
            folder.display(),
            LIBRARIES[0]
        )
    }
}

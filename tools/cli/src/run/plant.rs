// SPDX-License-Identifier: MIT OR Apache-2.0
//! Plants that close a program's loop (`--plant`): the file, its connection to the ports, the length of a period.

use crate::run::load::is_system;
use crate::run::loaded_program::LoadedProgram;
use crate::terminal::files;
use crate::terminal::number;
use crate::terminal::output::Failure;
use anyhow::{Result, anyhow};
use clap::Args;
use std::path::{Path, PathBuf};
use takt_asm::units;
use takt_isa::Program;
use takt_programs::plants::file::{TEXT_BYTES, is_fmu};
use takt_programs::plants::{ClosedLoop, Interface, Plant, PlantFile};

/// Options of a plant.
#[derive(Args, Clone, Default)]
pub(crate) struct PlantArguments {
    /// Close the loop with a plant: a TOML file with a model and its numbers (docs/plant.md), or an FMU, which runs in a process of its own.
    /// Its signals belong to the ports of their names, or as the file maps them; --inputs gives the other ports.
    #[arg(long, value_name = "TOML|FMU")]
    pub(crate) plant: Option<PathBuf>,
    /// Connect a signal of the plant with a port of another name, in place of the file's map; may be given several times.
    #[arg(long, value_name = "SIGNAL=PORT", requires = "plant")]
    connect: Vec<String>,
    /// Length of a period for the plant: `50us` [default: the program's constant `T` in s, or `FS` in Hz, whose comment begins with the
    /// unit].
    #[arg(long, value_name = "TIME", requires = "plant", value_parser = number::seconds, allow_hyphen_values = true)]
    period: Option<f64>,
}

/// A program's loop that a plant closes.
pub(crate) type ProgramLoop = ClosedLoop<Box<dyn Plant>>;

impl PlantArguments {
    /// Path with its option, for [`files::check`].
    pub(crate) fn file(&self) -> Option<files::OptionPath<'_>> {
        self.plant.as_deref().map(|path| ("--plant", path))
    }

    /// Loop of a program, if there is a plant. `has_table`: a table gives the ports that the plant leaves.
    pub(crate) fn close(
        &self,
        loaded: &LoadedProgram,
        has_table: bool,
        color: bool,
    ) -> Result<Option<ProgramLoop>> {
        let Some(path) = &self.plant else { return Ok(None) };
        let file = read(path, color)?;
        let options = connections(&self.connect)?;
        let period = self.period.or_else(|| units::sampling_period(&loaded.sources, &loaded.constants));
        let period = period.ok_or_else(|| {
            Failure::Usage(
                "--plant needs the length of a period: give it with --period, as in `--period 1ms`, or in the source, as in `.const T = \
                 1e-3 ; s`"
                    .to_owned(),
            )
        })?;
        let (plant, interface) = open(&file, path, period, color)?;
        let program = &loaded.program;
        let connection = file.connect(&interface, &program.inputs, &program.outputs, &options);
        let connection = connection.map_err(|mistakes| Failure::Diagnostics(mistakes.render(color)))?;
        connection.complete(|_| has_table).map_err(Failure::Usage)?;
        Ok(Some(ClosedLoop::new(plant, interface, connection, period)))
    }
}

/// Plant in the folder `plant` beside a program that gives all of the program's input ports and takes its outputs.
pub(crate) fn beside(file: &Path, loaded: &LoadedProgram) -> Option<PathBuf> {
    let period = units::sampling_period(&loaded.sources, &loaded.constants)?;
    let entries = std::fs::read_dir(file.with_file_name("plant")).ok()?.flatten();
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(|path| is_system(path)).collect();
    paths.sort();
    paths.into_iter().find(|path| {
        let fits = || {
            let text = String::from_utf8(files::read(path, TEXT_BYTES).ok()?).ok()?;
            let plant = PlantFile::read(&files::input_name(path), &text).ok()?;
            let (_, interface) = plant.simulation(period).ok()?;
            let Program { inputs, outputs, .. } = &loaded.program;
            plant.connect(&interface, inputs, outputs, &[]).ok()?.complete(|_| false).ok()
        };
        fits().is_some()
    })
}

/// Signals and ports of --connect.
pub(crate) fn connections(texts: &[String]) -> Result<Vec<(String, String)>> {
    let mut options: Vec<(String, String)> = Vec::new();
    for text in texts {
        let Some((signal, port)) = text.split_once('=') else {
            return Err(
                Failure::Usage(format!("--connect {text}: expected SIGNAL=PORT, as in `w=speed`")).into()
            );
        };
        let (signal, port) = (signal.trim().to_owned(), port.trim().to_owned());
        if options.iter().any(|(known, _)| *known == signal) {
            return Err(Failure::Usage(format!("--connect connects `{signal}` twice")).into());
        }
        options.push((signal, port));
    }
    Ok(options)
}

/// Reads a plant's file, or takes an FMU by itself.
pub(crate) fn read(path: &Path, color: bool) -> Result<PlantFile> {
    let name = files::input_name(path);
    if is_fmu(path) {
        return Ok(PlantFile::of_fmu(&name));
    }
    if !is_system(path) {
        return Err(Failure::Usage(format!("--plant {name}: expected a file `….toml` or `….fmu`")).into());
    }
    let text = String::from_utf8(files::read(path, TEXT_BYTES)?).map_err(|error| {
        anyhow!("{name} is not text: byte {} is not UTF-8", error.utf8_error().valid_up_to())
    })?;
    PlantFile::read(&name, &text).map_err(|mistakes| Failure::Diagnostics(mistakes.render(color)).into())
}

/// The plant in motion, with its signals.
pub(crate) fn open(
    file: &PlantFile,
    path: &Path,
    period: f64,
    color: bool,
) -> Result<(Box<dyn Plant>, Interface)> {
    if file.fmu(path).is_some() {
        return open_fmu(file, path, period, color);
    }
    let (plant, interface) = file.simulation(period)?;
    Ok((Box::new(plant), interface))
}

/// Starts an FMU in a process of its own, which is this program with the command `fmu-process`.
#[cfg(all(unix, feature = "fmu"))]
fn open_fmu(file: &PlantFile, path: &Path, period: f64, color: bool) -> Result<(Box<dyn Plant>, Interface)> {
    use anyhow::Context;
    use takt_fmu_plant::{FmuError, FmuPlant};
    let program = std::env::current_exe().context("cannot find takt's own file")?;
    let mut command = std::process::Command::new(program);
    command.arg("fmu-process");
    let plant = FmuPlant::of_file(file, path, command, period).map_err(|error| match error {
        FmuError::Plant(mistakes) => Failure::Diagnostics(mistakes.render(color)).into(),
        error => anyhow::Error::from(error),
    })?;
    let interface = plant.interface();
    Ok((Box::new(plant), interface))
}

#[cfg(not(all(unix, feature = "fmu")))]
fn open_fmu(_: &PlantFile, path: &Path, _: f64, _: bool) -> Result<(Box<dyn Plant>, Interface)> {
    anyhow::bail!(
        "{}: this takt was built without FMUs; `cargo install --path tools/cli --all-features` builds it with them, for Linux and macOS",
        path.display()
    )
}

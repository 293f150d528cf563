// SPDX-License-Identifier: MIT OR Apache-2.0
//! Systems of several cores: their files, and the commands that support them.

pub(crate) mod analyse;
pub(crate) mod controller;
pub(crate) mod debug;
pub(crate) mod observers;
pub(crate) mod record;
pub(crate) mod report;
pub(crate) mod run;

use crate::run::fault;
use crate::run::load::{Load, in_folder};
use crate::run::loaded_program::LoadedProgram;
use crate::terminal::files;
use crate::terminal::options::SourceArguments;
use crate::terminal::output::{Failure, message};
use anyhow::{Result, anyhow};
use std::path::{Path, PathBuf};
use takt_asm::diag::Diagnostics;
use takt_asm::levels::Levels;
use takt_asm::nearest;
use takt_rtl::{Library, SystemDesign, export_system};
use takt_system::{Description, ProgramError, ReadError, Request, SystemFault, TEXT_BYTES, stale_reads};

/// A system with the programs of its cores and their debug information.
pub(crate) struct LoadedSystem {
    pub(crate) description: Description,
    pub(crate) programs: Vec<LoadedProgram>,
    /// Source files of the programs.
    pub(crate) files: Vec<PathBuf>,
}

/// Reads a system's file, and its programs by paths relative to that file.
pub(crate) fn load(path: &Path, source: &SourceArguments, color: bool) -> Result<LoadedSystem> {
    let name = files::input_name(path);
    let text = String::from_utf8(files::read(path, TEXT_BYTES)?).map_err(|error| {
        anyhow!("{name} is not text: byte {} is not UTF-8", error.utf8_error().valid_up_to())
    })?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let (mut programs, mut files) = (Vec::new(), Vec::new());
    let machines = |path: &str| takt_asm::machine::load(&folder.join(path));
    let read = takt_system::read_with(&name, &text, machines, |request: &Request<'_>| {
        let file = folder.join(request.path);
        if !file.is_file() {
            return Err(missing(request.path, &file));
        }
        let loaded = Load::new(request.machine, color).with(source).with_source(&file);
        let loaded = loaded.map_err(ProgramError::Invalid)?;
        let program = loaded.program.clone();
        programs.push(loaded);
        files.push(file);
        Ok(program)
    });
    match read {
        Ok(description) => {
            let system = LoadedSystem { description, programs, files };
            warn(&system, source, color)?;
            Ok(system)
        }
        Err(ReadError::Mistakes(mistakes)) => Err(Failure::Diagnostics(mistakes.render(color)).into()),
        Err(ReadError::Program(error)) => Err(error),
    }
}

/// Prints warnings about stale reads, in the form of the assembler's warnings.
fn warn(system: &LoadedSystem, source: &SourceArguments, color: bool) -> Result<()> {
    let levels: Levels = source.warnings.iter().copied().collect();
    let reads = stale_reads::stale_reads(&system.description);
    let told = reads.iter().filter_map(|read| {
        let LoadedProgram { sources, folder, .. } = &system.programs[read.core];
        let told = takt_debug::stale_reads::diagnose(read, &system.description, sources, &levels)?;
        Some(in_folder(folder, told))
    });
    let told: Vec<Diagnostics> = told.collect();
    let text: Vec<String> = told.iter().map(|diagnostics| diagnostics.render(color)).collect();
    match told.iter().any(Diagnostics::has_errors) {
        true => Err(Failure::Diagnostics(text.join("\n")).into()),
        false => {
            message(&text.join("\n"));
            Ok(())
        }
    }
}

fn missing(asked: &str, file: &Path) -> ProgramError<anyhow::Error> {
    let (message, mut help) = match file.is_dir() {
        true => (format!("{asked} is a folder, not a program"), None),
        false => (format!("there is no program {asked}"), None),
    };
    let folder =
        file.parent().map(|folder| if folder.as_os_str().is_empty() { Path::new(".") } else { folder });
    if let (Some(folder), Some(wanted)) = (folder, file.file_name()) {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        let names: Vec<String> =
            entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
        let near = nearest(&wanted.to_string_lossy(), names.iter().map(String::as_str));
        help = Some(match near {
            Some(near) => format!("did you mean `{}`?", Path::new(asked).with_file_name(near).display()),
            None => "programs are looked for beside the system's file".to_owned(),
        });
    }
    ProgramError::Missing { message, help }
}

/// A core's fault, with its source line.
pub(crate) fn located_fault(fault: &SystemFault, system: &LoadedSystem, color: bool) -> anyhow::Error {
    let note = format!("core {}", fault.name);
    Failure::Diagnostics(fault::rendered(&fault.fault, &system.programs[fault.core], &note, color)).into()
}

/// Circuit of a system; the top module is named after the file.
pub(crate) fn circuit(system: &LoadedSystem, file: &Path) -> Result<SystemDesign> {
    let name = file.file_stem().unwrap_or_default().to_string_lossy();
    Ok(export_system(&system.description, &name, &Library::builtin())?)
}

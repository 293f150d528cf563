// SPDX-License-Identifier: MIT OR Apache-2.0
//! Loads programs from files, by built-in names, or from standard input.

use crate::run::cache::{self, CacheEntry, First};
use crate::run::loaded_program::LoadedProgram;
use crate::terminal::files;
use crate::terminal::options::SourceArguments;
use crate::terminal::output::{Failure, message};
use crate::terminal::progress::DelayedActivity;
use anyhow::{Context, Result, bail};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use takt_asm::diag::Diagnostics;
use takt_asm::limits::IMAGE_BYTES;
use takt_asm::names::DebugInfo;
use takt_asm::plain::PlainProgram;
use takt_asm::{
    AssembledProgram, Contraction, FileLoader, Loader, MemoryLoader, Options, Schedule, Search, image,
};
use takt_isa::{MACHINES, Machine, Program};

/// Options for loading: presentation of diagnostics, and target machine.
#[derive(Clone)]
pub(crate) struct Load {
    /// Machine that the user specified.
    pub(crate) machine: Option<&'static Machine>,
    /// Messages on standard error are coloured.
    pub(crate) color: bool,
    /// Selection of the bundles to schedule.
    pub(crate) schedule: Schedule,
    /// Effort of the scheduler.
    pub(crate) effort: u32,
    /// Source options from the command line.
    pub(crate) source: SourceArguments,
}

/// The file describes a system instead of a program: in every command, its name ends in `.toml`.
pub(crate) fn is_system(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml"))
}

/// Folder of a file; empty for the working directory.
pub(crate) fn folder_of(path: &Path) -> PathBuf {
    path.parent().map_or(PathBuf::new(), Path::to_owned)
}

/// Diagnostics in which sources of a folder have paths that open them.
pub(crate) fn in_folder(folder: &Path, mut diagnostics: Diagnostics) -> Diagnostics {
    Arc::make_mut(&mut diagnostics.sources).rename(|name| {
        let path = folder.join(name);
        path.is_file().then(|| path.display().to_string())
    });
    diagnostics
}

/// Gives diagnostics of the program in a file the paths of [`in_folder`].
fn in_folder_of(path: &Path) -> impl Fn(Diagnostics) -> Diagnostics {
    let folder = folder_of(path);
    move |diagnostics| in_folder(&folder, diagnostics)
}

impl Load {
    /// Default options: the scheduler settings are those of the source.
    pub(crate) fn new(machine: impl Into<Option<&'static Machine>>, color: bool) -> Load {
        let Options { schedule, effort, .. } = Options::default();
        Load { machine: machine.into(), color, schedule, effort, source: SourceArguments::default() }
    }

    /// Adds source options from the command line.
    pub(crate) fn with(mut self, source: &SourceArguments) -> Load {
        self.source = source.clone();
        self
    }

    fn options(&self) -> Options {
        Options {
            machine: self.machine.unwrap_or(MACHINES[0]),
            schedule: self.schedule,
            contract: self.source.contract.into(),
            effort: self.effort,
            levels: self.source.warnings.iter().copied().collect(),
        }
    }

    /// Reads a program file.
    fn bytes(path: &Path) -> Result<Vec<u8>> {
        if is_system(path) {
            let name = files::input_name(path);
            bail!(
                "{name} is a system, but this command needs a single program; `takt run`, `bound`, `analyse`, `debug`, `rtl`, `cosim`, `board`, `live` and `load` accept systems"
            );
        }
        files::read(path, IMAGE_BYTES)
    }

    /// Reads a source file; an image is an error.
    pub(crate) fn source(path: &Path) -> Result<Vec<u8>> {
        let bytes = Load::bytes(path)?;
        if image::is_image(&bytes) {
            bail!("{} is an image already; `takt disasm` turns it into source", files::input_name(path));
        }
        Load::may_be_source(path, &bytes)?;
        Ok(bytes)
    }

    /// Rejects a file that is neither a source nor an image.
    fn may_be_source(path: &Path, bytes: &[u8]) -> Result<()> {
        match takt_asm::foreign(&files::input_name(path), bytes) {
            Some(why) => bail!("{why}"),
            None => Ok(()),
        }
    }

    /// Loads a program: from an image, or from a source, which is assembled.
    pub(crate) fn program(&self, path: &Path) -> Result<Program> {
        Ok(self.with_source(path)?.program)
    }

    /// Loads a program as [`Load::program`] does, with its source if available.
    pub(crate) fn with_source(&self, path: &Path) -> Result<LoadedProgram> {
        let bytes = Load::bytes(path)?;
        let name = files::input_name(path);
        let loaded = if image::is_image(&bytes) {
            let (program, debug) =
                image::read_with(&bytes).with_context(|| format!("{name} is not an image that can run"))?;
            let DebugInfo { sources, constants, names } = debug.unwrap_or_default();
            let folder = PathBuf::new();
            LoadedProgram { program, constants, sources, folder, names, spilled: Vec::new() }
        } else {
            Load::may_be_source(path, &bytes)?;
            let kept = self.assembled_program(path, bytes, false);
            let loaded = kept.map_err(|mistakes| Failure::Diagnostics(mistakes.render(self.color)))?.loaded;
            LoadedProgram { folder: folder_of(path), ..loaded }
        };
        let program = &loaded.program;
        self.is_for(program, &name)?;
        if program.bundles() == 0 {
            bail!("{name} has no instruction");
        }
        Ok(loaded)
    }

    /// Rejects a program for a machine other than the one that the user specified.
    fn is_for(&self, program: &Program, name: &str) -> Result<()> {
        match self.machine.filter(|machine| **machine != *program.machine) {
            Some(machine) => bail!("{name} is for {}, not for {}", program.machine.name, machine.name),
            None => Ok(()),
        }
    }

    /// Search path of sources: the project, the folders from the command line, and Takt's library.
    fn sources<L: Loader>(&self, project: L) -> Search<L> {
        let folders = self.source.folders.iter();
        folders.fold(Search::new(project), Search::folder).library(takt_programs::LIBRARY)
    }

    /// Name of a source file, and a loader for its folder. Includes are searched there first, then as in [`Load::sources`].
    fn project(path: &Path) -> (String, FileLoader) {
        let folder = Some(folder_of(path)).filter(|folder| !folder.as_os_str().is_empty());
        let loader = FileLoader::new(folder.unwrap_or(PathBuf::from(".")));
        let name = match path.file_name() {
            Some(name) if !files::is_dash(path) => name.to_string_lossy().into_owned(),
            _ => "<stdin>".to_owned(),
        };
        (name, loader)
    }

    /// Assembles a source read from a file.
    pub(crate) fn assemble(&self, path: &Path, bytes: Vec<u8>) -> Result<AssembledProgram, Diagnostics> {
        let (name, folder) = Load::project(path);
        let _waiting = DelayedActivity::new(format!("assembling {}", files::input_name(path)));
        let located = in_folder_of(path);
        let result = takt_asm::assemble_bytes(&name, bytes, &self.sources(folder), &self.options());
        let mut assembled = result.map_err(&located)?;
        assembled.warnings = located(assembled.warnings);
        Ok(assembled)
    }

    /// Assembles a source read from a file without scheduling; also returns the contractions.
    pub(crate) fn plain(
        &self,
        path: &Path,
        bytes: Vec<u8>,
    ) -> Result<(PlainProgram, Vec<Contraction>), Diagnostics> {
        let (name, folder) = Load::project(path);
        let loader = self.sources(First { name: name.clone(), bytes, others: folder });
        let plain = takt_asm::plain::plain(&name, &loader, &self.options()).map_err(in_folder_of(path))?;
        let checked = takt_asm::check(&name, &loader, &self.options());
        Ok((plain, checked.contractions().to_vec()))
    }

    /// Assembles a program for one of many machines, without messages.
    pub(crate) fn assemble_quietly(
        &self,
        path: &Path,
        bytes: Vec<u8>,
    ) -> Result<AssembledProgram, Diagnostics> {
        let (name, folder) = Load::project(path);
        takt_asm::assemble_bytes(&name, bytes, &self.sources(folder), &self.options())
            .map_err(in_folder_of(path))
    }

    /// Names and texts of all files that a program on a machine consists of.
    pub(crate) fn texts(&self, path: &Path, bytes: Vec<u8>) -> Vec<(String, String)> {
        let (name, others) = Load::project(path);
        let first = First { name: name.clone(), bytes, others };
        let checked = takt_asm::check(&name, &self.sources(first), &self.options());
        let files = checked.sources().files();
        files.iter().map(|file| (file.name.to_string(), file.text.to_string())).collect()
    }

    /// Assembles a program, or loads it from the cache. Shows warnings and progress unless `is_quiet`.
    pub(crate) fn assembled_program(
        &self,
        path: &Path,
        bytes: Vec<u8>,
        is_quiet: bool,
    ) -> Result<CacheEntry, Diagnostics> {
        let (name, others) = Load::project(path);
        let _waiting =
            (!is_quiet).then(|| DelayedActivity::new(format!("assembling {}", files::input_name(path))));
        let warn = |warnings: &Diagnostics| {
            if !is_quiet {
                message(&in_folder_of(path)(warnings.clone()).render(self.color));
            }
        };
        let first = First { name: name.clone(), bytes, others };
        cache::assembled(&name, &self.sources(first), &self.options(), warn).map_err(in_folder_of(path))
    }

    /// Assembles a built-in program.
    pub(crate) fn builtin(&self, path: &str) -> Result<LoadedProgram> {
        let loader = self.sources(MemoryLoader::new(takt_programs::SOURCES));
        let _waiting = DelayedActivity::new(format!("assembling {path}"));
        let warn = |warnings: &Diagnostics| message(&warnings.render(self.color));
        let kept = cache::assembled(path, &loader, &self.options(), warn);
        let loaded = kept.map_err(|mistakes| Failure::Diagnostics(mistakes.render(self.color)))?.loaded;
        self.is_for(&loaded.program, path)?;
        Ok(loaded)
    }

    /// Prints warnings to standard error, and converts errors.
    pub(crate) fn finish(&self, result: Result<AssembledProgram, Diagnostics>) -> Result<AssembledProgram> {
        match result {
            Ok(assembled) => {
                message(&assembled.warnings.render(self.color));
                self.is_for(&assembled.program, &assembled.sources.files()[0].name)?;
                Ok(assembled)
            }
            Err(diagnostics) => Err(Failure::Diagnostics(diagnostics.render(self.color)).into()),
        }
    }
}

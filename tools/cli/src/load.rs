// SPDX-License-Identifier: MIT OR Apache-2.0
//! From a file, a name or standard input to a program.

use crate::cache::{self, First, Kept};
use crate::files;
use crate::output::{Failure, message};
use crate::progress::Waiting;
use crate::select::SourceArguments;
use crate::spills::spilled;
use anyhow::{Context, Result, bail};
use std::path::{Path, PathBuf};
use takt_asm::diag::Diagnostics;
use takt_asm::expr::Value;
use takt_asm::limits::IMAGE_BYTES;
use takt_asm::names::{DebugInfo, Names};
use takt_asm::plain::Plain;
use takt_asm::{Assembled, FileLoader, Loader, MemoryLoader, Options, Schedule, Search, image};
use takt_isa::{MACHINES, Machine, Program};
use takt_verify::Hint;

/// Options of loading: how diagnostics are shown, and for which machine sources are assembled.
#[derive(Clone)]
pub(crate) struct Load {
    /// The machine that the user asked for.
    pub(crate) machine: Option<&'static Machine>,
    /// Colour on standard error.
    pub(crate) color: bool,
    /// Which bundles are scheduled.
    pub(crate) schedule: Schedule,
    /// The scheduler's effort.
    pub(crate) effort: u32,
    /// Other options of the command line about sources.
    pub(crate) source: SourceArguments,
}

/// A program and, if it was assembled here, what is known of its source.
pub(crate) struct Loaded {
    pub(crate) program: Program,
    /// Named constants.
    pub(crate) constants: Vec<(String, Value)>,
    /// Texts, by the names that the program has for them.
    pub(crate) sources: Vec<(String, String)>,
    /// The meaning of names.
    pub(crate) names: Names,
    /// The cost of spilled registers, by lines; an image has none.
    pub(crate) spilled: Vec<String>,
}

impl From<Assembled> for Loaded {
    fn from(assembled: Assembled) -> Loaded {
        let DebugInfo { sources, constants, names } = assembled.debug_info();
        let spilled = spilled(&assembled);
        Loaded { program: assembled.program, constants, sources, names, spilled }
    }
}

/// True if a file describes a system of several cores, and is no program: its name says so, for every command.
pub(crate) fn is_system(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml"))
}

impl Load {
    /// With the scheduler as the source says.
    pub(crate) fn new(machine: impl Into<Option<&'static Machine>>, color: bool) -> Load {
        let Options { schedule, effort, .. } = Options::default();
        Load { machine: machine.into(), color, schedule, effort, source: SourceArguments::default() }
    }

    /// With what the command line says about sources.
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

    /// The bytes of a program's file.
    fn bytes(path: &Path) -> Result<Vec<u8>> {
        if is_system(path) {
            let name = files::input_name(path);
            bail!(
                "{name} is a system, but this command needs a single program; `takt run`, `bound`, `analyse`, `debug`, `rtl`, `cosim`, `board`, `live` and `load` accept systems"
            );
        }
        files::read(path, IMAGE_BYTES)
    }

    /// The text of a source.
    pub(crate) fn source(path: &Path) -> Result<Vec<u8>> {
        let bytes = Load::bytes(path)?;
        if image::is_image(&bytes) {
            bail!("{} is an image already; `takt disasm` turns it into source", files::input_name(path));
        }
        Ok(bytes)
    }

    /// The program in a file that is to run or be shown: an image, or a source, which is assembled.
    pub(crate) fn program(&self, path: &Path) -> Result<Program> {
        Ok(self.with_source(path)?.program)
    }

    /// As [`Load::program`], with its source, if that is at hand.
    pub(crate) fn with_source(&self, path: &Path) -> Result<Loaded> {
        let bytes = Load::bytes(path)?;
        let name = files::input_name(path);
        let loaded = if image::is_image(&bytes) {
            let (program, debug) =
                image::read_with(&bytes).with_context(|| format!("{name} is not an image that can run"))?;
            let DebugInfo { sources, constants, names } = debug.unwrap_or_default();
            Loaded { program, constants, sources, names, spilled: Vec::new() }
        } else {
            let kept = self.kept(path, bytes, false);
            kept.map_err(|mistakes| Failure::Diagnostics(mistakes.render(self.color)))?.loaded
        };
        let program = &loaded.program;
        self.is_for(program, &name)?;
        if program.bundles() == 0 {
            bail!("{name} has no instruction");
        }
        Ok(loaded)
    }

    /// Refuses a program that is for another machine than the one that the user asked for.
    fn is_for(&self, program: &Program, name: &str) -> Result<()> {
        match self.machine.filter(|machine| **machine != *program.machine) {
            Some(machine) => bail!("{name} is for {}, not for {}", program.machine.name, machine.name),
            None => Ok(()),
        }
    }

    /// The search for a program's sources: its project, the folders of the command line, and Takt's library.
    fn sources<L: Loader>(&self, project: L) -> Search<L> {
        let folders = self.source.folders.iter();
        folders.fold(Search::new(project), Search::folder).library(takt_programs::LIBRARY)
    }

    /// The name and the folder of a source that was read from a file. What it includes is looked for in that folder, then as
    /// [`Load::sources`] says.
    fn project(path: &Path) -> (String, FileLoader) {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let loader = FileLoader::new(folder.map_or(PathBuf::from("."), Path::to_owned));
        let name = match path.file_name() {
            Some(name) if !files::is_dash(path) => name.to_string_lossy().into_owned(),
            _ => "<stdin>".to_owned(),
        };
        (name, loader)
    }

    /// Assembles a source that was read from a file.
    pub(crate) fn assemble(&self, path: &Path, bytes: Vec<u8>) -> Result<Assembled, Diagnostics> {
        let (name, folder) = Load::project(path);
        let _waiting = Waiting::new(format!("assembling {}", files::input_name(path)));
        takt_asm::assemble_bytes(&name, bytes, &self.sources(folder), &self.options())
    }

    /// The plain program of a source that was read from a file, and the products that the assembler fuses in it.
    pub(crate) fn plain(&self, path: &Path, bytes: Vec<u8>) -> Result<(Plain, Vec<Hint>), Diagnostics> {
        let (name, folder) = Load::project(path);
        let loader = self.sources(First { name: name.clone(), bytes, others: folder });
        let plain = takt_asm::plain::plain(&name, &loader, &self.options())?;
        let checked = takt_asm::check(&name, &loader, &self.options());
        Ok((plain, takt_verify::hints(checked.contractions(), checked.selections())))
    }

    /// The program assembled for one of many machines, without a word.
    pub(crate) fn assemble_quietly(&self, path: &Path, bytes: Vec<u8>) -> Result<Assembled, Diagnostics> {
        let (name, folder) = Load::project(path);
        takt_asm::assemble_bytes(&name, bytes, &self.sources(folder), &self.options())
    }

    /// All that the assembler reads of a program on a machine, name and text of each file.
    pub(crate) fn texts(&self, path: &Path, bytes: Vec<u8>) -> Vec<(String, String)> {
        let (name, others) = Load::project(path);
        let first = First { name: name.clone(), bytes, others };
        let checked = takt_asm::check(&name, &self.sources(first), &self.options());
        let files = checked.sources().files();
        files.iter().map(|file| (file.name.to_string(), file.text.to_string())).collect()
    }

    /// The program assembled, or what was kept of an earlier run. Unless it is quiet, warnings and waits are shown.
    pub(crate) fn kept(&self, path: &Path, bytes: Vec<u8>, is_quiet: bool) -> Result<Kept, Diagnostics> {
        let (name, others) = Load::project(path);
        let _waiting = (!is_quiet).then(|| Waiting::new(format!("assembling {}", files::input_name(path))));
        let warn = |warnings: &Diagnostics| {
            if !is_quiet {
                message(&warnings.render(self.color));
            }
        };
        let first = First { name: name.clone(), bytes, others };
        cache::assembled(&name, &self.sources(first), &self.options(), warn)
    }

    /// Assembles one of the programs that come with Takt.
    pub(crate) fn builtin(&self, path: &str) -> Result<Loaded> {
        let loader = self.sources(MemoryLoader::new(takt_programs::SOURCES));
        let _waiting = Waiting::new(format!("assembling {path}"));
        let warn = |warnings: &Diagnostics| message(&warnings.render(self.color));
        let kept = cache::assembled(path, &loader, &self.options(), warn);
        let loaded = kept.map_err(|mistakes| Failure::Diagnostics(mistakes.render(self.color)))?.loaded;
        self.is_for(&loaded.program, path)?;
        Ok(loaded)
    }

    /// Shows warnings on standard error; errors are the error.
    pub(crate) fn finish(&self, result: Result<Assembled, Diagnostics>) -> Result<Assembled> {
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

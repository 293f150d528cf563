// SPDX-License-Identifier: MIT OR Apache-2.0
//! Programs: loaded from a source or an image, and analysed without running them.

use pyo3::exceptions::PyValueError;
use pyo3::import_exception;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};
use takt_asm::diag::Diagnostics;
use takt_asm::levels::LevelSetting;
use takt_asm::limits::IMAGE_BYTES;
use takt_asm::names::{DebugInfo, NamedArray};
use takt_asm::{
    AssembledProgram, Contract, FileLoader, Options, Schedule, Search, disasm, image, listing, nearest,
};
use takt_board::Array;
use takt_cache::CacheLocation;
use takt_isa::fp::Flags;
use takt_isa::program::{Port, Space, Symbol};
use takt_isa::{MACHINES, Machine};

import_exception!(takt._errors, AssemblyError);
import_exception!(takt._errors, NoBoundError);

/// A program for a machine.
#[pyclass(frozen, module = "takt._takt")]
pub(crate) struct Program {
    pub(crate) program: Arc<takt_isa::Program>,
    /// Source texts, keyed by the program's file names.
    pub(crate) sources: Arc<Vec<(String, String)>>,
    /// Result of the assembler, if the program was assembled in this process.
    pub(crate) assembled: Option<AssembledProgram>,
    /// Messages of the assembler, if the program was pickled.
    kept: Option<PickledMessages>,
    /// Source and options from which the program was assembled.
    recipe: Option<Recipe>,
    /// Debug information, if the program comes from an image.
    debug: Option<DebugInfo>,
}

/// Default effort of the scheduler: about a second for a policy of a thousand operations, a quarter of the time that `takt asm` takes.
const EFFORT: u32 = 5;
/// Minimum assembly time for a program to be cached.
const SLOW: Duration = Duration::from_millis(100);
/// Maximum number of cached programs; the newest are kept.
const MOST: usize = 400;

/// Identification of this build, since another may assemble differently; `None` if it cannot be determined.
static BUILD: OnceLock<Option<String>> = OnceLock::new();

/// Version of the package. `file` is the path of the extension module.
#[pyfunction]
pub(crate) fn version(file: PathBuf) -> &'static str {
    let version = env!("CARGO_PKG_VERSION");
    BUILD.get_or_init(|| Some(format!("{version} {}", takt_cache::build(&file)?)));
    version
}

/// Messages of the assembler for a pickled program, which is not assembled again.
#[derive(Clone, FromPyObject, IntoPyObject)]
pub(crate) struct PickledMessages(String, Option<(String, String)>, Vec<(Option<String>, u32, u32)>);

/// A source, and the options for assembling it.
#[derive(Clone)]
struct Recipe {
    text: Vec<u8>,
    name: String,
    folder: PathBuf,
    include: Vec<PathBuf>,
    wishes: OptionTexts,
    options: Options,
}

/// Options as text: `schedule`, `contract`, `effort`, `warnings`.
#[derive(Clone, FromPyObject, IntoPyObject)]
pub(crate) struct OptionTexts(String, String, Option<u32>, Vec<String>);

/// A recipe in the form for pickling: text, name, folder, folders of includes, options.
pub(crate) type Words = (Vec<u8>, String, PathBuf, Vec<PathBuf>, OptionTexts);

impl Default for OptionTexts {
    fn default() -> OptionTexts {
        OptionTexts("source".to_owned(), "source".to_owned(), None, Vec::new())
    }
}

impl OptionTexts {
    fn options(&self, machine: &'static Machine) -> PyResult<Options> {
        let OptionTexts(schedule, contract, effort, warnings) = self;
        let wishes = warnings.iter().map(|wish| {
            wish.parse::<LevelSetting>()
                .map_err(|reason| PyValueError::new_err(format!("warnings: `{wish}`: {reason}")))
        });
        Ok(Options {
            machine,
            schedule: choice(
                "schedule",
                schedule,
                &[("source", Schedule::AsWritten), ("on", Schedule::All), ("off", Schedule::None)],
            )?,
            contract: choice(
                "contract",
                contract,
                &[("source", Contract::AsWritten), ("on", Contract::All), ("off", Contract::None)],
            )?,
            effort: effort.unwrap_or(EFFORT),
            levels: wishes.collect::<PyResult<Vec<_>>>()?.into_iter().collect(),
        })
    }
}

impl Recipe {
    fn of((text, name, folder, include, wishes): Words, machine: &'static Machine) -> PyResult<Recipe> {
        let options = wishes.options(machine)?;
        Ok(Recipe { text, name, folder, include, wishes, options })
    }

    fn words(&self) -> Words {
        let Recipe { text, name, folder, include, wishes, .. } = self.clone();
        (text, name, folder, include, wishes)
    }

    fn search(&self) -> Search<FileLoader> {
        let search = Search::new(FileLoader::new(&self.folder));
        self.include.iter().fold(search, Search::folder).library(takt_programs::LIBRARY)
    }

    fn assemble(&self) -> Result<AssembledProgram, Diagnostics> {
        takt_asm::assemble_bytes(&self.name, self.text.clone(), &self.search(), &self.options)
    }

    /// Assembles the program, or loads it from the user's cache. Programs that took long are cached, unless they have warnings, which
    /// must be shown each time.
    fn make(self) -> Result<PyResult<Program>, Diagnostics> {
        let checked = takt_asm::check_bytes(&self.name, self.text.clone(), &self.search(), &self.options);
        let key = BUILD.get().and_then(Option::as_ref).map(|build| checked.key(build, &self.options));
        let place = key.and_then(|key| CacheLocation::of("python", key));
        if let Some(place) = &place
            && checked.diagnostics().is_empty()
            && let Some(program) = Program::read(place, checked.machine(), &self)
        {
            return Ok(Ok(program));
        }
        let begin = Instant::now();
        let program = Program::assembled(checked.finish()?, self);
        if let (Some(place), Ok(program)) = (place, &program)
            && begin.elapsed() >= SLOW
            && program.warnings().is_none()
        {
            program.keep(&place);
        }
        Ok(program)
    }
}

/// Suffix `; did you mean …?` if a similar name exists.
pub(crate) fn suggest<'a>(name: &str, names: impl IntoIterator<Item = &'a str>) -> String {
    nearest(name, names).map_or(String::new(), |near| format!("; did you mean `{near}`?"))
}

pub(crate) fn machine(name: &str) -> PyResult<&'static Machine> {
    takt_asm::machine(name).map_err(PyValueError::new_err)
}

/// Parses one of several words.
fn choice<T: Copy>(what: &str, given: &str, choices: &[(&str, T)]) -> PyResult<T> {
    let found = choices.iter().find(|(name, _)| *name == given);
    found.map(|(_, value)| *value).ok_or_else(|| {
        let names: Vec<String> = choices.iter().map(|(name, _)| format!("'{name}'")).collect();
        let near = suggest(given, choices.iter().map(|(name, _)| *name));
        PyValueError::new_err(format!("{what} is '{given}'{near} (it is one of {})", names.join(", ")))
    })
}

/// Available machines: name and description.
#[pyfunction]
pub(crate) fn machines() -> Vec<(&'static str, &'static str)> {
    MACHINES.iter().map(|machine| (machine.name, machine.text)).collect()
}

/// Exception flags: bit and name.
#[pyfunction]
pub(crate) fn flag_names() -> Vec<(u8, &'static str)> {
    Flags::NAMES.iter().map(|(flag, name)| (flag.bits(), *name)).collect()
}

/// Maximum number of cycles between ticks.
#[pyfunction]
pub(crate) fn longest_tick() -> u64 {
    takt_emu::LONGEST_TICK
}

/// Name most similar to a misspelt one, if it is similar enough.
#[pyfunction]
#[pyo3(name = "nearest")]
pub(crate) fn nearest_name(name: &str, names: Vec<String>) -> Option<String> {
    nearest(name, names.iter().map(String::as_str))
}

/// Assembles a text. Included files are searched in `folder`, then in `include`, then in Takt's library.
#[pyfunction]
#[pyo3(signature = (text, name, folder, include, machine, schedule, contract, effort, warnings))]
#[allow(clippy::too_many_arguments)]
pub(crate) fn assemble(
    py: Python<'_>,
    text: Vec<u8>,
    name: &str,
    folder: PathBuf,
    include: Vec<PathBuf>,
    machine: &str,
    schedule: &str,
    contract: &str,
    effort: Option<u32>,
    warnings: Vec<String>,
) -> PyResult<Program> {
    let machine = self::machine(machine)?;
    let wishes = OptionTexts(schedule.to_owned(), contract.to_owned(), effort, warnings);
    let recipe = Recipe::of((text, name.to_owned(), folder, include, wishes), machine)?;
    if let Some(none) = recipe.include.iter().find(|folder| !folder.is_dir()) {
        return Err(PyValueError::new_err(format!("include: there is no folder {}", none.display())));
    }
    match py.detach(|| recipe.make()) {
        Ok(program) => program,
        Err(diagnostics) => Err(AssemblyError::new_err((diagnostics.render(false), diagnostics.to_json()))),
    }
}

/// Restores a pickled program from its image, its recipe, and the assembler's messages.
#[pyfunction]
pub(crate) fn restored_program(
    image: &[u8],
    recipe: Option<Words>,
    kept: Option<PickledMessages>,
) -> PyResult<Program> {
    let program = Program::from_image(image, Path::new("a pickled program"))?;
    let machine = program.program.machine;
    let recipe = recipe.map(|words| Recipe::of(words, machine)).transpose()?;
    Ok(Program { recipe, kept, ..program })
}

/// Loads a program from a file: an image, or a source, which is assembled for `machine`, or else for the default machine.
pub(crate) fn read_program(
    path: &Path,
    machine: Option<&'static Machine>,
    wishes: OptionTexts,
) -> PyResult<takt_isa::Program> {
    let text = std::fs::read(path).map_err(|error| named(path, error))?;
    if image::is_image(&text) {
        let program = Program::from_image(&text, path)?.program;
        return of_machine(path, Arc::unwrap_or_clone(program), machine);
    }
    may_be_source(path, &text)?;
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let folder = path.parent().map_or_else(PathBuf::new, Path::to_owned);
    let words = (text, name, folder, Vec::new(), wishes);
    let recipe = Recipe::of(words, machine.unwrap_or(MACHINES[0]))?;
    let made = recipe.make();
    let made = made.map_err(|diagnostics| {
        AssemblyError::new_err((diagnostics.render(false), diagnostics.to_json()))
    })??;
    of_machine(path, Arc::unwrap_or_clone(made.program), machine)
}

/// Checks that a program is for the requested machine.
fn of_machine(
    path: &Path,
    program: takt_isa::Program,
    machine: Option<&'static Machine>,
) -> PyResult<takt_isa::Program> {
    match machine.filter(|machine| **machine != *program.machine) {
        None => Ok(program),
        Some(machine) => Err(PyValueError::new_err(format!(
            "{} is for {}, not for {}",
            path.display(),
            program.machine.name,
            machine.name
        ))),
    }
}

/// Loads an image; for a source, returns `None` and the bytes of the file.
#[pyfunction]
pub(crate) fn load(path: PathBuf) -> PyResult<(Option<Program>, Py<PyBytes>)> {
    let about = std::fs::metadata(&path).map_err(|error| named(&path, error))?;
    if about.len() > IMAGE_BYTES as u64 {
        let text = format!("{} is larger than {} MiB", path.display(), IMAGE_BYTES >> 20);
        return Err(PyValueError::new_err(text));
    }
    let bytes = std::fs::read(&path).map_err(|error| named(&path, error))?;
    let program = image::is_image(&bytes).then(|| Program::from_image(&bytes, &path)).transpose()?;
    if program.is_none() {
        may_be_source(&path, &bytes)?;
    }
    Ok((program, Python::attach(|py| PyBytes::new(py, &bytes).unbind())))
}

/// Rejects a file that is neither a source nor an image.
fn may_be_source(path: &Path, bytes: &[u8]) -> PyResult<()> {
    takt_asm::foreign(&path.display().to_string(), bytes)
        .map_or(Ok(()), |why| Err(PyValueError::new_err(why)))
}

pub(crate) fn named(path: &Path, error: std::io::Error) -> PyErr {
    std::io::Error::new(error.kind(), format!("cannot read {}: {error}", path.display())).into()
}

/// Smallest and largest number of cycles.
type Pair = (u64, u64);

/// Name and type of each port; the type is `float`, `int` or `bits`.
fn ports(ports: &[Port]) -> Vec<(String, &'static str)> {
    ports.iter().map(|port| (port.name.clone(), port.ty.name())).collect()
}

impl Program {
    fn assembled(assembled: AssembledProgram, recipe: Recipe) -> PyResult<Program> {
        if assembled.program.bundles() == 0 {
            return Err(PyValueError::new_err("the program has no instruction"));
        }
        let sources = Arc::new(assembled.debug_info().sources);
        let program = Arc::new(assembled.program.clone());
        Ok(Program {
            program,
            sources,
            assembled: Some(assembled),
            kept: None,
            recipe: Some(recipe),
            debug: None,
        })
    }

    /// Assembles the same source for another machine; `None` for an image, or if the program does not fit.
    pub(crate) fn again(&self, machine: &'static Machine) -> Option<AssembledProgram> {
        let recipe = self.recipe.as_ref()?;
        Recipe { options: Options { machine, ..recipe.options }, ..recipe.clone() }.assemble().ok()
    }

    /// Loads a cached program, with the messages of the assembler.
    fn read(place: &CacheLocation, machine: &'static Machine, recipe: &Recipe) -> Option<Program> {
        let parts = place.read()?;
        let [known, image] = &parts[..] else { return None };
        let (listing, blocks) = serde_json::from_slice(known).ok()?;
        let program = Program::from_image(image, Path::new("a kept program")).ok()?;
        if *program.program.machine != *machine {
            return None;
        }
        Some(Program {
            kept: Some(PickledMessages(listing, None, blocks)),
            recipe: Some(recipe.clone()),
            ..program
        })
    }

    fn keep(&self, place: &CacheLocation) {
        if let (Ok(known), Ok(image)) = (serde_json::to_vec(&(self.listing(), self.blocks())), self.image()) {
            place.keep(&[&known, &image], MOST);
        }
    }

    /// Sources, constants and names; `None` of an image without them.
    pub(crate) fn debug_info(&self) -> Option<DebugInfo> {
        self.assembled.as_ref().map(AssembledProgram::debug_info).or_else(|| self.debug.clone())
    }

    /// Arrays that the source places in data memory.
    pub(crate) fn arrays(&self) -> Vec<Array> {
        let arrays = self.debug_info().map_or(Vec::new(), |debug| debug.names.arrays);
        arrays
            .into_iter()
            .map(|NamedArray { name, base, sizes, ty }| Array { name, base, sizes, ty })
            .collect()
    }

    fn from_image(bytes: &[u8], path: &Path) -> PyResult<Program> {
        let wrong = |why: String| PyValueError::new_err(format!("{}: {why}", path.display()));
        let (program, debug) = image::read_with(bytes)
            .map_err(|error| wrong(format!("this is not an image that can run: {error}")))?;
        if program.bundles() == 0 {
            return Err(wrong("it has no instruction".to_owned()));
        }
        let sources = Arc::new(debug.as_ref().map_or(Vec::new(), |debug| debug.sources.clone()));
        Ok(Program { program: Arc::new(program), sources, assembled: None, kept: None, recipe: None, debug })
    }
}

#[pymethods]
impl Program {
    /// Name of the machine.
    #[getter]
    fn machine(&self) -> &'static str {
        self.program.machine.name
    }

    /// Whether the program is for the named machine; the name may state memory depths in any order.
    fn is_for(&self, machine: &str) -> PyResult<bool> {
        Ok(self::machine(machine)? == self.program.machine)
    }

    /// Number of bundles in the program.
    #[getter]
    fn bundles(&self) -> u32 {
        self.program.bundles()
    }

    /// Whether the ports are latched.
    #[getter]
    fn latched(&self) -> bool {
        self.program.latched
    }

    /// Input ports: name and type.
    #[getter]
    fn inputs(&self) -> Vec<(String, &'static str)> {
        ports(&self.program.inputs)
    }

    /// Output ports: name and type.
    #[getter]
    fn outputs(&self) -> Vec<(String, &'static str)> {
        ports(&self.program.outputs)
    }

    /// Parameters: name, type, bits at the start, and the range of the source.
    #[getter]
    #[allow(clippy::type_complexity)]
    fn parameters(&self) -> Vec<(String, &'static str, u32, Option<(f64, f64)>)> {
        let parameter = |port: &Port| {
            let range = self.program.range(port.register).map(takt_isa::program::Range::ends);
            (port.name.clone(), port.ty.name(), self.program.initial(port.register).unwrap_or(0), range)
        };
        self.program.parameters.iter().map(parameter).collect()
    }

    /// The program with other values of parameters at the start, as bits.
    fn with_parameters(&self, settings: Vec<(String, u32)>) -> PyResult<Program> {
        let mut program = (*self.program).clone();
        for (name, bits) in settings {
            let set = program.set_parameter(&name, bits);
            set.map_err(|error| PyValueError::new_err(error.to_string()))?;
        }
        let mut assembled = self.assembled.clone();
        if let Some(assembled) = &mut assembled {
            assembled.program = program.clone();
        }
        Ok(Program {
            program: Arc::new(program),
            sources: Arc::clone(&self.sources),
            assembled,
            kept: self.kept.clone(),
            recipe: self.recipe.clone(),
            debug: self.debug.clone(),
        })
    }

    /// Address of an array in data memory.
    fn data_address(&self, name: &str) -> Option<usize> {
        let of = |symbol: &&Symbol| symbol.space == Space::Data && symbol.name == name;
        Some(self.program.symbols.iter().find(of)?.address as usize)
    }

    /// Source texts, by file.
    #[getter]
    fn sources(&self) -> Vec<(String, String)> {
        self.sources.to_vec()
    }

    /// Warnings of the assembler: rendered, and as JSON.
    #[getter]
    fn warnings(&self) -> Option<(String, String)> {
        if let Some(PickledMessages(_, warnings, _)) = &self.kept {
            return warnings.clone();
        }
        let warnings = &self.assembled.as_ref()?.warnings;
        (!warnings.is_empty()).then(|| (warnings.render(false), warnings.to_json()))
    }

    /// Program words beside the source lines that they come from; for an image, a source that assembles to it.
    fn listing(&self) -> String {
        match (&self.assembled, &self.kept) {
            (Some(assembled), _) => listing::listing(assembled),
            (None, Some(PickledMessages(listing, ..))) => listing.clone(),
            (None, None) => disasm::disassemble(&self.program),
        }
    }

    /// Image of the program, as `takt asm` writes it.
    pub(crate) fn image(&self) -> PyResult<Vec<u8>> {
        let image = image::write_with(&self.program, self.debug_info().as_ref());
        image.map_err(|error| PyValueError::new_err(format!("no image: {error}")))
    }

    /// Scheduled blocks: label, cycles, and lower bound.
    fn blocks(&self) -> Vec<(Option<String>, u32, u32)> {
        if let Some(PickledMessages(_, _, blocks)) = &self.kept {
            return blocks.clone();
        }
        let blocks = self.assembled.iter().flat_map(|assembled| &assembled.blocks);
        blocks.map(|block| (block.label.clone(), block.cycles, block.bound.cycles())).collect()
    }

    /// Best and worst case of each section: name, place, whether it runs once, and three pairs of cycles: after a long wait, with the
    /// tick in time, and after a missed deadline. Then the worst period.
    #[allow(clippy::type_complexity)]
    fn bound(
        &self,
        py: Python<'_>,
    ) -> PyResult<(Vec<(String, Option<String>, bool, Pair, Pair, Pair)>, Option<u64>)> {
        let program = &self.program;
        let bounds = py
            .detach(|| takt_analysis::bound(program))
            .map_err(|error| NoBoundError::new_err(format!("no bound: {error}")))?;
        let worst = bounds.worst_period();
        let pair = |span: takt_isa::timing::Span| (span.best, span.worst);
        let sections = bounds.sections.into_iter().map(|section| {
            let place = section.location.map(|location| program.place_text(location));
            let (plain, in_time, missed) = (section.cycles, section.in_time, section.missed);
            (section.name, place, section.once, pair(plain), pair(in_time), pair(missed))
        });
        Ok((sections.collect(), worst))
    }

    /// Reduces the program for `pickle`.
    #[allow(clippy::type_complexity)]
    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>, Option<Words>, Option<PickledMessages>))> {
        let made = || PickledMessages(self.listing(), self.warnings(), self.blocks());
        let kept = (self.assembled.is_some() || self.kept.is_some()).then(made);
        let image = PyBytes::new(py, &self.image()?);
        let recipe = self.recipe.as_ref().map(Recipe::words);
        Ok((py.import("takt._takt")?.getattr("restored_program")?, (image, recipe, kept)))
    }

    /// Returns the program itself: it is immutable.
    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}

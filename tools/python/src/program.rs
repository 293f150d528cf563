// SPDX-License-Identifier: MIT OR Apache-2.0
//! Programs: from a source or an image, and what is known of them without running them.

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

/// A program in the machine's memories.
#[pyclass(frozen, module = "takt._takt")]
pub(crate) struct Program {
    pub(crate) program: Arc<takt_isa::Program>,
    /// Texts, by the names that the program has for them.
    pub(crate) sources: Arc<Vec<(String, String)>>,
    /// The assembler's result, of one that was assembled here.
    pub(crate) assembled: Option<AssembledProgram>,
    /// The same of one that was pickled.
    kept: Option<PickledMessages>,
    /// The way it was assembled.
    recipe: Option<Recipe>,
    /// And of one from an image.
    debug: Option<DebugInfo>,
}

/// The scheduler's effort, unless given: about a second for a policy of a thousand operations, a quarter of what `takt asm` takes.
const EFFORT: u32 = 5;
/// Programs that are assembled faster are not kept.
const SLOW: Duration = Duration::from_millis(100);
/// Programs that are kept, the newest.
const MOST: usize = 400;

/// This build of the package, of which another one may assemble otherwise; `None` if it is not known.
static BUILD: OnceLock<Option<String>> = OnceLock::new();

/// The package's version. `file` is that of the extension module.
#[pyfunction]
pub(crate) fn version(file: PathBuf) -> &'static str {
    let version = env!("CARGO_PKG_VERSION");
    BUILD.get_or_init(|| Some(format!("{version} {}", takt_cache::build(&file)?)));
    version
}

/// The assembler's messages of a program, for one that comes from a pickle: there it is not assembled again.
#[derive(Clone, FromPyObject, IntoPyObject)]
pub(crate) struct PickledMessages(String, Option<(String, String)>, Vec<(Option<String>, u32, u32)>);

/// A source and the options that make a program of it.
#[derive(Clone)]
struct Recipe {
    text: Vec<u8>,
    name: String,
    folder: PathBuf,
    include: Vec<PathBuf>,
    wishes: OptionTexts,
    options: Options,
}

/// The options in words: `schedule`, `contract`, `effort`, `warnings`.
#[derive(Clone, FromPyObject, IntoPyObject)]
pub(crate) struct OptionTexts(String, String, Option<u32>, Vec<String>);

/// A recipe in words, for a pickle: text, name, folder, folders of includes, wishes.
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

    /// The program, from the user's cache if it was assembled before. Programs that took long are kept, without warnings: those are
    /// shown each time.
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

/// `; did you mean …?` if one of the names is near.
pub(crate) fn suggest<'a>(name: &str, names: impl IntoIterator<Item = &'a str>) -> String {
    nearest(name, names).map_or(String::new(), |near| format!("; did you mean `{near}`?"))
}

pub(crate) fn machine(name: &str) -> PyResult<&'static Machine> {
    takt_asm::machine(name).map_err(PyValueError::new_err)
}

/// One of a few words.
fn choice<T: Copy>(what: &str, given: &str, choices: &[(&str, T)]) -> PyResult<T> {
    let found = choices.iter().find(|(name, _)| *name == given);
    found.map(|(_, value)| *value).ok_or_else(|| {
        let names: Vec<String> = choices.iter().map(|(name, _)| format!("'{name}'")).collect();
        let near = suggest(given, choices.iter().map(|(name, _)| *name));
        PyValueError::new_err(format!("{what} is '{given}'{near} (it is one of {})", names.join(", ")))
    })
}

/// The machines: name and description.
#[pyfunction]
pub(crate) fn machines() -> Vec<(&'static str, &'static str)> {
    MACHINES.iter().map(|machine| (machine.name, machine.text)).collect()
}

/// The exception flags: bit and name.
#[pyfunction]
pub(crate) fn flag_names() -> Vec<(u8, &'static str)> {
    Flags::NAMES.iter().map(|(flag, name)| (flag.bits(), *name)).collect()
}

/// The longest time between ticks, cycles.
#[pyfunction]
pub(crate) fn longest_tick() -> u64 {
    takt_emu::LONGEST_TICK
}

/// The name most like a misspelt one, if one is near enough to be meant.
#[pyfunction]
#[pyo3(name = "nearest")]
pub(crate) fn nearest_name(name: &str, names: Vec<String>) -> Option<String> {
    nearest(name, names.iter().map(String::as_str))
}

/// Assembles a text. Included files are looked for in `folder`, then in `include`, then in Takt's library.
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

/// A program that was pickled, from its image, how it was assembled, and what is said of it.
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

/// The program in a file: an image, or a source, which is assembled for the machine, or the first of all.
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

/// A program that was read, if it is for the machine that was asked for.
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

/// The program in a file: an image, or `None` if that is a source, with its bytes.
#[pyfunction]
pub(crate) fn load(path: PathBuf) -> PyResult<(Option<Program>, Py<PyBytes>)> {
    let about = std::fs::metadata(&path).map_err(|error| named(&path, error))?;
    if about.len() > IMAGE_BYTES as u64 {
        let text = format!("{} is larger than {} MiB", path.display(), IMAGE_BYTES >> 20);
        return Err(PyValueError::new_err(text));
    }
    let bytes = std::fs::read(&path).map_err(|error| named(&path, error))?;
    let program = image::is_image(&bytes).then(|| Program::from_image(&bytes, &path)).transpose()?;
    Ok((program, Python::attach(|py| PyBytes::new(py, &bytes).unbind())))
}

pub(crate) fn named(path: &Path, error: std::io::Error) -> PyErr {
    std::io::Error::new(error.kind(), format!("cannot read {}: {error}", path.display())).into()
}

/// Cycles, from the fewest to the most.
type Pair = (u64, u64);

/// A port: name, and `float`, `int` or `bits`.
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

    /// The same source assembled for another machine; `None` of an image, and if it does not fit.
    pub(crate) fn again(&self, machine: &'static Machine) -> Option<AssembledProgram> {
        let recipe = self.recipe.as_ref()?;
        Recipe { options: Options { machine, ..recipe.options }, ..recipe.clone() }.assemble().ok()
    }

    /// The program that is kept at a place, and what the assembler said of it.
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

    /// The arrays of its source in data memory.
    pub(crate) fn arrays(&self) -> Vec<Array> {
        let debug = self.assembled.as_ref().map(AssembledProgram::debug_info).or_else(|| self.debug.clone());
        let arrays = debug.map_or(Vec::new(), |debug| debug.names.arrays);
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
    /// The machine's name.
    #[getter]
    fn machine(&self) -> &'static str {
        self.program.machine.name
    }

    /// True if it is for the machine of a name, which may state the depths of memories in any order.
    fn is_for(&self, machine: &str) -> PyResult<bool> {
        Ok(self::machine(machine)? == self.program.machine)
    }

    /// Bundles in the program.
    #[getter]
    fn bundles(&self) -> u32 {
        self.program.bundles()
    }

    /// True if its ports are latched.
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

    /// The address of an array in data memory.
    fn data_address(&self, name: &str) -> Option<usize> {
        let of = |symbol: &&Symbol| symbol.space == Space::Data && symbol.name == name;
        Some(self.program.symbols.iter().find(of)?.address as usize)
    }

    /// Texts, by file.
    #[getter]
    fn sources(&self) -> Vec<(String, String)> {
        self.sources.to_vec()
    }

    /// The assembler's warnings: rendered, and as JSON.
    #[getter]
    fn warnings(&self) -> Option<(String, String)> {
        if let Some(PickledMessages(_, warnings, _)) = &self.kept {
            return warnings.clone();
        }
        let warnings = &self.assembled.as_ref()?.warnings;
        (!warnings.is_empty()).then(|| (warnings.render(false), warnings.to_json()))
    }

    /// Words beside the source lines that they come from; of an image, source that assembles to it.
    fn listing(&self) -> String {
        match (&self.assembled, &self.kept) {
            (Some(assembled), _) => listing::listing(assembled),
            (None, Some(PickledMessages(listing, ..))) => listing.clone(),
            (None, None) => disasm::disassemble(&self.program),
        }
    }

    /// The image, as `takt asm` writes it.
    pub(crate) fn image(&self) -> PyResult<Vec<u8>> {
        let debug = self.assembled.as_ref().map(AssembledProgram::debug_info).or_else(|| self.debug.clone());
        let image = image::write_with(&self.program, debug.as_ref());
        image.map_err(|error| PyValueError::new_err(format!("no image: {error}")))
    }

    /// Of each block that the scheduler packed: label, cycles, and what no schedule can beat.
    fn blocks(&self) -> Vec<(Option<String>, u32, u32)> {
        if let Some(PickledMessages(_, _, blocks)) = &self.kept {
            return blocks.clone();
        }
        let blocks = self.assembled.iter().flat_map(|assembled| &assembled.blocks);
        blocks.map(|block| (block.label.clone(), block.cycles, block.bound.cycles())).collect()
    }

    /// The best and the worst of each section: name, place, whether it runs once, and cycles as a pair three times: after a
    /// long wait, with the tick in time, after a missed deadline. Then the worst period.
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

    /// For `pickle`: what makes the same program again.
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

    /// A copy: nothing changes a program, so that it is the same.
    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}

//! The assembler: Takt source to [`Program`], and a program to an image and back.
//!
//! ```
//! use takt_asm::{MemoryLoader, Options, assemble};
//!
//! let source = MemoryLoader::of("gain.s", ".input x\n.output y\n.period\nstart:\n    fadd y, x, x\n    wait start\n");
//! match assemble("gain.s", &source, &Options::default()) {
//!     Ok(assembled) => {
//!         assert_eq!(assembled.program.inputs[0].name, "x");
//!         let image = takt_asm::image::write(&assembled.program).expect("it fits the machine");
//!         assert_eq!(takt_asm::image::read(&image).expect("it was just written").code, assembled.program.code);
//!     }
//!     Err(mistakes) => panic!("{}", mistakes.render(false)),
//! }
//! ```
//!
//! The stages, each a folder:
//!
//! ```text
//! text ─ syntax ─ tree ─ expand ─ flat list ─ resolve ─ ir ─ check ─ homes ─ schedule ─ emit ─ Program ─ output
//! ```
//!
//! `syntax` reads a file; `expand` writes out macros, repetitions and includes, and declares; `resolve` gives every name its
//! meaning; `check` looks at the whole program (types, who writes what); `homes` finds each operation a slot and each value its place;
//! `schedule` packs bundles, and chooses anew among the slots that can take an operation;
//! `emit` places registers and makes words; `output` is what can be made of the result. `context` is what the stages before
//! `schedule` share, `report` how mistakes are told. A stage uses those before it, never one after it.
//!
//! `docs/language.md` is the contract of the language, `docs/image.md` that of the image. Nothing here prints, and nothing here
//! touches the file system but [`FileLoader`]. No input makes the assembler panic; [`limits`] bounds what it takes.

mod check;
mod context;
mod emit;
mod expand;
mod homes;
mod ir;
pub mod limits;
mod output;
mod report;
mod resolve;
pub mod schedule;
mod syntax;

use emit::place;
use homes::{copies, values};
use report::source::Sources;
use std::sync::Arc;
use takt_isa::{Machine, Program, T3};

pub use expand::load::{FileLoader, LoadError, Loader, MemoryLoader, Search};
pub use homes::{Adjustment, Made};
pub use output::{disasm, image, listing, names};
pub use report::diag::{Diagnostic, Diagnostics};
pub use report::levels::Levels;
pub use report::{diag, levels, source};
pub use syntax::{Expression, expr};

/// What the assembler is to do.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// The machine to assemble for.
    pub machine: &'static Machine,
    /// Which bundles the scheduler packs.
    pub schedule: Schedule,
    /// How long it searches; 0 is one pass.
    pub effort: u32,
    /// What becomes of warnings.
    pub levels: Levels,
}

/// Which bundles the scheduler packs.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Schedule {
    /// Those that the source says (`.schedule on`).
    #[default]
    AsWritten,
    /// All.
    All,
    /// None.
    None,
}

impl Default for Options {
    fn default() -> Options {
        Options {
            machine: &T3,
            schedule: Schedule::AsWritten,
            effort: schedule::DEFAULT_EFFORT,
            levels: Levels::default(),
        }
    }
}

/// An assembled program and what is known about it beyond its image.
#[derive(Clone, Debug)]
pub struct Assembled {
    /// The program.
    pub program: Program,
    /// Warnings; there are no errors.
    pub warnings: Diagnostics,
    /// The sources.
    pub sources: Arc<Sources>,
    /// Named constants and their values, in the order of the source.
    pub constants: Vec<(String, expr::Value)>,
    /// What became of each block that the scheduler packed, in order.
    pub blocks: Vec<schedule::BlockReport>,
    /// What is demanded of ports (`.deadline`, `.order`, `.late`) and how it is met.
    pub timing: Vec<schedule::TimingReport>,
    /// What was done about registers that operations of several slots write.
    pub adjustments: Vec<Adjustment>,
    /// Words that a macro, a repetition or the assembler itself made: indices into the program's code, ascending.
    pub expanded: Vec<u32>,
    /// What the source's names stand for, bundle by bundle.
    pub names: names::Names,
}

impl Assembled {
    /// What a debugger wants to know of the program: for [`image::write_with`].
    pub fn debug_info(&self) -> names::DebugInfo {
        let files = self.sources.files().iter();
        names::DebugInfo {
            sources: files.map(|file| (file.name.to_string(), file.text.to_string())).collect(),
            constants: self.constants.clone(),
            names: self.names.clone(),
        }
    }
}

/// Assembles a program whose first source is at hand, as from standard input or an editor; what it includes is loaded.
/// `name` is its path within the project.
///
/// # Errors
/// Every error of the program, and its warnings.
pub fn assemble_bytes(
    name: &str,
    bytes: Vec<u8>,
    loader: &dyn Loader,
    options: &Options,
) -> Result<Assembled, Diagnostics> {
    assemble(name, &expand::load::First { name, bytes, rest: loader }, options)
}

/// Assembles the program that begins with the source at `path`.
///
/// # Errors
/// Every error of the program, and its warnings.
pub fn assemble(path: &str, loader: &dyn Loader, options: &Options) -> Result<Assembled, Diagnostics> {
    let mut context = context::Context::new(options.machine);
    context.reports.sink.levels = options.levels;
    let (mut context, flat) = expand::Expander::new(context, loader).expand(path);
    let mut ir = resolve::resolve(&mut context, loader, flat);
    let packs = |scheduled| match options.schedule {
        Schedule::AsWritten => scheduled,
        Schedule::All => true,
        Schedule::None => false,
    };
    ir.bundles.iter_mut().for_each(|bundle| bundle.scheduled = packs(bundle.scheduled));
    check::types::check(&mut context, &ir);
    // Of a program that cannot fit nothing else is worth its time.
    if emit::is_too_long(&ir) {
        emit::limits(&ir, &mut context.reports.sink);
        return Err(context.reports.sink.finish(Arc::new(context.reports.sources)));
    }
    homes::slots::choose(&mut ir);
    let mut homes = homes::choose(&mut ir);
    let values = values::split(&mut ir, &mut homes);
    copies::insert(&mut ir, &mut homes, &values);
    check::check(&mut context, &ir, &homes);
    let mut sink = std::mem::take(&mut context.reports.sink);
    let sources = Arc::new(std::mem::take(&mut context.reports.sources));
    // What follows would only report what follows from the errors there are.
    if sink.errors > 0 {
        return Err(sink.finish(sources));
    }
    let schedule::Report { blocks, timing } = schedule::schedule(&mut ir, options.effort, &mut sink);
    if sink.errors > 0 {
        return Err(sink.finish(sources));
    }
    let adjustments = copies::report(&ir, homes);
    let placement = place::place(&ir, &mut sink);
    let emitted = emit::emit(&ir, &placement, &mut sink);
    let names = names::names(&context, &ir, &placement, &emitted);
    let report = sink.finish(Arc::clone(&sources));
    if report.has_errors() {
        return Err(report);
    }
    let constants = context
        .declared
        .constants
        .into_iter()
        .filter_map(|constant| Some((constant.name, constant.value?)))
        .collect();
    Ok(Assembled {
        program: emitted.program,
        warnings: report,
        sources,
        constants,
        blocks,
        timing,
        adjustments,
        expanded: emitted.expanded,
        names,
    })
}

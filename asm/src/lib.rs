//! The assembler: Takt source to [`Program`], and a program to an image and back.
//!
//! The stages, each a module:
//!
//! ```text
//! text ─ lex ─ tokens ─ parse ─ ast ─ expand ─ flat list ─ resolve ─ ir ─ homes ─ schedule ─ place ─ emit ─ Program ─ image
//! ```
//!
//! `docs/language.md` is the contract of the language, `docs/image.md` that of the image. Nothing here prints, and nothing here
//! touches the file system but [`load::FileLoader`]. No input makes the assembler panic; [`limits`] bounds what it takes.

mod address;
pub mod ast;
mod blocks;
mod check;
mod context;
mod copies;
mod declare;
pub mod diag;
pub mod disasm;
mod emit;
mod expand;
pub mod expr;
mod expression;
mod files;
mod flow;
mod grammar;
mod homes;
pub mod image;
pub mod intern;
pub mod ir;
pub mod levels;
mod lex;
pub mod limits;
pub mod listing;
pub mod load;
pub mod names;
mod operand;
pub mod parse;
pub mod place;
pub mod resolve;
pub mod schedule;
mod serialise;
pub mod source;
mod types;
mod unknown;
mod values;

use diag::Diagnostics;
use source::Sources;
use std::sync::Arc;
use takt_isa::{Machine, Program, T3};

pub use diag::Diagnostic;
pub use expression::Expression;
pub use homes::{Adjustment, Made};
pub use levels::Levels;
pub use load::{FileLoader, LoadError, Loader, MemoryLoader, Search};

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
    assemble(name, &load::First { name, bytes, rest: loader }, options)
}

/// Assembles the program that begins with the source at `path`.
///
/// # Errors
/// Every error of the program, and its warnings.
pub fn assemble(path: &str, loader: &dyn Loader, options: &Options) -> Result<Assembled, Diagnostics> {
    let mut context = context::Context::new(options.machine);
    context.sink.levels = options.levels;
    let (mut context, flat) = expand::Expander::new(context, loader).expand(path);
    let mut ir = resolve::resolve(&mut context, loader, flat);
    let packs = |scheduled| match options.schedule {
        Schedule::AsWritten => scheduled,
        Schedule::All => true,
        Schedule::None => false,
    };
    ir.bundles.iter_mut().for_each(|bundle| bundle.scheduled = packs(bundle.scheduled));
    types::check(&mut context, &ir);
    // Of a program that cannot fit nothing else is worth its time.
    if emit::is_too_long(&ir) {
        emit::limits(&ir, &mut context.sink);
        return Err(context.sink.finish(Arc::new(context.sources)));
    }
    let mut homes = homes::choose(&mut ir);
    let values = values::split(&mut ir, &mut homes);
    copies::insert(&mut ir, &mut homes, &values);
    check::check(&mut context, &ir, &homes);
    let mut sink = std::mem::take(&mut context.sink);
    let sources = Arc::new(std::mem::take(&mut context.sources));
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
    let constants =
        context.constants.into_iter().filter_map(|constant| Some((constant.name, constant.value?))).collect();
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

// SPDX-License-Identifier: MIT OR Apache-2.0
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
//! The stages, each a folder, the first a crate of its own:
//!
//! ```text
//! text ─ syntax ─ tree ─ expand ─ flat list ─ resolve ─ ir ─ check ─ contract ─ banks ─ schedule ─ emit ─ Program ─ output
//! ```
//!
//! `syntax` reads a file; `expand` writes out macros, repetitions and includes, and declares; `resolve` gives every name its
//! meaning; `check` looks at the whole program (types, who writes what); `contract` fuses products into sums; `banks` finds
//! each operation a slot and each value its place; `schedule` packs bundles, and chooses again among the slots that can take an operation;
//! `emit` places registers and makes words; `output` writes images, listings and source again. `context` is the state that the stages
//! before `schedule` share; diagnostics are a crate of their own. A stage uses those before it, never one after it.
//!
//! `docs/language.md` is the contract of the language, `docs/image.md` the contract of the image. Nothing here prints, and only
//! [`FileLoader`] touches the file system. No input makes the assembler panic; [`limits`] bounds what it takes.

mod banks;
mod capacity;
mod check;
mod context;
mod contract;
mod emit;
mod expand;
mod foreign;
pub mod index;
mod ir;
pub mod loops;
mod output;
pub mod plain;
mod resolve;
pub mod schedule;
pub mod select;
pub mod units;

use banks::{copies, webs};
use emit::{allocate, spill};
use std::sync::Arc;
use takt_diagnostics::Sources;
use takt_isa::{Machine, Program, T3};

pub use banks::{Adjustment, Transfer};
pub use contract::Contraction;
pub use emit::spill::{SpilledValue, Spills};
pub use expand::load::{EXTENSIONS, FileLoader, LoadError, Loader, MemoryLoader, Open, Search, is_source};
pub use foreign::foreign;
pub use output::{disasm, format, image, listing, names};
pub use takt_diagnostics::{Diagnostic, Diagnostics, Levels, diag, levels, machine, nearest, source};
pub use takt_syntax::ast::{Directive, Operator};
pub use takt_syntax::{Expression, expr, limits, read, tokens};

/// Options of the assembler.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// The machine to assemble for, unless the source names another (`.machine`).
    pub machine: &'static Machine,
    /// Selection of the bundles that the scheduler packs.
    pub schedule: Schedule,
    /// Selection of the products that are fused into sums.
    pub contract: Contract,
    /// The effort of the scheduler's search; 0 is one pass.
    pub effort: u32,
    /// The level of each warning.
    pub levels: Levels,
}

/// Selection of the bundles that the scheduler packs.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Schedule {
    /// Bundles under the source's `.schedule on`.
    #[default]
    AsWritten,
    /// All bundles, except idle ones in which a loop must end.
    All,
    /// No bundles: source order.
    None,
}

/// Selection of the products that are fused into the sums that alone use them, on machines with an operation for it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Contract {
    /// Products under the source's `.contract on`.
    #[default]
    AsWritten,
    /// All products that can be fused.
    All,
    /// No products: two roundings each.
    None,
}

impl Default for Options {
    fn default() -> Options {
        Options {
            machine: &T3,
            schedule: Schedule::AsWritten,
            contract: Contract::AsWritten,
            effort: schedule::DEFAULT_EFFORT,
            levels: Levels::default(),
        }
    }
}

/// An assembled program with its reports: everything beyond the image.
#[derive(Clone, Debug)]
pub struct AssembledProgram {
    /// The program, ready for an image.
    pub program: Program,
    /// Warnings; there are no errors.
    pub warnings: Diagnostics,
    /// Sources, the first file and its includes.
    pub sources: Arc<Sources>,
    /// Named constants and their values, in the order of the source.
    pub constants: Vec<(String, expr::Value)>,
    /// Real numbers that constants of the program stand for, where rounding to binary32 changes them.
    pub reals: Vec<f64>,
    /// A report of each block that the scheduler packed, in order.
    pub blocks: Vec<schedule::BlockReport>,
    /// Counted loops of the source with their final form, in order.
    pub counted_loops: Vec<loops::CountedLoop>,
    /// A report of each loop that was pipelined, in order.
    pub loops: Vec<schedule::LoopReport>,
    /// Innermost loops that were not pipelined, with the reasons.
    pub plain_loops: Vec<schedule::PlainLoop>,
    /// Branches that became selections, in order.
    pub selections: Vec<select::Selection>,
    /// Steps of all searches of the scheduler together, at most [`schedule::most_steps`].
    pub steps: u64,
    /// Timing demands on ports (`.deadline`, `.order`, `.late`) with the times that meet them.
    pub timing: Vec<schedule::TimingReport>,
    /// Products that were fused into sums (`.contract on`), in the order of the sums.
    pub contractions: Vec<Contraction>,
    /// Transfers of values to the home banks of their registers.
    pub adjustments: Vec<Adjustment>,
    /// The cost of high register pressure, by block.
    pub spills: Vec<Spills>,
    /// Words made by a macro, a repetition or the assembler itself: indices into the program's code, ascending.
    pub expanded: Vec<u32>,
    /// Bindings of the source's names, for debuggers, bundle by bundle.
    pub names: names::Names,
}

impl AssembledProgram {
    /// The debugging information of the program, for [`image::write_with`].
    pub fn debug_info(&self) -> names::DebugInfo {
        let files = self.sources.files().iter();
        names::DebugInfo {
            sources: files.map(|file| (file.name.to_string(), file.text.to_string())).collect(),
            constants: self.constants.clone(),
            names: self.names.clone(),
        }
    }
}

/// Assembles a program whose first source is given, for example from standard input or an editor; its includes are loaded.
/// `name` is its path within the project.
///
/// # Errors
/// Every error of the program, and its warnings.
pub fn assemble_bytes(
    name: &str,
    bytes: Vec<u8>,
    loader: &dyn Loader,
    options: &Options,
) -> Result<AssembledProgram, Diagnostics> {
    assemble(name, &expand::load::First::new(name, bytes, loader), options)
}

/// Assembles the program that begins with the source at `path`.
///
/// # Errors
/// Every error of the program, and its warnings.
pub fn assemble(path: &str, loader: &dyn Loader, options: &Options) -> Result<AssembledProgram, Diagnostics> {
    check_with(context::Context::new(options.machine), path, loader, options).finish()
}

/// Reads and checks a program whose first source is given, without scheduling it: fast enough for an editor after each keystroke.
pub fn check_bytes(name: &str, bytes: Vec<u8>, loader: &dyn Loader, options: &Options) -> CheckedProgram {
    check(name, &expand::load::First::new(name, bytes, loader), options)
}

/// A program that is read and checked, but not yet scheduled.
pub struct CheckedProgram {
    context: context::Context,
    ir: ir::Ir,
    /// The bank assignment and the contractions; `None` if the program cannot fit, which is reported.
    assignment: Option<(banks::BankAssignment, Vec<Contraction>)>,
    effort: u32,
    index: index::Index,
    counted_loops: Vec<loops::CountedLoop>,
    selections: Vec<select::Selection>,
    /// The program's straight runs, unless bundles were inserted or removed since they were found.
    runs: Option<Vec<ir::runs::Run>>,
}

/// Reads and checks the program that begins with the source at `path`, and indexes its names. [`CheckedProgram::finish`] does the rest.
pub fn check(path: &str, loader: &dyn Loader, options: &Options) -> CheckedProgram {
    let mut context = context::Context::new(options.machine);
    context.notes = Some(context::Notes::default());
    check_with(context, path, loader, options)
}

fn check_with(
    mut context: context::Context,
    path: &str,
    loader: &dyn Loader,
    options: &Options,
) -> CheckedProgram {
    context.reports.sink.levels = options.levels;
    let (mut context, flat) = expand::Expander::new(context, loader).expand(path);
    let counted_loops = expand::loops::reports(&context, &flat.loop_notes);
    let mut ir = resolve::resolve(&mut context, loader, flat);
    let index = index::index(&mut context, &ir);
    if options.schedule != Schedule::AsWritten {
        ir.scheduled = options.schedule == Schedule::All;
        for bundle in &mut ir.bundles {
            bundle.scheduled = options.schedule == Schedule::All && !bundle.holds_place();
        }
    }
    // A program with errors is not checked further.
    let mut runs = (context.reports.sink.errors == 0).then(|| ir::runs::runs(&ir));
    check::types::check(&mut context, &ir, runs.as_deref().unwrap_or_default());
    // If the program cannot fit, further checks are not worth their time.
    let mut selections = Vec::new();
    let assignment = if ir.is_too_long() {
        emit::limits(&ir, &mut context.reports.sink);
        None
    } else {
        let marked = std::mem::take(&mut ir.contracted);
        let contracted = contract::contract(&mut ir, |bundle| {
            marked.get(bundle).copied().flatten().is_some_and(|on| match options.contract {
                Contract::AsWritten => on,
                Contract::All => true,
                Contract::None => false,
            })
        });
        selections = select::select(&mut ir);
        banks::slots::assign(&mut ir);
        let mut assignment = banks::assign(&mut ir);
        assignment.quiet.extend(contracted.gone);
        let values = webs::split(&mut ir, &mut assignment);
        // Operations that fused operations or presets have replaced are removed.
        if !(values.is_empty() && contracted.contractions.is_empty() && assignment.adjustments.is_empty()) {
            copies::insert(&mut ir, &mut assignment, &values);
            runs = None;
        }
        runs = runs.filter(|_| selections.is_empty());
        check::check(&mut context, &ir, &assignment);
        Some((assignment, contracted.contractions))
    };
    let effort = options.effort;
    CheckedProgram { context, ir, assignment, effort, index, counted_loops, selections, runs }
}

impl CheckedProgram {
    /// Declarations and references of the program, for editors.
    pub fn index(&self) -> &index::Index {
        &self.index
    }

    /// The target machine: the source's (`.machine`), else the machine of the options.
    pub fn machine(&self) -> &'static Machine {
        self.ir.machine
    }

    /// The products that are fused into sums.
    pub fn contractions(&self) -> &[Contraction] {
        self.assignment.as_ref().map_or(&[], |(_, contractions)| contractions)
    }

    /// Sources read so far: the first file and its includes.
    pub fn sources(&self) -> &Sources {
        &self.context.reports.sources
    }

    /// Key for caching the assembled program: everything that the result depends on. `build` names this build of the assembler.
    pub fn key(&self, build: &str, options: &Options) -> Vec<u8> {
        let mut key = format!("{build}\n{options:?}\n{:?}\n", self.machine()).into_bytes();
        for source in self.sources().files() {
            key.extend_from_slice(format!("{} {}\n", source.name, source.text.len()).as_bytes());
            key.extend_from_slice(source.text.as_bytes());
        }
        key
    }

    /// The errors and warnings so far. [`CheckedProgram::finish`] repeats these, and adds further ones if there is no error.
    pub fn diagnostics(&self) -> Diagnostics {
        let reports = &self.context.reports;
        reports.sink.clone().finish(Arc::new(reports.sources.clone()))
    }

    /// Schedules and emits the program.
    ///
    /// # Errors
    /// Every error of the program, and its warnings.
    pub fn finish(self) -> Result<AssembledProgram, Diagnostics> {
        let CheckedProgram {
            mut context, mut ir, assignment, effort, counted_loops, selections, runs, ..
        } = self;
        let mut sink = std::mem::take(&mut context.reports.sink);
        let sources = Arc::new(std::mem::take(&mut context.reports.sources));
        // With errors, later stages would only report consequences of these.
        let Some((assignment, contractions)) = assignment.filter(|_| sink.errors == 0) else {
            return Err(sink.finish(sources));
        };
        // The trees are not needed any more: later stages get their memory.
        context.asts = Vec::new();
        // Another schedule may be tried if registers run out.
        let source = ir.scheduled.then(|| ir.clone());
        let mut budget = schedule::Budget::new(effort);
        let mut report = schedule::schedule(&mut ir, &mut budget, schedule::Order::Free, &mut sink);
        if sink.errors > 0 {
            return Err(sink.finish(sources));
        }
        spill::reduce_loops(&mut ir, &mut report, source.as_ref(), &mut budget);
        let (spills, why) = match spill::reduce_pressure(&mut ir, &mut report, source.as_ref(), &mut budget) {
            Ok(spills) => (spills, None),
            Err(why) => (Vec::new(), why),
        };
        drop(source);
        let schedule::Report { blocks, loops, plain_loops, timing } = report;
        // A program that is too long gets no register allocation.
        if ir.bundles.len() > ir.machine.most_bundles() as usize {
            emit::limits(&ir, &mut sink);
            return Err(sink.finish(sources));
        }
        let adjustments = copies::report(&ir, assignment);
        let runs = runs.filter(|_| blocks.is_empty()).unwrap_or_else(|| ir::runs::runs(&ir));
        let allocation = allocate::allocate(&ir, &runs, why.as_deref(), &mut sink);
        let mut emitted = emit::emit(&mut ir, &allocation, &mut sink);
        emitted.program.parts = names::parts(&sources, &emitted);
        output::origins::add(&sources, &mut emitted.program);
        let names = names::names(&mut context, &ir, &allocation, &mut emitted);
        let report = sink.finish(Arc::clone(&sources));
        if report.has_errors() {
            return Err(report);
        }
        let reals = context.declared.reals.iter().map(|bits| f64::from_bits(*bits)).collect();
        let constants = context
            .declared
            .constants
            .into_iter()
            .filter_map(|constant| Some((constant.name, constant.value?)))
            .collect();
        Ok(AssembledProgram {
            program: emitted.program,
            warnings: report,
            sources,
            constants,
            reals,
            blocks,
            loops,
            plain_loops,
            counted_loops,
            selections,
            steps: budget.taken(),
            timing,
            contractions,
            adjustments,
            spills,
            expanded: emitted.expanded,
            names,
        })
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Macros, repetitions, conditionals and includes: the source as one flat list of bundles, data and declarations.
//!
//! Statements are visited in the order in which they take effect. Declarations are executed at once; bundles and data, which
//! need every name to be known, are listed for [`resolve`](crate::resolve). The walk has a stack of its own, separate from the
//! thread's.

mod declare;
pub(crate) mod equation;
mod files;
pub(crate) mod load;
pub(crate) mod loops;
mod macros;
mod numbers;
mod slices;

pub(crate) use declare::{address, register_at};

use crate::context::{
    AstPlace, Binding, Context, ErrorReported, NamedConstant, Scope, ScopeId, ScopeKind, space_of,
};
use crate::expand::equation::{Piece, Step};
use crate::expand::files::FileId;
use crate::expand::load::{Loader, include_path};
use crate::expand::loops::{CountedLoop, ForDirective, LoopNote, Pass};
use crate::ir::{Label, LabelId, RegisterId};
use crate::limits;
use std::collections::{HashMap, HashSet};
use std::rc::Rc;
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::source::Span;
use takt_isa::Type;
use takt_isa::program::{Columns, Location};
use takt_syntax::ast::*;
use takt_syntax::name::NameId;

/// A bundle or an equation of the source, in its expansion.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Item {
    pub(crate) at: AstPlace,
    pub(crate) statement: u32,
    /// Part of the statement that the item stands for.
    pub(crate) part: Part,
    /// The `.loc` in force: an index into [`ExpandedSource::locs`].
    pub(crate) loc: u32,
    /// `.schedule on` is in force.
    pub(crate) scheduled: bool,
    /// `.contract on` is in force; `None` if a library file exempts its macros.
    pub(crate) contracted: Option<bool>,
    /// Transformations that `.fast` allows.
    pub(crate) fast: Fast,
}

/// A `.assume`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Assumption {
    pub(crate) at: AstPlace,
    pub(crate) directive: u32,
    pub(crate) section: Section,
    /// Number of items of the section before it.
    pub(crate) item: u32,
}

/// Part of a statement.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Part {
    /// The statement as a whole.
    All,
    /// A piece of an equation that uses macros: an index into [`ExpandedSource::pieces`].
    Piece(u32),
    /// The beginning of a `.for`'s loop: an index into [`ExpandedSource::loops`].
    Begin(u32),
    /// The end of a `.for`'s loop.
    End(u32),
}

/// A line, and the columns of the relevant part, unless that is the whole line.
pub(crate) type SourcePlace = (Location, Option<Columns>);

/// Transformations of equations that `.fast` allows although they change the rounding.
#[derive(Clone, Copy, Default, Debug)]
pub(crate) struct Fast {
    /// Sums and products may be reordered.
    pub(crate) reassociate: bool,
    /// A division by a constant may become a multiplication by its inverse.
    pub(crate) reciprocal: bool,
}

/// Words of data memory.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Data {
    /// A number of a type.
    Value(AstPlace, Expr, Type),
    /// Zeros: scope, place, number of words, and type.
    Space(AstPlace, Span, u32, Type),
}

/// A `.loop_bound` of the bundle that follows, by its number in its section.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LoopBound {
    pub(crate) section: Section,
    pub(crate) item: u32,
    pub(crate) most: u32,
    pub(crate) total: Option<u32>,
    pub(crate) at: AstPlace,
    pub(crate) span: Span,
}

/// A `.preset` directive, with its scope.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Preset {
    pub(crate) register: Operand,
    /// The register is a place: `@` precedes it.
    pub(crate) placed: bool,
    pub(crate) value: Expr,
    pub(crate) at: AstPlace,
    pub(crate) span: Span,
}

/// A `.param` directive, with its scope.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Parameters {
    pub(crate) at: AstPlace,
    pub(crate) directive: u32,
    /// First register that the directive declares; the other elements of an array follow it.
    pub(crate) first: RegisterId,
    /// Number of registers; 1 unless an array is declared.
    pub(crate) count: usize,
}

/// A `.deadline`, `.order` or `.late`: the directive, and the section that it applies to.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Timing {
    pub(crate) at: AstPlace,
    pub(crate) directive: u32,
    pub(crate) section: Section,
}

/// The source after expansion.
#[derive(Debug)]
pub(crate) struct ExpandedSource {
    pub(crate) once: Vec<Item>,
    pub(crate) period: Vec<Item>,
    pub(crate) pieces: Vec<Piece>,
    /// Counted loops, by [`LoopId`](crate::ir::arrays::LoopId).
    pub(crate) loops: Vec<CountedLoop>,
    /// Forms of the source's loops, for reports.
    pub(crate) loop_notes: Vec<LoopNote>,
    pub(crate) data: Vec<Data>,
    pub(crate) presets: Vec<Preset>,
    pub(crate) parameters: Vec<Parameters>,
    pub(crate) loop_bounds: Vec<LoopBound>,
    pub(crate) timing: Vec<Timing>,
    /// Assumptions, in the order of the expansion.
    pub(crate) assumptions: Vec<Assumption>,
    /// Each `.range` and `.result`: its scope, and the directive.
    pub(crate) ranges: Vec<(AstPlace, u32)>,
    /// The `.ports` directive: whether it says `latched`, and its place.
    pub(crate) ports: Option<(bool, Span)>,
    /// The lines of each `.loc`; the first stands for no `.loc`.
    pub(crate) locs: Vec<Vec<Option<SourcePlace>>>,
    /// Files that `.loc` names, in order, then files whose own lines are code.
    pub(crate) files: Vec<String>,
    file_numbers: HashMap<String, u32>,
}

impl ExpandedSource {
    /// The number of a file that code is attributed to.
    pub(crate) fn file(&mut self, name: &str) -> u32 {
        if let Some(known) = self.file_numbers.get(name) {
            return *known;
        }
        let number = self.files.len() as u32;
        self.files.push(name.to_owned());
        self.file_numbers.insert(name.to_owned(), number);
        number
    }
}

/// A list of statements being walked.
pub(crate) struct Frame {
    at: AstPlace,
    next: u32,
    end: u32,
    pub(crate) kind: FrameKind,
}

pub(crate) enum FrameKind {
    /// An equation that uses macros; its statement.
    Equation(Rc<[Step]>, u32),
    /// Index of a file, and the `.loc` that was in force where it is included.
    File(usize, u32),
    Macro,
    /// A repetition: name, current and last value of the counter, first statement, and enclosing scope.
    Rep {
        variable: NameId,
        value: i64,
        last: i64,
        start: u32,
        outer: ScopeId,
        site: Span,
    },
    /// A counted loop: index variable, passes, number of passes done, opening statement, first statement of the body, statement after
    /// the body, and enclosing scope.
    For {
        variable: NameId,
        passes: Rc<[Pass]>,
        pass: u32,
        opener: u32,
        start: u32,
        end: u32,
        outer: ScopeId,
        site: Span,
    },
}

pub(crate) struct Expander<'l> {
    pub(crate) context: Context,
    pub(crate) loader: &'l dyn Loader,
    pub(crate) flat: ExpandedSource,
    pub(crate) frames: Vec<Frame>,
    /// Counted loops at run time around the current statement, each with its place.
    pub(crate) nest: Vec<(u32, Span)>,
    pub(crate) section: Section,
    pub(crate) loc: u32,
    pub(crate) data_words: usize,
    statements: usize,
    /// Files read: the tree and the index in the sources.
    pub(crate) files: HashMap<FileId, (u32, usize)>,
    /// Identity of each source, by tree.
    pub(crate) origins: Vec<FileId>,
    /// Files of numbers that were read.
    tables: HashMap<FileId, Rc<numbers::Table>>,
    /// Bytes of all files read.
    pub(crate) bytes: usize,
    /// The following bundles are scheduled.
    scheduled: bool,
    /// Products in the following lines are fused into sums.
    contracted: bool,
    /// Trees of library files none of whose products are fused.
    uncontracted: HashSet<u32>,
    fast: Fast,
    pub(crate) include_depth: usize,
    pub(crate) includes: usize,
    macro_depth: usize,
    /// A limit is reached: expansion ends.
    stop: bool,
}

impl<'l> Expander<'l> {
    pub(crate) fn new(context: Context, loader: &'l dyn Loader) -> Expander<'l> {
        let flat = ExpandedSource {
            once: Vec::new(),
            period: Vec::new(),
            pieces: Vec::new(),
            loops: Vec::new(),
            loop_notes: Vec::new(),
            data: Vec::new(),
            presets: Vec::new(),
            parameters: Vec::new(),
            loop_bounds: Vec::new(),
            timing: Vec::new(),
            ranges: Vec::new(),
            assumptions: Vec::new(),
            ports: None,
            locs: vec![Vec::new()],
            files: Vec::new(),
            file_numbers: HashMap::new(),
        };
        Expander {
            context,
            loader,
            flat,
            frames: Vec::new(),
            nest: Vec::new(),
            section: Section::Once,
            loc: 0,
            scheduled: false,
            contracted: false,
            uncontracted: HashSet::new(),
            fast: Fast::default(),
            data_words: 0,
            statements: 0,
            files: HashMap::new(),
            origins: Vec::new(),
            tables: HashMap::new(),
            bytes: 0,
            include_depth: 0,
            includes: 0,
            macro_depth: 0,
            stop: false,
        }
    }

    /// Expands the program that begins with a file.
    pub(crate) fn expand(mut self, path: &str) -> (Context, ExpandedSource) {
        let Some(path) = include_path("", path) else {
            let message = format!("`{path}` does not name a file of the project");
            self.context.reports.sink.push(Diagnostic::placeless("load", message));
            return (self.context, self.flat);
        };
        match self.load(&FileId { place: None, path: path.clone() }) {
            Ok((ast, file)) => {
                // Reserve for the bundles of a program in one file: memory that is not written to costs nothing.
                let room = self.context.asts[ast as usize].operations.len();
                self.flat.once.reserve(room);
                self.flat.period.reserve(room);
                self.enter_file(ast, file);
            }
            Err(unread) => {
                let message = format!("`{path}` cannot be read: {unread}");
                self.context.reports.sink.push(Diagnostic::placeless("load", message));
            }
        }
        while let Some(frame) = self.frames.last_mut() {
            if self.stop {
                break;
            }
            if frame.next < frame.end {
                let (at, index) = (frame.at, frame.next);
                frame.next += 1;
                match &frame.kind {
                    FrameKind::Equation(steps, statement) => {
                        let (steps, statement) = (Rc::clone(steps), *statement);
                        self.step(at, statement, &steps[index as usize]);
                    }
                    _ => self.statement(at, index),
                }
            } else {
                self.leave();
            }
        }
        for LoopBound { section, item, at, span, .. } in self.flat.loop_bounds.clone() {
            if item as usize >= self.bundles(section) {
                self.context.error(at.scope, "loop", span, "no bundle follows that could head the loop");
            }
        }
        (self.context, self.flat)
    }

    pub(crate) fn enter_file(&mut self, ast: u32, file: usize) {
        let end = self.context.asts[ast as usize].statements.len() as u32;
        let at = AstPlace { ast, scope: ScopeId::ROOT };
        self.frames.push(Frame { at, next: 0, end, kind: FrameKind::File(file, self.loc) });
        self.loc = 0;
        self.include_depth += 1;
    }

    /// Ends a frame's statements: continues with the next turn, or leaves the frame.
    fn leave(&mut self) {
        if self.pass() {
            return;
        }
        let Some(frame) = self.frames.last_mut() else { return };
        match &mut frame.kind {
            FrameKind::Rep { variable, value, last, start, outer, site } if *value < *last => {
                *value += 1;
                frame.next = *start;
                let (variable, value, outer, site) = (*variable, *value, *outer, *site);
                let scope = self.context.scopes.open(outer, outer, ScopeKind::Rep(variable, value), site);
                if let Some(frame) = self.frames.last_mut() {
                    frame.at.scope = scope;
                }
                self.count(outer, site);
            }
            _ => match self.frames.pop().map(|frame| frame.kind) {
                Some(FrameKind::File(_, loc)) => {
                    self.loc = loc;
                    self.include_depth -= 1;
                }
                Some(FrameKind::Macro) => self.macro_depth -= 1,
                _ => {}
            },
        }
    }

    /// Counts a statement against the limit.
    #[inline]
    pub(crate) fn count(&mut self, scope: ScopeId, span: Span) {
        self.statements += 1;
        if self.statements > limits::STATEMENTS {
            self.limit(
                scope,
                span,
                format!("the program expands to more than {} statements", limits::STATEMENTS),
            );
        }
    }

    pub(crate) fn limit(&mut self, scope: ScopeId, span: Span, message: String) {
        self.context.error(scope, "limit", span, message);
        self.stop = true;
    }

    fn statement(&mut self, at: AstPlace, index: u32) {
        let ast = &self.context.asts[at.ast as usize];
        let Statement { label, kind, .. } = ast.statements[index as usize];
        self.statements += 1;
        if self.statements > limits::STATEMENTS {
            let span = self.frames.iter().find_map(|frame| match frame.kind {
                FrameKind::Rep { site, .. } | FrameKind::For { site, .. } => Some(site),
                FrameKind::Macro => Some(self.context.scopes.scope(frame.at.scope).site),
                FrameKind::File(..) | FrameKind::Equation(..) => None,
            });
            let message = format!("the program expands to more than {} statements", limits::STATEMENTS);
            self.limit(ScopeId::ROOT, span.unwrap_or_default(), message);
            return;
        }
        if let Some(label) = label {
            self.label(at, label);
        }
        match kind {
            StatementKind::Empty => {}
            StatementKind::Bundle(first, count) => self.bundle(at, index, first, count.into()),
            StatementKind::Equation(equation) => self.equation(at, index, equation),
            StatementKind::Directive(directive) => {
                let ast = Rc::clone(&self.context.asts[at.ast as usize]);
                self.context.again = self.is_again(at, &ast, &ast.directives[directive as usize]);
                // Errors have been reported; the walk goes on.
                let _ = self.directive(at, &ast, directive, index);
                self.context.again = false;
            }
        }
    }

    /// Number of bundles of a section so far.
    fn bundles(&self, section: Section) -> usize {
        match section {
            Section::Once => self.flat.once.len(),
            Section::Period => self.flat.period.len(),
            Section::Data => 0,
        }
    }

    /// An assumption about a value of the operations before it.
    fn assume(&mut self, at: AstPlace, directive: u32, span: Span) -> Result<(), ErrorReported> {
        let section = self.section;
        if section == Section::Data {
            let error = Diagnostic::error("section", span, "an assumption in `.data`");
            let error = error.help("write it behind the operation that computes the value");
            return Err(self.context.report(at.scope, error));
        }
        let item = self.bundles(section) as u32;
        self.flat.assumptions.push(Assumption { at, directive, section, item });
        Ok(())
    }

    fn loop_bound(
        &mut self,
        at: AstPlace,
        most: Expr,
        total: Option<&(Name, Expr)>,
        span: Span,
    ) -> Result<(), ErrorReported> {
        let turns = self.iterations(at, most)?;
        let total = match total {
            Some((name, value)) => {
                let id = self.context.spelled(at, name.name, name.span)?;
                let text = self.context.scopes.text(id).to_owned();
                if text != "total" {
                    let message = format!("`{text}` is not part of a `.loop_bound`");
                    let error = Diagnostic::error("loop", name.span, message)
                        .did_you_mean(takt_diagnostics::nearest(
                            &text,
                            Directive::LoopBound.options().iter().copied(),
                        ))
                        .note("`total m`, the most in one section, may follow the iterations");
                    return Err(self.context.report(at.scope, error));
                }
                Some(self.iterations(at, *value)?)
            }
            None => None,
        };
        let section = self.section;
        if section == Section::Data {
            return Err(self.context.error(at.scope, "section", span, "a loop in `.data`"));
        }
        let item = self.bundles(section) as u32;
        let mut before = self.flat.loop_bounds.iter();
        if let Some(first) = before.find(|bound| (bound.section, bound.item) == (section, item)) {
            let error = Diagnostic::error("declared-twice", span, "this bundle's loop has a bound already")
                .also(first.span, "here");
            return Err(self.context.report(at.scope, error));
        }
        self.flat.loop_bounds.push(LoopBound { section, item, most: turns, total, at, span });
        Ok(())
    }

    /// The value of a limit on a loop's iterations.
    fn iterations(&mut self, at: AstPlace, value: Expr) -> Result<u32, ErrorReported> {
        let number = self.context.integer(at, value)?;
        u32::try_from(number).ok().filter(|number| *number > 0).ok_or_else(|| {
            let message = format!("{number} iterations: a loop has 1 to {}", u32::MAX);
            self.context.error(at.scope, "range", value.span, message)
        })
    }

    fn label(&mut self, at: AstPlace, label: Name) {
        let Ok(name) = self.context.name(at, label.name, label.span) else { return };
        let position = match self.section {
            Section::Data => self.data_words,
            section => self.bundles(section),
        };
        let id = LabelId(self.context.declared.labels.len() as u32);
        let space = space_of(self.section);
        let binding = if self.section == Section::Data { Binding::Data(id) } else { Binding::Code(id) };
        // A label whose name is a template is unique through the template's values, and can be reached from everywhere.
        let Scope { owner, labels, .. } = *self.context.scopes.scope(at.scope);
        let is_local = self.section != Section::Data && label.name.resolve().is_ok();
        let scope = if is_local { labels } else { owner };
        if self.context.declare_in(scope, at, name, label.span, binding).is_ok() {
            let name = match is_local {
                true => self.context.scopes.label_name(at.scope, name),
                false => self.context.scopes.full_name(at.scope, name),
            };
            self.context.declared.labels.push(Label {
                name,
                space,
                position: position as u32,
                span: label.span,
            });
            self.context.declared.label_sections.push(self.section);
        }
    }

    fn bundle(&mut self, at: AstPlace, index: u32, first: u32, count: u32) {
        let ast = &self.context.asts[at.ast as usize];
        let operation = ast.operations[first as usize];
        if count == 1 {
            let Ok(name) = self.context.spelled(at, operation.mnemonic.name, operation.mnemonic.span) else {
                return;
            };
            // A macro cannot have an instruction's name.
            if name.op().is_none() && self.context.scopes.macros.contains_key(&name) {
                self.call(at, name, operation);
                return;
            }
        }
        self.push(at, index, Part::All, operation.span);
    }

    /// Adds a bundle, an equation or a piece of one to the section.
    pub(crate) fn push(&mut self, at: AstPlace, statement: u32, part: Part, span: Span) {
        let contracted = (!self.uncontracted.contains(&at.ast)).then_some(self.contracted);
        let items = match self.section {
            Section::Once => &mut self.flat.once,
            Section::Period => &mut self.flat.period,
            Section::Data => {
                let what = match self.context.asts[at.ast as usize].statements[statement as usize].kind {
                    StatementKind::Equation(_) => "an equation in `.data`",
                    StatementKind::Directive(_) => "a counted loop in `.data`",
                    _ => "an instruction in `.data`",
                };
                let error =
                    Diagnostic::error("section", span, what).help("open `.once` or `.period` before it");
                self.context.report(at.scope, error);
                return;
            }
        };
        let (loc, scheduled, fast) = (self.loc, self.scheduled, self.fast);
        items.push(Item { at, statement, part, loc, scheduled, contracted, fast });
        if self.flat.once.len() + self.flat.period.len() > limits::OPERATIONS {
            let message = format!("the program expands to more than {} bundles", limits::OPERATIONS);
            self.limit(at.scope, span, message);
        }
    }

    fn directive(
        &mut self,
        at: AstPlace,
        ast: &Rc<Ast>,
        directive: u32,
        index: u32,
    ) -> Result<(), ErrorReported> {
        let DirectiveLine { kind, span } = &ast.directives[directive as usize];
        let span = *span;
        match kind {
            DirectiveKind::Declare(what, names) => self.declare_all(at, ast, *what, names),
            DirectiveKind::Machine(machine, options) => self.machine(at, machine, options, index, span)?,
            DirectiveKind::Array(arrays, values) => {
                for (number, declaration) in (1..).zip(arrays) {
                    let (first, count) = declaration.sizes;
                    let sizes = &ast.sizes[first as usize..(first + count) as usize];
                    let values = if number == arrays.len() { Some(values) } else { None };
                    let _ = self.declare_table(at, declaration, sizes, values);
                }
            }
            DirectiveKind::Const(name, value) => self.constant(at, name, value)?,
            DirectiveKind::Param { declaration, .. } => {
                let first = RegisterId::new(self.context.declared.registers.len());
                self.declare_all(at, ast, DeclarationKind::Parameter, std::slice::from_ref(declaration));
                let count = self.context.declared.registers.len() - first.index();
                if count > 0 {
                    self.flat.parameters.push(Parameters { at, directive, first, count });
                }
            }
            DirectiveKind::Preset { register, placed, value } => {
                // Registers may be declared further down.
                let (register, placed, value) = (*register, *placed, *value);
                if !(self.context.again && self.flat.presets.iter().any(|preset| preset.span == span)) {
                    self.flat.presets.push(Preset { register, placed, value, at, span });
                }
            }
            DirectiveKind::Section(section) => self.section = *section,
            DirectiveKind::Float(values) => self.data(at, values, Type::F, span)?,
            DirectiveKind::Word(values) => self.data(at, values, Type::I, span)?,
            DirectiveKind::Space(words) => self.space(at, *words, span)?,
            DirectiveKind::Macro { name, parameters, end } => {
                self.jump(*end + 1);
                self.define(at, directive, *name, parameters, (index + 1, *end))?;
            }
            DirectiveKind::Rep { variable, first, last, end } => {
                self.jump(*end + 1);
                self.repeat(at, (*variable, *first, *last), (index + 1, *end), span)?;
            }
            DirectiveKind::For { variable, first, last, options, end } => {
                self.jump(*end + 1);
                let (variable, first, last) = (*variable, *first, *last);
                let body = (index + 1, *end);
                self.for_loop(at, ast, ForDirective { variable, first, last, options, body, span })?;
            }
            DirectiveKind::If(condition, next) => {
                // A condition with a mistake counts as true, so that a branch is read.
                if self.context.value(at, condition.id).is_ok_and(takt_syntax::expr::Value::is_zero) {
                    self.branch(at, ast, *next);
                }
            }
            // Reached from above: a branch was taken and ends here.
            DirectiveKind::Elif(_, _, end) | DirectiveKind::Else(end) => self.jump(*end + 1),
            DirectiveKind::End(_) => {}
            DirectiveKind::Broken(_, end) => self.jump(*end + 1),
            DirectiveKind::Include(path, library) => {
                let included = self.include(at, path, *library, span);
                // The file's declarations are unknown: errors about names would hide this one.
                self.context.reports.sink.is_partial |= included.is_err();
                included?;
            }
            DirectiveKind::Loc(places) => self.set_loc(at, places)?,
            DirectiveKind::Schedule(word) => self.scheduled = self.is_on(at, *word, "schedule")?,
            DirectiveKind::Contract(word) => match self.is_on(at, *word, "contract")? {
                // A file of the library decides for its own macros, wherever they are used.
                false if self.is_in_library(at.ast) => {
                    self.uncontracted.insert(at.ast);
                }
                on => self.contracted = on,
            },
            DirectiveKind::Fast(words) => self.fast = self.allowed(at, words)?,
            DirectiveKind::Ports(word) => self.ports(at, *word)?,
            DirectiveKind::LoopBound(most, total) => self.loop_bound(at, *most, total.as_ref(), span)?,
            // Registers may be declared further down.
            DirectiveKind::Range { .. } | DirectiveKind::Result(_) => {
                let is_same = |(before, other): &(AstPlace, u32)| (before.ast, *other) == (at.ast, directive);
                if !(self.context.again && self.flat.ranges.iter().any(is_same)) {
                    self.flat.ranges.push((at, directive));
                }
            }
            DirectiveKind::Assume { .. } => self.assume(at, directive, span)?,
            DirectiveKind::Deadline(..) | DirectiveKind::Order(_) | DirectiveKind::Late(..) => {
                self.demand(at, directive, span)?;
            }
            DirectiveKind::Error(text) => {
                return Err(self.context.report(at.scope, Diagnostic::error("user", span, text.clone())));
            }
        }
        Ok(())
    }

    /// Declares registers, ports, or arrays of them.
    fn declare_all(&mut self, at: AstPlace, ast: &Ast, what: DeclarationKind, names: &[Declaration]) {
        for declaration in names {
            let (first, count) = declaration.sizes;
            if count > 0 {
                let sizes = &ast.sizes[first as usize..(first + count) as usize];
                let _ = self.declare_array(at, what, declaration, sizes);
                continue;
            }
            // Each name is a declaration of its own: a mistake in one leaves the others.
            let _ = self.declare(at, what, declaration);
        }
    }

    /// Keeps a demand on ports for its section.
    fn demand(&mut self, at: AstPlace, directive: u32, span: Span) -> Result<(), ErrorReported> {
        if self.section == Section::Data {
            let error = Diagnostic::error("section", span, "ports are not read or written in `.data`")
                .help("open `.once` or `.period` before it");
            return Err(self.context.report(at.scope, error));
        }
        let is_same = |other: &Timing| (other.at.ast, other.directive) == (at.ast, directive);
        if !(self.context.again && self.flat.timing.iter().any(is_same)) {
            self.flat.timing.push(Timing { at, directive, section: self.section });
        }
        Ok(())
    }

    /// Declares a constant.
    fn constant(&mut self, at: AstPlace, name: &Name, value: &Expr) -> Result<(), ErrorReported> {
        let id = self.context.name(at, name.name, name.span)?;
        let value = self.context.value(at, value.id).ok();
        let number = self.context.declared.constants.len() as u32;
        self.context.declare(at, id, name.span, Binding::Constant(number))?;
        let text = self.context.scopes.full_name(at.scope, id);
        let watched = self.include_depth == 1 && at.scope == ScopeId::ROOT;
        self.context.declared.constants.push(NamedConstant {
            name: text,
            value,
            span: name.span,
            used: false,
            watched,
        });
        Ok(())
    }

    /// Reserves words of data memory (`.space`).
    fn space(&mut self, at: AstPlace, words: Expr, span: Span) -> Result<(), ErrorReported> {
        self.data_section(at, span)?;
        let count = self.context.integer(at, words)?;
        if !(0..=limits::DATA_WORDS as i64).contains(&count) {
            let message = format!("{count} words of space: it is 0 to {}", limits::DATA_WORDS);
            return Err(self.context.error(at.scope, "limit", words.span, message));
        }
        self.data_words += count as usize;
        self.flat.data.push(Data::Space(at, words.span, count as u32, Type::B));
        self.check_data(at, span);
        Ok(())
    }

    /// Enters a repetition, whose variable and bounds are given, and the statements of its body.
    fn repeat(
        &mut self,
        at: AstPlace,
        (variable, first, last): (Name, Expr, Expr),
        (start, end): (u32, u32),
        span: Span,
    ) -> Result<(), ErrorReported> {
        let variable = self.context.spelled(at, variable.name, variable.span)?;
        let from = self.context.integer(at, first)?;
        let to = self.context.integer(at, last)?;
        if to.saturating_sub(from) >= limits::REPETITIONS {
            let message = format!(
                "{} repetitions: more than the {} that the assembler makes",
                i128::from(to) - i128::from(from) + 1,
                limits::REPETITIONS
            );
            return Err(self.context.error(at.scope, "limit", first.span.to(last.span), message));
        }
        if from <= to {
            let scope = self.context.scopes.open(at.scope, at.scope, ScopeKind::Rep(variable, from), span);
            let kind = FrameKind::Rep { variable, value: from, last: to, start, outer: at.scope, site: span };
            self.frames.push(Frame { at: AstPlace { scope, ..at }, next: start, end, kind });
        }
        Ok(())
    }

    /// Continues the current frame at a statement.
    fn jump(&mut self, to: u32) {
        if let Some(frame) = self.frames.last_mut() {
            frame.next = to.min(frame.end);
        }
    }

    /// Continues with the branch of an `.if` that is taken, beginning at the candidate `next`.
    fn branch(&mut self, at: AstPlace, ast: &Ast, mut next: u32) {
        while let Some(StatementKind::Directive(directive)) =
            ast.statements.get(next as usize).map(|statement| statement.kind)
            && let DirectiveKind::Elif(condition, after, _) = &ast.directives[directive as usize].kind
            && self.context.value(at, condition.id).is_ok_and(takt_syntax::expr::Value::is_zero)
        {
            next = *after;
        }
        self.jump(next + 1);
    }
}

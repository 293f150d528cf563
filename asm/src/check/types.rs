// SPDX-License-Identifier: MIT OR Apache-2.0
//! Type check: an abstract interpretation that warns of an operand whose value is certainly of another type than the operation reads.
//!
//! The instruction table gives every operand a type. A value has the type of the result that wrote it, of its declaration (ports, states,
//! registers with a type or a preset), of its literal, or of its table in data memory; an operation that takes any bits passes the type
//! on. Types of other registers are followed through each straight run; where runs meet, a register has the type of all that is written
//! to it, or none. A value that may be of either type is not reported: every warning is about a value that is certainly of the other
//! type.

use crate::check::{dest_span, source_span, text};
use crate::context::{Context, ScopeId, words};
use crate::ir::runs::Run;
use crate::ir::type_evidence::{self, GivenTypes, Kind, OperandPosition, TypeEvidence, TypeOrigin};
use crate::ir::{Ir, LabelId, Operation, RegisterId, RegisterKind, VirtualRegister};
use crate::resolve::forms::passed;
use foldhash::HashMap;
use smallvec::SmallVec;
use std::cell::Cell;
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::source::Span;
use takt_isa::{Effect, ROWS, Row, Type};
use takt_syntax::expr::Value;

#[derive(Clone, Copy, Debug)]
struct Origin {
    what: TypeOrigin,
    span: Span,
    scope: ScopeId,
}

/// Abstract value: its [`Kind`] alone, which is enough to find a mistake, or also the origin of the kind, for the report.
trait AbstractValue: Copy {
    /// A value with a kind and its origin.
    fn new(kind: Kind, origin: Option<Origin>) -> Self;

    fn kind(self) -> Kind;

    fn typed(self) -> TracedKind;

    fn join(self, other: Self) -> Self;
}

impl AbstractValue for Kind {
    #[inline]
    fn new(kind: Kind, _: Option<Origin>) -> Kind {
        kind
    }

    #[inline]
    fn kind(self) -> Kind {
        self
    }

    fn typed(self) -> TracedKind {
        TracedKind { kind: self, origin: None }
    }

    #[inline]
    fn join(self, other: Kind) -> Kind {
        Kind::join(self, other)
    }
}

#[derive(Clone, Copy, Debug)]
struct TracedKind {
    kind: Kind,
    origin: Option<Origin>,
}

impl AbstractValue for TracedKind {
    fn new(kind: Kind, origin: Option<Origin>) -> TracedKind {
        TracedKind { kind, origin }
    }

    fn kind(self) -> Kind {
        self.kind
    }

    fn typed(self) -> TracedKind {
        self
    }

    fn join(self, other: TracedKind) -> TracedKind {
        TracedKind { kind: self.kind.join(other.kind), origin: self.origin.or(other.origin) }
    }
}

/// Number of passes after which types that are still being found count as unknown: each pass follows a value through one more
/// register against the order of the program.
const PASSES: usize = 8;

/// Warns of values that an operation reads as another type, or that go to a register of another type.
pub(crate) fn check(context: &mut Context, ir: &Ir, runs: &[Run]) {
    // An operation with a mistake is not in the program, and its results are unknown.
    if context.reports.sink.errors > 0 {
        return;
    }
    let given = std::mem::take(&mut context.declared.given);
    if Types::<Kind>::new(context, ir, &given).settle(runs) {
        let mut types = Types::<TracedKind>::new(context, ir, &given);
        types.settle(runs);
        types.walk(runs, Some(context));
    }
}

struct Types<'i, V> {
    ir: &'i Ir,
    given: &'i GivenTypes,
    /// The value of each register at the start of a run.
    entry: Vec<V>,
    /// The declaration gives the type of the register.
    declared: Vec<bool>,
    /// The current value of each register, and the run that wrote it.
    now: Vec<(u32, V)>,
    /// The tables of data memory, by label.
    tables: HashMap<LabelId, V>,
    /// By instruction: the sources whose bits become its result.
    passed: Vec<SmallVec<[usize; 2]>>,
    /// Registers whose current type at the beginning of a run has been read.
    read: Vec<Cell<bool>>,
    /// A value has changed since it was read: the fixed point is not reached.
    changed: bool,
    /// An operation reads a value as another type, or writes it to a register of another type.
    mistaken: bool,
}

impl<'i, V: AbstractValue> Types<'i, V> {
    fn new(context: &Context, ir: &'i Ir, given: &'i GivenTypes) -> Types<'i, V> {
        // A raw word may write anything.
        let opaque = ir.is_opaque();
        let mut declared = Vec::with_capacity(ir.registers.len());
        let mut entry = Vec::with_capacity(ir.registers.len());
        for (index, register) in ir.registers.iter().enumerate() {
            let is_declared = match register.kind {
                RegisterKind::Plain => {
                    register.name.is_empty()
                        || register.preset.is_some()
                        || context.declared.typed.contains(&RegisterId::new(index))
                }
                _ => true,
            };
            declared.push(is_declared);
            entry.push(match (is_declared, register.kind) {
                (_, RegisterKind::Constant(_) | RegisterKind::Zero) => any(),
                (true, _) => {
                    let origin =
                        Origin { what: TypeOrigin::Declared, span: register.span, scope: ScopeId::ROOT };
                    V::new(Kind::of(register.ty), Some(origin))
                }
                (false, _) if opaque => any(),
                (false, _) => V::new(Kind::None, None),
            });
        }
        let now = entry.iter().map(|typed| (u32::MAX, *typed)).collect();
        let passed = ROWS.iter().map(|row| passed(row).into()).collect();
        let tables = tables(ir, &context.declared.data_types);
        let read = vec![Cell::new(false); ir.registers.len()];
        Types { ir, given, entry, declared, now, tables, passed, read, changed: false, mistaken: false }
    }

    /// Follows the types until nothing changes. Returns whether there is a mistake.
    fn settle(&mut self, runs: &[Run]) -> bool {
        for pass in 0.. {
            (self.changed, self.mistaken) = (false, false);
            self.walk(runs, None);
            if !self.changed {
                break;
            }
            if pass == PASSES {
                self.forget();
            }
        }
        self.mistaken
    }

    /// Gives up on types that still change.
    fn forget(&mut self) {
        for (entry, declared) in self.entry.iter_mut().zip(&self.declared) {
            if !declared {
                *entry = any();
            }
        }
        self.tables.values_mut().for_each(|table| *table = any());
    }

    /// An operation reads a value as another type than its own, or chooses between two types.
    #[inline]
    fn is_mistaken(&self, run: u32, operation: &Operation) -> bool {
        let (mut int, mut float) = (false, false);
        for which in &self.passed[operation.op as usize] {
            let kind = self.source(run, operation, *which).kind();
            (int, float) = (int | (kind == Kind::Int), float | (kind == Kind::Float));
        }
        let mistaken = |which| match self.expected_type(operation, which).0 {
            Type::B => false,
            wanted => self.source(run, operation, which).kind().mistaken_for(wanted).is_some(),
        };
        int && float || (0..operation.reads().len()).any(mistaken)
    }

    /// Follows the types through every run, and reports mistakes if there is a context to report to.
    fn walk(&mut self, runs: &[Run], mut context: Option<&mut Context>) {
        let ir = self.ir;
        for (number, run) in (0..).zip(runs) {
            for bundle in &ir.bundles[run.start..run.end] {
                if let Some(context) = &mut context {
                    for operation in &bundle.operations {
                        self.reads(number, operation, context);
                    }
                } else if !self.mistaken {
                    let is_mistaken = |operation| self.is_mistaken(number, operation);
                    self.mistaken = bundle.operations.iter().any(is_mistaken);
                }
                if let [operation] = &bundle.operations[..] {
                    let result = self.result(number, operation);
                    self.store(number, operation);
                    self.write(number, operation, result, context.as_deref_mut());
                    continue;
                }
                // All operations of a bundle read before any writes.
                let results: SmallVec<[V; 4]> =
                    bundle.operations.iter().map(|operation| self.result(number, operation)).collect();
                for (operation, result) in bundle.operations.iter().zip(results) {
                    self.store(number, operation);
                    self.write(number, operation, result, context.as_deref_mut());
                }
            }
        }
    }

    /// The value of one of an operation's sources.
    #[inline]
    fn source(&self, run: u32, operation: &Operation, which: usize) -> V {
        match self.given.get(operation, OperandPosition::Source(which as u8)) {
            Some(TypeEvidence::Cast(ty)) => V::new(Kind::of(ty), None),
            Some(TypeEvidence::Literal { kind, what, span }) => literal(operation, kind, what, span),
            // A value that is certainly of another type stays a mistake.
            Some(TypeEvidence::Asked(ty)) => match self.present(run, operation.sources[which]) {
                value if value.kind().mistaken_for(ty).is_some() => value,
                _ => V::new(Kind::of(ty), None),
            },
            _ => self.present(run, operation.sources[which]),
        }
    }

    /// The current value of a register.
    #[inline]
    fn present(&self, run: u32, register: RegisterId) -> V {
        let index = register.index();
        match self.now[index] {
            (written, typed) if written == run => typed,
            _ => {
                self.read[index].set(true);
                self.entry[index]
            }
        }
    }

    /// The type of the elements of the array that an operation loads from or stores to.
    fn element(&self, operation: &Operation) -> Option<Type> {
        self.ir.access(operation).map(|access| self.ir.arrays[access.array.0 as usize].ty)
    }

    /// The expected type of one of an operation's sources, and whether a macro's parameter demands it.
    #[inline]
    fn expected_type(&self, operation: &Operation, which: usize) -> (Type, bool) {
        match self.given.get(operation, OperandPosition::Source(which as u8)) {
            Some(TypeEvidence::Asked(ty)) => (ty, true),
            _ if which == 1 && operation.row().effect == Effect::Store => {
                (self.element(operation).unwrap_or(Type::B), false)
            }
            _ => (operation.row().source_type(which), false),
        }
    }

    /// The value of an operation's result.
    #[inline]
    fn result(&self, run: u32, operation: &Operation) -> V {
        let row = operation.row();
        let result = |ty| {
            let what = TypeOrigin::Result(row.mnemonic);
            let origin = Origin { what, span: operation.span, scope: ScopeId(operation.expansion) };
            V::new(Kind::of(ty), Some(origin))
        };
        if let Some(TypeEvidence::Cast(ty)) = self.given.get(operation, OperandPosition::Dest) {
            return result(ty);
        }
        if row.result_type() != Type::B {
            return result(row.result_type());
        }
        if let Some(TypeEvidence::Asked(ty)) = self.given.get(operation, OperandPosition::Dest) {
            return result(ty);
        }
        match row.effect {
            Effect::Immediate => match self.given.get(operation, OperandPosition::Immediate) {
                Some(TypeEvidence::Literal { kind, what, span }) => literal(operation, kind, what, span),
                _ => any(),
            },
            Effect::Load => match self.element(operation) {
                Some(ty) => result(ty),
                None => self.table(operation).map_or(any(), |label| self.tables[&label]),
            },
            // The type of the sources that pass to the result; effects without a result have no such source.
            Effect::Compute
            | Effect::Nothing
            | Effect::Store
            | Effect::Jump
            | Effect::BranchZero
            | Effect::BranchNonzero
            | Effect::Call
            | Effect::Return
            | Effect::Loop
            | Effect::Publish
            | Effect::Wait
            | Effect::Halt
            | Effect::ReadFlags
            | Effect::ClearFlags => {
                let passed = &self.passed[operation.op as usize];
                let typed = passed.iter().map(|which| self.source(run, operation, *which));
                typed.reduce(V::join).unwrap_or(any())
            }
        }
    }

    /// The table that an operation's memory operand lies in, if that is known.
    fn table(&self, operation: &Operation) -> Option<LabelId> {
        match self.given.get(operation, OperandPosition::Table) {
            Some(TypeEvidence::Table(label)) if self.tables.contains_key(&label) => Some(label),
            _ => None,
        }
    }

    /// Joins the value of a store into the value of its table.
    fn store(&mut self, run: u32, operation: &Operation) {
        if operation.row().effect == Effect::Store
            && let Some(label) = self.table(operation)
        {
            let stored = self.source(run, operation, 1);
            if let Some(table) = self.tables.get_mut(&label) {
                let joined = table.join(stored);
                self.changed |= joined.kind() != table.kind();
                *table = joined;
            }
        }
    }

    fn write(&mut self, run: u32, operation: &Operation, result: V, context: Option<&mut Context>) {
        let Some(dest) = operation.dest else { return };
        let index = dest.index();
        let register = self.ir.register(dest);
        let value = if !self.declared[index] {
            let joined = self.entry[index].join(result);
            self.changed |= joined.kind() != self.entry[index].kind() && self.read[index].get();
            self.entry[index] = joined;
            result
        } else if let Some(ty) = result.kind().mistaken_for(register.ty) {
            self.mistaken = true;
            if let Some(context) = context {
                wrong_register(context, self.ir, operation, register, ty, result.typed());
            }
            // Report each mistake once.
            any()
        } else if matches!(result.kind(), Kind::Any | Kind::None) || register.ty == Type::B {
            self.entry[index]
        } else {
            result
        };
        self.now[index] = (run, value);
    }

    /// Reports the sources that an operation reads as another type.
    fn reads(&self, run: u32, operation: &Operation, context: &mut Context) {
        for which in 0..operation.reads().len() {
            let (wanted, is_asked) = self.expected_type(operation, which);
            if wanted == Type::B {
                continue;
            }
            let source = self.source(run, operation, which).typed();
            if let Some(ty) = source.kind.mistaken_for(wanted) {
                match is_asked {
                    true => wrong_argument(context, self.ir, operation, which, (ty, wanted), source),
                    false => wrong_source(context, self.ir, operation, which, (ty, wanted), source),
                }
            }
        }
        // A choice between an integer and a float has neither type.
        let passed = &self.passed[operation.op as usize];
        let is =
            |kind| passed.iter().copied().find(|which| self.source(run, operation, *which).kind() == kind);
        if let (Some(int), Some(float)) = (is(Kind::Int), is(Kind::Float)) {
            let int = (int, self.source(run, operation, int).typed());
            let float = (float, self.source(run, operation, float).typed());
            either(context, operation, int, float);
        }
    }
}

/// A value of unknown type, which no operand rejects.
fn any<V: AbstractValue>() -> V {
    V::new(Kind::Any, None)
}

fn literal<V: AbstractValue>(operation: &Operation, kind: Kind, what: TypeOrigin, span: Span) -> V {
    V::new(kind, Some(Origin { what, span, scope: ScopeId(operation.expansion) }))
}

/// The types of the tables of data memory, by label.
fn tables<V: AbstractValue>(ir: &Ir, types: &[Type]) -> HashMap<LabelId, V> {
    let typed = |(label, kind): (LabelId, Kind)| {
        let span = ir.labels[label.0 as usize].span;
        (label, V::new(kind, Some(Origin { what: TypeOrigin::Table, span, scope: ScopeId::ROOT })))
    };
    type_evidence::tables(&ir.labels, types).into_iter().map(typed).collect()
}

/// The instruction that converts from one type to another.
fn conversion(from: Type, to: Type) -> Option<&'static str> {
    let converts = |row: &&Row| row.effect == Effect::Compute && row.types == [to, from];
    ROWS.iter().find(converts).map(|row| row.mnemonic)
}

/// `convert it with …`, if there is such an instruction.
fn convert(from: Type, to: Type) -> String {
    conversion(from, to).map_or(String::new(), |mnemonic| format!("convert it with `{mnemonic}`, "))
}

/// Adds the place where the value got its type to a warning.
fn explained(warning: Diagnostic, ty: Type, origin: Option<Origin>) -> Diagnostic {
    let Some(Origin { what, span, .. }) = origin else { return warning };
    let is = words(ty);
    warning.also(
        span,
        match what {
            TypeOrigin::Declared => format!("declared here, as {is}"),
            TypeOrigin::Result(mnemonic) => format!("`{mnemonic}` gives {is}"),
            TypeOrigin::Table => format!("each word here is {is}"),
            TypeOrigin::Address => "an address is an integer".to_owned(),
            TypeOrigin::Literal(_) => is.to_owned(),
        },
    )
}

/// A literal as a warning shows it, and its spelling as the wanted type.
fn literal_spellings(value: Value, wanted: Type) -> (String, Option<String>) {
    match (value, wanted) {
        (Value::Int(value), Type::F) => (format!("the integer {value}"), Some(format!("{value}.0"))),
        (Value::Int(value), _) => (format!("the integer {value}"), None),
        (Value::Real(value), _) => {
            let whole = value.trunc() == value && value.abs() < 2f64.powi(31);
            (format!("the real number {value:?}"), whole.then(|| format!("{value:.0}")))
        }
    }
}

/// Warns that an operation reads a value as another type.
fn wrong_source(
    context: &mut Context,
    ir: &Ir,
    operation: &Operation,
    which: usize,
    (ty, wanted): (Type, Type),
    source: TracedKind,
) {
    let place = source_span(context, operation, which);
    let name = match ir.register(operation.sources[which]) {
        // An element, or a nameless value, is shown in its spelling.
        register if register.name.is_empty() && register.pinned.is_none() => {
            bare(context.reports.sources.text(place)).to_owned()
        }
        register => text(ir, register),
    };
    if let Some(Origin { what: TypeOrigin::Literal(value), span, scope }) = source.origin {
        let (shown, instead) = literal_spellings(value, wanted);
        let message = format!("{shown} in `{name}` is read as {}", words(wanted));
        let warning = Diagnostic::warning("types", span, message)
            .also(place, format!("`{}` reads {} here", operation.row().mnemonic, words(wanted)));
        let warning = noted(warning, value);
        context.report(
            scope,
            match instead {
                Some(instead) => warning.mend(
                    format!("write `{instead}`, or `{name}:bits` there if these bits are meant"),
                    instead,
                ),
                None => warning.help(format!("write `{name}:bits` there if these bits are meant")),
            },
        );
        return;
    }
    let message =
        format!("`{name}` is {}, and `{}` reads {}", words(ty), operation.row().mnemonic, words(wanted));
    let warning = explained(Diagnostic::warning("types", place, message), ty, source.origin);
    let written = bare(context.reports.sources.text(place));
    let written = if written.contains('[') { &name } else { written };
    let declare = match source.origin {
        // The advice does not apply to a value that was copied from another register.
        Some(Origin { what: TypeOrigin::Declared, span, .. })
            if span == ir.register(operation.sources[which]).span =>
        {
            format!("declare `{name}:{}` if it is {}, ", wanted.name(), words(wanted))
        }
        _ => String::new(),
    };
    // An integer comparison has a counterpart for floats: rounding first would compare other values.
    let instead = match comparison(operation.row(), ty) {
        Some(other) => {
            format!("compare {} with `{other}`, ", if ty == Type::F { "floats" } else { "integers" })
        }
        None => convert(ty, wanted),
    };
    let help = format!("{declare}{instead}or write `{written}:bits` if its bits are meant");
    context.report(ScopeId(operation.expansion), warning.help(help));
}

/// Reports an argument whose type differs from the one that the macro's parameter demands: an error, as in the resolver, which
/// reports types that are known where the macro is used.
fn wrong_argument(
    context: &mut Context,
    ir: &Ir,
    operation: &Operation,
    which: usize,
    (ty, wanted): (Type, Type),
    source: TracedKind,
) {
    let name = text(ir, ir.register(operation.sources[which]));
    let place = source_span(context, operation, which);
    let parameter = bare(context.reports.sources.text(place)).to_owned();
    let message =
        format!("`{name}` is {} here, and the parameter `{parameter}` is {}", words(ty), words(wanted));
    let error = explained(Diagnostic::error("types", place, message), ty, source.origin);
    let help = format!("{}or declare `{name}:{}`", convert(ty, wanted), wanted.name());
    context.report(ScopeId(operation.expansion), error.help(help));
}

/// The instruction that compares floats as this one compares integers.
fn comparison(row: &Row, ty: Type) -> Option<&'static str> {
    let compares = |row: &Row, ty| row.effect == Effect::Compute && row.types == [Type::I, ty, ty];
    if ty != Type::F || !compares(row, Type::I) {
        return None;
    }
    let forms: Vec<String> = row.forms().map(|form| form.symbol).collect();
    let same = |other: &&Row| compares(other, ty) && other.forms().any(|form| forms.contains(&form.symbol));
    ROWS.iter().find(same).map(|row| row.mnemonic)
}

/// The text of an operand without the type after its colon.
fn bare(written: &str) -> &str {
    written.split_once(':').map_or(written, |(name, _)| name.trim_end())
}

/// Warns that an operation chooses between an integer and a float.
fn either(
    context: &mut Context,
    operation: &Operation,
    int: (usize, TracedKind),
    float: (usize, TracedKind),
) {
    let mnemonic = operation.row().mnemonic;
    let (here, there) = (source_span(context, operation, int.0), source_span(context, operation, float.0));
    let message = format!("`{mnemonic}` gives an integer or a float");
    let warning = Diagnostic::warning("types", here, message).here("an integer").also(there, "a float");
    let help = match int.1.origin.map(|origin| origin.what) {
        Some(TypeOrigin::Literal(value)) => {
            literal_spellings(value, Type::F).1.map(|instead| format!("write `{instead}`"))
        }
        _ => None,
    };
    let written = bare(context.reports.sources.text(here));
    let help = help.unwrap_or_else(|| {
        format!("{}or write `{written}:bits` if its bits are meant", convert(Type::I, Type::F))
    });
    // Typical cause: a flag kept in a state without a type.
    let help = match float.1.origin {
        Some(Origin { what: TypeOrigin::Declared, span, .. }) => {
            let declared = context.reports.sources.text(span);
            format!("{help}, or declare `{declared}:int` if it is an integer")
        }
        _ => help,
    };
    context.report(ScopeId(operation.expansion), warning.help(help));
}

/// Warns that a value goes to a register that is declared as another type.
fn wrong_register(
    context: &mut Context,
    ir: &Ir,
    operation: &Operation,
    register: &VirtualRegister,
    ty: Type,
    result: TracedKind,
) {
    let name = match register.name.is_empty() && register.pinned.is_none() {
        true => context.reports.sources.text(register.span).to_owned(),
        false => text(ir, register),
    };
    let wanted = register.ty;
    let declare = format!("declare `{name}:{}` if it is {}", ty.name(), words(ty));
    if let Some(Origin { what: TypeOrigin::Literal(value), span, scope }) = result.origin {
        let (shown, instead) = literal_spellings(value, wanted);
        let message = format!("{shown} goes to `{name}`, which is {}", words(wanted));
        let warning = Diagnostic::warning("types", span, message).also(register.span, "declared here");
        let instead = instead.map_or(String::new(), |instead| format!("write `{instead}`, or "));
        context.report(scope, noted(warning, value).help(format!("{instead}{declare}")));
        return;
    }
    let place = dest_span(context, operation);
    let message = format!("{} goes to `{name}`, which is {}", words(ty), words(wanted));
    let warning = Diagnostic::warning("types", place, message).also(register.span, "declared here");
    // Don't note the origin if it is the operation already shown.
    let origin = result.origin.filter(|origin| origin.span != operation.span);
    let written = bare(context.reports.sources.text(place));
    let help = format!("{declare}, {}or write `{written}:bits` if its bits are meant", convert(ty, wanted));
    context.report(ScopeId(operation.expansion), explained(warning, ty, origin).help(help));
}

/// Adds a note with the float that an integer's bits encode.
fn noted(warning: Diagnostic, value: Value) -> Diagnostic {
    match value {
        Value::Int(value) => {
            warning.note(format!("as binary32 its bits are {:e}", f32::from_bits(value as u32)))
        }
        Value::Real(_) => warning,
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Type check: an abstract interpretation that warns of an operand whose value is certainly of another type than the operation reads.
//!
//! The instruction table gives every operand a type. A value has the type of the result that wrote it, of its declaration (ports, states,
//! registers with a type or a preset), of its literal, or of its table in data memory; what takes any bits passes the type
//! on. Types of other registers are followed through each straight run; where runs meet, a register has the type of all that is
//! written to it, or none. A value that may be of either type is not reported: every warning is about a value that is certainly of
//! the other type.

use crate::check::{dest_span, source_span, text};
use crate::context::{Context, ScopeId, words};
use crate::ir::given::{self, Given, GivenTypes, Kind, OperandPosition, TypeOrigin};
use crate::ir::runs::Run;
use crate::ir::{Ir, LabelId, Operation, RegisterId, RegisterKind, VirtualRegister};
use crate::report::diag::Diagnostic;
use crate::report::source::Span;
use crate::resolve::forms::passed;
use crate::syntax::expr::Value;
use foldhash::HashMap;
use smallvec::SmallVec;
use std::cell::Cell;
use takt_isa::{Effect, ROWS, Row, Type};

#[derive(Clone, Copy, Debug)]
struct Origin {
    what: TypeOrigin,
    span: Span,
    scope: ScopeId,
}

/// Abstract value: its [`Kind`], which is enough to find that there is a mistake, or also the origin of that, for the report.
trait Known: Copy {
    /// A value of this kind from there.
    fn new(kind: Kind, origin: Option<Origin>) -> Self;

    fn kind(self) -> Kind;

    fn typed(self) -> Typed;

    fn join(self, other: Self) -> Self;
}

impl Known for Kind {
    #[inline]
    fn new(kind: Kind, _: Option<Origin>) -> Kind {
        kind
    }

    #[inline]
    fn kind(self) -> Kind {
        self
    }

    fn typed(self) -> Typed {
        Typed { kind: self, origin: None }
    }

    #[inline]
    fn join(self, other: Kind) -> Kind {
        Kind::join(self, other)
    }
}

#[derive(Clone, Copy, Debug)]
struct Typed {
    kind: Kind,
    origin: Option<Origin>,
}

impl Known for Typed {
    fn new(kind: Kind, origin: Option<Origin>) -> Typed {
        Typed { kind, origin }
    }

    fn kind(self) -> Kind {
        self.kind
    }

    fn typed(self) -> Typed {
        self
    }

    fn join(self, other: Typed) -> Typed {
        Typed { kind: self.kind.join(other.kind), origin: self.origin.or(other.origin) }
    }
}

/// Passes after which types that are still being found count as unknown: each follows a value through one more register
/// against the order of the program.
const PASSES: usize = 8;

/// Warns of values that are read as, or go to a register of, another type than theirs.
pub(crate) fn check(context: &mut Context, ir: &Ir, runs: &[Run]) {
    // An operation with a mistake is not in the program, and what it would have written is unknown.
    if context.reports.sink.errors > 0 {
        return;
    }
    let given = std::mem::take(&mut context.declared.given);
    if Types::<Kind>::new(context, ir, &given).settle(runs) {
        let mut types = Types::<Typed>::new(context, ir, &given);
        types.settle(runs);
        types.walk(runs, Some(context));
    }
}

struct Types<'i, V> {
    ir: &'i Ir,
    given: &'i GivenTypes,
    /// The value of each register at the start of a run.
    entry: Vec<V>,
    /// True if its declaration gives that.
    declared: Vec<bool>,
    /// The present value of each register, and the run that wrote it.
    now: Vec<(u32, V)>,
    /// The tables of data memory, by label.
    tables: HashMap<LabelId, V>,
    /// For each instruction, the sources whose bits its result is.
    passed: Vec<SmallVec<[usize; 2]>>,
    /// Registers whose type at the beginning of a run, as it was so far, has been read.
    read: Vec<Cell<bool>>,
    /// A value has changed since it was read: the fixed point is not reached.
    changed: bool,
    /// Something is read, or goes to a register of, another type than its own.
    mistaken: bool,
}

impl<'i, V: Known> Types<'i, V> {
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

    /// Gives up on what is still changing.
    fn forget(&mut self) {
        for (entry, declared) in self.entry.iter_mut().zip(&self.declared) {
            if !declared {
                *entry = any();
            }
        }
        self.tables.values_mut().for_each(|table| *table = any());
    }

    /// True if an operation now reads a value as another type than its own, or chooses between two types.
    #[inline]
    fn is_mistaken(&self, run: u32, operation: &Operation) -> bool {
        let (mut int, mut float) = (false, false);
        for which in &self.passed[operation.op as usize] {
            let kind = self.source(run, operation, *which).kind();
            (int, float) = (int | (kind == Kind::Int), float | (kind == Kind::Float));
        }
        let row = operation.row();
        let mistaken = |which| match row.source_type(which) {
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
            Some(Given::Cast(ty)) => V::new(Kind::of(ty), None),
            Some(Given::Literal { kind, what, span }) => literal(operation, kind, what, span),
            _ => {
                let index = operation.sources[which].index();
                match self.now[index] {
                    (written, typed) if written == run => typed,
                    _ => {
                        self.read[index].set(true);
                        self.entry[index]
                    }
                }
            }
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
        if let Some(Given::Cast(ty)) = self.given.get(operation, OperandPosition::Dest) {
            return result(ty);
        }
        if row.result_type() != Type::B {
            return result(row.result_type());
        }
        match row.effect {
            Effect::Immediate => match self.given.get(operation, OperandPosition::Immediate) {
                Some(Given::Literal { kind, what, span }) => literal(operation, kind, what, span),
                _ => any(),
            },
            Effect::Load => self.table(operation).map_or(any(), |label| self.tables[&label]),
            _ => {
                let passed = &self.passed[operation.op as usize];
                let typed = passed.iter().map(|which| self.source(run, operation, *which));
                typed.reduce(V::join).unwrap_or(any())
            }
        }
    }

    /// The table that an operation's memory operand lies in, if that is known.
    fn table(&self, operation: &Operation) -> Option<LabelId> {
        match self.given.get(operation, OperandPosition::Table) {
            Some(Given::Table(label)) if self.tables.contains_key(&label) => Some(label),
            _ => None,
        }
    }

    /// Joins the value of a store into that of its table.
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
            // One mistake, one warning.
            any()
        } else if matches!(result.kind(), Kind::Any | Kind::None) || register.ty == Type::B {
            self.entry[index]
        } else {
            result
        };
        self.now[index] = (run, value);
    }

    /// Reports what an operation reads as another type than it is.
    fn reads(&self, run: u32, operation: &Operation, context: &mut Context) {
        for which in 0..operation.reads().len() {
            let wanted = operation.row().source_type(which);
            if wanted == Type::B {
                continue;
            }
            let source = self.source(run, operation, which).typed();
            if let Some(ty) = source.kind.mistaken_for(wanted) {
                wrong_source(context, self.ir, operation, which, (ty, wanted), source);
            }
        }
        // A choice between an integer and a float is neither.
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

/// A value of any type, of which nothing is known.
fn any<V: Known>() -> V {
    V::new(Kind::Any, None)
}

fn literal<V: Known>(operation: &Operation, kind: Kind, what: TypeOrigin, span: Span) -> V {
    V::new(kind, Some(Origin { what, span, scope: ScopeId(operation.expansion) }))
}

/// The types of the tables of data memory, by label.
fn tables<V: Known>(ir: &Ir, types: &[Type]) -> HashMap<LabelId, V> {
    let typed = |(label, kind): (LabelId, Kind)| {
        let span = ir.labels[label.0 as usize].span;
        (label, V::new(kind, Some(Origin { what: TypeOrigin::Table, span, scope: ScopeId::ROOT })))
    };
    given::tables(&ir.labels, types).into_iter().map(typed).collect()
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

/// Says where a value got its type.
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

/// A literal as a warning shows it, and how it would be written as the wanted type.
fn shown(value: Value, wanted: Type) -> (String, Option<String>) {
    match (value, wanted) {
        (Value::Int(value), Type::F) => (format!("the integer {value}"), Some(format!("{value}.0"))),
        (Value::Int(value), _) => (format!("the integer {value}"), None),
        (Value::Real(value), _) => {
            let whole = value.trunc() == value && value.abs() < 2f64.powi(31);
            (format!("the real number {value:?}"), whole.then(|| format!("{value:.0}")))
        }
    }
}

/// An operation reads a value as another type than it is.
fn wrong_source(
    context: &mut Context,
    ir: &Ir,
    operation: &Operation,
    which: usize,
    (ty, wanted): (Type, Type),
    source: Typed,
) {
    let name = text(ir, ir.register(operation.sources[which]));
    let place = source_span(context, operation, which);
    if let Some(Origin { what: TypeOrigin::Literal(value), span, scope }) = source.origin {
        let (shown, instead) = shown(value, wanted);
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

/// An operand without the type that it is taken as.
fn bare(written: &str) -> &str {
    written.split_once(':').map_or(written, |(name, _)| name.trim_end())
}

/// An operation chooses between an integer and a float.
fn either(context: &mut Context, operation: &Operation, int: (usize, Typed), float: (usize, Typed)) {
    let mnemonic = operation.row().mnemonic;
    let (here, there) = (source_span(context, operation, int.0), source_span(context, operation, float.0));
    let message = format!("`{mnemonic}` gives an integer or a float");
    let warning = Diagnostic::warning("types", here, message).here("an integer").also(there, "a float");
    let help = match int.1.origin.map(|origin| origin.what) {
        Some(TypeOrigin::Literal(value)) => {
            shown(value, Type::F).1.map(|instead| format!("write `{instead}`"))
        }
        _ => None,
    };
    let written = bare(context.reports.sources.text(here));
    let help = help.unwrap_or_else(|| {
        format!("{}or write `{written}:bits` if its bits are meant", convert(Type::I, Type::F))
    });
    // A flag that is kept in a state of no type.
    let help = match float.1.origin {
        Some(Origin { what: TypeOrigin::Declared, span, .. }) => {
            let declared = context.reports.sources.text(span);
            format!("{help}, or declare `{declared}:int` if it is an integer")
        }
        _ => help,
    };
    context.report(ScopeId(operation.expansion), warning.help(help));
}

/// A value goes to a register that is declared as another type.
fn wrong_register(
    context: &mut Context,
    ir: &Ir,
    operation: &Operation,
    register: &VirtualRegister,
    ty: Type,
    result: Typed,
) {
    let (name, wanted) = (text(ir, register), register.ty);
    let declare = format!("declare `{name}:{}` if it is {}", ty.name(), words(ty));
    if let Some(Origin { what: TypeOrigin::Literal(value), span, scope }) = result.origin {
        let (shown, instead) = shown(value, wanted);
        let message = format!("{shown} goes to `{name}`, which is {}", words(wanted));
        let warning = Diagnostic::warning("types", span, message).also(register.span, "declared here");
        let instead = instead.map_or(String::new(), |instead| format!("write `{instead}`, or "));
        context.report(scope, noted(warning, value).help(format!("{instead}{declare}")));
        return;
    }
    let place = dest_span(context, operation);
    let message = format!("{} goes to `{name}`, which is {}", words(ty), words(wanted));
    let warning = Diagnostic::warning("types", place, message).also(register.span, "declared here");
    // That the operation itself gives it needs no telling.
    let origin = result.origin.filter(|origin| origin.span != operation.span);
    let written = bare(context.reports.sources.text(place));
    let help = format!("{declare}, {}or write `{written}:bits` if its bits are meant", convert(ty, wanted));
    context.report(ScopeId(operation.expansion), explained(warning, ty, origin).help(help));
}

/// Shows what an integer is as a float.
fn noted(warning: Diagnostic, value: Value) -> Diagnostic {
    match value {
        Value::Int(value) => {
            warning.note(format!("as binary32 its bits are {:e}", f32::from_bits(value as u32)))
        }
        Value::Real(_) => warning,
    }
}

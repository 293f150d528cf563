// SPDX-License-Identifier: MIT OR Apache-2.0
//! Names to registers, labels and numbers: the expanded source as [`Ir`].

mod address;
mod advice;
mod arguments;
mod common_subexpressions;
mod elements;
pub(crate) mod equation;
mod expression;
mod fast;
pub(crate) mod forms;
mod integers;
mod loops;
mod mismatch;
mod nesting;
mod operand;
mod ranges;
pub(crate) mod serialise;
mod share;
mod slots;
mod sums;
mod term;

use crate::capacity;
use crate::context::{AstPlace, Binding, Context, ErrorReported, ScopeId};
use crate::expand::load::Loader;
use crate::expand::{self, Data, ExpandedSource, Item, Part, Timing};
use crate::ir::type_evidence::{self, Kind};
use crate::ir::{
    Attribution, Bundle, Constant, Demand, DemandKind, Ir, Label, LabelId, LoopBound, Operation, RegisterId,
    RegisterKind,
};
use crate::resolve::common_subexpressions::CommonSubexpressions;
use crate::resolve::elements::Word;
use crate::resolve::forms::Forms;
use crate::resolve::loops::Nest;
use foldhash::{HashMap, HashSet};
use smallvec::SmallVec;
use std::collections::BTreeMap;
use std::rc::Rc;
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::source::Span;
use takt_isa::program::Location;
use takt_isa::spec::instructions::Function;
use takt_isa::{Effect, Machine, Op, ROWS, Slots, Type};
use takt_syntax::ast::*;

/// Limit on the cycles that a demand on ports can name: many times the length of a program.
const MAX_CYCLES: u32 = 1 << 24;

/// Resolves the expanded source. Lines with mistakes are left out and reported.
pub(crate) fn resolve(context: &mut Context, loader: &dyn Loader, flat: ExpandedSource) -> Ir {
    let machine = context.machine;
    let slots = ROWS
        .iter()
        .map(|row| match row.function {
            Function::Idle => Host::Any,
            function => Some(machine.hosts(function))
                .filter(|slots| !slots.is_empty())
                .map_or(Host::None, Host::Slots),
        })
        .collect();
    let ir = empty(machine, &flat);
    let types = flat.data.iter().flat_map(|data| match data {
        Data::Space(_, _, count, ty) => std::iter::repeat_n(*ty, *count as usize),
        Data::Value(_, _, ty) => std::iter::repeat_n(*ty, 1),
    });
    context.declared.data_types = types.collect();
    let tables = type_evidence::tables(&context.declared.labels, &context.declared.data_types);
    let data_words = context.declared.data_types.len() as u32;
    let is_full = data_words > machine.data_depth;
    if is_full {
        data_full(context, &flat.data, data_words);
    }
    let (pool, own_files) = (HashMap::default(), Vec::new());
    let has_typed = context.scopes.macros.values().any(|known| known.types.asked.iter().any(Option::is_some));
    let follows_types = has_typed || context.asts.iter().any(|ast| !ast.equations.is_empty());
    let mut resolver = Resolver {
        context,
        loader,
        flat,
        ir,
        slots,
        pool,
        own_files,
        label: 0,
        data_words,
        is_full,
        tables,
        cast: None,
        asked: None,
        mistaken: HashSet::default(),
        computed: Operation::COMPUTED,
        forms: Forms::new(),
        kinds: Vec::new(),
        subexpressions: CommonSubexpressions::default(),
        nest: Nest::default(),
        made_labels: Vec::new(),
        words: Vec::new(),
        stores: Vec::new(),
        line: (Attribution::NONE, false),
        turns: 0,
        follows_types,
    };
    resolver.reserve_loops();
    let once = std::mem::take(&mut resolver.flat.once);
    resolver.section(Section::Once, &once);
    resolver.ir.period = resolver.ir.bundles.len() as u32;
    let period = std::mem::take(&mut resolver.flat.period);
    resolver.section(Section::Period, &period);
    resolver.insert();
    resolver.entered();
    resolver.data();
    resolver.parameters();
    resolver.presets();
    resolver.ranges();
    for timing in std::mem::take(&mut resolver.flat.timing) {
        // Errors have been reported.
        if let Ok(demand) = resolver.demand(&timing) {
            resolver.ir.demands.push(demand);
        }
    }
    let Resolver { mut ir, flat, made_labels, nest, .. } = resolver;
    context.report_unknown();
    ir.registers = std::mem::take(&mut context.declared.registers);
    ir.numbers = std::mem::take(&mut context.declared.numbered);
    ir.labels = std::mem::take(&mut context.declared.labels);
    let source_labels = ir.labels.len();
    ir.labels.extend(made_labels);
    ir.arrays = context.declared.tables.iter().map(|table| table.array.clone()).collect();
    ir.files = flat.files;
    nesting::check(context, &ir, source_labels);
    if context.reports.sink.errors == 0 {
        share::share(&mut ir, &nest.made);
    }
    ir
}

/// The program before its first line is resolved.
fn empty(machine: &'static Machine, flat: &ExpandedSource) -> Ir {
    Ir {
        machine,
        registers: Vec::new(),
        bundles: Vec::with_capacity(flat.once.len() + flat.period.len()),
        period: 0,
        labels: Vec::new(),
        loop_bounds: Vec::new(),
        loops: Vec::new(),
        arrays: Vec::new(),
        accesses: Vec::new(),
        ranges: Vec::new(),
        array_ranges: Vec::new(),
        results: Vec::new(),
        assumptions: Vec::new(),
        demands: Vec::new(),
        latched: flat.ports.is_some_and(|(latched, _)| latched),
        numbers: BTreeMap::new(),
        scheduled: false,
        has_choices: false,
        data: Vec::new(),
        raw: Vec::new(),
        contracted: Vec::new(),
        files: Vec::new(),
        parts: Vec::new(),
        versions: Vec::new(),
    }
}

/// Reports that the source declares more data than the machine has memory for.
fn data_full(context: &mut Context, data: &[Data], words: u32) {
    let depth = context.machine.data_depth;
    let message = format!(
        "the data memory is full: {words} words of data, and {} has {depth}, {} too few",
        context.machine.name,
        words - depth
    );
    // Find the table of the first word without a place.
    let mut end = 0;
    let found = data.iter().find_map(|data| {
        let (at, span, count) = match *data {
            Data::Space(at, span, count, _) => (at, span, count),
            Data::Value(at, value, _) => (at, value.span, 1),
        };
        end += count;
        (end > depth).then_some((at, span, end - count))
    });
    let Some((at, span, start)) = found else { return };
    let here = match depth - start {
        0 => "no room from here on".to_owned(),
        fitting => format!("{fitting} of these words still fit"),
    };
    let mut error = Diagnostic::error("memory-full", span, message).here(here);
    let tables = context.declared.labels.iter().filter(|label| label.is_table() && label.position <= depth);
    if let Some(table) = tables.max_by_key(|label| label.position) {
        error = error.also(table.span, format!("in `{}`", table.name));
    }
    let help = capacity::for_words(context.machine, words.into());
    context.report(at.scope, error.help(help));
}

/// Slots that execute an instruction.
#[derive(Clone, Copy)]
enum Host {
    Any,
    Slots(Slots),
    None,
}

pub(crate) struct Resolver<'c> {
    pub(crate) context: &'c mut Context,
    /// Loader of further sources, for guesses at the intention behind a mistake.
    pub(crate) loader: &'c dyn Loader,
    flat: ExpandedSource,
    pub(crate) ir: Ir,
    slots: Vec<Host>,
    /// Registers that hold constants, by bits.
    pub(crate) pool: HashMap<u32, RegisterId>,
    /// By tree: the number of its file among the files that code is attributed to.
    own_files: Vec<Option<u32>>,
    /// Number of labels that already have their position.
    label: usize,
    /// The cast of the current operand, if the source has one.
    pub(crate) cast: Option<Type>,
    /// The argument that the current operand stands for, if its parameter has a type.
    pub(crate) asked: Option<u32>,
    /// Arguments whose types have been reported as wrong, with the place.
    mistaken: HashSet<(u32, Span)>,
    /// Number of the latest computed operation with a number of its own; these count down.
    computed: u32,
    /// Words of data memory that the source declares.
    pub(crate) data_words: u32,
    /// The source declares more words than the machine has, which is reported.
    pub(crate) is_full: bool,
    /// Types of tables, from the part of the program read so far.
    pub(crate) tables: HashMap<LabelId, Kind>,
    /// Instructions by their form in equations.
    forms: Forms,
    /// Type of the value last written to each register above the current line.
    kinds: Vec<Kind>,
    /// Subexpressions that are available.
    subexpressions: CommonSubexpressions,
    /// Counted loops around the current line, and ended loops whose values are still needed.
    nest: Nest,
    /// Labels made by the assembler, numbered after the source's.
    made_labels: Vec<Label>,
    /// Elements of arrays in data memory that operands denote.
    words: Vec<Word>,
    /// Elements that the current bundle writes, with the registers of their values.
    stores: Vec<(Word, RegisterId, Span)>,
    /// Attribution of the current line, and whether it is scheduled.
    line: (Attribution, bool),
    /// Number of turns of all sums so far.
    turns: usize,
    /// Equations or macros with typed parameters exist: only they need the types above.
    follows_types: bool,
}

impl Resolver<'_> {
    /// Resolves the bundles of a section, and moves the section's labels from statements to bundles.
    fn section(&mut self, section: Section, items: &[Item]) {
        self.label = 0;
        self.subexpressions.cut();
        let mut bounds = self.flat.loop_bounds.clone();
        bounds.retain(|bound| bound.section == section);
        let mut bounds = bounds.into_iter().peekable();
        let mut assumptions = self.flat.assumptions.clone();
        assumptions.retain(|assumption| assumption.section == section);
        let mut assumptions = assumptions.into_iter().peekable();
        let mut next = self.place_labels(section, 0);
        for (index, item) in items.iter().enumerate() {
            while let Some(assumption) = assumptions.next_if(|assumption| assumption.item <= index as u32) {
                // Errors have been reported.
                let _ = self.assume(&assumption);
            }
            if index as u32 >= next {
                next = self.place_labels(section, index as u32);
            }
            if let Some(expand::LoopBound { most, total, .. }) =
                bounds.next_if(|bound| bound.item == index as u32)
            {
                self.ir.loop_bounds.push(LoopBound { position: self.ir.bundles.len() as u32, most, total });
                self.subexpressions.cut();
            }
            self.item(item);
            self.ir.contracted.resize(self.ir.bundles.len(), item.contracted);
        }
        for assumption in assumptions {
            let _ = self.assume(&assumption);
        }
        self.place_labels(section, u32::MAX);
    }

    /// Positions the section's labels that stand at or before a statement. Returns the statement of the next label.
    fn place_labels(&mut self, section: Section, statement: u32) -> u32 {
        while let Some(label) = self.context.declared.labels.get_mut(self.label) {
            if self.context.declared.label_sections[self.label] == section {
                if label.position > statement {
                    return label.position;
                }
                label.position = self.ir.bundles.len() as u32;
                if section != Section::Data {
                    self.subexpressions.cut();
                }
            }
            self.label += 1;
        }
        u32::MAX
    }

    fn item(&mut self, item: &Item) {
        let ast = Rc::clone(&self.context.asts[item.at.ast as usize]);
        if matches!(item.part, Part::Begin(_) | Part::End(_)) {
            // Errors have been reported.
            let _ = self.loop_part(item, &ast);
            return;
        }
        let (first, count) = match ast.statements[item.statement as usize].kind {
            StatementKind::Bundle(first, count) => (first, u32::from(count)),
            StatementKind::Equation(equation) => {
                // Errors have been reported.
                let _ = self.equation(item, &ast, equation);
                return;
            }
            StatementKind::Empty | StatementKind::Directive(_) => return,
        };
        let written = &ast.operations[first as usize..(first + count) as usize];
        if let [one] = written {
            let location = self.location(item, (one.span, one.line), 0, 1);
            self.line = (location, item.scheduled);
            // Errors have been reported.
            if let Ok(operation) = self.operation(item.at, &ast, first, 1, location) {
                let operations = SmallVec::from_buf([operation]);
                self.push(Bundle { operations, explicit: false, scheduled: item.scheduled });
                self.store_results(item.at);
            }
            self.stores.clear();
            return;
        }
        let mut operations: SmallVec<[Operation; 1]> = SmallVec::with_capacity(written.len());
        for (index, (operation, number)) in written.iter().zip(first..).enumerate() {
            let location = self.location(item, (operation.span, operation.line), index, written.len());
            self.line = (location, item.scheduled);
            // Errors have been reported; other operations may have errors of their own.
            if let Ok(operation) = self.operation(item.at, &ast, number, written.len(), location) {
                operations.push(operation);
            }
        }
        let stores = std::mem::take(&mut self.stores);
        if operations.len() < written.len() {
            return;
        }
        if self.ir.machine.slots.len() == 1 {
            match serialise::order(&operations) {
                Ok(order) => {
                    for index in order {
                        let operations = SmallVec::from_elem(operations[index], 1);
                        self.push(Bundle { operations, explicit: true, scheduled: item.scheduled });
                    }
                }
                Err(diagnostic) => {
                    let diagnostic = diagnostic(&self.context.declared.registers, self.ir.machine);
                    self.context.report(item.at.scope, diagnostic);
                }
            }
        } else if self.assign_slots(item.at, &mut operations).is_ok() {
            if let Some(diagnostic) = serialise::twice(&operations) {
                let diagnostic = diagnostic(&self.context.declared.registers, self.ir.machine);
                self.context.report(item.at.scope, diagnostic);
            }
            self.push(Bundle { operations, explicit: true, scheduled: item.scheduled });
        }
        self.stores = stores;
        self.store_results(item.at);
    }

    /// Refuses jumps by number into stretches that rely on a subexpression computed above.
    fn entered(&mut self) {
        if self.subexpressions.stretches.is_empty() {
            return;
        }
        // Per bundle: stretches that begin minus stretches that end before it.
        let mut steps = vec![0i64; self.ir.bundles.len() + 2];
        for (computed, used) in &self.subexpressions.stretches {
            steps[*computed as usize + 1] += 1;
            steps[*used as usize + 1] -= 1;
        }
        let within: Vec<bool> = steps
            .iter()
            .scan(0, |open, step| {
                *open += step;
                Some(*open > 0)
            })
            .collect();
        let enters = |target: u32| within.get(target as usize).copied().unwrap_or(false);
        let jumps = self.ir.operations().filter(|operation| operation.target_number().is_some_and(enters));
        let wrong: Vec<(Span, u32)> = jumps.map(|operation| (operation.span, operation.expansion)).collect();
        for (span, expansion) in wrong {
            let message = "a jump by number between equations that share a subexpression";
            let error = Diagnostic::error("target", span, message)
                .help("jump to a label: equations behind it compute everything themselves");
            self.context.report(ScopeId(expansion), error);
        }
    }

    /// Adds a bundle to the program.
    fn push(&mut self, mut bundle: Bundle) {
        let order = self.ir.bundles.len() as u32;
        self.ir.scheduled |= bundle.scheduled;
        for operation in &mut bundle.operations {
            operation.order = order;
            self.ir.has_choices |= operation.slots.len() > 1;
        }
        if self.follows_types {
            self.note_results(&bundle);
        }
        self.ir.bundles.push(bundle);
    }

    /// Records the types that a bundle writes, for the equations below.
    fn note_results(&mut self, bundle: &Bundle) {
        let is_opaque = bundle.is_opaque();
        for operation in &bundle.operations {
            self.note_store(operation);
            if operation.row().effect == Effect::Store {
                let array = self.ir.access(operation).map(|access| access.array);
                self.subexpressions.store(array);
            }
            if let Some(dest) = operation.dest {
                let kind = self.result_kind(operation);
                self.set_kind(dest, kind);
                self.subexpressions.write(dest);
            }
            if is_opaque || operation.redirects() || operation.row().effect.drains() {
                self.subexpressions.cut();
            }
        }
    }

    /// The source line of an operation: its own, or the line of `.loc`.
    fn location(
        &mut self,
        item: &Item,
        (span, line): (Span, u32),
        index: usize,
        count: usize,
    ) -> Attribution {
        if item.loc != 0 {
            let places = &self.flat.locs[item.loc as usize];
            if places.len() > 1 && places.len() != count {
                let message = format!("a bundle of {count}, and `.loc` gives {} places", places.len());
                self.context.error(item.at.scope, "loc", span, message);
                return Attribution::NONE;
            }
            let place = places.get(if places.len() == 1 { 0 } else { index }).copied().flatten();
            return place.map_or(Attribution::NONE, |(location, part)| self.ir.attribute(location, part));
        }
        let ast = item.at.ast as usize;
        if let Some(Some(file)) = self.own_files.get(ast) {
            return Attribution::to(Location { file: *file, line });
        }
        let file = self.context.reports.sources.file_of(span.start);
        let name = std::sync::Arc::clone(&self.context.reports.sources.files()[file].name);
        let file = self.flat.file(&name);
        self.own_files.resize(self.own_files.len().max(ast + 1), None);
        self.own_files[ast] = Some(file);
        Attribution::to(Location { file, line })
    }

    fn operation(
        &mut self,
        at: AstPlace,
        ast: &Ast,
        number: u32,
        of: usize,
        location: Attribution,
    ) -> Result<Operation, ErrorReported> {
        let written = &ast.operations[number as usize];
        let name = self.context.spelled(at, written.mnemonic.name, written.mnemonic.span)?;
        let operands = &ast.operands[written.first as usize..(written.first + written.count) as usize];
        let (op, pinned) = match name.op() {
            Some(op) => (op, None),
            None if name.directive() == Some(Directive::Raw) => {
                return self.raw(at, number, written, operands, location);
            }
            None => match self.pinned(at, name, written.mnemonic.span)? {
                Some((op, slot)) => (op, Some(slot)),
                None => return Err(self.unknown_mnemonic(at, name, written, of)),
            },
        };
        let row = op.row();
        let slots = self.hosting(at, op, pinned, written.mnemonic.span)?;
        let places = row.shape.operands();
        if places.len() != operands.len() {
            return Err(self.wrong_count(at, row, written, operands));
        }
        let mut operation = Operation::new(op, slots, written.span, location, at.scope.0, (at.ast, number));
        let mut failed = false;
        for (place, operand) in places.iter().zip(operands) {
            // Check all operands, even if one is wrong.
            failed |= self.operand(at, row, *place, *operand, &mut operation).is_err();
        }
        operation.slots = self.writing(slots, operation.dest);
        operation.slot = operation.slots.first();
        if failed { Err(ErrorReported) } else { Ok(operation) }
    }

    /// A word given bit by bit: `.raw slot word`.
    fn raw(
        &mut self,
        at: AstPlace,
        number: u32,
        written: &takt_syntax::ast::Operation,
        operands: &[Operand],
        location: Attribution,
    ) -> Result<Operation, ErrorReported> {
        let [slot, word] = operands else { return Err(ErrorReported) };
        let name = self.context.reports.sources.text(slot.span).to_owned();
        let index = self.named_slot(at, &name, slot.span)?;
        let value = self.operand_value(at, *word)?;
        let Some(bits) =
            value.integer().ok().and_then(|value| u64::try_from(value).ok()).filter(|value| value >> 48 == 0)
        else {
            return Err(self.context.error(at.scope, "range", word.span, "a word has 48 bits"));
        };
        self.ir.raw.push(bits);
        Ok(Operation {
            constant: Constant::Raw(self.ir.raw.len() as u32 - 1),
            ..Operation::new(Op::nop, Slots::of(index), written.span, location, at.scope.0, (at.ast, number))
        })
    }

    fn data(&mut self) {
        for entry in std::mem::take(&mut self.flat.data) {
            match entry {
                Data::Space(_, _, count, _) => {
                    let length = self.ir.data.len() + count as usize;
                    self.ir.data.resize(length, 0);
                }
                Data::Value(at, value, ty) => {
                    let word = self.context.value(at, value.id);
                    let word = word.and_then(|word| self.bits(at, word, ty, value.into()));
                    // A word with a mistake keeps its place.
                    self.ir.data.push(word.unwrap_or(0));
                }
            }
        }
    }

    /// A number of cycles, not less than `least`.
    fn cycles(&mut self, at: AstPlace, cycles: Expr, least: u32) -> Result<u32, ErrorReported> {
        let value = self.context.integer(at, cycles)?;
        u32::try_from(value).ok().filter(|cycles| (least..=MAX_CYCLES).contains(cycles)).ok_or_else(|| {
            let message = format!("cycles are {least} to {MAX_CYCLES} here, not {value}");
            self.context.error(at.scope, "range", cycles.span, message)
        })
    }

    /// Resolves a `.deadline`, `.order` or `.late`.
    fn demand(&mut self, timing: &Timing) -> Result<Demand, ErrorReported> {
        let at = timing.at;
        let ast = Rc::clone(&self.context.asts[at.ast as usize]);
        let DirectiveLine { kind, span } = &ast.directives[timing.directive as usize];
        let (kind, names, wanted) = match kind {
            DirectiveKind::Deadline(names, cycle) => {
                let limit = self.cycles(at, *cycle, 1)?;
                (DemandKind::Deadline(limit), names, Some(RegisterKind::Output))
            }
            DirectiveKind::Order(names) => (DemandKind::Order, names, None),
            DirectiveKind::Late(names, cost) => {
                let cost = cost.map_or(Ok(0), |cost| self.cycles(at, cost, 0))?;
                (DemandKind::Late(cost), names, Some(RegisterKind::Input))
            }
            _ => return Err(ErrorReported),
        };
        if let Some((true, latched)) = self.flat.ports {
            return Err(self.unlatched(at, kind, *span, latched));
        }
        let mut ports: Vec<(RegisterId, Span)> = Vec::with_capacity(names.len());
        for name in names {
            let port = self.port(at, *name, wanted)?;
            if let Some((_, first)) = ports.iter().find(|(other, _)| *other == port) {
                let message = format!(
                    "`{}` appears twice in one directive",
                    self.context.reports.sources.text(name.span)
                );
                let error =
                    Diagnostic::error("declared-twice", name.span, message).also(*first, "first here");
                return Err(self.context.report(at.scope, error));
            }
            ports.push((port, name.span));
        }
        Ok(Demand { kind, ports, period: timing.section == Section::Period, span: *span })
    }

    /// Reports a demand on latched ports, which have no times of their own.
    fn unlatched(&mut self, at: AstPlace, kind: DemandKind, span: Span, latched: Span) -> ErrorReported {
        let (message, help) = match kind {
            DemandKind::Deadline(_) => (
                "outputs that are published together, at the `wait`, cannot have deadlines of their own",
                "bound the period instead: `takt bound --deadline`",
            ),
            DemandKind::Order => (
                "ports that are taken together, at the tick, or published together, at the `wait`, cannot have an order",
                "leave it out",
            ),
            DemandKind::Late(_) => (
                "inputs that are taken at the tick cannot be read later",
                "leave it out, or write `.ports direct`",
            ),
        };
        let error =
            Diagnostic::error("ports", span, message).also(latched, "ports are latched here").help(help);
        self.context.report(at.scope, error)
    }

    fn presets(&mut self) {
        let mut seen: HashMap<RegisterId, Span> = HashMap::default();
        for preset in std::mem::take(&mut self.flat.presets) {
            let found = self.preset_registers(preset.at, preset.register, preset.placed);
            let Ok(value) = self.context.value(preset.at, preset.value.id) else { continue };
            // A named register has a type; a place accepts any.
            let Ok((members, ty)) = found else { continue };
            let Ok(bits) = self.bits(preset.at, value, ty, preset.value.into()) else { continue };
            for register in members {
                if self.context.declared.registers[register.index()].kind == RegisterKind::Parameter {
                    let message = "`.param` states a parameter's value at the start";
                    self.context.error(preset.at.scope, "declared-twice", preset.span, message);
                    break;
                }
                if let Some(first) = seen.insert(register, preset.span) {
                    let message = "this register is preset already";
                    let error = Diagnostic::error("declared-twice", preset.span, message)
                        .also(first, "preset here first");
                    self.context.report(preset.at.scope, error);
                    break;
                }
                self.context.declared.registers[register.index()].preset = Some(bits);
            }
        }
    }

    /// The registers that a `.preset` names, all elements for an array, and their type.
    fn preset_registers(
        &mut self,
        at: AstPlace,
        operand: Operand,
        placed: bool,
    ) -> Result<(Vec<RegisterId>, Type), ErrorReported> {
        if let (OperandKind::Name(name), false) = (operand.kind, placed) {
            let id = self.context.spelled(at, name, operand.span)?;
            if let Binding::Array(number) = self.context.lookup(at.scope, id) {
                let _ = self.context.name(at, name, operand.span);
                let array = &self.context.declared.arrays[number as usize];
                let ty = self.context.declared.registers[array.first.index()].ty;
                return Ok((array.elements().collect(), ty));
            }
        }
        let (register, ty) = self.preset_register(at, operand, placed)?;
        Ok((vec![register], ty))
    }
}

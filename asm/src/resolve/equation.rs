// SPDX-License-Identifier: MIT OR Apache-2.0
//! Code generation for equations: each operator and function becomes the instruction that the table gives, on unnamed virtual
//! registers, in the order in which the equation is written ([`expression`](crate::resolve::expression)). The span of an operation
//! is the part of the line that it computes. This file assigns the values to their targets and checks their types.

use crate::context::{AstPlace, Binding, ErrorReported, NameRole, words};
use crate::expand::equation::Results;
use crate::expand::{Item, Part};
use crate::ir::arrays;
use crate::ir::type_evidence::{Kind, OperandPosition, TypeEvidence};
use crate::ir::{Bundle, LabelId, Operation, RegisterId, RegisterKind, VirtualRegister};
use crate::limits;
use crate::resolve::Resolver;
use crate::resolve::elements::Word;
use crate::resolve::forms::Meaning;
use crate::resolve::term::{CurrentEquation, Term, TermForm};
use smallvec::SmallVec;
use std::rc::Rc;
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::source::Span;
use takt_isa::{Effect, Op, Slots, Type};
use takt_syntax::ast::*;
use takt_syntax::expr::Value;

impl Resolver<'_> {
    pub(super) fn equation(
        &mut self,
        item: &Item,
        ast: &Rc<Ast>,
        equation: u32,
    ) -> Result<(), ErrorReported> {
        let equation = &ast.equations[equation as usize];
        let number = ast.statements[item.statement as usize].line;
        let location = self.location(item, (equation.span, number), 0, 1);
        let piece = match item.part {
            Part::Piece(piece) => Some(self.flat.pieces[piece as usize].clone()),
            _ => None,
        };
        let (argument, results) = piece.map_or((None, Results::default()), |p| (p.argument, p.results));
        self.subexpressions.next();
        self.line = (location, item.scheduled);
        let mut line = CurrentEquation { results, fast: item.fast, ..CurrentEquation::new(self.line) };
        if let Some((value, register, asked)) = argument {
            let asked = asked.map_or(Kind::None, Kind::of);
            let term = self.compute(item.at, &mut line, ast, value.id, asked)?;
            // Computed values are checked by the macro's use.
            let wanted = if term.value().is_some() { asked } else { Kind::None };
            return self.assign(item.at, &mut line, &[(register, wanted, value.span)], &[term], &[]);
        }
        if equation.targets.len() != equation.values.len() {
            let (targets, values) = (equation.targets.len(), equation.values.len());
            let plural = |count: usize| if count == 1 { "" } else { "s" };
            let message = format!(
                "{targets} register{} to write and {values} value{}",
                plural(targets),
                plural(values)
            );
            let error = Diagnostic::error("equation", equation.span, message)
                .help("write one value for each register, separated by `,`");
            return Err(self.context.report(item.at.scope, error));
        }
        if equation.targets.len() > limits::EQUATION_TARGETS {
            let message = format!("an equation writes at most {} registers", limits::EQUATION_TARGETS);
            return Err(self.context.error(item.at.scope, "limit", equation.span, message));
        }
        let mut targets: Vec<(RegisterId, Kind, Span)> = Vec::with_capacity(equation.targets.len());
        // Targets that are elements in data memory, by their position.
        let mut words: Vec<(usize, Word)> = Vec::new();
        let mut failed = false;
        for (number, target) in equation.targets.iter().enumerate() {
            match self.meaning(item.at, *target) {
                Ok((_, _, Some((_, Binding::Word(word))))) => {
                    let ty = self.element_type(&self.words[word as usize]);
                    failed |= self.check_result(Kind::of(ty)).is_err();
                    words.push((number, self.words[word as usize].clone()));
                    continue;
                }
                Ok(_) => {}
                Err(ErrorReported) => {
                    failed = true;
                    continue;
                }
            }
            match self.target_of(item.at, *target) {
                Ok((register, wanted)) => {
                    if let Some((_, _, first)) = targets.iter().find(|(other, ..)| *other == register) {
                        let message = "one register is written twice in one equation";
                        let error =
                            Diagnostic::error("equation", target.span, message).also(*first, "the other");
                        return Err(self.context.report(item.at.scope, error));
                    }
                    targets.push((register, wanted, target.span));
                }
                Err(ErrorReported) => failed = true,
            }
        }
        let mut terms = Vec::with_capacity(equation.values.len());
        let mut stored: Vec<(Word, Term)> = Vec::with_capacity(words.len());
        let mut words = words.into_iter().peekable();
        for (index, value) in equation.values.iter().enumerate() {
            let word = words.next_if(|(number, _)| *number == index);
            let wanted = match &word {
                Some((_, word)) => Kind::of(self.element_type(word)),
                None => targets.get(terms.len()).map_or(Kind::None, |(_, wanted, _)| *wanted),
            };
            match (self.compute(item.at, &mut line, ast, value.id, wanted), word) {
                (Ok(term), Some((_, word))) => stored.push((word, term)),
                (Ok(term), None) => terms.push(term),
                (Err(ErrorReported), _) => failed = true,
            }
        }
        if failed { Err(ErrorReported) } else { self.assign(item.at, &mut line, &targets, &terms, &stored) }
    }

    /// The type of an element.
    pub(super) fn element_type(&self, word: &Word) -> Type {
        self.context.declared.tables[word.array.0 as usize].array.ty
    }

    /// The register that an equation writes, and its type, if that does not depend on the value.
    fn target_of(&mut self, at: AstPlace, target: Operand) -> Result<(RegisterId, Kind), ErrorReported> {
        (self.cast, self.asked) = (None, None);
        let register = self.dest(at, target, NameRole::Left)?;
        let asked = self.type_of_parameter().map_or(Kind::None, Kind::of);
        Ok((register, self.declared_kind(register).unwrap_or(asked)))
    }

    /// The declared type of a register; `None` if its values determine the type.
    pub(super) fn declared_kind(&self, id: RegisterId) -> Option<Kind> {
        let register = &self.context.declared.registers[id.index()];
        let is_open = register.kind == RegisterKind::Plain
            && (register.name.is_empty() && register.pinned.is_none()
                || !register.name.is_empty() && !self.context.declared.typed.contains(&id));
        (!is_open).then(|| Kind::of(register.ty))
    }

    /// The type of a register's value, as far as its declaration or the writes above tell.
    pub(super) fn written_kind(&self, id: RegisterId) -> Kind {
        let written = || self.kinds.get(id.index()).copied().unwrap_or(Kind::None);
        self.declared_kind(id).unwrap_or_else(written)
    }

    /// The type of a register's value; float by default.
    pub(super) fn kind(&self, id: RegisterId) -> Kind {
        match self.written_kind(id) {
            Kind::None => Kind::Float,
            kind => kind,
        }
    }

    /// Records the type of the value last written to a register.
    pub(super) fn set_kind(&mut self, id: RegisterId, kind: Kind) {
        if self.kinds.len() <= id.index() {
            self.kinds.resize(self.context.declared.registers.len().max(id.index() + 1), Kind::None);
        }
        self.kinds[id.index()] = kind;
    }

    /// Type of an operation's result.
    pub(super) fn result_kind(&self, operation: &Operation) -> Kind {
        let given = |part| match self.context.declared.given.get(operation, part) {
            Some(TypeEvidence::Cast(ty)) => Some(Kind::of(ty)),
            Some(TypeEvidence::Literal { kind, .. }) => Some(kind),
            Some(TypeEvidence::Asked(ty)) if operation.row().result_type() == Type::B => Some(Kind::of(ty)),
            _ => None,
        };
        if let Some(kind) = given(OperandPosition::Dest).or_else(|| given(OperandPosition::Immediate)) {
            return kind;
        }
        match operation.row().effect {
            // A load has the type of its table, whatever type the index has.
            Effect::Load => match self.ir.access(operation) {
                Some(access) => Kind::of(self.context.declared.tables[access.array.0 as usize].array.ty),
                None => self.table_kind(operation).map_or(Kind::Any, |(_, kind)| kind),
            },
            _ => self.forms.result(operation.op, |which| self.source_kind(operation, which)),
        }
    }

    /// Type of an operation's source, if known.
    fn source_kind(&self, operation: &Operation, which: usize) -> Kind {
        match self.context.declared.given.get(operation, OperandPosition::Source(which as u8)) {
            Some(TypeEvidence::Cast(ty) | TypeEvidence::Asked(ty)) => return Kind::of(ty),
            Some(TypeEvidence::Literal { kind, .. }) => return kind,
            _ => {}
        }
        let id = operation.sources[which];
        match self.context.declared.registers[id.index()].kind {
            RegisterKind::Constant(_) | RegisterKind::Zero => Kind::Any,
            _ => self.kind(id),
        }
    }

    /// The table that a load or store names, and the type of its words, if known.
    fn table_kind(&self, operation: &Operation) -> Option<(LabelId, Kind)> {
        match self.context.declared.given.get(operation, OperandPosition::Table) {
            Some(TypeEvidence::Table(label)) => self.tables.get(&label).map(|kind| (label, *kind)),
            _ => None,
        }
    }

    /// Records the type that a store leaves in its table, for the equations below.
    pub(super) fn note_store(&mut self, operation: &Operation) {
        if operation.row().effect == Effect::Store
            && let Some((label, kind)) = self.table_kind(operation)
        {
            let kind = kind.join(self.source_kind(operation, 1));
            self.tables.insert(label, kind);
        }
    }

    /// Writes an equation's values to its registers and elements, all of them computed before any is written.
    fn assign(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        targets: &[(RegisterId, Kind, Span)],
        terms: &[Term],
        words: &[(Word, Term)],
    ) -> Result<(), ErrorReported> {
        self.check_targets(at, targets, terms, words)?;
        // The last operation writes the target itself if nothing after it reads the target's old value.
        let mut left: Vec<(RegisterId, Kind, Term)> = Vec::new();
        for (index, ((target, wanted, _), term)) in targets.iter().zip(terms).enumerate() {
            let others = terms.iter().enumerate().filter(|(other, _)| *other != index).map(|(_, term)| term);
            let is_other = |id: RegisterId| {
                let others = others.clone().chain(words.iter().map(|(_, term)| term));
                others
                    .into_iter()
                    .any(|other| matches!(other.form, TermForm::Register(used, _) if used == id))
                    || words.iter().any(|(word, _)| word.names(id))
            };
            if let TermForm::Register(value, kind) = term.form
                && let Some(place) = line.computed.iter().position(|(register, ..)| *register == value)
                && !is_other(value)
                && !is_other(*target)
            {
                let (_, bundle, key) = line.computed[place];
                let behind = &self.ir.bundles[bundle + 1..];
                let touches = |operation: &Operation| {
                    operation.dest == Some(*target)
                        || operation.reads().contains(target)
                        || operation.reads().contains(&value)
                };
                if !behind.iter().flat_map(|bundle| &bundle.operations).any(touches) {
                    // A pinned target leaves fewer slots to choose from.
                    let slots = self.writing(self.ir.bundles[bundle].operations[0].slots, Some(*target));
                    let operation = &mut self.ir.bundles[bundle].operations[0];
                    (operation.dest, operation.slots, operation.slot) = (Some(*target), slots, slots.first());
                    line.computed.remove(place);
                    self.written(*target, kind.or(*wanted));
                    let register = &self.context.declared.registers[target.index()];
                    let lasts = matches!(register.kind, RegisterKind::Plain | RegisterKind::State);
                    if lasts && register.pinned.is_none() {
                        self.subexpressions.insert(key, *target, bundle as u32);
                    } else {
                        self.subexpressions.remove(&key);
                    }
                    continue;
                }
            }
            left.push((*target, *wanted, *term));
        }
        // Elements first: their values and subscripts may be registers that are written.
        self.store_elements(at, line, words)?;
        // A register that is both read and written is copied first where it is read after it is written.
        for index in 0..left.len() {
            let TermForm::Register(value, kind) = left[index].2.form else { continue };
            let written = left[..index].iter().any(|(target, ..)| *target == value)
                || targets.iter().any(|(target, ..)| *target == value)
                    && left.iter().all(|(target, ..)| *target != value);
            if written {
                let span = left[index].2.span;
                let kept = self.copy(at, line, left[index].2, Type::B, None)?;
                left[index].2 = Term { form: TermForm::Register(kept, kind), span };
            }
        }
        for (target, wanted, term) in left {
            let ty = match wanted {
                Kind::Int => Type::I,
                Kind::Any => Type::B,
                Kind::Float | Kind::None => Type::F,
            };
            let kind = term.kind().unwrap_or(Kind::of(ty));
            self.copy(at, line, term, ty, Some(target))?;
            self.written(target, kind.or(wanted));
        }
        Ok(())
    }

    /// Checks that all values of an equation may go to its registers and elements.
    fn check_targets(
        &mut self,
        at: AstPlace,
        targets: &[(RegisterId, Kind, Span)],
        terms: &[Term],
        words: &[(Word, Term)],
    ) -> Result<(), ErrorReported> {
        let mut failed = false;
        for ((target, wanted, span), term) in targets.iter().zip(terms) {
            let VirtualRegister { name, span: declared, .. } =
                &self.context.declared.registers[target.index()];
            let (name, declared) = (name.clone(), *declared);
            failed |= self.check_target(at, (&name, declared), (*wanted, *span), *term).is_err();
        }
        for (word, term) in words {
            let arrays::Array { name, span: declared, ty, .. } =
                &self.context.declared.tables[word.array.0 as usize].array;
            let (name, declared, wanted) = (name.clone(), *declared, Kind::of(*ty));
            failed |= self.check_target(at, (&name, declared), (wanted, word.span), *term).is_err();
        }
        if failed { Err(ErrorReported) } else { Ok(()) }
    }

    /// Writes an equation's values to elements of arrays in memory.
    fn store_elements(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        words: &[(Word, Term)],
    ) -> Result<(), ErrorReported> {
        for (word, term) in words {
            let value = match term.form {
                TermForm::Register(register, _) => register,
                TermForm::Constant(value, expr) => {
                    let ty = match self.element_type(word) {
                        Type::B if matches!(value, Value::Int(_)) => Type::I,
                        Type::B => Type::F,
                        ty => ty,
                    };
                    self.holding(at, value, expr, term.span, ty)?
                }
                // The caller has computed an expression's value.
                TermForm::Chain(..) | TermForm::Counted(_) => return Err(ErrorReported),
            };
            self.store(at, line, word, value, word.span)?;
        }
        Ok(())
    }

    fn written(&mut self, target: RegisterId, kind: Kind) {
        self.set_kind(target, kind);
        self.subexpressions.write(target);
    }

    /// Checks that a value may go to a register or an array, given the target's name and declaration, its type and the place of
    /// the write.
    fn check_target(
        &mut self,
        at: AstPlace,
        (name, declared): (&str, Span),
        (wanted, span): (Kind, Span),
        term: Term,
    ) -> Result<(), ErrorReported> {
        let Some(kind) = term.kind() else { return Ok(()) };
        let (is, to) = match (kind, wanted) {
            (Kind::Int, Kind::Float) => (Type::I, Type::F),
            (Kind::Float, Kind::Int) => (Type::F, Type::I),
            _ => return Ok(()),
        };
        let message = format!("this is {}, and `{name}` {}", words(is), words(to));
        let written = self.context.reports.sources.text(term.span);
        let error = Diagnostic::error("equation", term.span, message)
            .here(words(is))
            .also(span, format!("`{name}` is written here"))
            .also(declared, format!("declared here, as {}", words(to)));
        let error = match self.forms.conversion(is, to) {
            Some(convert) => {
                let shown = if written.len() > 24 { "…" } else { written };
                let help = format!("convert it: `{convert}({shown})`, or declare `{name}:{}`", is.name());
                error.mend(help, format!("{convert}({written})"))
            }
            None => error.help(format!("declare `{name}:{}`", is.name())),
        };
        Err(self.context.report(at.scope, error))
    }

    /// Copies a value to `target`, or to a new register.
    pub(super) fn copy(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        term: Term,
        ty: Type,
        target: Option<RegisterId>,
    ) -> Result<RegisterId, ErrorReported> {
        let source = match term.form {
            TermForm::Register(register, _) => register,
            // Does not occur: the caller has settled chains and functions of indices.
            TermForm::Chain(..) | TermForm::Counted(_) => return Err(ErrorReported),
            TermForm::Constant(value, expr) => self.holding(at, value, expr, term.span, ty)?,
        };
        let Some(Meaning { op, .. }) = self.forms.get("", 1).first() else { return Err(ErrorReported) };
        let op = *op;
        let slots = self.hosting(at, op, None, term.span)?;
        let sources = [source, RegisterId::ZERO, RegisterId::ZERO];
        let register = target.unwrap_or_else(|| self.fresh(term.span));
        self.emit(at, line, op, slots, sources, register, term.span);
        self.note_computed(term.kind().unwrap_or(Kind::of(ty)));
        Ok(register)
    }

    /// Records the type of the last operation's result for the type check, if its instruction leaves the type open.
    pub(super) fn note_computed(&mut self, kind: Kind) {
        let ty = match kind {
            Kind::Float => Type::F,
            Kind::Int => Type::I,
            Kind::None | Kind::Any => return,
        };
        let Some(operation) = self.ir.bundles.last_mut().and_then(|bundle| bundle.operations.first_mut())
        else {
            return;
        };
        if operation.row().result_type() == Type::B && self.computed > Operation::FIRST_COMPUTED {
            self.computed -= 1;
            operation.written.1 = self.computed;
            self.context.declared.given.insert(operation, OperandPosition::Dest, TypeEvidence::Cast(ty));
        }
    }

    /// The register that holds a constant converted to a type.
    pub(super) fn holding(
        &mut self,
        at: AstPlace,
        value: Value,
        expr: ExprId,
        span: Span,
        ty: Type,
    ) -> Result<RegisterId, ErrorReported> {
        let operand = Operand { kind: OperandKind::Expr(expr), span };
        let value = match value {
            // An integer that the program computes has the low 32 bits.
            Value::Int(_) if ty != Type::F && self.context.names_known_index(at, expr) => value.word(),
            value => value,
        };
        let bits = self.bits(at, value, ty, operand)?;
        Ok(self.pooled(bits, span))
    }

    /// A new nameless register.
    pub(super) fn fresh(&mut self, span: Span) -> RegisterId {
        let registers = &mut self.context.declared.registers;
        registers.push(VirtualRegister::unnamed(span));
        RegisterId::new(registers.len() - 1)
    }

    #[allow(clippy::too_many_arguments)]
    pub(super) fn emit(
        &mut self,
        at: AstPlace,
        line: &CurrentEquation,
        op: Op,
        slots: Slots,
        sources: [RegisterId; 3],
        dest: RegisterId,
        span: Span,
    ) {
        let slots = self.writing(slots, Some(dest));
        let operation = Operation {
            dest: Some(dest),
            sources,
            ..Operation::new(op, slots, span, line.location, at.scope.0, (at.ast, Operation::COMPUTED))
        };
        let operations = SmallVec::from_elem(operation, 1);
        self.push(Bundle { operations, explicit: false, scheduled: line.scheduled });
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Elements of arrays in data memory: subscripts to addresses, loads and stores.
//!
//! An address is a register plus an offset that the load or store has in its word. Subscripts that are affine in the indices of
//! loops share a register for each distinct vector of coefficients, which the loops advance ([`loops`](crate::resolve::loops));
//! constants go into the offset.

use crate::context::loops::{AffineInteger, IterationLimitExceeded};
use crate::context::{AstPlace, Binding, ErrorReported, Table};
use crate::ir::arrays::{AccessId, Affine, ArrayAccess, ArrayId};
use crate::ir::type_evidence::Kind;
use crate::ir::{Bundle, Constant, Operation, RegisterId, with_effect};
use crate::resolve::Resolver;
use crate::resolve::term::{CurrentEquation, Term, TermForm};
use smallvec::SmallVec;
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::source::Span;
use takt_isa::shape::Field;
use takt_isa::{Effect, Type};
use takt_syntax::ast::{ExprId, Name, Node, Operand, OperandKind, Operator};
use takt_syntax::expr::Value;

/// An element of an array in data memory.
#[derive(Clone, Debug)]
pub(super) struct Word {
    pub(super) array: ArrayId,
    /// Index of the word relative to the array's first word.
    place: AffineInteger,
    pub(super) span: Span,
}

impl Word {
    /// A subscript names the register.
    pub(super) fn names(&self, id: RegisterId) -> bool {
        self.place.registers.iter().any(|(register, _)| *register == id)
    }
}

/// Location of an array element.
#[allow(clippy::large_enum_variant, reason = "there is one at a time")]
pub(super) enum Place {
    Register(RegisterId),
    Word(Word),
}

/// The address of a load or store.
#[derive(Clone, Copy)]
pub(super) struct Address {
    pub(super) base: RegisterId,
    pub(super) offset: u32,
    pub(super) access: AccessId,
}

impl Resolver<'_> {
    /// The element of an array in data memory, given its indices.
    pub(super) fn word(
        &mut self,
        at: AstPlace,
        table: u32,
        indices: &[Vec<Node>],
        span: Span,
    ) -> Result<Word, ErrorReported> {
        self.context.declared.tables[table as usize].used = true;
        let declared = self.context.declared.tables[table as usize].clone();
        let array = &declared.array;
        if indices.len() != array.sizes.len() {
            return Err(self.wrong_indices(at, &declared, indices.len(), span));
        }
        let mut place = AffineInteger::constant(0);
        let mut around = None;
        let mut slices = 0;
        for (nodes, size) in indices.iter().zip(&array.sizes) {
            let is_slice = nodes.last().is_some_and(|node| node.kind.is_slice());
            slices += usize::from(is_slice);
            let index = match is_slice {
                true => self.context.slice_index(at, nodes, slices, span)?,
                false => self.context.subscript(at, nodes, span)?,
            };
            let here = nodes.last().map_or(span, |node| node.span);
            if index.registers.is_empty() {
                let around = around.get_or_insert_with(|| self.context.loops_around(at.scope));
                match self.context.extremes(around, &index.source) {
                    Ok(Some([low, high])) if low < 1 || high > i64::from(*size) => {
                        return Err(self.outside(at, &declared, [low, high], *size, here));
                    }
                    Ok(_) => {}
                    Err(IterationLimitExceeded) => {
                        let message = "this nest has too many iterations for its subscripts to be checked";
                        return Err(self.context.error(at.scope, "limit", here, message));
                    }
                }
            }
            for (register, _) in &index.registers {
                if self.kind(*register) == Kind::Float {
                    let name = self.context.declared.registers[register.index()].name.clone();
                    let message = format!("`{name}` is a float, and a subscript is an integer");
                    let declared = self.context.declared.registers[register.index()].span;
                    let error = Diagnostic::error("array", here, message)
                        .also(declared, "declared here")
                        .help(format!("declare it as `{name}:int`"));
                    return Err(self.context.report(at.scope, error));
                }
            }
            let next = AffineInteger::constant(0)
                .plus(&place, i64::from(*size))
                .and_then(|place| place.plus(&index, 1))
                .and_then(|place| place.plus(&AffineInteger::constant(1), -1));
            place = next
                .ok_or_else(|| self.context.error(at.scope, "range", here, "a subscript beyond 64 bits"))?;
        }
        Ok(Word { array: ArrayId(table), place, span })
    }

    fn wrong_indices(&mut self, at: AstPlace, table: &Table, found: usize, span: Span) -> ErrorReported {
        let (text, takes) = (&table.array.name, table.array.sizes.len());
        let plural = if takes == 1 { "index" } else { "indices" };
        let message = format!("`{text}` has {takes} {plural}, not {found}");
        let error = Diagnostic::error("array", span, message)
            .also(table.array.span, format!("declared here as `{text}[{}]`", table.shape()));
        self.context.report(at.scope, error)
    }

    fn outside(
        &mut self,
        at: AstPlace,
        table: &Table,
        [low, high]: [i64; 2],
        size: u32,
        span: Span,
    ) -> ErrorReported {
        let text = &table.array.name;
        let message = match low == high {
            true => format!("`{text}` has no element {low} here: it is 1 to {size}"),
            false => format!(
                "this index is {low} to {high} in the loops around it, and of `{text}` it is 1 to {size}"
            ),
        };
        let error = Diagnostic::error("array", span, message)
            .also(table.array.span, format!("declared here as `{text}[{}]`", table.shape()));
        self.context.report(at.scope, error)
    }

    /// The address of an element; emits the operations that compute it.
    pub(super) fn word_address(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        word: &Word,
    ) -> Result<Address, ErrorReported> {
        let base = self.context.declared.tables[word.array.0 as usize].array.base;
        let AffineInteger { actual, registers, .. } = &word.place;
        let page = i64::from(Field::Offset.bits().max()) + 1;
        let first = i64::from(base) + actual.constant;
        // The register takes the part that does not fit into the offset.
        let pages = if registers.is_empty() { first.div_euclid(page) * page } else { first.min(0) };
        let over = if registers.is_empty() { 0 } else { (first - pages).div_euclid(page) * page };
        let bias = pages + over;
        let beyond = |resolver: &mut Self| {
            resolver.context.error(at.scope, "range", word.span, "this lies outside the data memory")
        };
        let offset = u32::try_from(first - bias).map_err(|_| beyond(self))?;
        let is_open = |&(id, _): &(crate::ir::arrays::LoopId, i64)| self.nest.is_open(id);
        let known = registers.is_empty() && actual.terms.iter().all(is_open);
        let access = ArrayAccess { array: word.array, word: known.then(|| actual.clone()) };
        let (actual, registers) = (actual.clone(), registers.clone());
        let mut base = match (&actual.terms[..], bias) {
            ([], 0) => RegisterId::ZERO,
            ([], bias) => {
                let bits = i32::try_from(bias).map_err(|_| beyond(self))?;
                self.pooled(bits.cast_unsigned(), word.span)
            }
            (terms, bias) => self.induction(at, line, terms, bias)?,
        };
        for (register, factor) in registers {
            let scaled = self.scaled(at, line, register, factor, word.span)?;
            base = match base {
                RegisterId::ZERO => scaled,
                base => self.integer_operation(at, line, Operator::Add, [base, scaled], word.span)?,
            };
        }
        self.ir.accesses.push(access);
        let access = AccessId(self.ir.accesses.len() as u32 - 1);
        Ok(Address { base, offset, access })
    }

    /// Emits an operation on integers. Returns the register of its result.
    pub(super) fn integer_operation(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        operator: Operator,
        operands: [RegisterId; 2],
        span: Span,
    ) -> Result<RegisterId, ErrorReported> {
        let terms = operands.map(|register| Term { form: TermForm::Register(register, Kind::Int), span });
        let here = (span, ExprId { first: 0, count: 0 });
        match self.operate(at, line, operator.text(), &terms, here, Kind::Int)?.form {
            TermForm::Register(register, _) => Ok(register),
            _ => Err(ErrorReported),
        }
    }

    /// Loads an element into a register of its own, unless a register holds it already.
    pub(super) fn load(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        word: &Word,
        span: Span,
    ) -> Result<RegisterId, ErrorReported> {
        let address = self.word_address(at, line, word)?;
        let Some(op) = with_effect(Effect::Load) else { return Err(ErrorReported) };
        let slots = self.hosting(at, op, None, span)?;
        let key = self.subexpressions.element(op, address.base, address.offset, word.array);
        if let Some((register, bundle)) = self.subexpressions.find(&key) {
            let here = self.ir.bundles.len() as u32;
            if !line.computed.iter().any(|(_, at, _)| *at as u32 == bundle) {
                self.subexpressions.stretches.push((bundle, here));
            }
            return Ok(register);
        }
        let register = self.fresh(span);
        let bundle = self.ir.bundles.len();
        let operation = Operation {
            dest: Some(register),
            sources: [address.base, RegisterId::ZERO, RegisterId::ZERO],
            constant: Constant::Value(address.offset),
            access: Some(address.access),
            ..Operation::new(op, slots, span, line.location, at.scope.0, (at.ast, Operation::COMPUTED))
        };
        let operations = SmallVec::from_elem(operation, 1);
        self.push(Bundle { operations, explicit: false, scheduled: line.scheduled });
        self.subexpressions.insert(key, register, bundle as u32);
        line.computed.push((register, bundle, key));
        Ok(register)
    }

    /// Stores a register's value to an element.
    pub(super) fn store(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        word: &Word,
        value: RegisterId,
        span: Span,
    ) -> Result<(), ErrorReported> {
        let address = self.word_address(at, line, word)?;
        let Some(op) = with_effect(Effect::Store) else { return Err(ErrorReported) };
        let slots = self.hosting(at, op, None, span)?;
        let bundle = self.ir.bundles.len();
        let operation = Operation {
            sources: [address.base, value, RegisterId::ZERO],
            constant: Constant::Value(address.offset),
            access: Some(address.access),
            ..Operation::new(op, slots, span, line.location, at.scope.0, (at.ast, Operation::COMPUTED))
        };
        let operations = SmallVec::from_elem(operation, 1);
        self.push(Bundle { operations, explicit: false, scheduled: line.scheduled });
        // A load of the element would return the value: reuse it.
        if let Some(load) = with_effect(Effect::Load) {
            let key = self.subexpressions.element(load, address.base, address.offset, word.array);
            self.subexpressions.insert(key, value, bundle as u32);
        }
        Ok(())
    }

    /// Stores the results of the bundle just pushed to array elements.
    pub(super) fn store_results(&mut self, at: AstPlace) {
        for (word, value, span) in std::mem::take(&mut self.stores) {
            let mut line = CurrentEquation::new(self.line);
            // Errors have been reported.
            let _ = self.store(at, &mut line, &word, value, span);
        }
    }

    /// The register of an element that an instruction reads, loaded before the instruction.
    pub(super) fn loaded(
        &mut self,
        at: AstPlace,
        word: u32,
        span: Span,
    ) -> Result<RegisterId, ErrorReported> {
        let mut line = CurrentEquation::new(self.line);
        let word = self.words[word as usize].clone();
        self.load(at, &mut line, &word, span)
    }

    /// The location of an element, given its array's name and its indices.
    pub(super) fn element_place(
        &mut self,
        at: AstPlace,
        name: Name,
        indices: &[Vec<Node>],
        span: Span,
    ) -> Result<Place, ErrorReported> {
        let operand = Operand { kind: OperandKind::Name(name.name), span: name.span };
        match self.meaning(at, operand)?.2 {
            Some((_, Binding::Table(table))) => self.word(at, table, indices, span).map(Place::Word),
            _ => self.element(at, name, indices, span).map(Place::Register),
        }
    }

    /// The value of an affine function of indices: a register, or a constant.
    pub(super) fn counted_form(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        counted: usize,
    ) -> Result<TermForm, ErrorReported> {
        let Affine { constant, terms } = line.counted[counted].clone();
        if terms.is_empty() {
            return Ok(TermForm::Constant(Value::Int(constant), ExprId { first: 0, count: 0 }));
        }
        let register = self.induction(at, line, &terms, constant)?;
        Ok(TermForm::Register(register, Kind::Int))
    }

    /// Applies an operator to functions of indices and to integers; `None` if the result is not affine.
    pub(super) fn counted_operation(
        &self,
        line: &mut CurrentEquation,
        operator: Operator,
        terms: &[Term],
    ) -> Option<TermForm> {
        if !terms.iter().any(|term| matches!(term.form, TermForm::Counted(_))) {
            return None;
        }
        let function = |term: &Term| match term.form {
            TermForm::Counted(counted) => Some(line.counted[counted].clone()),
            TermForm::Constant(Value::Int(value), _) => Some(Affine::constant(value)),
            _ => None,
        };
        let result = match (operator, terms) {
            (Operator::Sub, [a]) => function(a)?.times(-1)?,
            (Operator::Add, [a, b]) => function(a)?.plus(&function(b)?, 1)?,
            (Operator::Sub, [a, b]) => function(a)?.plus(&function(b)?, -1)?,
            (Operator::Mul, [a, b]) => {
                let (a, b) = (function(a)?, function(b)?);
                match (a.as_constant(), b.as_constant()) {
                    (_, Some(factor)) => a.times(factor)?,
                    (Some(factor), _) => b.times(factor)?,
                    _ => return None,
                }
            }
            _ => return None,
        };
        line.counted.push(result);
        Some(TermForm::Counted(line.counted.len() - 1))
    }

    /// The register of a loop's index for an instruction that reads it.
    pub(super) fn index_register(
        &mut self,
        at: AstPlace,
        index: u32,
        ty: Type,
        span: Span,
    ) -> Result<RegisterId, ErrorReported> {
        let mut line = CurrentEquation::new(self.line);
        line.counted.push(self.context.declared.indices[index as usize].value.actual.clone());
        match self.counted_form(at, &mut line, 0)? {
            TermForm::Register(register, _) => Ok(register),
            TermForm::Constant(value, expr) => self.holding(at, value, expr, span, ty),
            TermForm::Chain(..) | TermForm::Counted(_) => Err(ErrorReported),
        }
    }

    /// Reports that an array is named where a register is needed.
    pub(super) fn whole_array(&mut self, at: AstPlace, table: u32, span: Span) -> ErrorReported {
        let table = &self.context.declared.tables[table as usize];
        let all = |index: &str| vec![index; table.array.sizes.len()].join(",");
        let (first, all) = (all("1"), all(":"));
        let name = table.array.name.clone();
        let error = Diagnostic::error("operand", span, format!("`{name}` is an array in data memory"))
            .also(table.array.span, "declared here")
            .help(format!("name its elements, as `{name}[{first}]`, or all of them, as `{name}[{all}]`"));
        self.context.report(at.scope, error)
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Ranges that the source promises (`.range`), and parameters with their values and ranges (`.param`).

use crate::context::{AstPlace, Binding, ErrorReported};
use crate::expand::{Assumption, Parameters};
use crate::ir::{Assumed, AssumptionId, RegisterId};
use crate::resolve::Resolver;
use foldhash::HashMap;
use std::rc::Rc;
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::source::Span;
use takt_isa::program::{ArrayRange, ArrayResult, Range, Space};
use takt_isa::{Register, Type};
use takt_syntax::ast::*;
use takt_syntax::expr::Value;

/// Words of data memory, with the type of their array.
type Words = (std::ops::Range<u32>, Option<Type>);

impl Resolver<'_> {
    /// Values and ranges of the parameters.
    pub(super) fn parameters(&mut self) {
        for parameters in std::mem::take(&mut self.flat.parameters) {
            // Errors have been reported.
            let _ = self.parameter(parameters);
        }
    }

    fn parameter(
        &mut self,
        Parameters { at, directive, first, count }: Parameters,
    ) -> Result<(), ErrorReported> {
        let ast = Rc::clone(&self.context.asts[at.ast as usize]);
        let DirectiveKind::Param { declaration, values, range } = &ast.directives[directive as usize].kind
        else {
            return Err(ErrorReported);
        };
        let ty = self.context.declared.registers[first.index()].ty;
        let members = (first.index()..first.index() + count).map(RegisterId::new);
        if values.len() != 1 && values.len() != count {
            let span = values[0].span.to(values[values.len() - 1].span);
            let name = self.context.reports.sources.text(declaration.name.span).to_owned();
            let message = format!("`{name}` has {count} elements, and these are {} values", values.len());
            let error = Diagnostic::error("array", span, message)
                .help("give one value for all elements, or one for each, the last index counting fastest");
            return Err(self.context.report(at.scope, error));
        }
        let mut given = Vec::with_capacity(values.len());
        for expr in values {
            let value = self.context.value(at, expr.id)?;
            let bits = self.bits(at, value, ty, (*expr).into())?;
            if ty == Type::F && !f32::from_bits(bits).is_finite() {
                let message = "a parameter's value is finite";
                return Err(self.context.error(at.scope, "range", expr.span, message));
            }
            given.push(bits);
        }
        for (register, value) in members.clone().zip(given.iter().cycle()) {
            self.context.declared.registers[register.index()].preset = Some(*value);
        }
        let Some((word, least, largest)) = range else { return Ok(()) };
        let id = self.context.spelled(at, word.name, word.span)?;
        if self.context.scopes.text(id) != "range" {
            let message = "behind a parameter's value stands `range`, as in `range 0..50`";
            return Err(self.context.error(at.scope, "syntax", word.span, message));
        }
        let [low, high] = self.ends(at, ty, [least, largest])?;
        let range = Range { register: Register::ZERO, ty, low, high };
        if let Some(mistake) = range.mistake() {
            return Err(self.invalid(at, [least, largest], mistake));
        }
        for (value, expr) in given.iter().zip(values) {
            if !range.holds(*value) {
                let error =
                    Diagnostic::error("range", expr.span, "the value at the start lies outside of the range")
                        .also(least.span.to(largest.span), "the range");
                return Err(self.context.report(at.scope, error));
            }
        }
        self.ir.ranges.extend(members.map(|register| (register, [low, high])));
        Ok(())
    }

    /// Bits of a range's ends.
    fn ends(&mut self, at: AstPlace, ty: Type, [low, high]: [&Expr; 2]) -> Result<[u32; 2], ErrorReported> {
        let mut end = |end: &Expr| {
            let value = self.context.value(at, end.id)?;
            self.bits(at, value, ty, (*end).into())
        };
        // Both ends are read before either is missed, so that mistakes in both are reported.
        let (low, high) = (end(low), end(high));
        Ok([low?, high?])
    }

    /// Reports a range that is invalid.
    fn invalid(&mut self, at: AstPlace, [low, high]: [&Expr; 2], mistake: &str) -> ErrorReported {
        let span = low.span.to(high.span);
        self.context.error(at.scope, "range", span, format!("this range is invalid: {mistake}"))
    }

    /// A `.assume`: the operation before it that writes the register last gets the assumption. Operations in front of a label, a jump or a
    /// branch do not count: they execute on other paths, too.
    pub(super) fn assume(&mut self, assumption: &Assumption) -> Result<(), ErrorReported> {
        let Assumption { at, directive, .. } = *assumption;
        let ast = Rc::clone(&self.context.asts[at.ast as usize]);
        let DirectiveKind::Assume { register, least, bound } = &ast.directives[directive as usize].kind
        else {
            return Err(ErrorReported);
        };
        let (id, ty) = self.preset_register(at, *register, false)?;
        // A place has no type: its bound is a float.
        let ty = if ty == Type::I { Type::I } else { Type::F };
        let value = self.context.value(at, bound.id)?;
        let end = self.bits(at, value, ty, (*bound).into())?;
        let open = match ty {
            Type::F => [f32::MIN.to_bits(), f32::MAX.to_bits()],
            Type::I | Type::B => [i32::MIN.cast_unsigned(), i32::MAX.cast_unsigned()],
        };
        let ends = if *least { [end, open[1]] } else { [open[0], end] };
        let labels = self.context.declared.labels[..self.label].iter().chain(&self.made_labels);
        let code = labels.filter(|label| label.space == Space::Code).map(|label| label.position);
        let start = code.filter(|position| *position as usize <= self.ir.bundles.len()).max().unwrap_or(0);
        let start = if self.ir.period > 0 { start.max(self.ir.period) } else { start };
        let mut found = None;
        for index in (start as usize..self.ir.bundles.len()).rev() {
            let operations = &self.ir.bundles[index].operations;
            found = operations.iter().position(|operation| operation.dest == Some(id)).map(|at| (index, at));
            if found.is_some() || operations.iter().any(|operation| operation.redirects()) {
                break;
            }
        }
        let Some((bundle, number)) = found else {
            let name = self.context.reports.sources.text(register.span).to_owned();
            let message = format!("no operation since the last label or jump writes `{name}`");
            let error = Diagnostic::error("assume", register.span, message)
                .help("write `.assume` behind the operation that computes the value");
            return Err(self.context.report(at.scope, error));
        };
        let operation = &mut self.ir.bundles[bundle].operations[number];
        let known = operation.assumed.and_then(|id| self.ir.assumptions.get(id.index()));
        let ends = known.map_or(ends, |known| tightest(ty, known.ends, ends));
        let range = Range { register: Register::ZERO, ty, low: ends[0], high: ends[1] };
        if let Some(mistake) = range.mistake() {
            return Err(self.context.error(
                at.scope,
                "range",
                bound.span,
                format!("this assumption is invalid: {mistake}"),
            ));
        }
        self.ir.assumptions.push(Assumed { ty, ends });
        operation.assumed = AssumptionId::new(self.ir.assumptions.len() - 1);
        Ok(())
    }

    pub(super) fn ranges(&mut self) {
        let declared = |(register, _): &(RegisterId, [u32; 2])| {
            (*register, self.context.declared.registers[register.index()].span)
        };
        let mut seen: HashMap<RegisterId, Span> = self.ir.ranges.iter().map(declared).collect();
        for (at, directive) in std::mem::take(&mut self.flat.ranges) {
            let ast = Rc::clone(&self.context.asts[at.ast as usize]);
            let (registers, placed, low, high) = match &ast.directives[directive as usize].kind {
                DirectiveKind::Range { registers, placed, low, high } => (registers, placed, low, high),
                DirectiveKind::Result(arrays) => {
                    for name in arrays {
                        self.result(at, *name);
                    }
                    continue;
                }
                _ => continue,
            };
            for name in registers {
                if !*placed && let Some(array) = self.ranged_array(at, *name, [low, high]) {
                    self.array_range(at, *name, array, [low, high]);
                    continue;
                }
                // Errors have been reported.
                let Ok((members, ty)) = self.range_registers(at, *name, *placed) else { continue };
                let Ok([least, largest]) = self.ends(at, ty, [low, high]) else { continue };
                let range = Range { register: Register::ZERO, ty, low: least, high: largest };
                if let Some(mistake) = range.mistake() {
                    self.invalid(at, [low, high], mistake);
                    continue;
                }
                for register in members {
                    if let Some(first) = seen.insert(register, name.span) {
                        let message = "this register has a range already";
                        let error =
                            Diagnostic::error("declared-twice", name.span, message).also(first, "here");
                        self.context.report(at.scope, error);
                        break;
                    }
                    self.ir.ranges.push((register, [least, largest]));
                }
            }
        }
    }

    /// The array or label of data memory that a `.range` names: its words' extent and type. A label has no type: it is the ends'.
    fn ranged_array(
        &mut self,
        at: AstPlace,
        operand: Operand,
        [low, high]: [&Expr; 2],
    ) -> Option<(std::ops::Range<u32>, Type)> {
        let OperandKind::Name(name) = operand.kind else { return None };
        let (words, ty) = self.words_of(at, Name { name, span: operand.span }).ok()??;
        let mut is_integer = |end: &Expr| matches!(self.context.value(at, end.id), Ok(Value::Int(_)));
        let mut by_ends = || if is_integer(low) && is_integer(high) { Type::I } else { Type::F };
        Some((words, ty.unwrap_or_else(&mut by_ends)))
    }

    /// Words of an array or a label of data memory, with an array's type; `None` if the name means anything else.
    fn words_of(&mut self, at: AstPlace, Name { name, span }: Name) -> Result<Option<Words>, ErrorReported> {
        let id = self.context.spelled(at, name, span)?;
        Ok(match self.context.lookup(at.scope, id) {
            Binding::Table(number) => {
                let array = &self.context.declared.tables[number as usize].array;
                Some((array.base..array.base + array.words, Some(array.ty)))
            }
            Binding::Data(label) => {
                let first = self.context.declared.labels[label.0 as usize].position;
                Some((first..self.words_end(first), None))
            }
            _ => None,
        })
    }

    /// An array of a `.result`. The words of a label are binary32.
    fn result(&mut self, at: AstPlace, name: Name) {
        let Ok(words) = self.words_of(at, name) else { return };
        let Some((words, ty)) = words else {
            let text = self.context.reports.sources.text(name.span).to_owned();
            let message = format!("`{text}` is no array in data memory");
            let error = Diagnostic::error("array", name.span, message).help(
                "`.result` names arrays of `.array` or labels of data; an output port is a result by itself",
            );
            self.context.report(at.scope, error);
            return;
        };
        if !self.is_whole(at, name.span, &words) {
            return;
        }
        let count = words.end - words.start;
        let result = ArrayResult { first: words.start, words: count, ty: ty.unwrap_or(Type::F) };
        let known = self.ir.results.partition_point(|known| known.first < result.first);
        if self.ir.results.get(known).is_some_and(|known| known.first == result.first) {
            self.context.error(at.scope, "declared-twice", name.span, "this array is a result already");
        } else {
            self.ir.results.insert(known, result);
        }
    }

    /// The words are those of a label, which an image can name; otherwise reports an error.
    fn is_whole(&mut self, at: AstPlace, span: Span, words: &std::ops::Range<u32>) -> bool {
        if words.is_empty() {
            let message = "no words of data follow this label: expected an array or a label before words";
            self.context.error(at.scope, "range", span, message);
        } else if self.words_end(words.start) != words.end {
            let message = "words without a label follow this array, so that it has no end in an image";
            let error = Diagnostic::error("range", span, message).help("put a label before these words");
            self.context.report(at.scope, error);
        } else {
            return true;
        }
        false
    }

    /// End of the words that follow a label of data memory: the next label, or the end of the data.
    fn words_end(&self, first: u32) -> u32 {
        let labels = self.context.declared.labels.iter().filter(|label| label.space == Space::Data);
        let ends = labels.map(|label| label.position).chain([self.ir.data.len() as u32]);
        ends.filter(|end| *end > first).min().unwrap_or(first)
    }

    fn array_range(
        &mut self,
        at: AstPlace,
        operand: Operand,
        (words, ty): (std::ops::Range<u32>, Type),
        [low, high]: [&Expr; 2],
    ) {
        let Ok([least, largest]) = self.ends(at, ty, [low, high]) else { return };
        let count = words.end.saturating_sub(words.start);
        let range = ArrayRange { first: words.start, words: count, ty, low: least, high: largest };
        let known = self.ir.array_ranges.partition_point(|known| known.first < range.first);
        let has_range = self.ir.array_ranges.get(known).is_some_and(|known| known.first == range.first);
        if let Some(mistake) = range.mistake() {
            self.invalid(at, [low, high], mistake);
        } else if has_range {
            self.context.error(at.scope, "declared-twice", operand.span, "this array has a range already");
        } else if self.is_whole(at, operand.span, &words) {
            self.ir.array_ranges.insert(known, range);
        }
    }

    /// The registers that a `.range` names, all elements for an array, and their type.
    fn range_registers(
        &mut self,
        at: AstPlace,
        operand: Operand,
        placed: bool,
    ) -> Result<(Vec<RegisterId>, Type), ErrorReported> {
        let (members, ty) = self.preset_registers(at, operand, placed)?;
        // A place has no type: its range is one of floats.
        Ok((members, if placed { Type::F } else { ty }))
    }
}

/// Ends of the values in both of two ranges.
fn tightest(ty: Type, [low, high]: [u32; 2], [least, largest]: [u32; 2]) -> [u32; 2] {
    let is_above = |a: u32, b: u32| match ty {
        Type::F => f32::from_bits(a) > f32::from_bits(b),
        Type::I | Type::B => a.cast_signed() > b.cast_signed(),
    };
    [if is_above(least, low) { least } else { low }, if is_above(high, largest) { largest } else { high }]
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Equations between slices: a loop over their elements, for each index that is a slice.
//!
//! All values are read as they were before the equation. As elements are written one after the other, an array on both sides must
//! have the same subscripts, or subscripts shifted by a constant: then the loop runs in the direction in which each element is read
//! before it is written.

use crate::context::loops::AffineInteger;
use crate::context::{AstPlace, Binding, Context, ErrorReported};
use crate::expand::Expander;
use crate::expand::loops::{LoopOptions, Range};
use smallvec::SmallVec;
use std::rc::Rc;
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::source::Span;
use takt_syntax::ast::*;
use takt_syntax::expr::{operands, parts};
use takt_syntax::name::NameId;

/// An index of an element or a slice.
#[derive(Clone, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "there are a few at a time, for one line of the source")]
enum Subscript {
    One(AffineInteger),
    /// First and last index of a slice.
    Several(AffineInteger, AffineInteger),
}

/// An element or a slice, with its place.
struct ArrayReference {
    array: Binding,
    subscripts: Vec<Subscript>,
    span: Span,
}

impl Context {
    /// Name of the counter of a slice's elements, by the slice's number in the element, from 1. No source can write this
    /// name.
    pub(crate) fn slice_name(&mut self, number: usize) -> NameId {
        self.scopes.names_mut().intern(&format!(":{number}"))
    }

    /// Name of a loop in registers and reports: the index variable, or for a slice a name that an image can hold.
    pub(crate) fn loop_name(&self, variable: NameId) -> String {
        let text = self.scopes.text(variable);
        text.strip_prefix(':').map_or_else(|| text.to_owned(), |number| format!("slice.{number}"))
    }

    /// The current value of an index that is a slice, the `number`-th of its element.
    pub(crate) fn slice_index(
        &mut self,
        at: AstPlace,
        nodes: &[Node],
        number: usize,
        span: Span,
    ) -> Result<AffineInteger, ErrorReported> {
        let name = self.slice_name(number);
        let offset = match self.lookup(at.scope, name) {
            Binding::Count(value) => AffineInteger::constant(value),
            Binding::Index(index) => self.declared.indices[index as usize].value.clone(),
            _ => {
                let error = Diagnostic::error("slice", span, "a slice where one value is needed")
                    .help("write a slice on the left side too, as `y[:] = 2*x[:]`, or name an element");
                return Err(self.report(at.scope, error));
            }
        };
        let first = match nodes {
            [inner @ .., Node { kind: NodeKind::Range, .. }] => {
                let parts = parts(nodes);
                let (from, to) = operands(&parts, inner.len() as u32)[0];
                self.subscript(at, &nodes[from as usize..=to as usize], span)?
            }
            _ => AffineInteger::constant(1),
        };
        first
            .plus(&offset, 1)
            .ok_or_else(|| self.error(at.scope, "range", span, "a subscript beyond 64 bits"))
    }

    /// The binding of an array's name, arguments of macros replaced.
    fn array(&mut self, at: AstPlace, name: Name) -> Result<Binding, ErrorReported> {
        let mut id = self.spelled(at, name.name, name.span)?;
        let mut binding = self.lookup(at.scope, id);
        for _ in 0..crate::limits::EVALUATION_DEPTH {
            let Binding::Argument(argument) = binding else { break };
            let argument = self.declared.arguments[argument as usize];
            let OperandKind::Name(inner) = argument.operand.kind else { break };
            id = self.spelled(argument.at, inner, argument.operand.span)?;
            binding = self.lookup(argument.at.scope, id);
        }
        Ok(binding)
    }
}

impl Expander<'_> {
    /// Opens the next loop of an equation between slices. Returns false if all loops are open.
    pub(crate) fn slice_loop(
        &mut self,
        at: AstPlace,
        ast: &Rc<Ast>,
        statement: u32,
        equation: &Equation,
    ) -> Result<bool, ErrorReported> {
        let targets: Vec<&Element> =
            equation.targets.iter().filter_map(|target| element(ast, *target)).collect();
        let Some(first) = targets.iter().find(|element| element.is_slice()) else { return Ok(false) };
        let levels = first.indices.iter().filter(|index| is_slice(index)).count();
        let mut open = 0;
        while open < levels {
            let name = self.context.slice_name(open + 1);
            if self.context.lookup(at.scope, name) == Binding::None {
                break;
            }
            open += 1;
        }
        if open == levels {
            return Ok(false);
        }
        let span = first.name.span.to(equation.targets.first().map_or(first.name.span, |target| target.span));
        let target = self.named(at, first, span)?;
        let lengths = self.lengths(at, &target)?;
        if open == 0 {
            self.check_slices(at, ast, equation, &lengths)?;
        }
        let backwards = self.direction(at, ast, equation)?;
        let count = lengths[open].clone();
        let last = count.plus(&AffineInteger::constant(1), -1);
        let last = last
            .ok_or_else(|| self.context.error(at.scope, "range", equation.span, "a range beyond 64 bits"))?;
        let (first, step) = if backwards { (last, -1) } else { (AffineInteger::constant(0), 1) };
        let range = Range { first, step, count, register: None };
        let variable = self.context.slice_name(open + 1);
        let needs = self.slice_of_registers(at, ast, equation)?;
        let body = (statement, statement, statement + 1);
        self.open_loop(
            at,
            variable,
            &range,
            LoopOptions::default(),
            (needs, open + 1 == levels),
            body,
            equation.span,
        )?;
        Ok(true)
    }

    /// The elements and slices of an equation's values.
    fn read<'a>(ast: &'a Ast, equation: &'a Equation) -> impl Iterator<Item = (&'a Element, Span)> {
        let nodes = equation.values.iter().flat_map(|value| &ast.nodes[value.id.range()]);
        nodes.filter_map(|node| match node.kind {
            NodeKind::Element(element) => Some((&ast.elements[element as usize], node.span)),
            _ => None,
        })
    }

    /// Checks that every slice of an equation has the lengths of the first.
    fn check_slices(
        &mut self,
        at: AstPlace,
        ast: &Ast,
        equation: &Equation,
        lengths: &[AffineInteger],
    ) -> Result<(), ErrorReported> {
        let targets = equation.targets.iter().map(|target| (element(ast, *target), target.span));
        let mut others: Vec<(&Element, Span)> = Vec::new();
        for (target, span) in targets {
            match target {
                Some(target) if target.is_slice() => others.push((target, span)),
                _ => {
                    let error = Diagnostic::error(
                        "slice",
                        span,
                        "a slice and one register or element on the left side",
                    )
                    .help("write them in equations of their own");
                    return Err(self.context.report(at.scope, error));
                }
            }
        }
        others.extend(Self::read(ast, equation).filter(|(element, _)| element.is_slice()));
        for (element, span) in others {
            let named = self.named(at, element, span)?;
            let found = self.lengths(at, &named)?;
            if found != lengths {
                let shown = |lengths: &[AffineInteger]| {
                    let texts = lengths.iter().map(|length| match length.as_constant() {
                        Some(length) => length.to_string(),
                        None => "?".to_owned(),
                    });
                    texts.collect::<Vec<_>>().join(" × ")
                };
                let message =
                    format!("this has {} elements, and the left side {}", shown(&found), shown(lengths));
                return Err(self.context.error(at.scope, "slice", span, message));
            }
        }
        Ok(())
    }

    /// The lengths of a slice, in the order of its indices.
    fn lengths(&mut self, at: AstPlace, named: &ArrayReference) -> Result<Vec<AffineInteger>, ErrorReported> {
        let mut lengths = Vec::new();
        for subscript in &named.subscripts {
            let Subscript::Several(first, last) = subscript else { continue };
            let length = last.plus(first, -1).and_then(|length| length.plus(&AffineInteger::constant(1), 1));
            let mut length = length
                .ok_or_else(|| self.context.error(at.scope, "range", named.span, "a range beyond 64 bits"))?;
            length.registers.retain(|register| register.1 != 0);
            if !length.registers.is_empty() {
                let error = Diagnostic::error(
                    "slice",
                    named.span,
                    "the length of a slice must not depend on a register",
                )
                .help("write a `.for` with `max`");
                return Err(self.context.report(at.scope, error));
            }
            lengths.push(length);
        }
        Ok(lengths)
    }

    fn named(
        &mut self,
        at: AstPlace,
        element: &Element,
        span: Span,
    ) -> Result<ArrayReference, ErrorReported> {
        let array = self.context.array(at, element.name)?;
        let sizes: SmallVec<[u32; 2]> = match array {
            Binding::Array(array) => self.context.declared.arrays[array as usize].sizes.clone(),
            Binding::Table(table) => self.context.declared.tables[table as usize].array.sizes.clone(),
            _ => {
                let text = self.context.reports.sources.text(element.name.span).to_owned();
                let error = Diagnostic::error(
                    "slice",
                    element.name.span,
                    format!("`{text}` is not an array that is declared above"),
                )
                .note("the length of a slice is needed where it stands")
                .help(format!("declare `{text}` further up, with `.array` or `.reg`"));
                return Err(self.context.report(at.scope, error));
            }
        };
        let mut subscripts = Vec::with_capacity(element.indices.len());
        for (number, nodes) in element.indices.iter().enumerate() {
            subscripts.push(match nodes.last().map(|node| node.kind) {
                Some(NodeKind::All) => {
                    let size = sizes.get(number).copied().unwrap_or(1);
                    Subscript::Several(AffineInteger::constant(1), AffineInteger::constant(size.into()))
                }
                Some(NodeKind::Range) => {
                    let parts = parts(nodes);
                    let ends = operands(&parts, nodes.len() as u32 - 1);
                    let mut end = |(from, to): (u32, u32)| {
                        self.context.subscript(at, &nodes[from as usize..=to as usize], span)
                    };
                    Subscript::Several(end(ends[0])?, end(ends[1])?)
                }
                _ => Subscript::One(self.context.subscript(at, nodes, span)?),
            });
        }
        Ok(ArrayReference { array, subscripts, span })
    }

    /// The place of the first slice of an array of registers.
    fn slice_of_registers(
        &mut self,
        at: AstPlace,
        ast: &Ast,
        equation: &Equation,
    ) -> Result<Option<Span>, ErrorReported> {
        let targets =
            equation.targets.iter().filter_map(|target| Some((element(ast, *target)?, target.span)));
        for (element, span) in targets.chain(Self::read(ast, equation)) {
            if element.is_slice() && matches!(self.context.array(at, element.name)?, Binding::Array(_)) {
                return Ok(Some(span));
            }
        }
        Ok(None)
    }

    /// The loop must write elements from the last to the first.
    fn direction(&mut self, at: AstPlace, ast: &Ast, equation: &Equation) -> Result<bool, ErrorReported> {
        let mut ways: [Option<Span>; 2] = [None, None];
        for target in &equation.targets {
            let Some(written) = element(ast, *target) else { continue };
            let written = self.named(at, written, target.span)?;
            for (read, span) in Self::read(ast, equation) {
                if self.context.array(at, read.name)? != written.array {
                    continue;
                }
                let read = self.named(at, read, span)?;
                match way(&written, &read) {
                    Some(0) => {}
                    Some(way) => ways[usize::from(way < 0)] = Some(span),
                    None => {
                        let text = self.context.reports.sources.text(span).to_owned();
                        let message = format!("`{text}` may be read after this equation has written it");
                        let error = Diagnostic::error("slice", span, message)
                            .also(target.span, "written here, one element after the other")
                            .help("copy it first: an element to a register, a slice to another array");
                        return Err(self.context.report(at.scope, error));
                    }
                }
            }
        }
        match ways {
            [Some(one), Some(other)] => {
                let error = Diagnostic::error(
                    "slice",
                    one,
                    "the equation reads elements before and after the written ones",
                )
                .also(other, "the others")
                .help("write to another array");
                Err(self.context.report(at.scope, error))
            }
            [_, backwards] => Ok(backwards.is_some()),
        }
    }
}

/// Direction from the written elements to the read ones, 0 if either works; `None` if an element may be written before it is read.
fn way(written: &ArrayReference, read: &ArrayReference) -> Option<i64> {
    let pairs = || written.subscripts.iter().zip(&read.subscripts);
    let difference = |a: &AffineInteger, b: &AffineInteger| {
        let mut difference = a.plus(b, -1)?;
        difference.registers.sort_unstable();
        let registers = &difference.registers;
        let cancels = registers.chunks(2).all(|pair| matches!(pair, [a, b] if a.0 == b.0 && a.1 == -b.1));
        if cancels {
            difference.registers.clear();
        }
        difference.as_constant()
    };
    // Certainly disjoint in one dimension.
    let apart = pairs().any(|pair| match pair {
        (Subscript::One(a), Subscript::One(b)) => difference(a, b).is_some_and(|distance| distance != 0),
        (Subscript::Several(first, last), Subscript::One(one)) => {
            difference(one, first).is_some_and(|distance| distance < 0)
                || difference(one, last).is_some_and(|distance| distance > 0)
        }
        (Subscript::Several(first, last), Subscript::Several(from, to)) => {
            difference(from, last).is_some_and(|distance| distance > 0)
                || difference(to, first).is_some_and(|distance| distance < 0)
        }
        _ => false,
    });
    if apart || written.subscripts.len() != read.subscripts.len() {
        return Some(0);
    }
    let (mut same_slices, mut same_rest, mut moved) = (true, true, 0);
    for pair in pairs() {
        match pair {
            (Subscript::One(a), Subscript::One(b)) => same_rest &= difference(a, b) == Some(0),
            (Subscript::Several(a, _), Subscript::Several(b, _)) => {
                let distance = difference(b, a)?;
                same_slices &= distance == 0;
                if moved == 0 {
                    moved = distance;
                }
            }
            _ => return None,
        }
    }
    match (same_slices, same_rest) {
        // Rows are equal, or have no common elements.
        (true, _) => Some(0),
        (false, true) => Some(moved),
        (false, false) => None,
    }
}

fn is_slice(index: &[Node]) -> bool {
    index.last().is_some_and(|node| node.kind.is_slice())
}

/// The element that an operand denotes.
fn element(ast: &Ast, operand: Operand) -> Option<&Element> {
    match operand.kind {
        OperandKind::Element(element) => Some(&ast.elements[element as usize]),
        _ => None,
    }
}

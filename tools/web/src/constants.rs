// SPDX-License-Identifier: MIT OR Apache-2.0
//! Constants of the page's source that can be set while watching the plots: each `.const` whose value stands in the text itself, but no
//! sampling period, which a plant and a host share, and no count, on which arrays and loops depend. Constants that are computed from others
//! follow them. A slider begins at zero, but not that of a divisor or of a time: without one, few programs assemble.

use serde_json::{Value, json};
use std::collections::{HashMap, HashSet};
use takt_asm::AssembledProgram;
use takt_asm::expr::Value as Number;
use takt_asm::units;
use takt_diagnostics::diag::Sink;
use takt_diagnostics::source::Source;
use takt_syntax::ast::{Ast, DirectiveKind, Expr, Name, NodeKind, Operator, StatementKind};
use takt_syntax::intern::Interner;

/// Maximum number of constants that are offered.
const MOST: usize = 60;
/// Units of times.
const TIMES: [&str; 4] = ["s", "ms", "us", "µs"];
/// Least value of a slider that cannot begin at zero, in parts of the constant's value.
const LEAST: f64 = 0.1;

/// Settable constants in source order: name, value, and place of the value's text, in UTF-16 units as JavaScript counts them.
pub(crate) fn settable(assembled: &AssembledProgram) -> Vec<Value> {
    let Some(source) = assembled.sources.files().first() else { return Vec::new() };
    let mut names = Interner::new();
    let ast = takt_syntax::parse::parse(source, &mut names, &mut Sink::default());
    let mut offsets = Offsets { text: &source.text, byte: 0, units: 0 };
    let declared = declarations(&ast, &names);
    let known: HashSet<&str> = declared.iter().map(|(name, _)| *name).collect();
    let divisors = divisors(&ast, &names, &declared);
    let numbers: HashMap<&str, Number> =
        assembled.constants.iter().map(|(name, value)| (name.as_str(), *value)).collect();
    let of = |(name, value): &(&str, Expr)| {
        let number = *numbers.get(name)?;
        let is_literal = ast.nodes[value.id.range()].iter().all(|node| is_own(node.kind, &names, &known));
        if !is_literal || !number.real().is_finite() {
            return None;
        }
        let start = (value.span.start - source.base) as usize;
        let end = (value.span.end - source.base) as usize;
        let comment = comment_after(source, end);
        let unit = comment.and_then(units::leading_unit);
        // A number of elements has no unit.
        let is_count = matches!(number, Number::Int(_)) && unit.is_none();
        if is_count || units::PERIODS.contains(&(name, unit.as_deref().unwrap_or_default())) {
            return None;
        }
        let is_time = unit.as_deref().is_some_and(|unit| TIMES.contains(&unit));
        let is_above_zero = number.real() > 0.0 && (is_time || divisors.contains(name));
        let low = is_above_zero.then(|| number.real() * LEAST);
        let from = offsets.units_at(start);
        let to = offsets.units_at(end);
        // The computation of a value, such as `0.95/sqrt(3)`, says more than its number.
        let written = source.text.get(start..end).map(str::trim);
        let formula = written.filter(|text| text.parse::<f64>().is_err());
        Some(json!({
            "name": name, "value": number.real(), "integer": matches!(number, Number::Int(_)),
            "from": from, "to": to, "unit": unit, "text": comment, "formula": formula, "low": low,
        }))
    };
    declared.iter().filter_map(of).take(MOST).collect()
}

/// Constants that the source declares for every expansion: outside of macros, repetitions and conditions, under a plain name.
fn declarations<'n>(ast: &Ast, names: &'n Interner) -> Vec<(&'n str, Expr)> {
    let (mut depth, mut found) = (0_usize, Vec::new());
    for statement in &ast.statements {
        let StatementKind::Directive(index) = statement.kind else { continue };
        match &ast.directives[index as usize].kind {
            DirectiveKind::Macro { .. }
            | DirectiveKind::Rep { .. }
            | DirectiveKind::For { .. }
            | DirectiveKind::If(..) => depth += 1,
            DirectiveKind::End(_) => depth = depth.saturating_sub(1),
            DirectiveKind::Const(Name { name, .. }, value) if depth == 0 => {
                found.extend(name.resolve().ok().map(|id| (names.text(id), *value)));
            }
            _ => {}
        }
    }
    found
}

/// Names within a divisor, and those from which these are computed.
fn divisors<'n>(ast: &Ast, names: &'n Interner, declared: &[(&'n str, Expr)]) -> Vec<&'n str> {
    let name = |kind: NodeKind| match kind {
        NodeKind::Name(name) => name.resolve().ok().map(|id| names.text(id)),
        _ => None,
    };
    // Nodes of an expression follow one another, operands first: a stack holds where each operand begins.
    let mut found = Vec::new();
    let mut begins: Vec<usize> = Vec::new();
    for (at, node) in ast.nodes.iter().enumerate() {
        let operands = match node.kind {
            NodeKind::Prefix(_) => 1,
            NodeKind::Infix(_) | NodeKind::Range => 2,
            NodeKind::Choice => 3,
            NodeKind::Call(_, count) => count as usize,
            _ => 0,
        };
        let first = begins.len().saturating_sub(operands);
        if node.kind == NodeKind::Infix(Operator::Div) {
            let divisor = begins.last().copied().unwrap_or(at)..at;
            found.extend(ast.nodes[divisor].iter().filter_map(|node| name(node.kind)));
        }
        let begin = begins.get(first).copied().unwrap_or(at);
        begins.truncate(first);
        begins.push(begin);
    }
    // Constants are declared before they are used.
    for (of, value) in declared.iter().rev() {
        if found.contains(of) {
            found.extend(ast.nodes[value.id.range()].iter().filter_map(|node| name(node.kind)));
        }
    }
    found
}

/// The node depends on nothing that the source declares.
fn is_own(kind: NodeKind, names: &Interner, declared: &HashSet<&str>) -> bool {
    match kind {
        NodeKind::Name(name) => {
            name.resolve().is_ok_and(|id| id.builtin().is_some() && !declared.contains(names.text(id)))
        }
        NodeKind::Element(_) | NodeKind::All | NodeKind::Range => false,
        _ => true,
    }
}

/// Comment on the line of an offset.
fn comment_after(source: &Source, offset: usize) -> Option<&str> {
    let rest = source.text.get(offset..)?.lines().next()?;
    rest.split_once(';').map(|(_, comment)| comment.trim())
}

/// Conversion of ascending byte offsets to UTF-16 units.
struct Offsets<'t> {
    text: &'t str,
    byte: usize,
    units: usize,
}

impl Offsets<'_> {
    fn units_at(&mut self, byte: usize) -> usize {
        self.units += self.text.get(self.byte..byte).map_or(0, |part| part.encode_utf16().count());
        self.byte = byte;
        self.units
    }
}

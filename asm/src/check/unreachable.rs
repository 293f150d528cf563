// SPDX-License-Identifier: MIT OR Apache-2.0
//! Unreachable code, found by following control flow from the first bundle.

use super::{ScopeId, target};
use crate::context::Context;
use crate::ir::{Bundle, Ir, Label, Operation};
use foldhash::{HashMap, HashMapExt as _};
use std::ops::Range;
use takt_diagnostics::diag::Diagnostic;
use takt_isa::Effect;
use takt_isa::program::Space;

/// The bundles to which control may pass next. A call counts as returning.
pub(super) fn next(ir: &Ir, index: u32, bundle: &Bundle) -> impl Iterator<Item = u32> {
    let on = end(bundle).is_none().then_some(index + 1);
    on.into_iter().chain(bundle.operations.iter().filter_map(|operation| target(ir, operation)))
}

/// The operation after which control never falls through.
fn end(bundle: &Bundle) -> Option<&Operation> {
    let ends = |operation: &&Operation| {
        let effect = operation.row().effect;
        !effect.falls_through() && effect != Effect::Call
    };
    bundle.operations.iter().find(ends)
}

/// Marks the bundles that control may reach from a bundle.
fn follow(ir: &Ir, from: u32, seen: &mut [bool]) {
    let mut reached = vec![from];
    while let Some(index) = reached.pop() {
        let Some(bundle) = ir.bundles.get(index as usize) else { continue };
        if !std::mem::replace(&mut seen[index as usize], true) {
            reached.extend(next(ir, index, bundle));
        }
    }
}

/// Warns of unreachable code, once for each piece. A piece lies between two ends of the flow.
pub(super) fn check(context: &mut Context, ir: &Ir) {
    let mut seen = vec![false; ir.bundles.len()];
    follow(ir, 0, &mut seen);
    if seen.iter().all(|seen| *seen) {
        return;
    }
    let mut labels: HashMap<usize, Vec<&Label>> = HashMap::new();
    for label in ir.labels.iter().filter(|label| label.space == Space::Code) {
        labels.entry(label.position as usize).or_default().push(label);
    }
    let mut dead = 0..0;
    while let Some(start) = (dead.end..seen.len()).find(|&index| !seen[index]) {
        let ends = |index: &usize| seen[*index] || end(&ir.bundles[index - 1]).is_some();
        dead = start..(start + 1..seen.len()).find(ends).unwrap_or(seen.len());
        piece(context, ir, dead.clone(), labels.get(&start).map_or(&[], Vec::as_slice));
        // Code after the piece would run if the piece did: no warning of its own.
        follow(ir, start as u32, &mut seen);
    }
}

/// Warns of one unreachable piece, unless it does nothing, the assembler made it, or it is a subroutine that others may call.
fn piece(context: &mut Context, ir: &Ir, dead: Range<usize>, labels: &[&Label]) {
    let does = |operation: &&Operation| !operation.made && operation.row().effect != Effect::Nothing;
    let Some(first) = ir.bundles[dead.clone()].iter().flat_map(|bundle| &bundle.operations).find(does) else {
        return;
    };
    // An included file may define more than the program needs; a leading `_` marks code as unused on purpose.
    let is_included = context.reports.sources.file_of(first.span.start) != 0;
    if labels.iter().any(|label| is_included || label.name.starts_with('_')) {
        return;
    }
    let mut warning =
        Diagnostic::warning("unreachable", first.span, "nothing leads here").here("this never runs");
    let before = dead.start.checked_sub(1).and_then(|before| end(&ir.bundles[before]));
    if let Some(before) = before {
        let message = format!("control never continues after this `{}`", before.row().mnemonic);
        warning = warning.also(before.span, message);
    }
    let help = match labels.first() {
        Some(label) => format!(
            "jump to `{0}` or call it, or begin its name with `_` if it is to be there unused",
            label.name
        ),
        None => {
            "move it before the operation that ends the flow, give it a label that is jumped to, or leave it out".to_owned()
        }
    };
    context.report(ScopeId(first.expansion), warning.help(help));
}

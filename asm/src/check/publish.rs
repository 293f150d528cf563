// SPDX-License-Identifier: MIT OR Apache-2.0
//! Publication of outputs: on no path from a `publish` to the `wait` is an output written, or published again.

use super::{ScopeId, text, unreachable};
use crate::context::Context;
use crate::ir::{Bundle, Ir, Operation, RegisterKind};
use takt_diagnostics::diag::Diagnostic;
use takt_isa::Effect;

/// Limit on the groups of `publish`es that errors tell apart.
const GROUPS: usize = 16;

/// Reports each write to an output, and each `publish`, that may follow a `publish` in its period.
pub(super) fn check(context: &mut Context, ir: &Ir) {
    if !ir.operations().any(publishes) {
        return;
    }
    let late = Paths::new(ir).after_publications();
    let mut errors = Vec::new();
    for (bundle, &late) in ir.bundles.iter().zip(&late) {
        // Results of the bundle with the `publish` come after it.
        let beside = bundle.operations.iter().find(|operation| publishes(operation));
        let Some(before) = late.or(beside) else { continue };
        for operation in &bundle.operations {
            let message = match operation.dest.filter(|dest| is_output(ir, ir.register(*dest))) {
                Some(dest) => {
                    format!(
                        "output `{}` is written after the outputs are published",
                        text(ir, ir.register(dest))
                    )
                }
                None if late.is_some() && publishes(operation) => {
                    "the outputs are published a second time in a period".to_owned()
                }
                None => continue,
            };
            let error = Diagnostic::error("publish", operation.span, message);
            let error = match before.span == operation.span {
                true => error,
                false => error.also(before.span, "published here"),
            };
            let help = "write all outputs, then publish them, once on each path to the `wait`";
            errors.push((ScopeId(operation.expansion), error.help(help)));
        }
    }
    for (scope, error) in errors {
        context.report(scope, error);
    }
}

fn publishes(operation: &Operation) -> bool {
    operation.row().effect == Effect::Publish
}

fn is_output(ir: &Ir, register: &crate::ir::VirtualRegister) -> bool {
    register.kind == RegisterKind::Output
        || register.pinned.is_some_and(|address| ir.machine.is_output(address))
}

/// Control flow within a period: from bundle to bundle, up to the next `wait`.
struct Paths<'i> {
    ir: &'i Ir,
    /// Loops that the sequencer counts: the last bundle of each, and its first.
    loops: Vec<(u32, u32)>,
    /// Calls: the bundle of each, and the first bundle that it calls.
    calls: Vec<(u32, u32)>,
}

impl<'i> Paths<'i> {
    fn new(ir: &'i Ir) -> Paths<'i> {
        let with = |effect: Effect| {
            (0..).zip(&ir.bundles).flat_map(move |(at, bundle)| {
                let of_effect = bundle.operations.iter().filter(move |one| one.row().effect == effect);
                of_effect.filter_map(move |operation| Some((at, super::target(ir, operation)?)))
            })
        };
        let loops = with(Effect::Loop).map(|(at, end): (u32, u32)| (end.saturating_sub(1), at + 1)).collect();
        Paths { ir, loops, calls: with(Effect::Call).collect() }
    }

    /// For each bundle that control may reach after a `publish`, one such `publish`.
    fn after_publications(&self) -> Vec<Option<&'i Operation>> {
        let publication =
            |bundle: &'i Bundle| bundle.operations.iter().find(|operation| publishes(operation));
        let all: Vec<(u32, &Operation)> =
            (0..).zip(&self.ir.bundles).filter_map(|(at, bundle)| Some((at, publication(bundle)?))).collect();
        let called: Vec<Vec<bool>> =
            self.calls.iter().map(|(_, target)| self.reached(vec![*target])).collect();
        let mut late = vec![None; self.ir.bundles.len()];
        // Few groups, so that a program of thousands of them takes no longer.
        for group in all.chunks(all.len().div_ceil(GROUPS).max(1)) {
            let own = group.iter().map(|(at, _)| *at);
            // A subroutine that publishes returns behind its call.
            let calls = self.calls.iter().zip(&called);
            let calls = calls.filter(|(_, reached)| own.clone().any(|at| reached[at as usize]));
            let sources = own.clone().chain(calls.map(|((at, _), _)| *at));
            let reached = self.reached(sources.flat_map(|at| self.continuations(at, false)).collect());
            for (late, reached) in late.iter_mut().zip(reached) {
                if reached {
                    late.get_or_insert(group[0].1);
                }
            }
        }
        late
    }

    /// The bundles that follow a bundle: the next one, or the first one of a loop that it ends; with `targets`, also where it leads.
    fn continuations(&self, at: u32, targets: bool) -> Vec<u32> {
        let heads = self.loops.iter().filter(|(last, _)| *last == at).map(|(_, head)| *head);
        let mut next: Vec<u32> = heads.collect();
        match self.ir.bundles.get(at as usize) {
            Some(bundle) if targets => next.extend(unreachable::next(self.ir, at, bundle)),
            _ => next.push(at + 1),
        }
        next
    }

    /// Marks the bundles that control may reach from some, without passing a `wait`.
    fn reached(&self, mut left: Vec<u32>) -> Vec<bool> {
        let mut seen = vec![false; self.ir.bundles.len()];
        while let Some(index) = left.pop() {
            let Some(bundle) = self.ir.bundles.get(index as usize) else { continue };
            let is_new = !std::mem::replace(&mut seen[index as usize], true);
            if is_new && !bundle.operations.iter().any(|operation| operation.row().effect == Effect::Wait) {
                left.extend(self.continuations(index, true));
            }
        }
        seen
    }
}

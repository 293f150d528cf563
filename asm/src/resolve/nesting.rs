// SPDX-License-Identifier: MIT OR Apache-2.0
//! Nesting of counted loops and calls, once every bundle has its place: a loop is entered at its beginning and left at its end, does not
//! call itself by any chain of calls, and with the loops of its callers stays within the machine's loop depth.

use crate::context::{Context, ScopeId};
use crate::ir::calls::Calls;
use crate::ir::runs::{self, Run};
use crate::ir::{Ir, LabelId, Operation};
use std::ops::Range;
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::source::Span;
use takt_isa::Effect;

/// Refuses jumps, calls and loops that break these rules. Labels from `made` on are the assembler's own.
pub(super) fn check(context: &mut Context, ir: &Ir, made: usize) {
    check_jumps(context, ir, made);
    let has_loops =
        !ir.loops.is_empty() || ir.operations().any(|operation| operation.row().effect == Effect::Loop);
    if !has_loops || context.reports.sink.errors > 0 || ir.is_too_long() {
        return;
    }
    let runs = runs::runs(ir);
    let calls = Calls::new(ir, &runs);
    if !recurs(context, ir, &calls) {
        check_depth(context, ir, &runs, &calls);
    }
}

fn position(ir: &Ir, label: LabelId) -> usize {
    ir.labels[label.0 as usize].position as usize
}

/// Target of an operation, if it is a bundle that the source names.
fn target(ir: &Ir, operation: &Operation) -> Option<usize> {
    operation.target().map(|target| target.map_or_else(|number| number as usize, |label| position(ir, label)))
}

/// Refuses jumps into and out of the body of a loop: the count is set before it and runs out at its end.
fn check_jumps(context: &mut Context, ir: &Ir, made: usize) {
    // A loop that could not begin has no end label of the assembler.
    let begun = ir.loops.iter().filter(|counted| counted.end.0 as usize >= made);
    let bodies: Vec<(Range<usize>, Span)> =
        begun.map(|counted| (counted.head as usize..position(ir, counted.end), counted.span)).collect();
    if bodies.is_empty() {
        return;
    }
    let mut wrong: Vec<(&Operation, Span, &str)> = Vec::new();
    for (at, bundle) in ir.bundles.iter().enumerate() {
        for operation in bundle.operations.iter().filter(|operation| operation.redirects()) {
            // Jumps made by the assembler keep to the rules.
            if matches!(operation.target(), Some(Ok(label)) if label.0 as usize >= made) {
                continue;
            }
            let to = target(ir, operation);
            for (body, span) in &bodies {
                let (is_from, is_to) = (body.contains(&at), to.is_some_and(|to| body.contains(&to)));
                let message = match operation.row().effect {
                    Effect::Call if is_to => "this calls into the body of a counted loop",
                    Effect::Call | Effect::Halt => continue,
                    _ if is_from && !is_to => "this leaves the body of a counted loop",
                    _ if is_to && !is_from => "this leads into the body of a counted loop",
                    _ => continue,
                };
                wrong.push((operation, *span, message));
                break;
            }
        }
    }
    for (operation, span, message) in wrong {
        let error = Diagnostic::error("loop", operation.span, message)
            .also(span, "this loop")
            .note("a counted loop is entered at its beginning and left when its count runs out")
            .help("write a loop that ends earlier with a label and `bnz`");
        context.report(ScopeId(operation.expansion), error);
    }
}

/// Reports loops that call themselves: counters are registers, shared by all uses of the loop. Returns whether there are any.
fn recurs(context: &mut Context, ir: &Ir, calls: &Calls<'_>) -> bool {
    let outermost = ir.loops.iter().filter(|counted| counted.parent.is_none());
    for counted in outermost {
        let body = counted.head as usize..position(ir, counted.end);
        if calls.within(&body).next().is_none() {
            continue;
        }
        let Some(chain) = calls.chain(&body, &body) else { continue };
        let message = "a counted loop calls itself: its count and its index would be lost";
        let mut error = Diagnostic::error("recursion", counted.span, message);
        for at in chain {
            error = error.also(call_at(ir, at).span, "by this call");
        }
        let error = error.help("call from outside of the loop, or write the loop with a label and `bnz`");
        context.report(ScopeId(call_scope(ir, body.start)), error);
        return true;
    }
    false
}

/// The call of a bundle.
fn call_at(ir: &Ir, at: usize) -> &Operation {
    let operations = &ir.bundles[at].operations;
    operations.iter().find(|operation| operation.row().effect == Effect::Call).unwrap_or(&operations[0])
}

fn call_scope(ir: &Ir, at: usize) -> u32 {
    ir.bundles.get(at).map_or(0, |bundle| bundle.operations[0].expansion)
}

/// A loop that the sequencer counts: the bundle of its `loop`, and its body.
struct Hardware<'a> {
    at: usize,
    body: Range<usize>,
    operation: &'a Operation,
}

/// Reports loops beyond the sequencer's loop depth, which includes enclosing loops and those of callers.
fn check_depth(context: &mut Context, ir: &Ir, runs: &[Run], calls: &Calls<'_>) {
    let loops = hardware(ir);
    let Some(depth) = Some(ir.machine.loop_depth as usize).filter(|_| !loops.is_empty()) else { return };
    // Number of loops around each bundle.
    let mut around = vec![0isize; ir.bundles.len() + 1];
    for Hardware { body, .. } in &loops {
        around[body.start] += 1;
        around[body.end] -= 1;
    }
    for at in 1..around.len() {
        around[at] += around[at - 1];
    }
    // By run: the largest number of loops around the calls that lead there, and the last of these calls. Counts saturate at one too many,
    // so that recursion comes to an end.
    let mut callers: Vec<(usize, Option<usize>)> = vec![(0, None); runs.len()];
    let mut left: Vec<usize> = (0..runs.len()).collect();
    while let Some(run) = left.pop() {
        let (most, call) = callers[run];
        let after = calls.after(run).map(|to| (to, most, call));
        let called =
            calls.of(run).map(|(at, to)| (to, (most + around[at] as usize).min(depth + 1), Some(at)));
        for (to, loops, call) in after.chain(called) {
            if loops > callers[to].0 {
                callers[to] = (loops, call);
                left.push(to);
            }
        }
    }
    let of = |at: usize| callers[runs.partition_point(|run| run.end <= at)];
    let nested = |at: usize| of(at).0 + around[at] as usize + 1;
    let Some(wrong) = loops.iter().find(|one| nested(one.at) > depth) else { return };
    let (count, name) = (nested(wrong.at), ir.machine.name);
    let message = match of(wrong.at).0 {
        0 => format!("a nest of {count} counted loops: {name} counts {depth} within one another"),
        _ => format!("counted loops nest {count} deep by calls: {name} counts {depth} within one another"),
    };
    let mut error = Diagnostic::error("loop", wrong.operation.span, message);
    let (mut at, mut shown) = (wrong.at, 0);
    loop {
        for outer in loops.iter().rev().filter(|outer| outer.body.contains(&at)) {
            error = error.also(outer.operation.span, "around it");
            shown += 1;
        }
        let Some(call) = of(at).1.filter(|_| shown <= depth) else { break };
        error = error.also(call_at(ir, call).span, "called here");
        at = call;
    }
    let error = error.help("write one of them out: `unroll` with its number of iterations");
    context.report(ScopeId(wrong.operation.expansion), error);
}

fn hardware(ir: &Ir) -> Vec<Hardware<'_>> {
    let mut loops = Vec::new();
    for (at, bundle) in ir.bundles.iter().enumerate() {
        for operation in bundle.operations.iter().filter(|operation| operation.row().effect == Effect::Loop) {
            let end = target(ir, operation).unwrap_or(0).min(ir.bundles.len());
            loops.push(Hardware { at, body: at + 1..end.max(at + 1), operation });
        }
    }
    loops
}

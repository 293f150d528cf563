// SPDX-License-Identifier: MIT OR Apache-2.0
//! Copies between banks: an operation that copies a value to the bank of its register, if another slot computes it. The copy goes
//! into a slot that the source leaves free, else into a bundle of its own.

use crate::banks::webs::BankCopy;
use crate::banks::{self, Adjustment, BankAssignment, Transfer};
use crate::ir::runs::{self, Run};
use crate::ir::{Bundle, Constant, Ir, Operation, RegisterId, RegisterKind};
use crate::schedule;
use smallvec::SmallVec;
use takt_isa::{BundleAddress, Effect, Op};

/// A bundle of a run with copies inserted.
#[derive(Clone)]
struct RunBundle {
    bundle: Bundle,
    /// Index of the original bundle; `None` for a new one.
    origin: Option<usize>,
}

/// A preset or a fused operation has replaced this operation.
fn is_gone(operation: &Operation) -> bool {
    operation.made && operation.op == Op::nop
}

/// Inserts the copies, and takes out the operations that presets and fused operations have replaced.
pub(crate) fn insert(ir: &mut Ir, assignment: &mut BankAssignment, copies: &[BankCopy]) {
    let count = ir.bundles.len();
    let mut bundles: Vec<Bundle> = Vec::with_capacity(count + copies.len());
    // New position of each bundle, by its old one.
    let mut moved = vec![0u32; count + 1];
    let mut left = copies;
    for run in runs::runs(ir) {
        let place = |at: usize| RunBundle { bundle: ir.bundles[at].clone(), origin: Some(at) };
        let mut places: Vec<RunBundle> = (run.start..run.end).map(place).collect();
        let (here, rest) = left.split_at(left.partition_point(|copy| copy.at.0 < run.end));
        left = rest;
        for (index, copy) in here.iter().enumerate() {
            let Some((home, copier)) = assignment.get(copy.to).and_then(|home| Some((home, home.copier?)))
            else {
                continue;
            };
            let from = ir.bundles[copy.at.0].operations[copy.at.1];
            let operation = Operation {
                op: copier,
                slots: banks::able(ir, copy.to, copier),
                slot: Some(home.slot),
                dest: Some(copy.to),
                sources: [copy.from, RegisterId::ZERO, RegisterId::ZERO],
                constant: Constant::None,
                access: None,
                assumed: None,
                made: true,
                ..from
            };
            let limit = limit(ir, run, copy, &here[index + 1..]);
            let cycles = put(ir, &mut places, run, copy, operation, limit);
            assignment.copied.push((assignment.adjustments.len(), copy.from));
            // The address is known after scheduling.
            let transfer = Transfer::Copy { address: BundleAddress::RESET, alone: true, cycles };
            assignment.adjustments.push(banks::adjustment(ir, copy.to, home.slot, &from, transfer));
        }
        for RunBundle { mut bundle, origin } in places {
            if let Some(origin) = origin {
                moved[origin] = bundles.len() as u32;
            }
            bundle.operations.retain(|operation| !is_gone(operation));
            if !bundle.operations.is_empty() {
                bundles.push(bundle);
            }
        }
    }
    moved[count] = bundles.len() as u32;
    ir.replace_bundles(bundles, |position: u32| moved.get(position as usize).copied().unwrap_or(position));
}

/// Index of the bundle before which a value must be copied: where control leaves, and for an output port also the next write
/// and the next access to memory, which may fault. `later` are the copies of the run that follow.
fn limit(ir: &Ir, run: Run, copy: &BankCopy, later: &[BankCopy]) -> usize {
    let output = ir.register(copy.to).kind == RegisterKind::Output;
    let ends = |operation: &Operation| {
        let access = matches!(operation.row().effect, Effect::Load | Effect::Store);
        operation.redirects() || (output && (access || operation.dest == Some(copy.to)))
    };
    let end = (copy.at.0 + 1..run.end).find(|&at| ir.bundles[at].operations.iter().any(ends));
    let next = later.iter().find(|other| output && other.to == copy.to).map(|other| other.at.0);
    end.unwrap_or(run.end).min(next.unwrap_or(run.end))
}

/// Inserts a copy into a run, before a bundle. Returns the cycles that it costs the run, if the bundles are not scheduled.
fn put(
    ir: &Ir,
    places: &mut Vec<RunBundle>,
    run: Run,
    copy: &BankCopy,
    operation: Operation,
    limit: usize,
) -> Option<u32> {
    let issue = |places: &[RunBundle]| {
        let bundles: Vec<Bundle> = places.iter().map(|place| place.bundle.clone()).collect();
        schedule::as_written(ir, &bundles)
    };
    let length = |places: &[RunBundle]| issue(places).last().copied().unwrap_or(0);
    let before = if run.scheduled { 0 } else { length(places) };
    let writer = places.iter().position(|place| place.origin == Some(copy.at.0))?;
    let is_late = |place: &RunBundle| {
        place.origin.is_some_and(|origin| origin >= limit)
            || place.bundle.operations.iter().any(Operation::redirects)
    };
    let mut end = (writer + 1..places.len()).find(|&at| is_late(&places[at])).unwrap_or(places.len());
    // A redirection is issued after the copy.
    let bundle = &mut places[writer].bundle;
    if bundle.operations.iter().any(Operation::redirects) {
        let (redirects, others) = bundle.operations.iter().copied().partition(Operation::redirects);
        bundle.operations = others;
        let last = Bundle { operations: redirects, explicit: false, scheduled: bundle.scheduled };
        end = writer + 1;
        places.insert(end, RunBundle { bundle: last, origin: None });
    }
    let mut alone = places.clone();
    let bundle =
        Bundle { operations: SmallVec::from_elem(operation, 1), explicit: false, scheduled: run.scheduled };
    alone.insert(end, RunBundle { bundle, origin: None });
    if run.scheduled {
        *places = alone;
        return None;
    }
    let start = issue(places);
    let value = places[writer].bundle.operations.iter().find(|operation| operation.dest == Some(copy.from));
    let ready = start[writer] + value.map_or(0, |value| schedule::latency(ir.machine, value));
    let has_room = |&at: &usize| {
        let operations = || places[at].bundle.operations.iter().filter(|operation| !is_gone(operation));
        operations().count() < ir.machine.slots.len()
            && operations().all(|other| other.slot != operation.slot)
            && operations().count() > 0
    };
    let free: Vec<usize> = (writer + 1..end).filter(has_room).collect();
    let ready = free.iter().copied().find(|&at| start[at] >= ready);
    let shared = ready.into_iter().chain(free.last().copied()).map(|at| {
        let mut shared = places.clone();
        shared[at].bundle.operations.push(operation);
        shared
    });
    // The first minimum shares a bundle if any does.
    let best = shared.chain([alone]).min_by_key(|places| length(places))?;
    let longer = length(&best).saturating_sub(before);
    *places = best;
    Some(longer)
}

/// The adjustments, with the final addresses of the copies.
pub(crate) fn report(ir: &Ir, assignment: BankAssignment) -> Vec<Adjustment> {
    let BankAssignment { mut adjustments, copied, .. } = assignment;
    for (at, bundle) in (0u32..).zip(&ir.bundles) {
        for operation in bundle.operations.iter().filter(|operation| operation.made) {
            let Some(&(index, _)) = copied.iter().find(|(_, from)| operation.reads() == [*from]) else {
                continue;
            };
            if let Transfer::Copy { address, alone, .. } = &mut adjustments[index].transfer {
                *address = BundleAddress::new(at);
                *alone = bundle.operations.iter().all(|operation| operation.made);
            }
        }
    }
    adjustments
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Control-flow graph between the straight runs of a program, and analyses on it: liveness of registers, bundles that issue only
//! once, and estimated execution frequencies.

use crate::ir::runs::{self, Run};
use crate::ir::{Ir, Operation, RegisterId};
use std::collections::HashMap;
use takt_isa::Effect;

/// Estimated frequency of a bundle of the period relative to a bundle of `.once`, and of a bundle in a loop relative to a bundle
/// outside: rough guesses, used only to weigh copies.
const PERIOD: u64 = 64;
const LOOP: u32 = 3;
const LOOPS: u32 = 4;

/// The control flow of a program.
pub(crate) struct Flow {
    /// By run: its predecessors.
    sources: Vec<Vec<usize>>,
    /// Runs after which every register counts as read: control stops there, and a debugger can look at registers.
    ends: Vec<usize>,
    /// Number of bundles from the first on that are issued once each, one after another.
    pub(crate) once: usize,
    /// The estimated frequency of each bundle.
    pub(crate) weights: Vec<u64>,
    /// Control may go anywhere, or raw words may read any register: then every register is live.
    pub(crate) unknown: bool,
}

impl Flow {
    pub(crate) fn new(ir: &Ir, runs: &[Run]) -> Flow {
        let count = ir.bundles.len();
        let starts: HashMap<usize, usize> = (0..).zip(runs).map(|(index, run)| (run.start, index)).collect();
        // Redirections with a target: source bundle, target bundle and effect.
        let mut jumps: Vec<(usize, usize, Effect)> = Vec::new();
        for (at, bundle) in ir.bundles.iter().enumerate() {
            for operation in &bundle.operations {
                if let Some(Ok(label)) = operation.target() {
                    let (to, effect) =
                        (ir.labels[label.0 as usize].position as usize, operation.row().effect);
                    // A loop leads from its last bundle back to its first.
                    let jump = if effect == Effect::Loop { (to.saturating_sub(1), at + 1) } else { (at, to) };
                    jumps.push((jump.0, jump.1, effect));
                }
            }
        }
        jumps.sort_by_key(|jump| jump.0);
        let returns: Vec<usize> =
            jumps.iter().filter(|jump| jump.2 == Effect::Call).map(|(at, ..)| at + 1).collect();
        let mut sources = vec![Vec::new(); runs.len()];
        let mut ends = Vec::new();
        for (index, run) in runs.iter().enumerate() {
            let Some(last) = ir.bundles[run.start..run.end].last() else { continue };
            let effects = || last.operations.iter().map(|operation| operation.row().effect);
            let mut next: Vec<usize> = Vec::new();
            if effects().all(Effect::falls_through) {
                next.push(run.end);
            }
            if effects().any(|effect| effect == Effect::Return) {
                next.extend_from_slice(&returns);
            }
            let from = jumps.partition_point(|jump| jump.0 < run.end - 1);
            let own = jumps[from..].iter().take_while(|jump| jump.0 == run.end - 1);
            next.extend(own.map(|&(_, to, _)| to));
            if effects().any(|effect| effect == Effect::Halt) || next.iter().any(|to| *to >= count) {
                ends.push(index);
            }
            for to in next {
                if let Some(&to) = starts.get(&to) {
                    sources[to].push(index);
                }
            }
        }
        let unknown = runs::jumps_to_numbers(ir) || ir.is_opaque();
        let once = if unknown { 0 } else { once(ir, &jumps) };
        Flow { sources, ends, once, weights: weights(ir, &jumps), unknown }
    }

    /// Liveness of a register at the end of each run. Given by run: whether it reads the register before writing it, and
    /// whether it writes it.
    pub(crate) fn live_after(&self, reads: &[bool], writes: &[bool]) -> Vec<bool> {
        if self.unknown {
            return vec![true; reads.len()];
        }
        let mut live = vec![false; reads.len()];
        let mut wanted: Vec<usize> = (0..reads.len()).filter(|&run| reads[run]).collect();
        let mut known: Vec<bool> = reads.to_vec();
        let mut reached: Vec<usize> = self.ends.clone();
        loop {
            while let Some(run) = reached.pop() {
                if !std::mem::replace(&mut live[run], true) && !writes[run] && !known[run] {
                    known[run] = true;
                    wanted.push(run);
                }
            }
            let Some(run) = wanted.pop() else { return live };
            reached.extend_from_slice(&self.sources[run]);
        }
    }
}

impl Flow {
    /// Every path from the start to the end of run `at`, itself included, passes a run of `some`.
    pub(crate) fn is_always(&self, at: usize, some: &[bool]) -> bool {
        let mut left = vec![at];
        let mut known = vec![false; some.len()];
        while let Some(run) = left.pop() {
            if some[run] || std::mem::replace(&mut known[run], true) {
                continue;
            }
            if run == 0 {
                return false;
            }
            left.extend_from_slice(&self.sources[run]);
        }
        true
    }
}

/// Number of bundles from the first on that are issued once each and in order: nothing leads back to them or past them.
fn once(ir: &Ir, jumps: &[(usize, usize, Effect)]) -> usize {
    let onward = |&(at, to, effect): &(usize, usize, Effect)| {
        to == at + 1 && matches!(effect, Effect::Jump | Effect::Wait)
    };
    let elsewhere = jumps.iter().filter(|jump| !onward(jump)).map(|&(_, to, _)| to);
    // A `.loop_bound` stays with its bundle.
    let heads = ir.loop_bounds.iter().map(|bound| bound.position as usize);
    let end = elsewhere.chain(heads).fold(ir.period as usize, usize::min);
    let leaves = |at: usize| {
        let redirects = ir.bundles[at].operations.iter().any(Operation::redirects);
        redirects && !jumps.iter().any(|jump| jump.0 == at && onward(jump))
    };
    (0..end).find(|&at| leaves(at)).map_or(end, |at| at + 1)
}

fn weights(ir: &Ir, jumps: &[(usize, usize, Effect)]) -> Vec<u64> {
    let mut deeper = vec![0i64; ir.bundles.len() + 1];
    for &(at, to, effect) in jumps.iter().filter(|&&(at, to, _)| to <= at) {
        // Neither the period as a whole nor a call of earlier code is a loop.
        if matches!(effect, Effect::Jump | Effect::BranchZero | Effect::BranchNonzero | Effect::Loop) {
            deeper[to] += 1;
            deeper[at + 1] -= 1;
        }
    }
    let mut depth = 0;
    (0..ir.bundles.len())
        .map(|at| {
            depth += deeper[at];
            let once = if at < ir.period as usize { 1 } else { PERIOD };
            once << (LOOP * (depth as u32).min(LOOPS))
        })
        .collect()
}

/// By run: whether it reads a register before it writes it, and whether it writes it.
pub(crate) fn uses(ir: &Ir, runs: &[Run], register: RegisterId) -> (Vec<bool>, Vec<bool>) {
    let of = |run: &Run| {
        let mut read = false;
        for bundle in &ir.bundles[run.start..run.end] {
            read |= bundle.operations.iter().any(|operation| operation.reads().contains(&register));
            if bundle.operations.iter().any(|operation| operation.dest == Some(register)) {
                return (read, true);
            }
            if read {
                break;
            }
        }
        (read, false)
    };
    runs.iter().map(of).unzip()
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Sharing of registers between loops: each loop gets registers of its own while it is resolved; here registers that never hold a
//! value at the same time are merged.
//!
//! A loop's register lives from the first bundle that names it to the last: a loop is entered at its beginning and left at its end. While
//! it lives, the bundles between run, and the subroutines that they call. So two of them can be merged if neither comes between the
//! ends of the other, in the text or by calls.

use crate::ir::calls::Calls;
use crate::ir::{Ir, RegisterId, runs};
use std::collections::HashMap;
use std::ops::Range;

/// Live range of a register.
struct LiveRange {
    register: RegisterId,
    bundles: Range<usize>,
    /// Bundles that run while the range calls.
    called: Vec<Range<usize>>,
}

impl LiveRange {
    /// The register's loop is called within the live range of another.
    fn is_called_in(&self, other: &LiveRange) -> bool {
        let first = other.called.partition_point(|called| called.end <= self.bundles.start);
        other.called.get(first).is_some_and(|called| called.start < self.bundles.end)
    }
}

/// Registers that become one.
#[derive(Default)]
struct RegisterGroup {
    lives: Vec<usize>,
    /// Live ranges that contain calls.
    calling: Vec<usize>,
    /// Bundle after the last live range.
    end: usize,
}

/// Merges registers of `made`, which the assembler made for loops, where possible.
pub(super) fn share(ir: &mut Ir, made: &[RegisterId]) {
    if made.len() < 2 || runs::jumps_to_numbers(ir) || ir.is_opaque() || ir.is_too_long() {
        return;
    }
    let lives = lives(ir, made);
    let mut all: Vec<RegisterGroup> = Vec::new();
    let mut merged: HashMap<RegisterId, RegisterId> = HashMap::new();
    for (index, life) in lives.iter().enumerate() {
        let ty = ir.register(life.register).ty;
        let meets = |other: &usize| {
            let other = &lives[*other];
            life.is_called_in(other) || other.is_called_in(life)
        };
        let fits = |shared: &&mut RegisterGroup| {
            // Registers apart in the text meet only if one of them calls.
            let others = if life.called.is_empty() { &shared.calling } else { &shared.lives };
            shared.end <= life.bundles.start
                && ir.register(lives[shared.lives[0]].register).ty == ty
                && !others.iter().any(meets)
        };
        let shared = match all.iter_mut().find(fits) {
            Some(shared) => shared,
            None => {
                all.push(RegisterGroup::default());
                let Some(shared) = all.last_mut() else { return };
                shared
            }
        };
        shared.lives.push(index);
        shared.calling.extend(Some(index).filter(|_| !life.called.is_empty()));
        shared.end = life.bundles.end;
        merged.insert(life.register, lives[shared.lives[0]].register);
    }
    for operation in ir.bundles.iter_mut().flat_map(|bundle| &mut bundle.operations) {
        for register in operation.sources.iter_mut().chain(&mut operation.dest) {
            *register = merged.get(register).copied().unwrap_or(*register);
        }
    }
    // Clear the names of merged registers: the unused-register warning is not for them.
    for (register, _) in merged.iter().filter(|(register, one)| register != one) {
        ir.registers[register.index()].name.clear();
    }
}

/// Live ranges of registers, in the order of their starts.
fn lives(ir: &Ir, made: &[RegisterId]) -> Vec<LiveRange> {
    let mut bundles: HashMap<RegisterId, Range<usize>> = HashMap::new();
    let mut is_made = vec![false; ir.registers.len()];
    made.iter().for_each(|register| is_made[register.index()] = true);
    for (at, bundle) in ir.bundles.iter().enumerate() {
        for operation in &bundle.operations {
            for register in operation.reads().iter().chain(&operation.dest) {
                if is_made[register.index()] {
                    bundles.entry(*register).or_insert(at..at).end = at + 1;
                }
            }
        }
    }
    let runs = runs::runs(ir);
    let calls = Calls::new(ir, &runs);
    // All registers of a loop have the same calls in it.
    let mut known: HashMap<Vec<usize>, Vec<Range<usize>>> = HashMap::new();
    let life = |(register, bundles): (RegisterId, Range<usize>)| {
        let within = calls.within(&bundles).collect();
        let called = known.entry(within).or_insert_with(|| calls.during(&bundles)).clone();
        LiveRange { register, bundles, called }
    };
    let mut lives: Vec<LiveRange> = bundles.into_iter().map(life).collect();
    lives.sort_by_key(|life| (life.bundles.start, life.register));
    lives
}

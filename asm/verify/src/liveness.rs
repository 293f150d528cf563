// SPDX-License-Identifier: MIT OR Apache-2.0
//! Liveness: registers of a source that may be read after a tick before they are written.

use crate::code::Code;
use takt_isa::Effect;

/// Bit set of registers.
#[derive(Clone, PartialEq, Eq)]
pub(crate) struct Registers(Vec<u64>);

impl Registers {
    pub(crate) fn contains(&self, register: usize) -> bool {
        self.0.get(register / 64).is_some_and(|word| word >> (register % 64) & 1 == 1)
    }

    fn insert(&mut self, register: usize) {
        self.0[register / 64] |= 1 << (register % 64);
    }

    fn remove(&mut self, register: usize) {
        self.0[register / 64] &= !(1 << (register % 64));
    }
}

/// Registers that are live before each bundle of a source (Aho, Lam, Sethi, Ullman, Compilers, §9.2.5). Returns are matched with calls (see
/// [`successors`]).
pub(crate) fn live(code: &Code) -> Vec<Registers> {
    let count = code.bundles.len();
    let next = successors(code);
    let mut before: Vec<Vec<usize>> = vec![Vec::new(); count];
    for (at, next) in next.iter().enumerate() {
        next.iter().for_each(|next| before[*next].push(at));
    }
    let none = Registers(vec![0; code.initial.len().div_ceil(64)]);
    let mut live = vec![none.clone(); count];
    let mut waiting = vec![true; count];
    let mut left: Vec<usize> = (0..count).collect();
    while let Some(at) = left.pop() {
        waiting[at] = false;
        let mut new = none.clone();
        for next in &next[at] {
            new.0.iter_mut().zip(&live[*next].0).for_each(|(new, next)| *new |= next);
        }
        let bundle = &code.bundles[at];
        bundle.iter().filter_map(|operation| operation.dest).for_each(|dest| new.remove(dest));
        for operation in bundle {
            operation.reads().iter().for_each(|register| new.insert(*register));
        }
        if new != live[at] {
            live[at] = new;
            for &from in &before[at] {
                if !std::mem::replace(&mut waiting[from], true) {
                    left.push(from);
                }
            }
        }
    }
    live
}

/// Successors of each bundle. A call leads to its subroutine and to the bundle after the call, so a return needs no successor, and the
/// registers of one caller are not live in another. But if a tick may occur inside a subroutine, a return may lead to the bundle after any
/// call, because the callers are unknown after the tick.
fn successors(code: &Code) -> Vec<Vec<usize>> {
    let operations =
        || code.bundles.iter().enumerate().flat_map(|(at, bundle)| bundle.iter().map(move |op| (at, op)));
    let of = |effect: Effect| operations().filter(move |(_, operation)| operation.op.row().effect == effect);
    let mut all: Vec<Vec<usize>> = (1..=code.bundles.len()).map(|next| vec![next]).collect();
    for (at, operation) in operations() {
        let target = operation.constant as usize;
        match operation.op.row().effect {
            Effect::Jump | Effect::Wait => all[at] = vec![target],
            Effect::Call | Effect::BranchZero | Effect::BranchNonzero => all[at].push(target),
            Effect::Return | Effect::Halt => all[at].clear(),
            _ => {}
        }
    }
    for (at, operation) in of(Effect::Loop) {
        if let Some(last) = (operation.constant as usize).checked_sub(1).and_then(|last| all.get_mut(last)) {
            last.push(at + 1);
        }
    }
    all.iter_mut().for_each(|next| next.retain(|next| *next < code.bundles.len()));
    let subroutines = of(Effect::Call).map(|(_, operation)| operation.constant as usize);
    let mut is_within = vec![false; all.len()];
    let mut left: Vec<usize> = subroutines.collect();
    while let Some(at) = left.pop() {
        if at < all.len() && !std::mem::replace(&mut is_within[at], true) {
            left.extend(&all[at]);
        }
    }
    if of(Effect::Wait).any(|(at, _)| is_within[at]) {
        let behind_calls: Vec<usize> =
            of(Effect::Call).map(|(at, _)| at + 1).filter(|next| *next < all.len()).collect();
        of(Effect::Return).for_each(|(at, _)| all[at].clone_from(&behind_calls));
    }
    all
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Registers that each iteration advances by a constant, and the accesses whose address is one of them.

use super::super::memory;
use crate::ir::{Bundle, Constant, Ir, RegisterId};
use std::collections::HashMap;
use takt_isa::Effect;
use takt_isa::shape::Field;

/// Limit on the advances of an induction register by which an access may be ahead or behind.
const AHEAD: i64 = 8;

/// A load or store whose address is an induction register and an offset.
#[derive(Clone, Copy, Debug)]
pub(super) struct Induction {
    /// The task of the access, and the task that advances the register.
    pub(super) access: usize,
    pub(super) advance: usize,
    /// Offset in the source, and the constant that each advance adds to the register.
    offset: i64,
    step: i64,
    /// Advances of its own iteration that the access sees in the source: 1 if it follows, else 0.
    seen: i64,
}

impl Induction {
    /// Offset of the access if the advances that it sees exceed the iterations begun before its own by `advances`.
    pub(super) fn offset(&self, advances: i64) -> i64 {
        self.offset + self.step * (self.seen - advances)
    }

    /// The least and the most advances that the access can see, limited by the offset's field and [`AHEAD`].
    pub(super) fn advances(&self) -> (i64, i64) {
        let fits =
            |advances: &i64| (0..=i64::from(Field::Offset.bits().max())).contains(&self.offset(*advances));
        let most = (self.seen..=self.seen + AHEAD).take_while(fits).last().unwrap_or(self.seen);
        let least = (self.seen - AHEAD..=self.seen).rev().take_while(fits).last().unwrap_or(self.seen);
        (least, most)
    }
}

/// The accesses of a body whose address is a register that one operation of the body advances by a constant, and nothing else
/// writes.
pub(super) fn inductions(
    ir: &Ir,
    fixed: &[Option<u32>],
    own: &[Bundle],
    origins: &[usize],
) -> Vec<Induction> {
    let single = |task: usize| match &own[origins[task]].operations[..] {
        [operation] => Some(operation),
        _ => None,
    };
    let dests = own.iter().flat_map(|bundle| &bundle.operations).filter_map(|operation| operation.dest);
    let mut writes: HashMap<RegisterId, u32> = HashMap::new();
    dests.for_each(|dest| *writes.entry(dest).or_default() += 1);
    let mut found = Vec::new();
    for advance in 0..origins.len() {
        let Some(operation) = single(advance) else { continue };
        let (Some(register), Some(step)) = (operation.dest, memory::step(operation, fixed)) else { continue };
        if operation.sources.contains(&register)
            && writes[&register] == 1
            && ir.register(register).pinned.is_none()
        {
            for access in 0..origins.len() {
                let Some(operation) = single(access) else { continue };
                let is_access = matches!(operation.row().effect, Effect::Load | Effect::Store);
                let is_address =
                    operation.sources[0] == register && !operation.sources[1..].contains(&register);
                if let (true, Constant::Value(offset)) = (is_access && is_address, operation.constant) {
                    let (offset, seen) = (i64::from(offset), i64::from(access > advance));
                    found.push(Induction { access, advance, offset, step, seen });
                }
            }
        }
    }
    found
}

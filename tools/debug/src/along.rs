// SPDX-License-Identifier: MIT OR Apache-2.0
//! Values along a run, ever farther apart: checkpoints, and what searches know.

use std::collections::BTreeMap;
use takt_isa::timing::Cycle;

/// Values that are kept.
pub(crate) const MOST: usize = 512;

/// Values by cycle, [`MOST`] at most: if there are more, every other one goes.
#[derive(Clone, Debug)]
pub(crate) struct Along<T> {
    values: BTreeMap<Cycle, T>,
    /// Cycles between values that are wanted.
    interval: Cycle,
}

impl<T> Along<T> {
    /// None yet; one is wanted each time that so many cycles have passed.
    pub(crate) fn every(interval: Cycle) -> Along<T> {
        Along { values: BTreeMap::new(), interval }
    }

    pub(crate) fn add(&mut self, cycle: Cycle, value: T) {
        self.values.insert(cycle, value);
        if self.values.len() > MOST {
            let mut number = 0;
            self.values.retain(|_, _| {
                number += 1;
                number % 2 == 1
            });
            self.interval *= 2;
        }
    }

    /// The cycle at which the next value is wanted: never, before the last one.
    pub(crate) fn due(&self, now: Cycle) -> Cycle {
        let last = self.values.last_key_value().map_or(0, |(cycle, _)| *cycle);
        if now < last { Cycle::MAX } else { last + self.interval }
    }

    /// The last value of a cycle or of one before it.
    pub(crate) fn before(&self, cycle: Cycle) -> Option<(Cycle, &T)> {
        self.values.range(..=cycle).next_back().map(|(cycle, value)| (*cycle, value))
    }

    /// The last value of those at the beginning for which something holds; the first if it holds for none.
    pub(crate) fn last_while(&self, holds: impl Fn(&T) -> bool) -> Option<&T> {
        self.values.values().rfind(|value| holds(value)).or_else(|| self.first())
    }

    pub(crate) fn first(&self) -> Option<&T> {
        self.values.first_key_value().map(|(_, value)| value)
    }

    pub(crate) fn cycles(&self) -> impl Iterator<Item = Cycle> {
        self.values.keys().copied()
    }

    /// Forgets the values of a cycle and of those behind it.
    pub(crate) fn forget_from(&mut self, cycle: Cycle) {
        self.values.split_off(&cycle);
    }

    pub(crate) fn clear(&mut self) {
        self.values.clear();
    }
}

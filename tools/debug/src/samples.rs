// SPDX-License-Identifier: MIT OR Apache-2.0
//! Values sampled along a run at growing distances: checkpoints, and states of searches.

use std::collections::BTreeMap;
use takt_isa::timing::Cycle;

/// Maximum number of values kept.
pub(crate) const MOST: usize = 512;

/// Values by cycle, at most [`MOST`]: when this number is exceeded, every second value is dropped and the interval doubles.
#[derive(Clone, Debug)]
pub(crate) struct ThinnedSeries<T> {
    values: BTreeMap<Cycle, T>,
    /// Distance from the last value to the next, in cycles.
    interval: Cycle,
}

impl<T> ThinnedSeries<T> {
    /// An empty series that requests a value every `interval` cycles.
    pub(crate) fn every(interval: Cycle) -> ThinnedSeries<T> {
        ThinnedSeries { values: BTreeMap::new(), interval }
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

    /// Cycle at which the next value is due; `Cycle::MAX` if `now` precedes the last value.
    pub(crate) fn due(&self, now: Cycle) -> Cycle {
        let last = self.values.last_key_value().map_or(0, |(cycle, _)| *cycle);
        if now < last { Cycle::MAX } else { last + self.interval }
    }

    /// Last value at or before a cycle, with its cycle.
    pub(crate) fn before(&self, cycle: Cycle) -> Option<(Cycle, &T)> {
        self.values.range(..=cycle).next_back().map(|(cycle, value)| (*cycle, value))
    }

    /// Last value for which `holds`, or the first value if it holds for none.
    pub(crate) fn last_while(&self, holds: impl Fn(&T) -> bool) -> Option<&T> {
        self.values.values().rfind(|value| holds(value)).or_else(|| self.first())
    }

    pub(crate) fn first(&self) -> Option<&T> {
        self.values.first_key_value().map(|(_, value)| value)
    }

    pub(crate) fn cycles(&self) -> impl Iterator<Item = Cycle> {
        self.values.keys().copied()
    }

    /// Drops values at and after a cycle.
    pub(crate) fn forget_from(&mut self, cycle: Cycle) {
        self.values.split_off(&cycle);
    }

    pub(crate) fn clear(&mut self) {
        self.values.clear();
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Statistics: the cycles of a run by cause and by bundle.

use std::collections::{BTreeMap, HashMap};
use takt_isa::timing::{Cause, Cycle};
use takt_isa::{BundleAddress, Op, ROWS};

/// Counts since reset. `cycles = bundles + stalled()`, always.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Statistics {
    /// Number of cycles passed.
    pub cycles: Cycle,
    /// Number of bundles issued.
    pub bundles: u64,
    /// Operations issued, by [`Op`] (`operations[op as usize]`), without operations that do nothing.
    pub operations: [u64; ROWS.len()],
    /// Number of issues of each bundle of the program, by address.
    pub visits: Vec<u64>,
    /// Stalled cycles, by the bundle that could not issue and the cause. For [`Cause::Wait`], the bundle is the waiting one.
    pub causes: BTreeMap<(BundleAddress, Cause), u64>,
    /// Number of ticks seen.
    pub ticks: u64,
    /// Ticks that came before the program waited and were remembered: missed deadlines.
    pub missed: u64,
    /// Ticks that came while another was remembered, and were lost.
    pub lost: u64,
    /// Number of NaNs written to output ports that carry binary32.
    pub nan_writes: u64,
}

impl Statistics {
    /// Stalled cycles by kind of cause, in the order of [`Cause::KINDS`].
    pub fn stalls(&self) -> [u64; Cause::KINDS.len()] {
        let mut kinds = [0; Cause::KINDS.len()];
        for ((_, cause), cycles) in &self.causes {
            kinds[cause.kind()] += cycles;
        }
        kinds
    }

    /// Stalled cycles, waiting included.
    pub fn stalled(&self) -> u64 {
        self.causes.values().sum()
    }

    /// Number of operations issued, without operations that do nothing.
    pub fn total_operations(&self) -> u64 {
        self.operations.iter().sum()
    }

    /// Number of issues of an operation.
    pub fn operation(&self, op: Op) -> u64 {
        self.operations[op as usize]
    }
}

/// Running counts. Counts of blocks are added only on demand, since each block counts its own runs.
#[derive(Clone, Debug)]
pub(crate) struct Tally {
    pub(crate) bundles: u64,
    pub(crate) operations: [u64; ROWS.len()],
    pub(crate) visits: Vec<u64>,
    pub(crate) causes: HashMap<(BundleAddress, Cause), u64>,
    /// Cycles waited, by the address of the `wait`. They are not in the hash table, because every period adds to one of them.
    pub(crate) waits: Vec<u64>,
}

impl Tally {
    pub(crate) fn new(bundles: usize) -> Tally {
        Tally {
            bundles: 0,
            operations: [0; ROWS.len()],
            visits: vec![0; bundles],
            causes: HashMap::new(),
            waits: vec![0; bundles],
        }
    }

    pub(crate) fn stall(&mut self, address: BundleAddress, cause: Cause, cycles: u64) {
        if cycles > 0 {
            *self.causes.entry((address, cause)).or_default() += cycles;
        }
    }

    pub(crate) fn wait(&mut self, address: BundleAddress, cycles: u64) {
        self.waits[address.index()] += cycles;
    }

    pub(crate) fn issue(&mut self, address: BundleAddress, operations: impl Iterator<Item = Op>) {
        self.bundles += 1;
        self.visits[address.index()] += 1;
        for op in operations {
            self.operations[op as usize] += 1;
        }
    }

    /// Sorted table of the causes, waiting included.
    pub(crate) fn causes(&self) -> BTreeMap<(BundleAddress, Cause), u64> {
        let addresses = (0..).map(BundleAddress::new);
        let waits = addresses.zip(&self.waits).filter(|&(_, &cycles)| cycles > 0);
        let waits = waits.map(|(address, &cycles)| ((address, Cause::Wait), cycles));
        self.causes.iter().map(|(&key, &cycles)| (key, cycles)).chain(waits).collect()
    }
}

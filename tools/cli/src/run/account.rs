// SPDX-License-Identifier: MIT OR Apache-2.0
//! Cycle account of a run or a period, as a table and as JSON.

use serde_json::Value;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use takt_emu::Statistics;
use takt_isa::timing::Cause;
use takt_isa::{BundleAddress, Function, Program, ROWS};

/// Number of fused operations in a program.
pub(crate) fn fused_operations(program: &Program) -> usize {
    let bundles = program.addresses().filter_map(|address| program.bundle(address)?.ok());
    bundles.flatten().filter(|instruction| instruction.op.row().function == Function::Fused).count()
}

/// Note on rounding, worded to follow "of the program".
pub(crate) fn rounding(fused: usize) -> String {
    match fused {
        0 => "no operation rounds a product and a sum together".to_owned(),
        1 => "1 operation rounds a product and a sum together (fused multiply-add)".to_owned(),
        fused => format!("{fused} operations round a product and a sum together (fused multiply-add)"),
    }
}

/// Counts over a run or a period. `cycles = bundles + Σ stalls`.
#[derive(Clone, Debug)]
pub(crate) struct Account {
    pub(crate) cycles: u64,
    pub(crate) bundles: u64,
    /// Executed operations by mnemonic, without unused mnemonics.
    pub(crate) operations: BTreeMap<&'static str, u64>,
    /// Stall cycles by kind of cause, including zeros.
    stalls: BTreeMap<&'static str, u64>,
    causes: Vec<((BundleAddress, Cause), u64)>,
}

impl Account {
    /// Counts of the whole run, since reset.
    pub(crate) fn of(statistics: &Statistics) -> Account {
        Account::new(statistics, |count| count(statistics))
    }

    /// Counts between two statistics.
    pub(crate) fn between(before: &Statistics, after: &Statistics) -> Account {
        Account::new(after, |count| count(after) - count(before))
    }

    /// Computes the counts for all keys of the statistics; `difference` yields each count.
    fn new(after: &Statistics, difference: impl Fn(&dyn Fn(&Statistics) -> u64) -> u64) -> Account {
        let operations = ROWS
            .iter()
            .map(|row| (row.mnemonic, difference(&|statistics| statistics.operation(row.op))))
            .filter(|(_, count)| *count > 0)
            .collect();
        let caused = |key| difference(&|statistics| statistics.causes.get(key).copied().unwrap_or(0));
        let causes: Vec<_> =
            after.causes.keys().map(|key| (*key, caused(key))).filter(|(_, count)| *count > 0).collect();
        let mut stalls: BTreeMap<_, _> = Cause::KINDS.into_iter().map(|kind| (kind, 0)).collect();
        for ((_, cause), count) in &causes {
            *stalls.entry(cause.name()).or_default() += count;
        }
        let (cycles, bundles) = (difference(&|s| s.cycles), difference(&|s| s.bundles));
        Account { cycles, bundles, operations, stalls, causes }
    }

    /// Total number of operations.
    pub(crate) fn total_operations(&self) -> u64 {
        self.operations.values().sum()
    }

    /// Stall cycles by kind of cause; blanks in names become underscores, as JSON keys.
    pub(crate) fn stalls_json(&self) -> Value {
        self.stalls.iter().map(|(kind, count)| (kind.replace(' ', "_"), Value::from(*count))).collect()
    }

    /// Stall cycles of one kind of cause.
    pub(crate) fn stall(&self, kind: &str) -> u64 {
        self.stalls.get(kind).copied().unwrap_or(0)
    }

    /// The `most` costliest stalls with their places, excluding waits for the tick.
    pub(crate) fn longest(&self, most: usize) -> impl Iterator<Item = (BundleAddress, Cause, u64)> {
        let mut causes: Vec<_> = self.causes.iter().filter(|((_, cause), _)| *cause != Cause::Wait).collect();
        causes.sort_by_key(|((address, _), count)| (std::cmp::Reverse(*count), *address));
        causes.into_iter().take(most).map(|&((address, cause), count)| (address, cause, count))
    }

    /// Share of each kind of stall, then the `most` costliest stalls with their places, excluding waits for the tick.
    pub(crate) fn stall_table(&self, program: &Program, most: usize) -> String {
        let mut out = String::new();
        let waiting = self.stall(Cause::Wait.name());
        let _ = writeln!(out, "  {:<14} {:>9}", "issue", self.bundles);
        for (kind, count) in
            self.stalls.iter().filter(|(kind, count)| **kind != Cause::Wait.name() && **count > 0)
        {
            let _ = writeln!(out, "  {kind:<14} {count:>9}");
        }
        let _ = writeln!(out, "  {:<14} {:>9}", "all", self.cycles - waiting);
        let mut causes = self.longest(most).peekable();
        if causes.peek().is_some() {
            out.push_str("  the longest stalls:\n");
        }
        for (address, cause, count) in causes {
            let _ = writeln!(
                out,
                "  {count:>8}  {}: {}",
                program.bundle_text(address),
                program.cause_text(cause)
            );
        }
        out
    }
}

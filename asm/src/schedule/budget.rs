// SPDX-License-Identifier: MIT OR Apache-2.0
//! Budgets of the scheduler's searches, counted in steps rather than time, so that every computer finds the same schedule.
//!
//! A step is the visit of an edge, of a member of a constraint or of a cell of a reservation table, a nanosecond or two; placing a
//! task is [`PLACING`] of them. Each search has a budget of its own, which grows with the effort, and draws it from a pool that all
//! blocks, or all loops, of a program share, in all schedules that are tried for it. So a single block may search as long as the
//! effort allows, and a program with any number of blocks takes a limited number of steps.

/// Steps that a unit of effort buys each search of a block, and the search for a loop's schedule.
pub(super) const STEPS: u64 = 8_000_000;

/// Steps charged for placing a task in a list schedule.
pub(super) const PLACING: u64 = 40;

/// Searches of a block: for list schedules, exact, and for late tasks.
const SEARCHES: u64 = 3;

/// Blocks of a program that may each search for the full budget. Further blocks share the same pool.
const BLOCKS: u64 = 16;

/// Loops of a program that may each search for the full budget.
const LOOPS: u64 = 16;

/// Least effort of the search for loop schedules, so that low efforts still pipeline loops.
const LEAST_FOR_LOOPS: u32 = 4;

/// Complete schedules of a program that a pool pays for: a program is scheduled again if registers or bundles run out.
const SCHEDULES: u64 = 4;

/// Steps per operation of the first passes over a block, which run at any effort: far more than they take.
const FIRST_PASSES: u64 = 100_000;

/// Upper bound of the scheduler's steps for a program of `operations` operations, counted in its final blocks.
pub fn most_steps(effort: u32, operations: u64) -> u64 {
    let pools = [Pool::for_blocks(effort), Pool::for_loops(effort)];
    pools.iter().map(|pool| pool.left + pool.each).sum::<u64>() + FIRST_PASSES * operations
}

/// Pool of steps that searches of one kind share.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pool {
    /// Limit of a single search.
    each: u64,
    /// Steps left to all searches together.
    left: u64,
}

impl Pool {
    fn for_blocks(effort: u32) -> Pool {
        let each = u64::from(effort) * STEPS;
        Pool { each, left: SCHEDULES * BLOCKS * SEARCHES * each }
    }

    fn for_loops(effort: u32) -> Pool {
        let each = u64::from(effort.max(LEAST_FOR_LOOPS)) * STEPS;
        Pool { each, left: SCHEDULES * LOOPS * each }
    }

    /// Budget of the next search, with `searches` still to come in this schedule: an equal share of half the pool. The other half is for
    /// further schedules.
    pub(super) fn share(&self, searches: u64) -> u64 {
        self.each.min(self.left / (2 * searches).max(1))
    }
}

/// Pools of steps for a program's schedules.
#[derive(Clone, Copy, Debug)]
pub struct Budget {
    blocks: Pool,
    loops: Pool,
    taken: u64,
}

impl Budget {
    /// Budget for an effort (`--effort`).
    pub fn new(effort: u32) -> Budget {
        Budget { blocks: Pool::for_blocks(effort), loops: Pool::for_loops(effort), taken: 0 }
    }

    /// Steps taken so far.
    pub fn taken(&self) -> u64 {
        self.taken
    }

    /// Budget of each search of the next block, with `blocks` blocks left in this schedule.
    pub(super) fn of_block(&self, blocks: usize) -> u64 {
        self.blocks.share(SEARCHES * blocks as u64)
    }

    /// Budget of the next loop's search, with `loops` loops left in this schedule.
    pub(super) fn of_loop(&self, loops: usize) -> Steps {
        Steps::new(self.loops.share(loops as u64))
    }

    /// Takes the steps of a block's searches.
    pub(super) fn take_for_block(&mut self, steps: u64) {
        self.taken += steps;
        self.blocks.left = self.blocks.left.saturating_sub(steps);
    }

    /// Takes the steps of a loop's search.
    pub(super) fn take_for_loop(&mut self, steps: u64) {
        self.taken += steps;
        self.loops.left = self.loops.left.saturating_sub(steps);
    }
}

/// The steps of one search.
#[derive(Clone, Copy, Debug)]
pub(super) struct Steps {
    taken: u64,
    most: u64,
}

impl Steps {
    pub(super) fn new(most: u64) -> Steps {
        Steps { taken: 0, most }
    }

    /// Takes steps; `None` once the budget is exceeded, which ends the search.
    pub(super) fn take(&mut self, steps: usize) -> Option<()> {
        self.taken += steps as u64;
        (!self.are_spent()).then_some(())
    }

    /// Counts steps of work that is done whatever the budget.
    pub(super) fn add(&mut self, steps: u64) {
        self.taken += steps;
    }

    pub(super) fn taken(&self) -> u64 {
        self.taken
    }

    pub(super) fn are_spent(&self) -> bool {
        self.taken > self.most
    }
}

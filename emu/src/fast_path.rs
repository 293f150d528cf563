// SPDX-License-Identifier: MIT OR Apache-2.0
//! Fast path: execution of whole blocks. Special cases are left to the stepper. If one can be recognised before a block, the block is not
//! run; if one occurs within a block, the block's effects are undone.

use crate::block::{Block, BlockSource, CompilationState, Extent};
use crate::emulator::{CompiledRuns, Emulator, Recent, Status};
use crate::execute::flow_fault;
use crate::jit;
use crate::machine::{PendingResult, RegisterSet, State, Word};
use crate::micro::{self, AddressError, Context};
use takt_isa::fp::{Flags, Value};
use takt_isa::timing::Cycle;
use takt_isa::{BundleAddress, Flow, Register};

/// Reason why no further block runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fast {
    /// The stepper must run, up to this cycle.
    Step { until: Cycle },
    /// A `wait` has issued.
    Wait { cycle: Cycle, address: BundleAddress },
    /// The machine has halted.
    Halted,
}

/// Undo log of a block, and buffers that are reused to avoid allocation.
#[derive(Debug, Default)]
pub(crate) struct Journal {
    registers: Vec<(Register, u32)>,
    pending: Vec<PendingResult>,
    written: RegisterSet,
    flags: Flags,
    kept_nans: usize,
    counted_nans: u64,
    stored: Vec<(u32, u32)>,
    nans: Vec<(u32, u32)>,
    writes: Vec<(u32, u32)>,
    logged: usize,
    late: Vec<(Flags, Option<u32>)>,
    words: jit::Words,
}

impl Journal {
    /// Saves the state that `block`, whose last bundle issues in cycle `last`, may change before it faults.
    fn begin(&mut self, state: &State, block: &Block, last: Cycle) {
        self.stored.clear();
        self.nans.clear();
        self.writes.clear();
        self.late.clear();
        self.late.resize(block.late.len(), (Flags::NONE, None));
        let Some(restore) = &block.restore else { return };
        self.pending.clone_from(&state.pending);
        (self.written, self.flags) = (state.written, state.flags);
        self.logged = state.port_writes.len();
        (self.kept_nans, self.counted_nans) = (state.nan_writes.kept.len(), state.nan_writes.count);
        self.registers.clear();
        let registers = state.due(last).chain(restore.iter().copied());
        self.registers.extend(registers.map(|register| (register, state.get(register))));
    }

    fn undo(&mut self, state: &mut State) {
        for &(register, bits) in &self.registers {
            state.set(register, bits);
        }
        for &(address, old) in self.stored.iter().rev() {
            if let Some(word) = state.memory.get_mut(address as usize) {
                *word = old;
            }
        }
        std::mem::swap(&mut state.pending, &mut self.pending);
        (state.written, state.flags) = (self.written, self.flags);
        state.nan_writes.kept.truncate(self.kept_nans);
        state.nan_writes.count = self.counted_nans;
        state.port_writes.truncate(self.logged);
    }
}

impl Emulator {
    /// Runs blocks as long as they end before cycle `bound` and, if `stop_at_wait`, until a `wait` issues. The machine must
    /// be running, and the next bundle must not have been charged any stall but the front end's.
    pub(crate) fn run_blocks(&mut self, bound: Cycle, stop_at_wait: bool) -> Fast {
        loop {
            let entered = self.front.delivered;
            let Some(id) = self.next_block() else { return Fast::Step { until: entered + 1 } };
            let beyond_bound = self.beyond_bound().is_some();
            let last = entered + Cycle::from(self.cache.blocks[id as usize].last);
            if last >= bound {
                return Fast::Step { until: bound.max(self.now + 1) };
            }
            self.begin_cycle();
            let block = &mut self.cache.blocks[id as usize];
            let (state, flow, ends_loop) = (&mut self.state, block.flow, block.ends_loop);
            let end = block.end().previous();
            // The block does not write the loop's count; unless a result for it is in flight, the loop reads its present value.
            let count_pends = matches!(flow, Flow::Loop { count, .. } if state.is_pending(count));
            if let Some(after) = self.compile_after {
                block.compile_after(after, self.code.machine.data_depth);
            }
            if flow_fault(flow, ends_loop, state, self.code.machine, end).is_some()
                || count_pends
                || beyond_bound
                || !(block.verified || has_required(state, block, last))
                || !run(block, &mut self.compiled_runs, state, &mut self.journal, entered)
            {
                return Fast::Step { until: last + 1 };
            }
            let address = self.after_block(id, last);
            self.follow(flow, address, last, &mut None);
            match flow {
                Flow::Wait(_) if stop_at_wait || self.status != Status::Running => {
                    return Fast::Wait { cycle: last, address };
                }
                Flow::Halt => return Fast::Halted,
                _ => {}
            }
        }
    }
}

impl Emulator {
    /// Block to run next; `None` if no block can begin at the next bundle.
    #[inline]
    pub(crate) fn next_block(&mut self) -> Option<u32> {
        let whole = self.block_at_next(Extent::Whole)?;
        match self.cache.blocks[whole as usize].pause {
            Some(pause) if self.front.delivered + Cycle::from(pause) >= self.pause_from => {
                self.block_at_next(Extent::ToPause)
            }
            _ => Some(whole),
        }
    }

    /// Block that begins at the next bundle, with the given extent.
    pub(crate) fn block_at_next(&mut self, extent: Extent) -> Option<u32> {
        if self.cache.is_full() {
            self.drop_blocks();
        }
        let (entry, entered) = (self.front.next, self.front.delivered);
        let stretch = BlockSource { code: &self.code, pauses: &self.pauses, extent };
        match &self.recent {
            Recent::Block { id, cycle } => self.cache.successor(stretch, *id, *cycle, entry, entered),
            Recent::List(recent) => self.cache.after(stretch, recent, entry, entered),
        }
    }

    /// Updates the state except for registers and memory after a block: statistics, ticks, the current cycle (the cycle after the block's
    /// last issue, `last`). Returns the block's last bundle.
    #[inline]
    pub(crate) fn after_block(&mut self, id: u32, last: Cycle) -> BundleAddress {
        let block = &mut self.cache.blocks[id as usize];
        if !block.verified {
            self.state.written.insert_all(&block.writes);
            block.verified = true;
        }
        block.enter(self.front.from, self.front.delivered - self.now);
        block.runs += 1;
        if block.acts {
            self.pause_from = 0;
        }
        let address = block.end().previous();
        self.now = last + 1;
        self.recent = Recent::Block { id, cycle: last };
        self.scoreboard = None;
        while let Some(tick) = self.ticks.next().filter(|&tick| tick <= last) {
            self.ticks.take(tick);
            self.see_tick(tick, &mut None);
        }
        address
    }
}

/// All registers that a block requires will have been written. Pending results count if they are written back by the block's last issue:
/// the block cannot read a later one anyway.
pub(crate) fn has_required(state: &State, block: &Block, last: Cycle) -> bool {
    let mut written = state.written;
    state.due(last).for_each(|register| written.insert(register));
    written.contains_all(&block.required)
}

/// Runs a block entered in cycle `entered`. After a fault, all its effects are undone and the result is false.
fn run(
    block: &mut Block,
    runs: &mut CompiledRuns,
    state: &mut State,
    journal: &mut Journal,
    entered: Cycle,
) -> bool {
    let last = entered + Cycle::from(block.last);
    journal.begin(state, block, last);
    state.write_back_until(last);
    if let CompilationState::Code(code, _) = &block.compiled {
        if code.run(&block.late, state, &mut journal.words, &mut journal.late, &mut journal.writes) {
            finish(block, state, journal, entered);
            runs.done += 1;
            return true;
        }
        runs.left += 1;
        block.compiled.count_exits(block.runs);
    }
    let mut context = Context {
        registers: &mut state.registers,
        memory: &mut state.memory,
        flags: state.flags,
        late: &mut journal.late,
        stored: &mut journal.stored,
        nans: &mut journal.nans,
        writes: &mut journal.writes,
    };
    let (head, tail) = block.micros.split_at(block.split);
    let ran = micro::run::<false>(head, &mut context).and_then(|()| micro::run::<true>(tail, &mut context));
    let flags = context.flags;
    if let Err(AddressError) = ran {
        journal.undo(state);
        return false;
    }
    state.flags = flags;
    finish(block, state, journal, entered);
    true
}

/// Completes a block after its operations: puts its late results in flight and records its port writes.
fn finish(block: &Block, state: &mut State, journal: &Journal, entered: Cycle) {
    for (i, (late, &(flags, memory))) in block.late.iter().zip(&journal.late).enumerate() {
        let value = Value { bits: state.get(Word::late(i)), flags };
        state.pending.push(late.pending(entered, value, memory));
    }
    for &(check, bits) in &journal.nans {
        state.nan_writes.record(block.checks[check as usize].write(entered, bits));
    }
    let writes = journal.writes.iter();
    state.port_writes.extend(writes.map(|&(check, bits)| block.checks[check as usize].write(entered, bits)));
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Stepper: cycle-by-cycle execution, with the scoreboard of `takt_isa::timing`. It is slow and handles every case; blocks (`fast_path`)
//! are the fast path.
//!
//! Each cycle has three steps, in this order: the machine sees the tick; results are written back; the next bundle issues or is
//! charged a stall.

use crate::emulator::{Emulator, PredictedIssue, Recent, Sink, Status, Step, emit};
use crate::event::Event;
use crate::execute;
use crate::fault::{Fault, FaultKind};
use crate::machine::Loop;
use std::sync::Arc;
use takt_isa::program::LoopBound;
use takt_isa::spec::units::MAX_LATENCY;
use takt_isa::timing::{self, Cause, Cycle, Scoreboard};
use takt_isa::{BundleAddress, Flow};

/// Length at which the list of recent bundles is purged of bundles that can no longer stall others.
const RECENT: usize = 4 * MAX_LATENCY as usize;

impl Emulator {
    /// Advances by one cycle.
    pub(crate) fn cycle(&mut self, sink: &mut Sink<'_>) -> Result<Step, Fault> {
        let now = self.now;
        let waiting = match self.status {
            Status::Halted { .. } => return Ok(Step::Halted),
            Status::Faulted(ref fault) => return Err(fault.clone()),
            Status::Waiting { address, .. } => Some(address),
            Status::Running => None,
        };
        if now >= self.cycle_limit {
            let address = waiting.unwrap_or(self.front.next);
            return Err(self.fault(address, None, FaultKind::CycleLimit { limit: now }, sink));
        }
        self.begin_cycle();
        while self.ticks.take(now) {
            self.see_tick(now, sink);
        }
        self.write_back(now, sink);

        if let Some(address) = waiting {
            self.tally.wait(address, 1);
            self.now += 1;
            return Ok(Step::Stalled { cycle: now, address, cause: Cause::Wait });
        }
        let address = self.front.next;
        if let Some(cause) = self.stall(address, sink)? {
            self.tally.stall(address, cause, 1);
            self.now += 1;
            return Ok(Step::Stalled { cycle: now, address, cause });
        }
        self.issue(address, sink)?;
        self.now += 1;
        Ok(Step::Issued { cycle: now, address })
    }

    /// Latches the inputs, if latching is due before the next cycle.
    pub(crate) fn begin_cycle(&mut self) {
        if self.state.latches.as_ref().is_some_and(|latches| latches.take) {
            self.state.take_inputs();
        }
    }

    /// Cause of the stall in this cycle; `None` if the next bundle issues.
    fn stall(&mut self, address: BundleAddress, sink: &mut Sink<'_>) -> Result<Option<Cause>, Fault> {
        let (now, delivered) = (self.now, self.front.delivered);
        if now < delivered {
            return Ok(Some(Cause::Branch { from: self.front.from }));
        }
        if self.planned.is_none() {
            let kind = match self.code.get(address) {
                Some(Ok(_)) => None,
                Some(Err((slot, reason))) => {
                    Some((Some(*slot), FaultKind::IllegalWord(reason.clone().into())))
                }
                None => Some((None, FaultKind::ProgramCounter { bundles: self.code.len() as u32 })),
            };
            if let Some((slot, kind)) = kind {
                return Err(self.fault(address, slot, kind, sink));
            }
            self.plan(address);
        }
        let Some(issue) = self.planned else { return Ok(None) };
        Ok(PredictedIssue { address, delivered, from: self.front.from, issue }.cause(now))
    }

    /// Plans the issue of the next bundle on the scoreboard.
    fn plan(&mut self, address: BundleAddress) {
        let code = Arc::clone(&self.code);
        if let Some(decoded) = code.legal(address) {
            let delivered = self.front.delivered;
            self.planned = Some(self.scoreboard().issue(&decoded.timing, address, delivered));
        }
    }

    /// Scoreboard; rebuilt from the recent bundles if blocks have run since its last use.
    pub(crate) fn scoreboard(&mut self) -> &mut Scoreboard {
        let scoreboard = self.scoreboard.take().unwrap_or_else(|| {
            self.list_recent();
            let mut scoreboard = Box::new(Scoreboard::new(self.code.machine));
            if let Recent::List(recent) = &self.recent {
                // Issue each bundle again in its old cycle: the list has all bundles that can still matter.
                for &(address, cycle) in recent {
                    if let Some(decoded) = self.code.legal(address) {
                        scoreboard.issue(&decoded.timing, address, cycle);
                    }
                }
            }
            scoreboard
        });
        self.scoreboard.insert(scoreboard)
    }

    /// Issues the next bundle.
    fn issue(&mut self, address: BundleAddress, sink: &mut Sink<'_>) -> Result<(), Fault> {
        let (now, machine) = (self.now, self.code.machine);
        let Some(decoded) = self.code.legal(address) else { return Ok(()) };
        if let Some(kind) = self.beyond_bound() {
            return Err(self.fault(address, None, kind, sink));
        }
        if let Some((slot, kind)) = execute::check(decoded, &self.state, machine, address) {
            return Err(self.fault(address, Some(slot), kind, sink));
        }
        emit(sink, || Event::Issue { cycle: now, address });
        let flow = decoded.flow;
        if decoded.acts {
            self.pause_from = 0;
        }
        execute::issue(decoded, &mut self.state, address, now, |retire| {
            emit(sink, || Event::Retire(retire));
        });
        self.tally.issue(address, decoded.operations.iter().map(|operation| operation.op));
        self.planned = None;
        self.push_recent(address, now);
        self.follow(flow, address, now, sink);
        Ok(())
    }

    /// Follows the control flow of the bundle at `address`, which issued in `cycle`. Registers must still hold the values that
    /// the bundle read, before the writeback of its own results.
    #[inline]
    pub(crate) fn follow(&mut self, flow: Flow, address: BundleAddress, cycle: Cycle, sink: &mut Sink<'_>) {
        let machine = self.code.machine;
        let redirected = timing::after_redirect(machine, cycle);
        match flow {
            Flow::Next => self.continue_at(address.next(), timing::after_sequential(cycle), address),
            Flow::Branch { register, zero, .. } if (self.state.get(register) == 0) != zero => {
                self.continue_at(address.next(), timing::after_not_taken(machine, cycle), address);
            }
            Flow::Jump(target) | Flow::Branch { target, .. } => self.jump_to(target, redirected, address),
            Flow::Call(target) => {
                self.state.stack.push(address.next());
                self.continue_at(target, redirected, address);
            }
            Flow::Return => {
                // The stack is not empty: an empty one has been reported as a fault.
                let target = self.state.stack.pop().unwrap_or(address.next());
                self.continue_at(target, redirected, address);
            }
            Flow::Loop { count, end } => {
                // The count is 1 to 65,535: other counts have been reported as faults.
                let left = self.state.get(count) as u16;
                self.state.loops.push(Loop { start: address.next(), end, left });
                let delivered = timing::after_loop(machine, address, end, cycle);
                self.continue_at(address.next(), delivered, address);
            }
            Flow::LoopEnd => {
                let next = timing::after_sequential(cycle);
                match self.state.loops.last_mut().filter(|top| top.end == address.next()) {
                    Some(top) if top.left > 1 => {
                        top.left -= 1;
                        let start = top.start;
                        self.jump_to(start, next, address);
                    }
                    Some(_) => {
                        self.state.loops.pop();
                        self.continue_at(address.next(), next, address);
                    }
                    None => self.continue_at(address.next(), next, address),
                }
            }
            Flow::Publish => {
                emit(sink, || Event::Publish { cycle, address });
                self.publish_issued(cycle);
                self.continue_at(address.next(), timing::after_sequential(cycle), address);
            }
            Flow::Wait(target) => {
                emit(sink, || Event::Wait { cycle, address });
                self.wait_issued(cycle, address, target);
            }
            Flow::Halt => {
                emit(sink, || Event::Halt { cycle, address });
                self.halt_issued(cycle, address, sink);
            }
        }
    }

    /// Continues at a bundle, without a back edge: if the bundle is the head of a counted loop, this is the first iteration of a run.
    pub(crate) fn continue_at(&mut self, next: BundleAddress, delivered: Cycle, from: BundleAddress) {
        (self.front.next, self.front.delivered, self.front.from) = (next, delivered, Some(from));
        if let Some(head) = self.code.head(next) {
            let turns = &mut self.turns[head];
            (turns.run, turns.section) = (1, turns.section.saturating_add(1));
        }
    }

    /// Continues at the target of a jump or a taken branch: if that is a back edge to the head of a counted loop, this is a
    /// further iteration.
    pub(crate) fn jump_to(&mut self, target: BundleAddress, delivered: Cycle, from: BundleAddress) {
        let turns = self.code.head(target).map_or(0, |head| self.turns[head].run);
        self.continue_at(target, delivered, from);
        if let Some(head) = self.code.head(target).filter(|_| target <= from) {
            self.turns[head].run = turns.saturating_add(1);
        }
    }

    /// Fault of the loop whose head is the next bundle, if this iteration exceeds its bound.
    pub(crate) fn beyond_bound(&self) -> Option<FaultKind> {
        let head = self.code.head(self.front.next)?;
        let (LoopBound { most, total, .. }, turns) = (self.code.loops[head], self.turns[head]);
        let beyond = total.filter(|total| turns.section > *total);
        let run = (turns.run > most).then_some(FaultKind::LoopBound { most });
        run.or(beyond.map(|total| FaultKind::LoopTotal { total }))
    }

    /// Stops the machine. Results in flight are written back at once, since no other event can precede their cycles.
    pub(crate) fn halt_issued(&mut self, cycle: Cycle, address: BundleAddress, sink: &mut Sink<'_>) {
        self.status = Status::Halted { cycle, address };
        self.front.next = address;
        let last = self.state.pending.iter().map(|pending| pending.retire.cycle).max().unwrap_or(0);
        for cycle in cycle + 1..=last {
            self.write_back(cycle, sink);
        }
    }

    /// Writes back the results of a cycle, in slot order.
    fn write_back(&mut self, cycle: Cycle, sink: &mut Sink<'_>) {
        loop {
            let due =
                self.state.pending.iter().enumerate().filter(|(_, pending)| pending.retire.cycle == cycle);
            let Some((i, _)) = due.min_by_key(|(_, pending)| pending.retire.slot) else { return };
            let pending = self.state.pending.remove(i);
            emit(sink, || Event::Retire(pending.retire));
            if let Some(write) = self.state.write_back(&pending) {
                emit(sink, || Event::PortWrite(write));
            }
        }
    }

    fn push_recent(&mut self, address: BundleAddress, cycle: Cycle) {
        self.list_recent();
        if let Recent::List(recent) = &mut self.recent {
            if recent.len() >= RECENT {
                recent.retain(|&(_, issued)| issued + Cycle::from(MAX_LATENCY) > cycle);
            }
            recent.push((address, cycle));
        }
    }

    /// Converts the recent bundles to the form of a list.
    pub(crate) fn list_recent(&mut self) {
        if matches!(self.recent, Recent::Block { .. }) {
            self.recent = Recent::List(self.recent_issues());
        }
    }

    /// Recent bundles with their cycles of issue.
    pub(crate) fn recent_issues(&self) -> Vec<(BundleAddress, Cycle)> {
        match &self.recent {
            Recent::List(recent) => recent.clone(),
            Recent::Block { id, cycle } => {
                let recent = self.cache.recent(*id).iter();
                let mut recent: Vec<_> =
                    recent.map(|&(address, age)| (address, cycle - Cycle::from(age))).collect();
                if recent.is_empty() {
                    // The block's last bundle can stall nothing, but is listed as proof that a bundle has issued.
                    recent.push((self.cache.blocks[*id as usize].end().previous(), *cycle));
                }
                recent
            }
        }
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Moves along a run: to a cycle or a period, by steps, or to a search hit.

use super::machine::Machine;
use super::search_positions::Interest;
use super::stops::{BreakpointLocation, Stop};
use super::{Core, Cycle, End, Move, SLICE, Session, StopReason, Unit, WINDOW, WatchExpression};
use std::sync::atomic::Ordering;
use takt_emu::{Emulator, PeriodError, PredictedIssue};
use takt_isa::program::Location;
use takt_isa::{BundleAddress, Flow};

impl Session {
    /// Runs forward to a cycle; an end of the run or an interrupt may come earlier.
    fn advance(&mut self, target: Cycle) -> Result<(), End> {
        self.make_edits();
        while self.cycle() < target {
            self.slice(target)?;
        }
        Ok(())
    }

    /// Runs one slice towards a cycle: at most to the end of the period, the next edit, or the next checkpoint.
    fn slice(&mut self, target: Cycle) -> Result<(), End> {
        let control = &self.options.control;
        control.cycle.store(self.cycle(), Ordering::Relaxed);
        if control.interrupt.load(Ordering::Relaxed) {
            control.clear();
            return Err(StopReason::Interrupted);
        }
        if self.options.inputs.as_ref().is_some_and(|rows| self.core.periods >= rows.len() as u64) {
            return Err(StopReason::InputsEnd);
        }
        let edit = self.edits.get(self.core.edits).map_or(Cycle::MAX, |edit| edit.cycle);
        let checkpoint = self.checkpoints.due(self.cycle());
        let begin = self.cycle();
        let until = target.min(edit).min(checkpoint).min(begin + SLICE);
        let result = self.core.emulator.run_period_until(until);
        self.core.boundary = false;
        match result {
            Ok(None) => {}
            Ok(Some(report)) => {
                self.core.periods += 1;
                self.core.boundary = true;
                self.core.report = Some(report);
                self.set_row();
            }
            Err(PeriodError::Fault(fault)) => return Err(StopReason::Fault(fault)),
            // The position after the last cycle is part of the run; only the next move reports the halt.
            Err(PeriodError::Halted) if self.cycle() > begin => {}
            // A port error cannot occur: this loop names no ports.
            Err(PeriodError::Halted | PeriodError::Port(_)) => return Err(StopReason::Halted),
        }
        if self.cycle() >= checkpoint {
            // The checkpoint is taken before this position's edits.
            self.checkpoints.add(self.cycle(), self.core.clone());
        }
        self.make_edits();
        Ok(())
    }

    /// Repeats the run from reset to this position, and calls `visit` with machine and bundle after each issue. The session's position
    /// does not change.
    ///
    /// # Returns
    /// [`StopReason::Done`], or [`StopReason::Interrupted`].
    pub fn replay(&mut self, visit: &mut dyn FnMut(&Emulator, BundleAddress)) -> StopReason {
        let here = self.cycle();
        let Some(beginning) = self.checkpoints.first().cloned() else { return StopReason::Start };
        let core = std::mem::replace(&mut self.core, beginning);
        self.make_edits();
        let mut why = StopReason::Done;
        while self.cycle() < here {
            let now = self.cycle();
            let upcoming = self.core.emulator.upcoming().filter(|upcoming| upcoming.issue.cycle == now);
            if let Err(end) = self.slice(now + 1) {
                why = end;
                break;
            }
            if let Some(PredictedIssue { address, .. }) = upcoming {
                visit(&self.core.emulator, address);
            }
        }
        self.core = core;
        why
    }

    /// Cycles of the checkpoints.
    pub fn checkpoints(&self) -> Vec<Cycle> {
        self.checkpoints.cycles().collect()
    }

    /// Goes to a cycle, forward or back.
    ///
    /// # Returns
    /// [`StopReason::Done`], or the reason why the run ends earlier.
    pub fn go_to(&mut self, cycle: Cycle) -> StopReason {
        self.approach(|core| core.emulator.now() <= cycle);
        self.advance(cycle).err().unwrap_or(StopReason::Done)
    }

    /// Restores the last checkpoint for which `is_before` holds, unless it also holds for the current position, which is later.
    fn approach(&mut self, is_before: impl Fn(&Core) -> bool) {
        let Some(checkpoint) = self.checkpoints.last_while(&is_before) else { return };
        if checkpoint.emulator.now() > self.cycle() || !is_before(&self.core) {
            self.core = checkpoint.clone();
        }
        self.make_edits();
    }

    /// Goes to the position after this number of periods.
    pub fn go_to_period(&mut self, period: u64) -> StopReason {
        self.approach(|core| core.periods < period || core.periods == period && core.boundary);
        while self.period() < period {
            if let Err(end) = self.run_period() {
                return end;
            }
        }
        StopReason::Done
    }

    /// Runs to the end of the period.
    fn run_period(&mut self) -> Result<(), End> {
        let (periods, until) = (self.period(), self.cycle().saturating_add(self.run_limit));
        self.make_edits();
        while self.period() == periods {
            if self.cycle() >= until {
                return Err(StopReason::Limit(self.run_limit));
            }
            self.slice(until)?;
        }
        Ok(())
    }

    /// Visits relevant positions from here up to `until`, and stops when `visit` returns a hit.
    pub(super) fn scan(
        &mut self,
        until: Cycle,
        interest: &Interest,
        visit: &mut dyn FnMut(&Session, Option<BundleAddress>) -> Option<StopReason>,
    ) -> Result<StopReason, End> {
        self.core.emulator.set_pauses(interest.pauses());
        let result = self.scan_positions(until, interest, visit);
        self.core.emulator.set_pauses([]);
        result
    }

    fn scan_positions(
        &mut self,
        until: Cycle,
        interest: &Interest,
        visit: &mut dyn FnMut(&Session, Option<BundleAddress>) -> Option<StopReason>,
    ) -> Result<StopReason, End> {
        self.make_edits();
        let mut upcoming = self.core.emulator.upcoming();
        while self.cycle() < until {
            let is_now = |upcoming: &PredictedIssue| upcoming.issue.cycle == self.cycle();
            let issuing = upcoming.filter(is_now).map(|upcoming| upcoming.address);
            self.slice(interest.next(&self.core.emulator, issuing, until))?;
            let now = self.cycle();
            if upcoming.is_none_or(|upcoming| upcoming.issue.cycle < now) {
                upcoming = self.core.emulator.upcoming();
            }
            let issuing = upcoming.filter(|upcoming| upcoming.issue.cycle == now);
            if let Some(why) = visit(self, issuing.map(|upcoming| upcoming.address)) {
                return Ok(why);
            }
        }
        Err(StopReason::Limit(self.run_limit))
    }

    /// Goes to the next position at which `visit` returns a hit.
    fn forward(
        &mut self,
        interest: &Interest,
        mut visit: impl FnMut(&Session, Option<BundleAddress>) -> Option<StopReason>,
    ) -> StopReason {
        let until = self.cycle().saturating_add(self.run_limit);
        self.scan(until, interest, &mut visit).unwrap_or_else(|end| end)
    }

    /// Goes to the last earlier position at which `visit` returns a hit; calls `begin` at the start of each stretch. On an interrupt, the
    /// position does not change.
    fn backward<V: FnMut(&Session, Option<BundleAddress>) -> Option<StopReason>>(
        &mut self,
        interest: &Interest,
        begin: impl Fn(&mut Session) -> Result<V, End>,
    ) -> StopReason {
        let from = self.cycle();
        // Positions from `end` on have been searched, or are out of range.
        let (mut end, mut window) = (from, WINDOW);
        while end >= 2 {
            // A hit must come after the start of its stretch, so that the previous state is known. Search a short window first, since a
            // hit may be near; later stretches begin at checkpoints.
            let near = (end - 1).saturating_sub(window);
            let start = near.max(self.checkpoints.before(end - 2).map_or(0, |(cycle, _)| cycle));
            window = window.saturating_mul(8);
            let mut found = self.go_to(start);
            let mut last = None;
            if found == StopReason::Done {
                found = match begin(self) {
                    Ok(mut visit) => {
                        let mut all = |session: &Session, issuing| {
                            if let Some(why) = visit(session, issuing) {
                                last = Some((session.cycle(), why));
                            }
                            None
                        };
                        self.scan(end - 1, interest, &mut all).unwrap_or_else(|end| end)
                    }
                    Err(end) => end,
                };
            }
            if found == StopReason::Interrupted {
                self.go_to(from);
                return found;
            }
            if let Some((cycle, why)) = last {
                self.go_to(cycle);
                return why;
            }
            if from - start > self.run_limit {
                return StopReason::Limit(self.run_limit);
            }
            end = start + 1;
        }
        self.go_to(0);
        StopReason::Start
    }

    /// Executes one move; for steps, a single step.
    pub fn go(&mut self, to: &Move) -> StopReason {
        match to {
            Move::Step(unit, _) => self.step(*unit),
            Move::Back(unit, _) => self.step_back(*unit),
            Move::Resume => self.resume(),
            Move::ResumeBack => self.resume_back(),
            Move::Until(live) => self.run_until(live),
            Move::Cycle(cycle) => self.go_to(*cycle),
            Move::Period(period) => self.go_to_period(*period),
            Move::Start => self.go_to(0),
        }
    }

    /// Steps forward by one unit.
    pub fn step(&mut self, unit: Unit) -> StopReason {
        match unit {
            Unit::Cycle => return self.go_to(self.cycle() + 1),
            Unit::Period => return self.run_period().err().unwrap_or(StopReason::Done),
            _ => {}
        }
        let stack = self.core.emulator.stack();
        let (depth, caller) = (stack.len(), stack.last().copied());
        let next = self.core.emulator.next_address();
        let interest = match unit {
            // A completed call can only end here.
            Unit::Call if self.calls(next) => Interest::bundles([next, next.next()]),
            Unit::Out => Interest::bundles(caller),
            _ => Interest::everything(),
        };
        self.forward(&interest, move |session, issuing| session.ends_step(unit, depth, issuing))
    }

    /// The bundle contains a subroutine call.
    fn calls(&self, address: BundleAddress) -> bool {
        let bundle = self.program().bundle(address).and_then(Result::ok);
        bundle.is_some_and(|bundle| matches!(Flow::of(&bundle), Flow::Call(_)))
    }

    /// Steps back by one unit.
    pub fn step_back(&mut self, unit: Unit) -> StopReason {
        if self.cycle() == 0 {
            return StopReason::Start;
        }
        match unit {
            Unit::Cycle => return self.go_to(self.cycle() - 1),
            Unit::Period => {
                let period = self.period() - u64::from(self.core.boundary && self.period() > 0);
                return if period == 0 { self.go_to(0) } else { self.go_to_period(period) };
            }
            _ => {}
        }
        let depth = self.core.emulator.stack().len();
        let interest = Interest::everything();
        self.backward(&interest, |_| {
            Ok(move |session: &Session, issuing| session.ends_step(unit, depth, issuing))
        })
    }

    /// Tells whether a step by `unit` that began at call depth `depth` ends at this position, where `issuing` is about to issue.
    pub(super) fn ends_step(
        &self,
        unit: Unit,
        depth: usize,
        issuing: Option<BundleAddress>,
    ) -> Option<StopReason> {
        let address = issuing?;
        let now = self.core.emulator.stack().len();
        let ends = match unit {
            Unit::Cycle | Unit::Bundle | Unit::Period => true,
            Unit::Call => now <= depth,
            Unit::Out => now < depth,
            Unit::Line => {
                let line = |address| self.program().location(address);
                let last = self.core.emulator.last_issued().and_then(line);
                line(address).is_some_and(|line| Some(line) != last)
            }
        };
        ends.then_some(StopReason::Done)
    }

    /// Runs forward to the next breakpoint or watchpoint.
    pub fn resume(&mut self) -> StopReason {
        let mut watcher = match self.watcher() {
            Ok(watcher) => watcher,
            Err(end) => return end,
        };
        let interest = Interest::stops(&self.stops, self.program());
        let why = self.forward(&interest, |session, issuing| watcher.visit(session, issuing));
        if matches!(why, StopReason::Stop { .. } | StopReason::Limit(_)) {
            self.keep_watcher(watcher);
        }
        self.stopped(why)
    }

    /// Makes the line of the breakpoint that stopped the run the current line.
    pub(crate) fn stopped(&mut self, why: StopReason) -> StopReason {
        let stop = match &why {
            StopReason::Stop { id, .. } => self.stops.iter().find(|(known, _)| known == id),
            _ => None,
        };
        if let Some((_, Stop::Break { at: BreakpointLocation::Line(line, _), .. })) = stop {
            self.line = Some((self.cycle(), *line));
        }
        why
    }

    /// Runs back to the previous breakpoint or watchpoint.
    pub fn resume_back(&mut self) -> StopReason {
        let interest = Interest::stops(&self.stops, self.program());
        let why = self.backward(&interest, |session| {
            let mut watcher = session.watcher()?;
            Ok(move |session: &Session, issuing| watcher.visit(session, issuing))
        });
        self.stopped(why)
    }

    /// Runs forward to the next position at which an expression is nonzero. An expression without a value counts as zero.
    pub fn run_until(&mut self, live: &WatchExpression) -> StopReason {
        // An expression that holds now may still hold in the next cycle, without a change that the search would visit.
        if self.holds(live) {
            match self.go_to(self.cycle() + 1) {
                StopReason::Done if self.holds(live) => return StopReason::Holds,
                StopReason::Done => {}
                end => return end,
            }
        }
        let interest = Interest::value(live, self.program());
        self.forward(&interest, |session, _| session.holds(live).then_some(StopReason::Holds))
    }

    /// Evaluates a breakpoint's condition as the current line would read it, with results in flight. Returns whether it holds, and a
    /// description of operands that no bundle has computed yet.
    pub(super) fn judge(
        &self,
        line: Option<Location>,
        condition: &WatchExpression,
    ) -> (bool, Option<String>) {
        let (own, program) = (self.machine(), self.program());
        let machine = Machine { line: line.or(own.line), ahead: true, ..own };
        let value = condition.evaluate(&machine, program);
        let error = || value.as_ref().err().filter(|_| !condition.is_there(&machine, program)).cloned();
        let doubt = condition.note(&machine, program).or_else(error);
        (value.as_ref().is_ok_and(|value| !value.is_zero()), doubt)
    }

    /// The condition of a breakpoint holds here. An operand that has not been computed is recorded as a doubt
    /// ([`Control::take_doubts`](super::Control::take_doubts)).
    pub fn meets(&self, id: u32, condition: &WatchExpression) -> bool {
        let (holds, doubt) = self.judge(None, condition);
        self.remember(id, doubt.filter(|_| !holds));
        holds
    }

    /// Records the doubt with which a breakpoint was passed here.
    pub(super) fn remember(&self, id: u32, doubt: Option<String>) {
        if let Some(doubt) = doubt {
            let first = doubt.lines().next().unwrap_or_default();
            self.options.control.doubt(id, format!("{}: {first}", self.time()));
        }
    }

    /// Every value in the expression is in its register.
    pub(super) fn is_there(&self, live: &WatchExpression) -> bool {
        live.is_there(&self.machine(), self.program())
    }

    /// The expression is nonzero.
    pub(crate) fn holds(&self, live: &WatchExpression) -> bool {
        self.evaluate(live).is_ok_and(|value| !value.is_zero())
    }
}

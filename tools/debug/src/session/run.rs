// SPDX-License-Identifier: MIT OR Apache-2.0
//! Going forward and back: to a cycle or a period, by steps, to where something is found.

use super::interest::Interest;
use super::machine::Machine;
use super::stops::{Stop, Where};
use super::{Core, Cycle, End, Live, Move, SLICE, Session, Unit, WINDOW, Why};
use std::sync::atomic::Ordering;
use takt_emu::{Emulator, PeriodError, Upcoming};
use takt_isa::program::Location;
use takt_isa::{BundleAddress, Flow};

impl Session {
    /// Runs on to a cycle; less far if the run ends or is interrupted.
    fn advance(&mut self, target: Cycle) -> Result<(), End> {
        self.make_edits();
        while self.cycle() < target {
            self.slice(target)?;
        }
        Ok(())
    }

    /// Runs on towards a cycle: to the end of the period, to the next edit or checkpoint, if they come before.
    fn slice(&mut self, target: Cycle) -> Result<(), End> {
        let control = &self.options.control;
        control.cycle.store(self.cycle(), Ordering::Relaxed);
        if control.interrupt.load(Ordering::Relaxed) {
            control.clear();
            return Err(Why::Interrupted);
        }
        if self.options.inputs.as_ref().is_some_and(|rows| self.core.periods >= rows.len() as u64) {
            return Err(Why::InputsEnd);
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
            Err(PeriodError::Fault(fault)) => return Err(Why::Fault(fault)),
            // The position behind the last cycle is one of the run's: who goes on from there learns that it has halted.
            Err(PeriodError::Halted) if self.cycle() > begin => {}
            // Nothing asks for ports by name.
            Err(PeriodError::Halted | PeriodError::Port(_)) => return Err(Why::Halted),
        }
        if self.cycle() >= checkpoint {
            // Before its edits.
            self.checkpoints.add(self.cycle(), self.core.clone());
        }
        self.make_edits();
        Ok(())
    }

    /// Runs again from the beginning to this position, and shows the machine after each cycle in which a bundle issued, with that
    /// bundle. The session stays where it is.
    ///
    /// # Returns
    /// [`Why::Done`], or that it was interrupted.
    pub fn replay(&mut self, visit: &mut dyn FnMut(&Emulator, BundleAddress)) -> Why {
        let here = self.cycle();
        let Some(beginning) = self.checkpoints.first().cloned() else { return Why::Start };
        let core = std::mem::replace(&mut self.core, beginning);
        self.make_edits();
        let mut why = Why::Done;
        while self.cycle() < here {
            let now = self.cycle();
            let upcoming = self.core.emulator.upcoming().filter(|upcoming| upcoming.issue.cycle == now);
            if let Err(end) = self.slice(now + 1) {
                why = end;
                break;
            }
            if let Some(Upcoming { address, .. }) = upcoming {
                visit(&self.core.emulator, address);
            }
        }
        self.core = core;
        why
    }

    /// The cycles of the checkpoints.
    pub fn checkpoints(&self) -> Vec<Cycle> {
        self.checkpoints.cycles().collect()
    }

    /// Goes back, or on, to a cycle.
    ///
    /// # Returns
    /// [`Why::Done`], or why the run ends before.
    pub fn go_to(&mut self, cycle: Cycle) -> Why {
        self.approach(|core| core.emulator.now() <= cycle);
        self.advance(cycle).err().unwrap_or(Why::Done)
    }

    /// Restores the last checkpoint at which `is_before` holds, unless this position is nearer to the end of those.
    fn approach(&mut self, is_before: impl Fn(&Core) -> bool) {
        let Some(checkpoint) = self.checkpoints.last_while(&is_before) else { return };
        if checkpoint.emulator.now() > self.cycle() || !is_before(&self.core) {
            self.core = checkpoint.clone();
        }
        self.make_edits();
    }

    /// Goes to where so many periods have ended.
    pub fn go_to_period(&mut self, period: u64) -> Why {
        self.approach(|core| core.periods < period || core.periods == period && core.boundary);
        while self.period() < period {
            if let Err(end) = self.run_period() {
                return end;
            }
        }
        Why::Done
    }

    /// Runs to the end of the period.
    fn run_period(&mut self) -> Result<(), End> {
        let (periods, until) = (self.period(), self.cycle().saturating_add(self.run_limit));
        self.make_edits();
        while self.period() == periods {
            if self.cycle() >= until {
                return Err(Why::Limit(self.run_limit));
            }
            self.slice(until)?;
        }
        Ok(())
    }

    /// Visits the positions after this one that are of interest, up to `until`, until `visit` finds one.
    pub(super) fn scan(
        &mut self,
        until: Cycle,
        interest: &Interest,
        visit: &mut dyn FnMut(&Session, Option<BundleAddress>) -> Option<Why>,
    ) -> Result<Why, End> {
        self.core.emulator.set_pauses(interest.pauses());
        let result = self.scan_positions(until, interest, visit);
        self.core.emulator.set_pauses([]);
        result
    }

    fn scan_positions(
        &mut self,
        until: Cycle,
        interest: &Interest,
        visit: &mut dyn FnMut(&Session, Option<BundleAddress>) -> Option<Why>,
    ) -> Result<Why, End> {
        self.make_edits();
        let mut upcoming = self.core.emulator.upcoming();
        while self.cycle() < until {
            let is_now = |upcoming: &Upcoming| upcoming.issue.cycle == self.cycle();
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
        Err(Why::Limit(self.run_limit))
    }

    /// Goes to the next position that `visit` finds.
    fn forward(
        &mut self,
        interest: &Interest,
        mut visit: impl FnMut(&Session, Option<BundleAddress>) -> Option<Why>,
    ) -> Why {
        let until = self.cycle().saturating_add(self.run_limit);
        self.scan(until, interest, &mut visit).unwrap_or_else(|end| end)
    }

    /// Goes to the last position before this one that `visit` finds; `begin` is told where each stretch begins. Interrupted,
    /// it stays here.
    fn backward<V: FnMut(&Session, Option<BundleAddress>) -> Option<Why>>(
        &mut self,
        interest: &Interest,
        begin: impl Fn(&mut Session) -> Result<V, End>,
    ) -> Why {
        let from = self.cycle();
        // Positions from here on are seen, or not wanted.
        let (mut end, mut window) = (from, WINDOW);
        while end >= 2 {
            // A position that is found lies behind the beginning of the stretch, so that the state before it is known. What is
            // looked for may be near, and else a stretch begins at a checkpoint.
            let near = (end - 1).saturating_sub(window);
            let start = near.max(self.checkpoints.before(end - 2).map_or(0, |(cycle, _)| cycle));
            window = window.saturating_mul(8);
            let mut found = self.go_to(start);
            let mut last = None;
            if found == Why::Done {
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
            if found == Why::Interrupted {
                self.go_to(from);
                return found;
            }
            if let Some((cycle, why)) = last {
                self.go_to(cycle);
                return why;
            }
            if from - start > self.run_limit {
                return Why::Limit(self.run_limit);
            }
            end = start + 1;
        }
        self.go_to(0);
        Why::Start
    }

    /// Moves the run; of a step, by one.
    pub fn go(&mut self, to: &Move) -> Why {
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

    /// Steps forward.
    pub fn step(&mut self, unit: Unit) -> Why {
        match unit {
            Unit::Cycle => return self.go_to(self.cycle() + 1),
            Unit::Period => return self.run_period().err().unwrap_or(Why::Done),
            _ => {}
        }
        let stack = self.core.emulator.stack();
        let (depth, caller) = (stack.len(), stack.last().copied());
        let next = self.core.emulator.next_address();
        let interest = match unit {
            // Nowhere else does it end that it is over.
            Unit::Call if self.calls(next) => Interest::bundles([next, next.next()]),
            Unit::Out => Interest::bundles(caller),
            _ => Interest::everything(),
        };
        self.forward(&interest, move |session, issuing| session.ends_step(unit, depth, issuing))
    }

    /// True if a bundle calls a subroutine.
    fn calls(&self, address: BundleAddress) -> bool {
        let bundle = self.program().bundle(address).and_then(Result::ok);
        bundle.is_some_and(|bundle| matches!(Flow::of(&bundle), Flow::Call(_)))
    }

    /// Steps back.
    pub fn step_back(&mut self, unit: Unit) -> Why {
        if self.cycle() == 0 {
            return Why::Start;
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

    /// The end of a step by `unit` that began `depth` calls deep, if it ends here, where `issuing` is about to issue.
    pub(super) fn ends_step(&self, unit: Unit, depth: usize, issuing: Option<BundleAddress>) -> Option<Why> {
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
        ends.then_some(Why::Done)
    }

    /// Runs on to the next breakpoint or watchpoint.
    pub fn resume(&mut self) -> Why {
        let mut watcher = match self.watcher() {
            Ok(watcher) => watcher,
            Err(end) => return end,
        };
        let interest = Interest::stops(&self.stops, self.program());
        let why = self.forward(&interest, |session, issuing| watcher.visit(session, issuing));
        if matches!(why, Why::Stop { .. } | Why::Limit(_)) {
            self.keep_watcher(watcher);
        }
        self.stopped(why)
    }

    /// Takes the line of the breakpoint that it stopped at for the line at hand.
    pub(crate) fn stopped(&mut self, why: Why) -> Why {
        let stop = match &why {
            Why::Stop { id, .. } => self.stops.iter().find(|(known, _)| known == id),
            _ => None,
        };
        if let Some((_, Stop::Break { at: Where::Line(line, _), .. })) = stop {
            self.line = Some((self.cycle(), *line));
        }
        why
    }

    /// Runs back to the last breakpoint or watchpoint.
    pub fn resume_back(&mut self) -> Why {
        let interest = Interest::stops(&self.stops, self.program());
        let why = self.backward(&interest, |session| {
            let mut watcher = session.watcher()?;
            Ok(move |session: &Session, issuing| watcher.visit(session, issuing))
        });
        self.stopped(why)
    }

    /// Runs on to the next position at which an expression holds (is not zero). Where it has no value it does not.
    pub fn run_until(&mut self, live: &Live) -> Why {
        // An expression that holds already may still hold in the next cycle, in which nothing need change that the search looks for.
        if self.holds(live) {
            match self.go_to(self.cycle() + 1) {
                Why::Done if self.holds(live) => return Why::Holds,
                Why::Done => {}
                end => return end,
            }
        }
        let interest = Interest::value(live, self.program());
        self.forward(&interest, |session, _| session.holds(live).then_some(Why::Holds))
    }

    /// True if an expression has a value other than zero where this line is at hand.
    pub(super) fn holds_at(&self, line: Location, live: &Live) -> bool {
        let machine = Machine { line: Some(line), ..self.machine() };
        live.evaluate(&machine, self.program()).is_ok_and(|value| !value.is_zero())
    }

    /// True if every value in an expression is there.
    pub(super) fn is_there(&self, live: &Live) -> bool {
        live.is_there(&self.machine(), self.program())
    }

    /// True if an expression has a value other than zero.
    pub(crate) fn holds(&self, live: &Live) -> bool {
        self.evaluate(live).is_ok_and(|value| !value.is_zero())
    }
}

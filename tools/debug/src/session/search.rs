// SPDX-License-Identifier: MIT OR Apache-2.0
//! Searches on a machine that another component runs, such as a core of a system. The machine is shown ([`Session::look`]) at each
//! relevant position.

use super::search_positions::Interest;
use super::stops::Watcher;
use super::{Session, StopReason, Unit, WatchExpression};
use std::collections::BTreeSet;
use takt_emu::Event;
use takt_isa::BundleAddress;
use takt_isa::timing::{Cycle, INPUT_DELAY};
use takt_system::InputEvent;

/// A forward search from the position at which it was created.
#[derive(Clone)]
pub(crate) struct Search {
    interest: Interest,
    goal: Goal,
    /// Relevant positions beyond the last range, caused by events within it; `None` before the first range.
    ahead: Option<BTreeSet<Cycle>>,
}

/// Number of positions for which an event stays relevant. (Results in flight are reported on arrival.)
const AHEAD: Cycle = if INPUT_DELAY + 1 > 3 { INPUT_DELAY + 1 } else { 3 };

#[derive(Clone)]
enum Goal {
    /// Breakpoints and watchpoints of the session.
    Stops(Watcher),
    /// A nonzero value of this expression.
    Holds(Box<WatchExpression>),
    /// The end of a step that began at this call depth.
    Step { unit: Unit, depth: usize },
}

impl Search {
    /// A search for the session's stops; `None` without stops. Previous values of watched expressions are those at the session's
    /// position; [`Search::is_complete`] is false if one is missing.
    pub(crate) fn stops(session: &Session) -> Option<Search> {
        let goal = Goal::Stops(Watcher::new(session));
        let interest = Interest::stops(&session.stops, session.program());
        (!session.stops.is_empty()).then_some(Search { interest, goal, ahead: None })
    }

    /// The last value of each watched expression is known.
    pub(crate) fn is_complete(&self) -> bool {
        self.watcher().is_none_or(Watcher::is_complete)
    }

    /// The search is for the session's current stops.
    pub(crate) fn is_of(&self, session: &Session) -> bool {
        self.watcher().is_some_and(|watcher| watcher.is_of(session))
    }

    /// Copies missing previous values from a search at an earlier position.
    pub(crate) fn complete(&mut self, earlier: &Search) {
        if let (Goal::Stops(watcher), Some(earlier)) = (&mut self.goal, earlier.watcher()) {
            watcher.complete(earlier);
        }
    }

    fn watcher(&self) -> Option<&Watcher> {
        match &self.goal {
            Goal::Stops(watcher) => Some(watcher),
            Goal::Holds(_) | Goal::Step { .. } => None,
        }
    }

    /// A search for a position at which the expression is nonzero.
    pub(crate) fn value(live: WatchExpression, session: &Session) -> Search {
        let interest = Interest::value(&live, session.program());
        Search { interest, goal: Goal::Holds(Box::new(live)), ahead: None }
    }

    /// A search for the end of a step from the session's position: by bundle, line or call, or out of a subroutine.
    pub(crate) fn step(unit: Unit, session: &Session) -> Search {
        let depth = session.core.emulator.stack().len();
        Search { interest: Interest::default(), goal: Goal::Step { unit, depth }, ahead: None }
    }

    /// Relevant positions from `begin` to `end`, given the machine's events in that range. Ranges are consecutive. Events before the
    /// first range are unknown, so its first few positions are all relevant.
    pub(crate) fn positions(
        &mut self,
        events: &[&Event],
        inputs: &[&InputEvent],
        begin: Cycle,
        end: Cycle,
    ) -> BTreeSet<Cycle> {
        let mut positions = self.ahead.take().unwrap_or_else(|| (begin..=begin + AHEAD).collect());
        if self.interest.is_each() {
            positions.extend(begin..=end);
        }
        for event in events {
            match event {
                // A step ends only just before an issue.
                Event::Issue { cycle, .. } if matches!(self.goal, Goal::Step { .. }) => {
                    positions.insert(*cycle);
                }
                Event::Issue { cycle, address } if self.interest.is_of(*address) => {
                    positions.extend([*cycle, cycle + 1]);
                }
                // Bundles can read a result from its writeback on.
                Event::Retire(retire) if self.interest.is_of(retire.address) => {
                    positions.extend([retire.cycle, retire.cycle + 1]);
                }
                // Latched output ports change, and a period ends.
                Event::Publish { cycle, .. } | Event::Wait { cycle, .. } => {
                    positions.extend(cycle + 1..=cycle + 3)
                }
                // Latched input ports change.
                Event::Tick { cycle } => positions.extend(*cycle..=cycle + 2),
                _ => {}
            }
        }
        // The core sees an input a few cycles after it arrives at the pins.
        let seen = inputs.iter().flat_map(|input| input.cycle..=input.cycle + INPUT_DELAY + 1);
        positions.extend(seen);
        positions.extend(self.interest.cycles(begin, end));
        self.ahead = Some(positions.split_off(&(end + 1)));
        positions.split_off(&begin)
    }

    /// Reason to stop at the session's position, where `issuing` is about to issue.
    pub(crate) fn visit(&mut self, session: &Session, issuing: Option<BundleAddress>) -> Option<StopReason> {
        match &mut self.goal {
            Goal::Stops(watcher) => watcher.visit(session, issuing),
            Goal::Holds(live) => session.holds(live).then_some(StopReason::Holds),
            Goal::Step { unit, depth } => session.ends_step(*unit, *depth, issuing),
        }
    }
}

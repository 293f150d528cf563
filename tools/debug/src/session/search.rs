// SPDX-License-Identifier: MIT OR Apache-2.0
//! Searches in a machine that somebody else runs: the core of a system, which shows itself to its session
//! ([`Session::look`]) at the positions that matter.

use super::interest::Interest;
use super::stops::Watcher;
use super::{Live, Session, Unit, Why};
use std::collections::BTreeSet;
use takt_emu::Event;
use takt_isa::BundleAddress;
use takt_isa::timing::{Cycle, INPUT_DELAY};
use takt_system::InputEvent;

/// A search through a run, from the position on at which it was made.
#[derive(Clone)]
pub(crate) struct Search {
    interest: Interest,
    goal: Goal,
    /// Positions beyond the last range that matter for what happened in it; `None`: no range was asked for yet.
    ahead: Option<BTreeSet<Cycle>>,
}

/// An event of a cycle matters at most so many positions later; results in flight are told of when they arrive.
const AHEAD: Cycle = if INPUT_DELAY + 1 > 3 { INPUT_DELAY + 1 } else { 3 };

#[derive(Clone)]
enum Goal {
    /// The session's breakpoints and watchpoints.
    Stops(Watcher),
    /// That this is not zero.
    Holds(Box<Live>),
    /// The end of a step that began so many calls deep.
    Step { unit: Unit, depth: usize },
}

impl Search {
    /// For the session's stops; `None` if it has none. It knows of watched values what there is to see where the session looks
    /// now ([`Search::is_complete`]).
    pub(crate) fn stops(session: &Session) -> Option<Search> {
        let goal = Goal::Stops(Watcher::new(session));
        let interest = Interest::stops(&session.stops, session.program());
        (!session.stops.is_empty()).then_some(Search { interest, goal, ahead: None })
    }

    /// True if it knows each watched value as it was where it was there last.
    pub(crate) fn is_complete(&self) -> bool {
        self.watcher().is_none_or(Watcher::is_complete)
    }

    /// True if it is one for the session's stops as they are now.
    pub(crate) fn is_of(&self, session: &Session) -> bool {
        self.watcher().is_some_and(|watcher| watcher.is_of(session))
    }

    /// Takes from a search that was made for an earlier position, or went on from one, what this one does not know.
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

    /// For an expression that holds.
    pub(crate) fn value(live: Live, session: &Session) -> Search {
        let interest = Interest::value(&live, session.program());
        Search { interest, goal: Goal::Holds(Box::new(live)), ahead: None }
    }

    /// For the end of a step from where the session looks now: by a bundle, a line, a call, or out of a subroutine.
    pub(crate) fn step(unit: Unit, session: &Session) -> Search {
        let depth = session.core.emulator.stack().len();
        Search { interest: Interest::default(), goal: Goal::Step { unit, depth }, ahead: None }
    }

    /// The positions from `begin` to `end` that matter, given what the machine did meanwhile; ranges follow one another. What
    /// it did before the first of them is not known, and the first few positions of it matter.
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
                // A step ends where a bundle is about to issue, and nowhere else.
                Event::Issue { cycle, .. } if matches!(self.goal, Goal::Step { .. }) => {
                    positions.insert(*cycle);
                }
                Event::Issue { cycle, address } if self.interest.is_of(*address) => {
                    positions.extend([*cycle, cycle + 1]);
                }
                // A result is seen by what issues from its writeback on.
                Event::Retire(retire) if self.interest.is_of(retire.address) => {
                    positions.extend([retire.cycle, retire.cycle + 1]);
                }
                // A period has ended, and latched ports have their values.
                Event::Wait { cycle, .. } => positions.extend(cycle + 1..=cycle + 3),
                // Latched inputs have new values.
                Event::Tick { cycle } => positions.extend(*cycle..=cycle + 2),
                _ => {}
            }
        }
        // An input is seen a few cycles after it is on its pins.
        let seen = inputs.iter().flat_map(|input| input.cycle..=input.cycle + INPUT_DELAY + 1);
        positions.extend(seen);
        positions.extend(self.interest.cycles(begin, end));
        self.ahead = Some(positions.split_off(&(end + 1)));
        positions.split_off(&begin)
    }

    /// The reason to stop where the session looks now, and `issuing` is about to issue, if there is one.
    pub(crate) fn visit(&mut self, session: &Session, issuing: Option<BundleAddress>) -> Option<Why> {
        match &mut self.goal {
            Goal::Stops(watcher) => watcher.visit(session, issuing),
            Goal::Holds(live) => session.holds(live).then_some(Why::Holds),
            Goal::Step { unit, depth } => session.ends_step(*unit, *depth, issuing),
        }
    }
}

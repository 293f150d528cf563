//! What is looked for in a machine that somebody else runs: the core of a system, which shows itself to its session
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
}

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
    /// For the session's stops; `None` if it has none.
    pub(crate) fn stops(session: &Session) -> Option<Search> {
        let goal = Goal::Stops(Watcher::new(session));
        let interest = Interest::stops(&session.stops, session.program());
        (!session.stops.is_empty()).then_some(Search { interest, goal })
    }

    /// For an expression that holds.
    pub(crate) fn value(live: Live, session: &Session) -> Search {
        Search { interest: Interest::value(&live, session.program()), goal: Goal::Holds(Box::new(live)) }
    }

    /// For the end of a step from where the session looks now: by a bundle, a line, a call, or out of a subroutine.
    pub(crate) fn step(unit: Unit, session: &Session) -> Search {
        let depth = session.core.emulator.stack().len();
        Search { interest: Interest::default(), goal: Goal::Step { unit, depth } }
    }

    /// The positions from `begin` to `end` that matter, given what the machine did meanwhile.
    pub(crate) fn positions(
        &self,
        events: &[&Event],
        inputs: &[&InputEvent],
        begin: Cycle,
        end: Cycle,
    ) -> BTreeSet<Cycle> {
        let mut positions = BTreeSet::new();
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
        positions.into_iter().filter(|position| (begin..=end).contains(position)).collect()
    }

    /// Whether it is found where the session looks now, and `issuing` is about to issue.
    pub(crate) fn visit(&mut self, session: &Session, issuing: Option<BundleAddress>) -> Option<Why> {
        match &mut self.goal {
            Goal::Stops(watcher) => watcher.visit(session, issuing),
            Goal::Holds(live) => session.holds(live).then_some(Why::Holds),
            Goal::Step { unit, depth } => session.ends_step(*unit, *depth, issuing),
        }
    }
}

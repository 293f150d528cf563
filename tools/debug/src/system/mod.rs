// SPDX-License-Identifier: MIT OR Apache-2.0
//! A debug session on a system of several cores: one global time, forward and back.
//!
//! **Positions** are those of a single core's session, for all cores at once: at position *n*, cycles 0 to *n* - 1 have passed in
//! each. What happens on a link in cycle *c* has happened at position *c* + 1; a bundle that issues in *c* is about to at *c*.
//!
//! **Going back** is restoring a checkpoint and running from there. **The host** takes its turn as `takt run` has it: a row of
//! inputs for each base tick, written so early that the periods which begin there read them; of each FIFO to it, one entry taken.
//!
//! Looking back and ahead for what a command waits for, all that happens in a stretch is recorded, and the session then goes to
//! the first or the last of it. What a core's own session stops at (breakpoints with conditions, watchpoints) is asked of that
//! session, which looks at the core at each position that matters to it.

mod links;
mod seek;

pub(crate) use links::link_named;
pub use links::link_text;

use crate::along::Along;
use crate::session::{self, Control, Place, RUN_LIMIT, Why};
use std::sync::Arc;
use takt_emu::{Emulator, Event, LoadError};
use takt_isa::BundleAddress;
use takt_isa::timing::Cycle;
use takt_system::{
    Description, HostError, InputEvent, LinkEvent, LinkEventKind, MAX_LATENCY, System, SystemFault,
};

/// Cycles that are recorded at once.
const STRETCH: Cycle = 1 << 12;
/// An event on a link is told of at most so many cycles late: what is under way, and a few more.
const LATE: Cycle = MAX_LATENCY + 8;

/// The host's actions at a base tick.
#[derive(Clone, Debug, Default)]
pub struct Turn {
    /// Inputs of the system that it writes.
    pub inputs: Vec<(String, u32)>,
    /// Snapshots that it publishes.
    pub publish: Vec<usize>,
    /// FIFOs that it puts an entry into.
    pub push: Vec<usize>,
}

/// The options of a session.
#[derive(Clone, Default)]
pub struct SystemOptions {
    /// A turn for each base tick; `None`: each is `idle`.
    pub turns: Option<Arc<Vec<Turn>>>,
    /// A turn of a host that writes zeros.
    pub idle: Turn,
    /// FIFOs to the host, of which it takes an entry each time.
    pub pops: Vec<usize>,
    /// The state shared with whoever watches.
    pub control: Arc<Control>,
}

/// The reason why a command stopped.
#[derive(Clone, Debug, PartialEq)]
pub enum SystemWhy {
    /// It is done.
    Done,
    /// An event on a link, by the stop's number.
    Stop(u32),
    /// The reason why the session of a core stopped.
    Core(usize, Why),
    /// The beginning was reached.
    Start,
    /// Every core has halted.
    Halted,
    /// The last turn of the recorded inputs is over.
    InputsEnd,
    /// A core stopped the system.
    Fault(SystemFault),
    /// There was nothing to stop at in so many cycles.
    Limit(Cycle),
    /// Somebody interrupted it.
    Interrupted,
    /// The host was refused.
    Host(HostError),
}

/// A stop at an event on a link; without a kind, any. (Stops at what a core does are those of its own session.)
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SystemStop {
    /// The link.
    pub link: usize,
    /// The event.
    pub kind: Option<LinkEventKind>,
}

/// The run up to some position.
#[derive(Clone)]
struct Point {
    system: System,
    /// Turns that the host has taken.
    turns: u64,
    /// Events on links that may be ahead of the position.
    links: Vec<LinkEvent>,
    /// Edits that have been made.
    edits: usize,
}

/// A value that was set by hand.
#[derive(Clone, Copy, Debug)]
struct Edit {
    cycle: Cycle,
    core: usize,
    place: Place,
    bits: u32,
}

/// The events of the cores in a stretch.
#[derive(Default)]
struct Seen {
    cores: Vec<(usize, Event)>,
    inputs: Vec<InputEvent>,
}

/// A debug session on a system.
pub struct SystemSession {
    options: SystemOptions,
    point: Point,
    /// By cycle, ascending; the first is cycle 0.
    checkpoints: Along<Point>,
    stops: Vec<(u32, SystemStop, String)>,
    next_id: u32,
    /// By cycle, ascending.
    edits: Vec<Edit>,
    /// Searches for the stops of the cores' sessions that have gone through the run up to positions of it.
    known: Along<seek::Searches>,
    /// Cycles for which a command may run.
    pub run_limit: Cycle,
}

impl SystemSession {
    /// A session at the beginning.
    ///
    /// # Errors
    /// If a core's memories cannot hold its program.
    pub fn new(description: &Description, options: SystemOptions) -> Result<SystemSession, LoadError> {
        let mut system = System::new(description)?;
        system.keep_events();
        let point = Point { system, turns: 0, links: Vec::new(), edits: 0 };
        let mut checkpoints = Along::every(STRETCH);
        checkpoints.add(0, point.clone());
        Ok(SystemSession {
            options,
            checkpoints,
            point,
            stops: Vec::new(),
            next_id: 1,
            edits: Vec::new(),
            known: Along::every(STRETCH),
            run_limit: RUN_LIMIT,
        })
    }

    /// The system at this position.
    pub fn system(&self) -> &System {
        &self.point.system
    }

    /// Cycles that have passed.
    pub fn cycle(&self) -> Cycle {
        self.point.system.now()
    }

    /// Base ticks for which the host has taken its turn.
    pub fn turns(&self) -> u64 {
        self.point.turns
    }

    // ---- Stops.

    /// Adds a stop; its number.
    pub fn add_stop(&mut self, stop: SystemStop, text: String) -> u32 {
        let id = self.next_id;
        self.next_id += 1;
        self.stops.push((id, stop, text));
        id
    }

    /// The number that the next one gets: one count for links and for all cores' sessions.
    pub(crate) fn next_stop(&mut self) -> &mut u32 {
        &mut self.next_id
    }

    /// Removes one; whether there was one.
    pub fn remove_stop(&mut self, id: u32) -> bool {
        let before = self.stops.len();
        self.stops.retain(|(known, ..)| *known != id);
        self.stops.len() < before
    }

    /// Numbers and texts of all.
    pub fn stops(&self) -> impl Iterator<Item = (u32, &str)> {
        self.stops.iter().map(|(id, _, text)| (*id, text.as_str()))
    }

    // ---- Moving.

    /// Goes to a position, forward or back.
    pub fn go_to(&mut self, cycle: Cycle) -> SystemWhy {
        if cycle < self.cycle() {
            self.restore(cycle);
        }
        loop {
            let next = cycle.min(self.cycle() + STRETCH);
            let why = self.advance(next, None);
            if why != SystemWhy::Done || self.cycle() >= cycle {
                return why;
            }
            if self.interrupted() {
                return SystemWhy::Interrupted;
            }
        }
    }

    /// Runs again from the beginning to this position, and shows a core after each cycle in which a bundle of it issued, with
    /// that bundle. The session stays where it is.
    ///
    /// # Returns
    /// [`SystemWhy::Done`], or that it was interrupted.
    pub fn replay(&mut self, core: usize, visit: &mut dyn FnMut(&Emulator, BundleAddress)) -> SystemWhy {
        let here = self.cycle();
        let Some(beginning) = self.checkpoints.first().cloned() else { return SystemWhy::Start };
        let point = std::mem::replace(&mut self.point, beginning);
        let mut why = SystemWhy::Done;
        while self.cycle() < here && why == SystemWhy::Done {
            let (now, mut seen) = (self.cycle(), Seen::default());
            why = self.advance(now + 1, Some(&mut seen));
            for (own, event) in seen.cores {
                match event {
                    Event::Issue { cycle, address } if (own, cycle) == (core, now) => {
                        visit(self.system().core(core), address);
                    }
                    _ => {}
                }
            }
            if self.interrupted() {
                why = SystemWhy::Interrupted;
            }
        }
        self.point = point;
        why
    }

    /// Sets a register or a data word of a core. What was recorded of the run after this position is forgotten.
    pub fn set(&mut self, core: usize, place: Place, bits: u32) {
        let now = self.cycle();
        self.edits.truncate(self.point.edits);
        self.checkpoints.forget_from(now + 1);
        self.known.forget_from(now);
        self.edits.push(Edit { cycle: now, core, place, bits });
        make_edits(&self.edits, &mut self.point);
    }

    fn interrupted(&self) -> bool {
        self.options.control.report(self.cycle())
    }

    /// To the last checkpoint not after a cycle.
    fn restore(&mut self, cycle: Cycle) {
        if let Some((_, point)) = self.checkpoints.before(cycle) {
            self.point = point.clone();
        }
    }

    /// Lets the system run until so many cycles have passed, with the host's turns and the edits on the way. `seen` gets what the
    /// cores do.
    fn advance(&mut self, cycle: Cycle, mut seen: Option<&mut Seen>) -> SystemWhy {
        let point = &mut self.point;
        make_edits(&self.edits, point);
        let now = point.system.now();
        // Events of long ago are of no interest.
        point.links.retain(|event| event.cycle + LATE + STRETCH >= now);
        let mut why = SystemWhy::Done;
        while why == SystemWhy::Done && point.system.now() < cycle {
            if point.system.halted() {
                why = SystemWhy::Halted;
                break;
            }
            let turn = turn(&point.system, point.turns);
            let edit = self.edits.get(point.edits).map_or(Cycle::MAX, |edit| edit.cycle);
            let until = cycle.min(edit);
            if seen.is_some() {
                point.system.keep_core_events();
            } else {
                point.system.drop_core_events();
            }
            let result = match turn {
                None => point.system.run_to_start(until).map(|_| ()),
                Some(turn) => point.system.run_until(until.min(turn)),
            };
            point.links.extend(point.system.take_events());
            if let Some(seen) = &mut seen {
                seen.cores.extend(point.system.take_core_events());
                seen.inputs.extend(point.system.take_input_events());
            }
            if let Err(fault) = result {
                why = SystemWhy::Fault(fault);
            } else if turn == Some(point.system.now()) {
                why = match take_turn(&self.options, point) {
                    Ok(true) => SystemWhy::Done,
                    Ok(false) => SystemWhy::InputsEnd,
                    Err(error) => SystemWhy::Host(error),
                };
            }
            make_edits(&self.edits, point);
        }
        self.options.control.report(self.cycle());
        if why == SystemWhy::Done && self.cycle() >= self.checkpoints.due(self.cycle()) {
            self.checkpoints.add(self.cycle(), self.point.clone());
        }
        why
    }
}

/// Makes the edits of this position that have not been made.
fn make_edits(edits: &[Edit], point: &mut Point) {
    while let Some(edit) = edits.get(point.edits).filter(|edit| edit.cycle == point.system.now()) {
        session::put(point.system.core_mut(edit.core), edit.place, edit.bits);
        point.edits += 1;
    }
}

/// The cycle of the host's next turn, once ticks have started.
fn turn(system: &System, turns: u64) -> Option<Cycle> {
    let description = system.description();
    Some(system.start()? - description.lead() + turns * description.tick)
}

/// Takes the host's turn; false if there is none any more.
fn take_turn(options: &SystemOptions, point: &mut Point) -> Result<bool, HostError> {
    let turn = match &options.turns {
        None => &options.idle,
        Some(turns) => match turns.get(point.turns as usize) {
            Some(turn) => turn,
            None => return Ok(false),
        },
    };
    if point.turns > 0 {
        for &link in &options.pops {
            point.system.pop(link)?;
        }
    }
    for (name, bits) in &turn.inputs {
        point.system.set_input(name, *bits)?;
    }
    for &link in &turn.publish {
        point.system.publish(link)?;
    }
    for &link in &turn.push {
        // One that finds it full is refused, and counted.
        point.system.push(link)?;
    }
    point.turns += 1;
    Ok(true)
}

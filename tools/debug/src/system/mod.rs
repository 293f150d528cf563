// SPDX-License-Identifier: MIT OR Apache-2.0
//! Debug session on a system of several cores: one global time, forward and back.
//!
//! **Positions** are as in a session of one core, for all cores at once: at position *n*, cycles 0 to *n* - 1 have passed in each core. A
//! link event in cycle *c* is visible at position *c* + 1; a bundle that issues in *c* is about to issue at position *c*.
//!
//! **Going back** restores a checkpoint and runs forward. **The host** acts as in `takt run`: at each base tick it writes a row of
//! inputs, early enough for the periods that begin there, and takes one entry from each FIFO to it.
//!
//! A search records the events of a stretch, and then moves to the first or last hit. Conditional breakpoints and watchpoints belong to a
//! core's session, which is shown the core at each relevant position.

mod links;
mod seek;

pub(crate) use links::link_named;
pub use links::link_text;

use crate::samples::ThinnedSeries;
use crate::session::{self, Control, Place, RUN_LIMIT, StopReason};
use std::sync::Arc;
use takt_emu::{Emulator, Event, LoadError};
use takt_isa::BundleAddress;
use takt_isa::timing::Cycle;
use takt_system::{
    Description, HostError, InputEvent, LinkEvent, LinkEventKind, MAX_LATENCY, System, SystemFault,
};

/// Number of cycles recorded at a time.
const STRETCH: Cycle = 1 << 12;
/// Upper bound, in cycles, on the delay with which link events are reported: latency of values in transit, plus a margin.
const LATE: Cycle = MAX_LATENCY + 8;

/// Host actions at a base tick.
#[derive(Clone, Debug, Default)]
pub struct TickActions {
    /// System inputs to write.
    pub inputs: Vec<(String, u32)>,
    /// Numbers of the snapshots to publish.
    pub publish: Vec<usize>,
    /// FIFOs to put an entry into.
    pub push: Vec<usize>,
}

/// Options of a session on a system.
#[derive(Clone, Default)]
pub struct SystemOptions {
    /// Host turn at each base tick; `None`: `idle` at each.
    pub turns: Option<Arc<Vec<TickActions>>>,
    /// Turn that writes zeros.
    pub idle: TickActions,
    /// FIFOs to the host, from which it takes one entry per turn.
    pub pops: Vec<usize>,
    /// State shared with an observer.
    pub control: Arc<Control>,
}

/// Reason why a command stopped.
#[derive(Clone, Debug, PartialEq)]
pub enum SystemStopReason {
    /// The command is complete.
    Done,
    /// A stop at a link event, by number.
    Stop(u32),
    /// The session of a core stopped, with the reason.
    Core(usize, StopReason),
    /// The run is back at its beginning.
    Start,
    /// Every core has halted.
    Halted,
    /// The recorded inputs have ended with this turn.
    InputsEnd,
    /// A core faulted, which stops the system.
    Fault(SystemFault),
    /// No stop was reached within this number of cycles.
    Limit(Cycle),
    /// The user interrupted the command.
    Interrupted,
    /// The system rejected an action of the host.
    Host(HostError),
}

/// A stop at link events of one kind, or of any kind. (Stops at events of a core belong to the core's session.)
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SystemStop {
    /// Index of the link.
    pub link: usize,
    /// Kind of event; `None` for any.
    pub kind: Option<LinkEventKind>,
}

/// State of the run at a position.
#[derive(Clone)]
struct Point {
    system: System,
    /// Number of host turns taken.
    turns: u64,
    /// Link events that may not have been reported at this position.
    links: Vec<LinkEvent>,
    /// Number of edits already applied.
    edits: usize,
}

/// A value set by the user, replayed at its cycle.
#[derive(Clone, Copy, Debug)]
struct Edit {
    cycle: Cycle,
    core: usize,
    place: Place,
    bits: u32,
}

/// Events of the cores in a stretch.
#[derive(Default)]
struct StretchEvents {
    cores: Vec<(usize, Event)>,
    inputs: Vec<InputEvent>,
}

/// Debug session of a system.
pub struct SystemSession {
    options: SystemOptions,
    point: Point,
    /// Checkpoints by ascending cycle; the first is at cycle 0.
    checkpoints: ThinnedSeries<Point>,
    stops: Vec<(u32, SystemStop, String)>,
    next_id: u32,
    /// Edits, by ascending cycle.
    edits: Vec<Edit>,
    /// Searches for the stops of the cores' sessions, recorded along the run.
    known: ThinnedSeries<seek::Searches>,
    /// Maximum number of cycles of a command.
    pub run_limit: Cycle,
}

impl SystemSession {
    /// Starts a session at reset of a system.
    ///
    /// # Errors
    /// If a core's memories cannot hold its program.
    pub fn new(description: &Description, options: SystemOptions) -> Result<SystemSession, LoadError> {
        let mut system = System::new(description)?;
        system.keep_events();
        let point = Point { system, turns: 0, links: Vec::new(), edits: 0 };
        let mut checkpoints = ThinnedSeries::every(STRETCH);
        checkpoints.add(0, point.clone());
        Ok(SystemSession {
            options,
            checkpoints,
            point,
            stops: Vec::new(),
            next_id: 1,
            edits: Vec::new(),
            known: ThinnedSeries::every(STRETCH),
            run_limit: RUN_LIMIT,
        })
    }

    /// State of the system at this position.
    pub fn system(&self) -> &System {
        &self.point.system
    }

    /// Number of cycles since reset.
    pub fn cycle(&self) -> Cycle {
        self.point.system.now()
    }

    /// Number of base ticks with a host turn taken.
    pub fn turns(&self) -> u64 {
        self.point.turns
    }

    // ---- Stops.

    /// Adds a stop; returns its number.
    pub fn add_stop(&mut self, stop: SystemStop, text: String) -> u32 {
        let id = self.next_id;
        self.next_id += 1;
        self.stops.push((id, stop, text));
        id
    }

    /// Counter that numbers the stops of links and of all cores' sessions.
    pub(crate) fn next_stop(&mut self) -> &mut u32 {
        &mut self.next_id
    }

    /// Removes a stop; returns whether it existed.
    pub fn remove_stop(&mut self, id: u32) -> bool {
        let before = self.stops.len();
        self.stops.retain(|(known, ..)| *known != id);
        self.stops.len() < before
    }

    /// Numbers and texts of all stops at link events.
    pub fn stops(&self) -> impl Iterator<Item = (u32, &str)> {
        self.stops.iter().map(|(id, _, text)| (*id, text.as_str()))
    }

    // ---- Moving.

    /// Goes to a position, forward or back.
    pub fn go_to(&mut self, cycle: Cycle) -> SystemStopReason {
        if cycle < self.cycle() {
            self.restore(cycle);
        }
        loop {
            let next = cycle.min(self.cycle() + STRETCH);
            let why = self.advance(next, None);
            if why != SystemStopReason::Done || self.cycle() >= cycle {
                return why;
            }
            if self.interrupted() {
                return SystemStopReason::Interrupted;
            }
        }
    }

    /// Repeats the run from reset to this position, and calls `visit` with the core and the bundle after each issue of one core. The
    /// session's position does not change.
    ///
    /// # Returns
    /// [`SystemStopReason::Done`], or [`SystemStopReason::Interrupted`].
    pub fn replay(
        &mut self,
        core: usize,
        visit: &mut dyn FnMut(&Emulator, BundleAddress),
    ) -> SystemStopReason {
        let here = self.cycle();
        let Some(beginning) = self.checkpoints.first().cloned() else { return SystemStopReason::Start };
        let point = std::mem::replace(&mut self.point, beginning);
        let mut why = SystemStopReason::Done;
        while self.cycle() < here && why == SystemStopReason::Done {
            let (now, mut seen) = (self.cycle(), StretchEvents::default());
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
                why = SystemStopReason::Interrupted;
            }
        }
        self.point = point;
        why
    }

    /// Sets a register or a data word of a core. Discards records of the run after this position.
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

    /// Restores the last checkpoint at or before a cycle.
    fn restore(&mut self, cycle: Cycle) {
        if let Some((_, point)) = self.checkpoints.before(cycle) {
            self.point = point.clone();
        }
    }

    /// Runs the system up to this cycle, with the host's turns and the edits on the way. Events of the cores are added to `seen`.
    fn advance(&mut self, cycle: Cycle, mut seen: Option<&mut StretchEvents>) -> SystemStopReason {
        let point = &mut self.point;
        make_edits(&self.edits, point);
        let now = point.system.now();
        // Drop events too old to be reported.
        point.links.retain(|event| event.cycle + LATE + STRETCH >= now);
        let mut why = SystemStopReason::Done;
        while why == SystemStopReason::Done && point.system.now() < cycle {
            if point.system.halted() {
                why = SystemStopReason::Halted;
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
                why = SystemStopReason::Fault(fault);
            } else if turn == Some(point.system.now()) {
                why = match take_turn(&self.options, point) {
                    Ok(true) => SystemStopReason::Done,
                    Ok(false) => SystemStopReason::InputsEnd,
                    Err(error) => SystemStopReason::Host(error),
                };
            }
            make_edits(&self.edits, point);
        }
        self.options.control.report(self.cycle());
        if why == SystemStopReason::Done && self.cycle() >= self.checkpoints.due(self.cycle()) {
            self.checkpoints.add(self.cycle(), self.point.clone());
        }
        why
    }
}

/// Applies the pending edits of this position.
fn make_edits(edits: &[Edit], point: &mut Point) {
    while let Some(edit) = edits.get(point.edits).filter(|edit| edit.cycle == point.system.now()) {
        session::put(point.system.core_mut(edit.core), edit.place, edit.bits);
        point.edits += 1;
    }
}

/// Cycle of the host's next turn, once ticks have started.
fn turn(system: &System, turns: u64) -> Option<Cycle> {
    let description = system.description();
    Some(system.start()? - description.lead() + turns * description.tick)
}

/// Executes the host's turn; returns false if no turns are left.
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
        // A full FIFO rejects the entry and counts the rejection.
        point.system.push(link)?;
    }
    point.turns += 1;
    Ok(true)
}

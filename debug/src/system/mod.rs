//! A debug session on a system of several cores: one global time, forward and back.
//!
//! **Positions** are those of a single core's session, for all cores at once: at position *n*, cycles 0 to *n* - 1 have passed in
//! each. What happens on a link in cycle *c* has happened at position *c* + 1; a bundle that issues in *c* is about to at *c*.
//!
//! **Going back** is restoring a checkpoint and running from there. **The host** takes its turn as `takt run` has it: a row of
//! inputs for each base tick, written so early that the periods which begin there read them; of each FIFO to it, one entry taken.
//!
//! Looking back and ahead for what a command waits for, all that happens in a stretch is recorded, and the session then goes to
//! the first or the last of it.

mod console;

pub use console::SystemConsole;

use crate::session::{Control, RUN_LIMIT};
use std::sync::Arc;
use takt_emu::{Event, LoadError};
use takt_isa::BundleAddress;
use takt_isa::timing::Cycle;
use takt_system::{Description, HostError, LinkEvent, LinkEventKind, MAX_LATENCY, System, SystemFault};

/// Cycles that are recorded at once.
const STRETCH: Cycle = 1 << 12;
/// Checkpoints that are kept; the distance between them doubles when there are more.
const CHECKPOINTS: usize = 256;
/// An event on a link is told of at most so many cycles late: what is under way, and a few more.
const LATE: Cycle = MAX_LATENCY + 8;

/// What the host does at a base tick.
#[derive(Clone, Debug, Default)]
pub struct Turn {
    /// Inputs of the system that it writes.
    pub inputs: Vec<(String, u32)>,
    /// Snapshots that it publishes.
    pub publish: Vec<usize>,
    /// FIFOs that it puts an entry into.
    pub push: Vec<usize>,
}

/// What a session is about.
#[derive(Clone, Default)]
pub struct SystemOptions {
    /// A turn for each base tick; `None`: each is `idle`.
    pub turns: Option<Arc<Vec<Turn>>>,
    /// A turn of a host that writes zeros.
    pub idle: Turn,
    /// FIFOs to the host, of which it takes an entry each time.
    pub pops: Vec<usize>,
    /// What is shared with whoever watches.
    pub control: Arc<Control>,
}

/// Why a command stopped.
#[derive(Clone, Debug, PartialEq)]
pub enum SystemWhy {
    /// It is done.
    Done,
    /// A stop, by number.
    Stop(u32),
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

/// What to stop at.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SystemStop {
    /// A core's bundle, of these, is about to issue.
    Bundle(usize, Vec<BundleAddress>),
    /// An event on a link; without a kind, any.
    Link(usize, Option<LinkEventKind>),
    /// So many cycles have passed.
    Cycle(Cycle),
}

/// What to step by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// A cycle of all cores.
    Cycle,
    /// To where a bundle of a core is about to issue.
    Bundle(usize),
    /// To where the `wait` of a core has issued.
    Period(usize),
}

/// The run up to some position.
#[derive(Clone)]
struct Point {
    system: System,
    /// Turns that the host has taken.
    turns: u64,
    /// Events on links that may be ahead of the position.
    links: Vec<LinkEvent>,
}

/// What is looked for: positions at which to stop, with the stop's number if it is one.
type Hits = Vec<(Cycle, Option<u32>)>;

/// A debug session on a system.
pub struct SystemSession {
    options: SystemOptions,
    point: Point,
    /// By cycle, ascending; the first is cycle 0.
    checkpoints: Vec<Point>,
    interval: Cycle,
    stops: Vec<(u32, SystemStop, String)>,
    next_id: u32,
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
        let point = Point { system, turns: 0, links: Vec::new() };
        Ok(SystemSession {
            options,
            checkpoints: vec![point.clone()],
            point,
            interval: STRETCH,
            stops: Vec::new(),
            next_id: 1,
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

    /// Goes on by a step.
    pub fn step(&mut self, step: Step) -> SystemWhy {
        match step {
            Step::Cycle => self.go_to(self.cycle() + 1),
            _ => self.seek(|cores, links| found(step, cores, links)),
        }
    }

    /// Goes back by a step.
    pub fn step_back(&mut self, step: Step) -> SystemWhy {
        match (step, self.cycle()) {
            (_, 0) => SystemWhy::Start,
            (Step::Cycle, now) => self.go_to(now - 1),
            _ => self.seek_back(|cores, links| found(step, cores, links)),
        }
    }

    /// Runs on to a stop.
    pub fn resume(&mut self) -> SystemWhy {
        let stops = self.stops.clone();
        self.seek(|cores, links| stopped(&stops, cores, links))
    }

    /// Runs back to a stop.
    pub fn resume_back(&mut self) -> SystemWhy {
        let stops = self.stops.clone();
        self.seek_back(|cores, links| stopped(&stops, cores, links))
    }

    /// Goes on to the first position after this one that is looked for.
    fn seek(&mut self, wanted: impl Fn(&[(usize, Event)], &[LinkEvent]) -> Hits) -> SystemWhy {
        let origin = self.cycle();
        loop {
            let mut cores = Vec::new();
            let why = self.advance(self.cycle() + STRETCH, Some(&mut cores));
            let now = self.cycle();
            let hits = wanted(&cores, &self.point.links).into_iter();
            let first = hits.filter(|(cycle, _)| *cycle > origin && *cycle <= now).min();
            if let Some((cycle, id)) = first {
                self.go_to(cycle);
                return id.map_or(SystemWhy::Done, SystemWhy::Stop);
            }
            if why != SystemWhy::Done {
                return why;
            }
            if now - origin >= self.run_limit {
                return SystemWhy::Limit(now - origin);
            }
            if self.interrupted() {
                return SystemWhy::Interrupted;
            }
        }
    }

    /// Goes back to the last position before this one that is looked for.
    fn seek_back(&mut self, wanted: impl Fn(&[(usize, Event)], &[LinkEvent]) -> Hits) -> SystemWhy {
        // Looked for are positions before `end`, from a checkpoint before `before` on.
        let (mut end, mut before) = (self.cycle(), self.cycle());
        while before > 0 {
            self.restore(before - 1);
            let start = self.cycle();
            let mut hits = Hits::new();
            let mut cores = Vec::new();
            // What is told of late, too.
            while self.cycle() < end + LATE {
                let why = self.advance((self.cycle() + STRETCH).min(end + LATE), Some(&mut cores));
                hits.extend(wanted(&cores, &self.point.links));
                cores.clear();
                if why != SystemWhy::Done {
                    break;
                }
            }
            // What has just happened where a stretch begins is known of the one before.
            let last =
                hits.into_iter().filter(|(cycle, _)| *cycle < end && (*cycle > start || start == 0)).max();
            if let Some((cycle, id)) = last {
                self.go_to(cycle);
                return id.map_or(SystemWhy::Done, SystemWhy::Stop);
            }
            (end, before) = (start + 1, start);
            if self.interrupted() {
                return SystemWhy::Interrupted;
            }
        }
        self.go_to(0);
        SystemWhy::Start
    }

    fn interrupted(&self) -> bool {
        self.options.control.report(self.cycle())
    }

    /// To the last checkpoint not after a cycle.
    fn restore(&mut self, cycle: Cycle) {
        let next = self.checkpoints.partition_point(|point| point.system.now() <= cycle);
        self.point = self.checkpoints[next.saturating_sub(1)].clone();
    }

    fn checkpoint(&mut self) {
        let now = self.cycle();
        let last = self.checkpoints.last().map_or(0, |point| point.system.now());
        if now < last + self.interval {
            return;
        }
        self.checkpoints.push(self.point.clone());
        if self.checkpoints.len() > CHECKPOINTS {
            let mut number = 0;
            self.checkpoints.retain(|_| {
                number += 1;
                number % 2 == 1
            });
            self.interval *= 2;
        }
    }

    /// Lets the system run until so many cycles have passed, with the host's turns on the way. `cores` gets what the cores do.
    fn advance(&mut self, cycle: Cycle, mut cores: Option<&mut Vec<(usize, Event)>>) -> SystemWhy {
        let point = &mut self.point;
        let now = point.system.now();
        // What has happened long ago is of no interest.
        point.links.retain(|event| event.cycle + LATE + STRETCH >= now);
        let mut why = SystemWhy::Done;
        while why == SystemWhy::Done && point.system.now() < cycle {
            if point.system.halted() {
                why = SystemWhy::Halted;
                break;
            }
            let turn = turn(&point.system, point.turns);
            if cores.is_some() {
                point.system.keep_core_events();
            } else {
                point.system.drop_core_events();
            }
            let result = match turn {
                None => point.system.run_to_start(cycle).map(|_| ()),
                Some(turn) => point.system.run_until(cycle.min(turn)),
            };
            point.links.extend(point.system.take_events());
            if let Some(cores) = &mut cores {
                cores.extend(point.system.take_core_events());
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
        }
        self.options.control.report(self.cycle());
        if why == SystemWhy::Done {
            self.checkpoint();
        }
        why
    }
}

/// The cycle of the host's next turn, once ticks have started.
fn turn(system: &System, turns: u64) -> Option<Cycle> {
    let description = system.description();
    Some(system.start()? - description.lead() + turns * description.tick)
}

/// What the host does at its turn; false if there is none any more.
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

fn found(step: Step, cores: &[(usize, Event)], _: &[LinkEvent]) -> Hits {
    let of = |wanted: usize, position: &dyn Fn(&Event) -> Option<Cycle>| -> Hits {
        let own = cores.iter().filter(|(core, _)| *core == wanted);
        own.filter_map(|(_, event)| Some((position(event)?, None))).collect()
    };
    match step {
        Step::Cycle => Hits::new(),
        Step::Bundle(core) => of(core, &|event| match event {
            Event::Issue { cycle, .. } => Some(*cycle),
            _ => None,
        }),
        Step::Period(core) => of(core, &|event| match event {
            Event::Wait { cycle, .. } => Some(*cycle + 1),
            _ => None,
        }),
    }
}

fn stopped(stops: &[(u32, SystemStop, String)], cores: &[(usize, Event)], links: &[LinkEvent]) -> Hits {
    let mut hits = Hits::new();
    for (id, stop, _) in stops {
        match stop {
            SystemStop::Bundle(core, bundles) => {
                hits.extend(cores.iter().filter_map(|(own, event)| match event {
                    Event::Issue { cycle, address } if own == core && bundles.contains(address) => {
                        Some((*cycle, Some(*id)))
                    }
                    _ => None,
                }))
            }
            SystemStop::Link(link, kind) => {
                let same = |event: &&LinkEvent| {
                    event.link == *link && kind.is_none_or(|kind| kind.name() == event.kind.name())
                };
                hits.extend(links.iter().filter(same).map(|event| (event.cycle + 1, Some(*id))));
            }
            SystemStop::Cycle(cycle) => hits.push((*cycle, Some(*id))),
        }
    }
    hits
}

//! The emulator of a system. Each core runs ahead on its own until it needs to know what another one did.
//!
//! A core's reads of linked inputs are where it can see others, and nothing arrives earlier than [`MIN_LATENCY`] cycles
//! after it was sent. So a core runs to the next bundle that reads such an input (or tick that takes one), and goes on once
//! every sender has come within the link's latency of that cycle. The core that is behind all others can always go on.

use crate::description::{Description, End, Lane, Link, LinkKind, MIN_LATENCY, Side, Source};
use crate::fifo::{Change, Fifo, FifoCounts};
use crate::gate::Gate;
use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;
use takt_emu::{Emulator, Fault, LoadError, Number, PeriodReport, PortWrite, Status, Stop};
use takt_isa::timing::{Cycle, ENDED_DELAY};
use takt_isa::{BundleAddress, Program, Register};

/// Cycles that a core runs ahead of the one that is behind all others at most, so that what is under way stays small.
const WINDOW: Cycle = 1 << 14;

/// A core that stopped with a fault: the system stands.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("core {name}: {fault}")]
pub struct SystemFault {
    /// The core.
    pub core: usize,
    /// Its name.
    pub name: String,
    /// What happened.
    #[source]
    pub fault: Fault,
}

/// What the host cannot do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum HostError {
    /// The system has no such port or link at the host.
    #[error("the system has no {what} `{name}`")]
    Unknown {
        /// `input`, `output`, `snapshot from the host`, ….
        what: &'static str,
        /// The name.
        name: String,
    },
    /// An entry has so many fields.
    #[error("`{name}` has {wanted} fields, not {given}")]
    Fields {
        /// The link.
        name: String,
        /// Fields that it has.
        wanted: usize,
        /// Values given.
        given: usize,
    },
}

/// Something that happens on a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct LinkEvent {
    /// The cycle.
    pub cycle: Cycle,
    /// The link.
    pub link: usize,
    /// What.
    pub kind: LinkEventKind,
}

/// What happens on a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum LinkEventKind {
    /// A value of a wire arrives at the receiver.
    Value(u32),
    /// A snapshot's values arrive together.
    Published,
    /// The receiver takes them, for the tick to come.
    Taken,
    /// The receiver does not wait for its tick in time: it keeps those that it has.
    Skipped,
    /// An entry is put into a FIFO.
    Pushed,
    /// An entry is taken out of a FIFO.
    Popped,
    /// A FIFO is full: the entry is refused.
    Overflow,
    /// A FIFO is empty: there is no entry to be taken out.
    Underflow,
}

/// What a core's periods came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CorePeriods {
    /// Periods that ended.
    pub count: u64,
    /// The cycles of the shortest; 0 if there was none.
    pub shortest: Cycle,
    /// The cycles of the longest.
    pub longest: Cycle,
    /// Ticks for which it took no snapshots, because it did not wait in time.
    pub skipped: u64,
}

#[derive(Clone)]
struct CoreState {
    emulator: Emulator,
    lanes: Arc<[Lane]>,
    gate: Gate,
    /// Of links that drive its input ports at any time, one lane each.
    moving: Arc<[Source]>,
    /// Whether it has no tick to come, for good.
    halted: bool,
    /// The cycle of its first `wait`.
    waited: Option<Cycle>,
    /// Its next tick; there only once ticks have started.
    tick: Cycle,
    /// Whether its snapshots for that tick are dealt with.
    taken: bool,
    periods: CorePeriods,
    last: Option<PeriodReport>,
}

#[derive(Clone)]
enum LinkState {
    Wire {
        /// What is to be published at the sender's `wait`, if its ports are latched.
        changed: Option<u32>,
        /// Values on the way to the host, with the cycle in which they arrive.
        host: VecDeque<(Cycle, u32)>,
        /// What the host sees.
        shown: u32,
    },
    Snapshot {
        /// As written, of a link with a strobe, or of the host's.
        working: Vec<u32>,
        /// Published, with the first cycle in which it can be taken.
        published: VecDeque<(Cycle, Vec<u32>)>,
        /// What was published last of what could be seen.
        shown: Vec<u32>,
        taken: u64,
    },
    Fifo {
        working: Vec<u32>,
        fifo: Box<Fifo>,
    },
}

/// A system that runs.
#[derive(Clone)]
pub struct System {
    description: Arc<Description>,
    cores: Vec<CoreState>,
    links: Vec<LinkState>,
    now: Cycle,
    /// How far the present run goes.
    until: Cycle,
    /// The first base tick.
    start: Option<Cycle>,
    /// Whether the present run goes to where that is known.
    starting: bool,
    fault: Option<SystemFault>,
    events: Option<Vec<LinkEvent>>,
}

/// The input ports that a bundle of the program reads.
fn readers(program: &Program, ports: &BTreeSet<Register>) -> Vec<BundleAddress> {
    let reads = |address: &BundleAddress| match program.bundle(*address) {
        Some(Ok(bundle)) => {
            bundle.iter().any(|instruction| instruction.reads().iter().any(|read| ports.contains(read)))
        }
        _ => false,
    };
    program.addresses().filter(reads).collect()
}

impl System {
    /// The system after reset, at the beginning of cycle 0.
    ///
    /// # Errors
    /// If a core's memories cannot hold its program.
    pub fn new(description: &Description) -> Result<System, LoadError> {
        let description = Arc::new(description.clone());
        let mut cores = Vec::new();
        for (number, core) in description.cores.iter().enumerate() {
            let mut emulator = Emulator::new(&core.program)?;
            let lanes: Arc<[Lane]> = description.lanes(number).into();
            for port in &core.program.inputs {
                let lane = lanes.iter().find(|lane| lane.register == port.register);
                let initial = lane.map_or(0, |lane| initial(&description, lane.source));
                // The port is the program's own.
                let _ = emulator.set_input_bits(port.register, initial);
            }
            emulator.set_watched(watched(&description, number));
            let moving: Vec<&Lane> =
                lanes.iter().filter(|lane| !description.links[lane.source.link()].is_snapshot()).collect();
            if !core.program.latched {
                let ports = moving.iter().map(|lane| lane.register).collect();
                emulator.set_pauses(readers(&core.program, &ports));
            }
            let mut sources: Vec<Source> = Vec::new();
            for lane in moving {
                let same = |known: &Source| match (known, &lane.source) {
                    (Source::Status { link, side, .. }, Source::Status { link: l, side: s, .. }) => {
                        (link, side) == (l, s)
                    }
                    (known, source) => {
                        known.link() == source.link() && matches!(source, Source::Field { .. })
                    }
                };
                if !sources.iter().any(same) {
                    sources.push(lane.source);
                }
            }
            cores.push(CoreState {
                emulator,
                lanes: Arc::clone(&lanes),
                gate: Gate::default(),
                moving: sources.into(),
                halted: false,
                waited: None,
                tick: 0,
                taken: false,
                periods: CorePeriods { count: 0, shortest: 0, longest: 0, skipped: 0 },
                last: None,
            });
        }
        let links = description.links.iter().map(state).collect();
        Ok(System {
            description,
            cores,
            links,
            now: 0,
            until: 0,
            start: None,
            starting: false,
            fault: None,
            events: None,
        })
    }

    // ---- What there is to see.

    /// Cores and links.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// Cycles that have passed since reset.
    pub fn now(&self) -> Cycle {
        self.now
    }

    /// The cycle of the first base tick; `None` until every core has waited for the first time.
    pub fn start(&self) -> Option<Cycle> {
        self.start
    }

    /// A core. Between runs it stands at [`System::now`], if it has not halted and there is no fault.
    pub fn core(&self, core: usize) -> &Emulator {
        &self.cores[core].emulator
    }

    /// The same, for a debugger.
    pub fn core_mut(&mut self, core: usize) -> &mut Emulator {
        &mut self.cores[core].emulator
    }

    /// What a core's periods came to.
    pub fn periods(&self, core: usize) -> CorePeriods {
        self.cores[core].periods
    }

    /// A core's last period that ended.
    pub fn last_period(&self, core: usize) -> Option<&PeriodReport> {
        self.cores[core].last.as_ref()
    }

    /// Whether every core has halted.
    pub fn halted(&self) -> bool {
        self.cores.iter().all(|core| core.halted)
    }

    /// The fault that it stands with.
    pub fn fault(&self) -> Option<&SystemFault> {
        self.fault.as_ref()
    }

    /// What has happened to a FIFO; `None` for other links.
    pub fn fifo_counts(&self, link: usize) -> Option<FifoCounts> {
        match self.links.get(link)? {
            LinkState::Fifo { fifo, .. } => Some(fifo.store.counts),
            _ => None,
        }
    }

    /// Entries of a FIFO now, the head first; none of other links.
    pub fn fifo_entries(&self, link: usize) -> Vec<Vec<u32>> {
        match self.links.get(link) {
            Some(LinkState::Fifo { fifo, .. }) => fifo.store.entries.iter().cloned().collect(),
            _ => Vec::new(),
        }
    }

    /// Keeps the events on links from now on, until they are taken.
    pub fn keep_events(&mut self) {
        self.events.get_or_insert_default();
    }

    /// The events on links since this was last asked, by cycle. (Those of the last few cycles may still be missing: they
    /// come with the next run.)
    pub fn take_events(&mut self) -> Vec<LinkEvent> {
        let mut events = self.events.as_mut().map(std::mem::take).unwrap_or_default();
        events.sort();
        events
    }

    // ---- The host.

    /// Writes an input of the system: it is on its way from now on. A field of a snapshot or of a FIFO waits for
    /// [`System::publish`], [`System::push`].
    ///
    /// # Errors
    /// If there is no such input.
    pub fn set_input(&mut self, name: &str, bits: u32) -> Result<(), HostError> {
        let description = Arc::clone(&self.description);
        let mut found = false;
        for (number, link) in description.links.iter().enumerate().filter(|(_, link)| link.from == End::Host)
        {
            match &mut self.links[number] {
                LinkState::Wire { .. } => {
                    if link.fields.first().is_some_and(|field| field.from == name) {
                        self.deliver(number, self.now + link.transit(), 0, bits);
                        found = true;
                    }
                }
                LinkState::Snapshot { working, .. } | LinkState::Fifo { working, .. } => {
                    let Some(name) = name.strip_prefix(&link.name).and_then(|rest| rest.strip_prefix('.'))
                    else {
                        continue;
                    };
                    if let Some(field) = link.fields.iter().position(|field| field.from == name) {
                        working[field] = bits;
                        found = true;
                    }
                }
            }
        }
        if found { Ok(()) } else { Err(HostError::Unknown { what: "input", name: name.to_owned() }) }
    }

    /// Publishes the host's values of a snapshot.
    ///
    /// # Errors
    /// If it is no snapshot from the host.
    pub fn publish(&mut self, link: usize) -> Result<(), HostError> {
        let description = Arc::clone(&self.description);
        let now = self.now;
        match (description.links.get(link), self.links.get_mut(link)) {
            (Some(known), Some(LinkState::Snapshot { working, published, .. }))
                if known.from == End::Host =>
            {
                published.push_back((now + known.transit() + 1, working.clone()));
                Ok(())
            }
            (known, _) => {
                let name = known.map_or_else(|| link.to_string(), |link| link.name.clone());
                Err(HostError::Unknown { what: "snapshot from the host", name })
            }
        }
    }

    /// Puts the host's values of a FIFO into it. False if that makes it overflow, as far as the host can know: entries on
    /// their way count, room that is made meanwhile does not.
    ///
    /// # Errors
    /// If it is no FIFO from the host.
    pub fn push(&mut self, link: usize) -> Result<bool, HostError> {
        let description = Arc::clone(&self.description);
        let now = self.now;
        match (description.links.get(link), self.links.get_mut(link)) {
            (Some(known), Some(LinkState::Fifo { working, fifo })) if known.from == End::Host => {
                let LinkKind::Fifo { depth, .. } = known.kind else { return Ok(false) };
                let room = fifo.store.entries.len() + fifo.pushing() < depth as usize;
                let cycle = (now + known.transit()).max(fifo.free().0);
                fifo.push(cycle, working.clone());
                Ok(room)
            }
            (known, _) => {
                let name = known.map_or_else(|| link.to_string(), |link| link.name.clone());
                Err(HostError::Unknown { what: "FIFO from the host", name })
            }
        }
    }

    /// Takes the head of a FIFO to the host; `None` if it is empty.
    ///
    /// # Errors
    /// If it is no FIFO to the host.
    pub fn pop(&mut self, link: usize) -> Result<Option<Vec<u32>>, HostError> {
        let description = Arc::clone(&self.description);
        let now = self.now;
        match (description.links.get(link), self.links.get_mut(link)) {
            (Some(known), Some(LinkState::Fifo { fifo, .. })) if known.to == End::Host => {
                let entry = fifo.store.entries.get(fifo.popping()).cloned();
                if entry.is_some() {
                    fifo.pop(now.max(fifo.free().1));
                }
                Ok(entry)
            }
            (known, _) => {
                let name = known.map_or_else(|| link.to_string(), |link| link.name.clone());
                Err(HostError::Unknown { what: "FIFO to the host", name })
            }
        }
    }

    /// What the host sees on an output of the system: of a FIFO its head, 0 while it is empty.
    ///
    /// # Errors
    /// If there is no such output.
    pub fn output(&self, name: &str) -> Result<u32, HostError> {
        let ports = self.description.outputs();
        let port = ports.iter().find(|port| port.name == name);
        let port = port.ok_or_else(|| HostError::Unknown { what: "output", name: name.to_owned() })?;
        Ok(match &self.links[port.link] {
            LinkState::Wire { shown, .. } => *shown,
            LinkState::Snapshot { shown, .. } => shown[port.field],
            LinkState::Fifo { fifo, .. } => fifo.store.entries.front().map_or(0, |entry| entry[port.field]),
        })
    }

    /// As [`System::output`], as a number of the port's type.
    ///
    /// # Errors
    /// As there.
    pub fn output_number(&self, name: &str) -> Result<Number, HostError> {
        let bits = self.output(name)?;
        let ty = self.description.outputs().iter().find(|port| port.name == name).map(|port| port.ty);
        Ok(ty.map_or(Number::Bits(bits), |ty| Number::of(ty, bits)))
    }

    // ---- Running.

    /// Runs until ticks have started, or every core has halted, but no further than until `limit` cycles have passed. The
    /// cycle of the first base tick, if it is known then.
    ///
    /// # Errors
    /// The first fault of a core; asked again, the same one.
    pub fn run_to_start(&mut self, limit: Cycle) -> Result<Option<Cycle>, SystemFault> {
        if self.start.is_none() && !self.halted() {
            self.starting = true;
            let result = self.run_until(limit);
            self.starting = false;
            result?;
        }
        Ok(self.start)
    }

    /// Runs until `cycle` cycles have passed since reset.
    ///
    /// # Errors
    /// The first fault of a core; asked again, the same one. The cores that had run ahead of it stay ahead.
    pub fn run_until(&mut self, cycle: Cycle) -> Result<(), SystemFault> {
        self.until = cycle.max(self.now);
        loop {
            self.try_start();
            let behind = self.cores.iter().filter(|core| !core.halted).map(|core| core.emulator.now()).min();
            let horizon = behind.map_or(self.until, |behind| self.until.min(behind + WINDOW));
            let mut went = false;
            for core in 0..self.cores.len() {
                while !matches!(self.cores[core].emulator.status(), Status::Faulted(_)) {
                    match self.segment(core, horizon.min(self.until)) {
                        Ok(true) => went = true,
                        Ok(false) => break,
                        Err(fault) => {
                            went = true;
                            // The others run as far: an earlier one may show.
                            self.until = self.until.min(fault.cycle + 1);
                            let name = self.description.cores[core].name.clone();
                            let earlier =
                                |known: &SystemFault| (known.fault.cycle, known.core) <= (fault.cycle, core);
                            if !self.fault.as_ref().is_some_and(earlier) {
                                self.fault = Some(SystemFault { core, name, fault });
                            }
                            break;
                        }
                    }
                }
            }
            if !went {
                let started = self.start.is_some();
                self.try_start();
                if started == self.start.is_some() {
                    break;
                }
            }
        }
        self.now = self.until;
        for core in 0..self.cores.len() {
            self.know(core);
            // What counts from the cycle to come on goes in when that begins.
            self.enter(core, self.now.saturating_sub(1));
        }
        self.show();
        match &self.fault {
            Some(fault) => Err(fault.clone()),
            None => Ok(()),
        }
    }

    /// Ticks start once every core has waited, in the first cycle that is a multiple of their distance and that leaves the
    /// host and the snapshots their time.
    fn try_start(&mut self) {
        if self.start.is_some() || self.cores.iter().any(|core| core.waited.is_none() && !core.halted) {
            return;
        }
        let Some(last) = self.cores.iter().filter_map(|core| core.waited).max() else { return };
        let tick = self.description.tick;
        let start = (last + MIN_LATENCY + self.description.lead()).div_ceil(tick) * tick;
        self.start = Some(start);
        if self.starting {
            // No core is further, and the host is in time for the first tick.
            self.until = self.until.min(last + MIN_LATENCY);
        }
        for (core, known) in self.cores.iter_mut().zip(&self.description.cores) {
            core.tick = start + known.offset;
        }
    }

    /// Cycles of which all that an end does is known.
    fn known(&self, end: End) -> Cycle {
        match end {
            End::Host => self.until.max(self.now),
            End::Core(core) => match &self.cores[core] {
                state if state.halted || matches!(state.emulator.status(), Status::Faulted(_)) => {
                    Cycle::MAX / 2
                }
                state => state.emulator.now(),
            },
        }
    }

    /// Cycles of which all is known that arrives at a core.
    fn know(&mut self, core: usize) -> Cycle {
        let description = Arc::clone(&self.description);
        let moving = Arc::clone(&self.cores[core].moving);
        let arrivals = moving.iter().map(|source| {
            let link = &description.links[source.link()];
            let known = self.known(link.from) + link.transit();
            let LinkKind::Fifo { .. } = link.kind else {
                return if latched(&description, link.from) { known + ENDED_DELAY } else { known };
            };
            let done = self.carry_out(source.link());
            match source {
                Source::Status { side: Side::Sender, .. } => done + 1 + link.transit(),
                _ => done + 1,
            }
        });
        arrivals.min().unwrap_or(Cycle::MAX / 2)
    }

    /// Lets a FIFO do what is known of both sides; the cycles that are done.
    fn carry_out(&mut self, number: usize) -> Cycle {
        let description = Arc::clone(&self.description);
        let link = &description.links[number];
        let LinkKind::Fifo { sender, receiver, .. } = &link.kind else { return 0 };
        let end = (self.known(link.from) + link.transit()).min(self.known(link.to)).min(self.until);
        loop {
            let LinkState::Fifo { fifo, .. } = &mut self.links[number] else { return 0 };
            let Some((cycle, change)) = fifo.next(end) else { return fifo.done };
            let head = fifo.store.entries.front().filter(|_| change.head).cloned();
            let status = |list: &[(crate::Status, Register)]| -> Vec<u32> {
                list.iter().map(|(status, _)| fifo.store.status(*status)).collect()
            };
            let (to_sender, to_receiver) = (status(sender), status(receiver));
            self.fifo_events(cycle, number, change);
            let core = |end| if let End::Core(core) = end { Some(core) } else { None };
            if let Some(core) = core(link.to) {
                for (field, value) in head.into_iter().flatten().enumerate() {
                    self.arrive(core, cycle + 1, Source::Field { link: number, field }, value);
                }
            }
            let sides = [
                (link.from, Side::Sender, sender, to_sender, cycle + 1 + link.transit()),
                (link.to, Side::Receiver, receiver, to_receiver, cycle + 1),
            ];
            for (end, side, list, values, cycle) in sides {
                for (&(status, _), value) in list.iter().zip(values) {
                    if let Some(core) = core(end) {
                        self.arrive(core, cycle, Source::Status { link: number, side, status }, value);
                    }
                }
            }
        }
    }

    fn fifo_events(&mut self, cycle: Cycle, link: usize, change: Change) {
        for (happened, kind) in [
            (change.popped, LinkEventKind::Popped),
            (change.pushed, LinkEventKind::Pushed),
            (change.overflow, LinkEventKind::Overflow),
            (change.underflow, LinkEventKind::Underflow),
        ] {
            if happened {
                self.event(cycle, link, kind);
            }
        }
    }

    fn event(&mut self, cycle: Cycle, link: usize, kind: LinkEventKind) {
        if let Some(events) = &mut self.events {
            events.push(LinkEvent { cycle, link, kind });
        }
    }

    /// A value arrives at a core's gate.
    fn arrive(&mut self, core: usize, cycle: Cycle, source: Source, value: u32) {
        let state = &mut self.cores[core];
        if let Some(lane) = state.lanes.iter().position(|lane| lane.source == source) {
            state.gate.arrive(cycle, lane, value);
        }
    }

    /// A field of a wire arrives.
    fn deliver(&mut self, number: usize, cycle: Cycle, field: usize, value: u32) {
        self.event(cycle, number, LinkEventKind::Value(value));
        match self.description.links[number].to {
            End::Core(core) => self.arrive(core, cycle, Source::Field { link: number, field }, value),
            End::Host => {
                if let LinkState::Wire { host, .. } = &mut self.links[number] {
                    host.push_back((cycle, value));
                }
            }
        }
    }

    /// Lets values go in that count before or in cycle `now` of a core.
    fn enter(&mut self, core: usize, now: Cycle) {
        let delay = self.description.cores[core].input_delay();
        let CoreState { emulator, gate, lanes, .. } = &mut self.cores[core];
        gate.run((now + 1).saturating_sub(delay), |lane, value| {
            // A lane's port is an input.
            let _ = emulator.set_input_bits(lanes[lane].register, value);
        });
    }

    /// Lets a core run on, at most until cycle `until`, to where it needs to know of others. False if it cannot.
    fn segment(&mut self, core: usize, until: Cycle) -> Result<bool, Fault> {
        let state = &self.cores[core];
        let now = state.emulator.now();
        if state.halted || now >= until {
            return Ok(false);
        }
        let delay = self.description.cores[core].input_delay();
        if self.know(core) + delay < now {
            return Ok(false);
        }
        let mut end = until;
        let state = &self.cores[core];
        if self.start.is_none() {
            if state.waited.is_some() {
                // Ticks do not start before the others have waited.
                let others = self.cores.iter().filter(|other| other.waited.is_none() && !other.halted);
                let Some(first) = others.map(|other| other.emulator.now()).min() else { return Ok(false) };
                end = end.min(first + MIN_LATENCY);
                if end <= now {
                    return Ok(false);
                }
            }
        } else {
            let taking = self.description.taking(core);
            // When the last value has gone in: in the tick's cycle if that takes latched inputs, or in the one after.
            let entered = state.tick - ENDED_DELAY + delay;
            let take = state.tick - taking;
            if !state.taken && now >= take {
                if !self.take(core, take) {
                    return Ok(false);
                }
                return Ok(true);
            }
            end = end.min(if !state.taken { take } else { entered.max(now + 1) });
        }
        self.enter(core, now);
        let state = &mut self.cores[core];
        let stop = state.emulator.run_to_wait_until(end);
        let writes = state.emulator.take_port_writes();
        if let Some(report) = state.emulator.take_period() {
            let periods = &mut state.periods;
            periods.shortest =
                if periods.count == 0 { report.cycles } else { periods.shortest.min(report.cycles) };
            periods.longest = periods.longest.max(report.cycles);
            periods.count += 1;
            state.last = Some(report);
        }
        let waited = if let Ok(Stop::Wait { cycle, .. }) = stop { Some(cycle) } else { None };
        state.waited = state.waited.or(waited);
        state.halted = stop == Ok(Stop::Halted);
        // Its inputs for the tick are in: on to the next one.
        if self.start.is_some() && state.taken && state.emulator.now() >= state.tick - ENDED_DELAY + delay {
            state.taken = false;
            state.tick += self.description.cores[core].period(self.description.tick);
        }
        self.send(core, &writes, waited);
        stop.map(|_| true)
    }

    /// Takes the snapshots for a core's next tick, and lets the tick come; false if a sender is not far enough.
    fn take(&mut self, core: usize, cycle: Cycle) -> bool {
        let description = Arc::clone(&self.description);
        let here = |link: &&Link| link.is_snapshot() && link.to == End::Core(core);
        let far = |link: &Link| self.known(link.from) + ENDED_DELAY + link.transit() >= cycle;
        if !description.links.iter().filter(here).all(far) {
            return false;
        }
        let waits = match self.cores[core].emulator.status() {
            Status::Waiting { since, .. } => since + ENDED_DELAY <= cycle,
            _ => false,
        };
        let numbered = description.links.iter().enumerate().filter(|(_, link)| here(link));
        let mut any = false;
        for (number, _) in numbered {
            any = true;
            self.see(number, cycle);
            if waits {
                let LinkState::Snapshot { shown, taken, .. } = &mut self.links[number] else { continue };
                *taken += 1;
                for (field, value) in shown.clone().into_iter().enumerate() {
                    self.arrive(core, cycle, Source::Field { link: number, field }, value);
                }
            }
            self.event(cycle, number, if waits { LinkEventKind::Taken } else { LinkEventKind::Skipped });
        }
        let state = &mut self.cores[core];
        state.periods.skipped += u64::from(any && !waits);
        state.emulator.tick_at(state.tick);
        state.taken = true;
        true
    }

    /// Shows what was published of a snapshot and can be seen in a cycle.
    fn see(&mut self, number: usize, cycle: Cycle) {
        if let LinkState::Snapshot { published, shown, .. } = &mut self.links[number] {
            while let Some((_, values)) = published.pop_front_if(|(first, _)| *first <= cycle) {
                *shown = values;
            }
        }
    }

    /// What arrives at the host.
    fn show(&mut self) {
        for number in 0..self.links.len() {
            if matches!(self.links[number], LinkState::Fifo { .. }) {
                self.carry_out(number);
            }
            if self.description.links[number].to == End::Host {
                self.see(number, self.now);
            }
            if let LinkState::Wire { host, shown, .. } = &mut self.links[number] {
                while let Some((_, value)) = host.pop_front_if(|(cycle, _)| *cycle < self.now) {
                    *shown = value;
                }
            }
        }
    }

    /// Puts on the links what a core has written, and what its `wait` in cycle `waited` publishes.
    fn send(&mut self, core: usize, writes: &[PortWrite], waited: Option<Cycle>) {
        let description = Arc::clone(&self.description);
        let here = End::Core(core);
        for (number, link) in description.links.iter().enumerate() {
            if link.from == here {
                match &link.kind {
                    LinkKind::Wire => self.send_wire(number, link, writes, waited),
                    LinkKind::Snapshot { strobe } => {
                        self.send_snapshot(number, link, *strobe, writes, waited)
                    }
                    LinkKind::Fifo { push: Some(push), .. } => {
                        let LinkState::Fifo { working, fifo } = &mut self.links[number] else { continue };
                        follow(link, *push, writes, working, |cycle, entry| {
                            fifo.push(cycle + link.transit(), entry);
                        });
                    }
                    LinkKind::Fifo { .. } => {}
                }
            }
            if let (LinkKind::Fifo { pop: Some(pop), .. }, true) = (&link.kind, link.to == here)
                && let LinkState::Fifo { fifo, .. } = &mut self.links[number]
            {
                let pops = writes.iter().filter(|write| write.register == *pop);
                pops.for_each(|write| fifo.pop(write.cycle));
            }
        }
    }

    fn send_wire(&mut self, number: usize, link: &Link, writes: &[PortWrite], waited: Option<Cycle>) {
        let output = link.fields.first().and_then(|field| field.output);
        let written = writes.iter().filter(|write| Some(write.register) == output);
        if !latched(&self.description, link.from) {
            for write in written {
                self.deliver(number, write.cycle + link.transit(), 0, write.value);
            }
            return;
        }
        let LinkState::Wire { changed, .. } = &mut self.links[number] else { return };
        *changed = written.last().map(|write| write.value).or(*changed);
        if let Some(cycle) = waited
            && let Some(value) = changed.take()
        {
            self.deliver(number, cycle + ENDED_DELAY + link.transit(), 0, value);
        }
    }

    fn send_snapshot(
        &mut self,
        number: usize,
        link: &Link,
        strobe: Option<Register>,
        writes: &[PortWrite],
        waited: Option<Cycle>,
    ) {
        let mut sent = Vec::new();
        let LinkState::Snapshot { working, published, .. } = &mut self.links[number] else { return };
        let first = |cycle| cycle + ENDED_DELAY + link.transit() + 1;
        match (strobe, waited, link.from) {
            (Some(strobe), ..) => follow(link, strobe, writes, working, |cycle, values| {
                published.push_back((first(cycle), values));
                sent.push(first(cycle));
            }),
            (None, Some(cycle), End::Core(core)) => {
                let emulator = &self.cores[core].emulator;
                let value = |field: &crate::Field| field.output.and_then(|port| emulator.register(port));
                let values = link.fields.iter().map(|field| value(field).unwrap_or(0)).collect();
                published.push_back((first(cycle), values));
                sent.push(first(cycle));
            }
            _ => {}
        }
        for cycle in sent {
            self.event(cycle, number, LinkEventKind::Published);
        }
    }
}

/// Follows a core's writes to the fields of a link, and tells what they are whenever `action` is written. What is written in
/// the same cycle counts.
fn follow(
    link: &Link,
    action: Register,
    writes: &[PortWrite],
    working: &mut [u32],
    mut tell: impl FnMut(Cycle, Vec<u32>),
) {
    for writes in writes.chunk_by(|a, b| a.cycle == b.cycle) {
        for write in writes {
            for (field, value) in link.fields.iter().zip(&mut *working) {
                if field.output == Some(write.register) {
                    *value = write.value;
                }
            }
        }
        if let Some(write) = writes.iter().find(|write| write.register == action) {
            tell(write.cycle, working.to_vec());
        }
    }
}

fn latched(description: &Description, end: End) -> bool {
    description.core(end).is_some_and(|core| core.program.latched)
}

/// What a port shows before anything has arrived.
pub(crate) fn initial(description: &Description, source: Source) -> u32 {
    match source {
        Source::Field { link, field } => {
            let link = &description.links[link];
            let fifo = matches!(link.kind, LinkKind::Fifo { .. });
            if fifo { 0 } else { link.fields[field].initial }
        }
        Source::Status { status, .. } => status.initial(),
    }
}

/// The output ports of a core whose every write counts.
fn watched(description: &Description, core: usize) -> BTreeSet<Register> {
    let here = End::Core(core);
    let mut ports = BTreeSet::new();
    for link in &description.links {
        let fields = link.fields.iter().filter_map(|field| field.output);
        match &link.kind {
            LinkKind::Wire if link.from == here => ports.extend(fields),
            LinkKind::Snapshot { strobe: Some(strobe) } if link.from == here => {
                ports.extend(fields.chain([*strobe]));
            }
            LinkKind::Fifo { push, pop, .. } => {
                if link.from == here {
                    ports.extend(fields.chain(*push));
                }
                if link.to == here {
                    ports.extend(*pop);
                }
            }
            _ => {}
        }
    }
    ports
}

fn state(link: &Link) -> LinkState {
    let initial = || link.fields.iter().map(|field| field.initial).collect::<Vec<_>>();
    match link.kind {
        LinkKind::Wire => LinkState::Wire {
            changed: None,
            host: VecDeque::new(),
            shown: link.fields.first().map_or(0, |field| field.initial),
        },
        LinkKind::Snapshot { .. } => {
            LinkState::Snapshot { working: initial(), published: VecDeque::new(), shown: initial(), taken: 0 }
        }
        LinkKind::Fifo { depth, .. } => {
            LinkState::Fifo { working: initial(), fifo: Box::new(Fifo::new(depth)) }
        }
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Emulator of a system. Each core runs ahead on its own until it needs to know what another core did.
//!
//! Reads of linked inputs are the only places at which a core sees others, and no value arrives earlier than
//! [`MIN_LATENCY`](crate::MIN_LATENCY) cycles after it was sent. So a core runs to the next bundle that reads such an input with an unknown
//! value (or to a tick that takes a snapshot), and continues once every sender has come within the link's latency of that cycle. The core
//! that is farthest behind can always continue.

mod host;
mod links;
mod restore;
mod run;

use crate::fifo::{Fifo, FifoCounts};
use crate::gate::Gate;
pub use restore::{Transit, WaitingSystem};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;
use takt_emu::{Emulator, Event, Fault, LoadError, PeriodReport};
use takt_isa::system::{Description, End, Link, LinkKind, Mailbox, Source, Status};
use takt_isa::timing::Cycle;
use takt_isa::{BundleAddress, Program, Register};

/// Fault of a core, which stops the whole system.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("core {name}: {fault}")]
pub struct SystemFault {
    /// Index of the core.
    pub core: usize,
    /// Name of the core.
    pub name: String,
    /// Fault of the core's program.
    #[source]
    pub fault: Fault,
}

/// Error in a request of the host.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum HostError {
    /// The host has no port or link of this kind and name.
    #[error("the system has no {what} `{name}`")]
    Unknown {
        /// Kind of the missing port or link: `input`, `output`, `snapshot from the host`, ….
        what: &'static str,
        /// Name in the request.
        name: String,
    },
    /// The number of values differs from the number of the link's fields.
    #[error("`{name}` has {wanted} fields, not {given}")]
    Fields {
        /// Name of the link.
        name: String,
        /// Number of the link's fields.
        wanted: usize,
        /// Number of values in the request.
        given: usize,
    },
}

/// Event on a link, in the global time of the system.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct LinkEvent {
    /// Cycle of the event, from reset.
    pub cycle: Cycle,
    /// Index of the link in the description.
    pub link: usize,
    /// Kind of the event.
    pub kind: LinkEventKind,
}

/// Kind of an event on a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum LinkEventKind {
    /// A value of a wire arrives at the receiver.
    Value(u32),
    /// A snapshot's values arrive together.
    Published,
    /// The receiver takes a snapshot's values, for the tick to come.
    Taken,
    /// The receiver does not wait for its tick in time and keeps its old values.
    Skipped,
    /// An entry is put into a FIFO.
    Pushed,
    /// An entry is taken out of a FIFO.
    Popped,
    /// An entry is refused because the FIFO is full.
    Overflow,
    /// A pop is refused because the FIFO is empty.
    Underflow,
}

/// Value on a core's input pins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct InputEvent {
    /// Cycle in which the value is on the pins.
    pub cycle: Cycle,
    /// Index of the core.
    pub core: usize,
    /// Register of the input port.
    pub register: Register,
    /// New value, as bits.
    pub value: u32,
}

impl LinkEventKind {
    /// Text for a log, with a wire's value.
    pub fn text(self) -> String {
        match self {
            LinkEventKind::Value(value) => format!("the value 0x{value:08x} arrives"),
            other => other.name().to_owned(),
        }
    }

    /// Short name of the kind, without the value.
    pub fn name(self) -> &'static str {
        match self {
            LinkEventKind::Value(_) => "value",
            LinkEventKind::Published => "published",
            LinkEventKind::Taken => "taken",
            LinkEventKind::Skipped => "skipped",
            LinkEventKind::Pushed => "pushed",
            LinkEventKind::Popped => "popped",
            LinkEventKind::Overflow => "overflow",
            LinkEventKind::Underflow => "underflow",
        }
    }
}

/// Recorded action of the host.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum HostAction {
    /// Call of [`System::set_input`] for a port.
    Input {
        /// Name of the input.
        name: String,
        /// Value as 32 bits.
        bits: u32,
    },
    /// [`System::publish`] of a link.
    Publish(usize),
    /// [`System::push`] of a link.
    Push(usize),
    /// [`System::pop`] of a link that had an entry.
    Pop(usize),
}

/// Statistics of a core's periods.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CorePeriods {
    /// Number of periods that ended.
    pub count: u64,
    /// Cycles of the shortest period; 0 without periods.
    pub shortest: Cycle,
    /// Cycles of the longest period.
    pub longest: Cycle,
    /// Ticks for which the core took no snapshots, because it did not wait in time.
    pub skipped: u64,
}

#[derive(Clone)]
struct CoreState {
    emulator: Emulator,
    mailboxes: Arc<[Mailbox]>,
    gate: Gate,
    /// Sources of the values that can arrive at any time: one for each group that is known up to the same cycle.
    moving: Arc<[Source]>,
    /// Cycles up to which all arrivals are known ([`System::know`] extends this).
    known: Cycle,
    /// The core has halted: no tick is to come.
    halted: bool,
    /// Cycle of the first `wait`, or of the halt before that.
    waited: Option<Cycle>,
    /// Cycle of the next tick; valid only once ticks have started.
    tick: Cycle,
    /// Snapshots for the next tick have been taken or skipped.
    taken: bool,
    periods: CorePeriods,
    last: Option<PeriodReport>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
enum LinkState {
    Wire {
        /// Value that the sender's next `publish` or `wait` sends, if its ports are latched.
        changed: Option<u32>,
        /// Values on the way to the host, with the cycle in which they arrive.
        host: VecDeque<(Cycle, u32)>,
        /// Value that the host sees.
        shown: u32,
    },
    Snapshot {
        /// Latest writes of the fields.
        working: Vec<u32>,
        /// Published values, with the first cycle in which they can be taken.
        published: VecDeque<(Cycle, Vec<u32>)>,
        /// Newest published values that a receiver can see.
        shown: Vec<u32>,
        taken: u64,
    },
    Fifo {
        working: Vec<u32>,
        fifo: Box<Fifo>,
    },
}

/// Emulator of a running system.
#[derive(Clone)]
pub struct System {
    description: Arc<Description>,
    cores: Vec<CoreState>,
    links: Vec<LinkState>,
    now: Cycle,
    /// Cycle at which the present run ends.
    until: Cycle,
    /// Cycle of the first base tick.
    start: Option<Cycle>,
    /// The present run ends once the cycle of the first base tick is known.
    starting: bool,
    fault: Option<SystemFault>,
    events: Option<Vec<LinkEvent>>,
    /// Events of the cores, each with its core's index.
    recorded: Option<Vec<(usize, Event)>>,
    /// Values on the cores' input pins.
    inputs: Option<Vec<InputEvent>>,
    /// Actions of the host, each with its cycle.
    actions: Option<Vec<(Cycle, HostAction)>>,
}

/// Bundles of the program that read one of these input ports.
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
    /// System after reset, at the beginning of cycle 0.
    ///
    /// # Errors
    /// If a core's memories cannot hold its program.
    pub fn new(description: &Description) -> Result<System, LoadError> {
        let description = Arc::new(description.clone());
        let mut cores = Vec::new();
        for (number, core) in description.cores.iter().enumerate() {
            let mut emulator = Emulator::new(&core.program)?;
            let mailboxes: Arc<[Mailbox]> = description.mailboxes(number).into();
            for port in &core.program.inputs {
                let mailbox = mailboxes.iter().find(|mailbox| mailbox.register == port.register);
                let initial = mailbox.map_or(0, |mailbox| description.initial(mailbox.source));
                // The port belongs to the program, so setting it cannot fail.
                let _ = emulator.set_input_bits(port.register, initial);
            }
            emulator.set_watched(watched(&description, number));
            let moving: Vec<&Mailbox> = mailboxes
                .iter()
                .filter(|mailbox| !description.links[mailbox.source.link()].is_snapshot())
                .collect();
            if !core.program.latched {
                let ports = moving.iter().map(|mailbox| mailbox.register).collect();
                emulator.set_pauses(readers(&core.program, &ports));
                emulator.set_acting(acting(&description, number));
            }
            let mut sources: Vec<Source> = Vec::new();
            for mailbox in moving {
                if !sources.iter().any(|known| come_together(&description, *known, mailbox.source)) {
                    sources.push(mailbox.source);
                }
            }
            cores.push(CoreState {
                emulator,
                mailboxes: Arc::clone(&mailboxes),
                gate: Gate::default(),
                moving: sources.into(),
                known: 0,
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
            recorded: None,
            inputs: None,
            actions: None,
        })
    }

    // ---- Observation.

    /// Cores and links of the system.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// Cycles that have passed since reset.
    pub fn now(&self) -> Cycle {
        self.now
    }

    /// Cycle of the first base tick; `None` until every core has waited for the first time.
    pub fn start(&self) -> Option<Cycle> {
        self.start
    }

    /// Emulator of a core. Between runs it stands at [`System::now`], if it has not halted and there is no fault.
    pub fn core(&self, core: usize) -> &Emulator {
        &self.cores[core].emulator
    }

    /// Mutable emulator of a core, for a debugger.
    pub fn core_mut(&mut self, core: usize) -> &mut Emulator {
        &mut self.cores[core].emulator
    }

    /// Statistics of a core's periods.
    pub fn periods(&self, core: usize) -> CorePeriods {
        self.cores[core].periods
    }

    /// Report of a core's last completed period.
    pub fn last_period(&self, core: usize) -> Option<&PeriodReport> {
        self.cores[core].last.as_ref()
    }

    /// All cores have halted.
    pub fn halted(&self) -> bool {
        self.cores.iter().all(|core| core.halted)
    }

    /// Fault that stopped the system.
    pub fn fault(&self) -> Option<&SystemFault> {
        self.fault.as_ref()
    }

    /// Event counts of a FIFO; `None` for other links.
    pub fn fifo_counts(&self, link: usize) -> Option<FifoCounts> {
        match self.links.get(link)? {
            LinkState::Fifo { fifo, .. } => Some(fifo.store.counts),
            _ => None,
        }
    }

    /// Present status of a FIFO; `None` for other links.
    pub fn fifo_status(&self, link: usize, status: Status) -> Option<u32> {
        match self.links.get(link)? {
            LinkState::Fifo { fifo, .. } => Some(fifo.store.status(status)),
            _ => None,
        }
    }

    /// Present entries of a FIFO, the head first; empty for other links.
    pub fn fifo_entries(&self, link: usize) -> Vec<Vec<u32>> {
        match self.links.get(link) {
            Some(LinkState::Fifo { fifo, .. }) => fifo.store.entries.iter().cloned().collect(),
            _ => Vec::new(),
        }
    }

    /// Records the cores' events from now on, until they are taken. Cores then run slower, since no block of bundles runs as a whole.
    pub fn keep_core_events(&mut self) {
        self.recorded.get_or_insert_default();
        self.inputs.get_or_insert_default();
    }

    /// Stops recording the cores' events.
    pub fn drop_core_events(&mut self) {
        (self.recorded, self.inputs) = (None, None);
    }

    /// Values on the cores' input pins since the last call, by cycle; the values of the last [`INPUT_DELAY`](takt_isa::timing::INPUT_DELAY)
    /// cycles come with the next run.
    pub fn take_input_events(&mut self) -> Vec<InputEvent> {
        let mut inputs = self.inputs.as_mut().map(std::mem::take).unwrap_or_default();
        inputs.sort();
        inputs
    }

    /// Events of the cores since the last call, each core's in the order of its run. After a fault, they include later events of cores that
    /// had run ahead.
    pub fn take_core_events(&mut self) -> Vec<(usize, Event)> {
        self.recorded.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// Records the host's actions from now on.
    pub fn keep_host_actions(&mut self) {
        self.actions.get_or_insert_default();
    }

    /// Recorded actions of the host, each with the cycle before which it was done.
    pub fn host_actions(&self) -> &[(Cycle, HostAction)] {
        self.actions.as_deref().unwrap_or_default()
    }

    /// Records the events on links from now on, until they are taken.
    pub fn keep_events(&mut self) {
        self.events.get_or_insert_default();
    }

    /// Events on links since the last call, by cycle. (Events of the last few cycles may be missing: they come with the next run.)
    pub fn take_events(&mut self) -> Vec<LinkEvent> {
        let mut events = self.events.as_mut().map(std::mem::take).unwrap_or_default();
        events.sort();
        events
    }
}

pub(super) fn latched(description: &Description, end: End) -> bool {
    description.core(end).is_some_and(|core| core.program.latched)
}

/// Arrivals from both sources are known up to the same cycle.
fn come_together(description: &Description, one: Source, other: Source) -> bool {
    match (one, other) {
        (Source::Status { link, side, .. }, Source::Status { link: l, side: s, .. }) => {
            (link, side) == (l, s)
        }
        (Source::Field { link, .. }, Source::Field { link: l, .. }) => {
            let (a, b) = (&description.links[link], &description.links[l]);
            let wires = matches!((&a.kind, &b.kind), (LinkKind::Wire, LinkKind::Wire));
            link == l || (wires && (a.from, a.transit()) == (b.from, b.transit()))
        }
        _ => false,
    }
}

/// Output ports whose writes push to or pop from a FIFO: by them, the core itself changes the FIFO that it sees.
fn acting(description: &Description, core: usize) -> impl Iterator<Item = Register> {
    let here = End::Core(core);
    description
        .links
        .iter()
        .flat_map(move |link| match link.kind {
            LinkKind::Fifo { push, pop, .. } => {
                [push.filter(|_| link.from == here), pop.filter(|_| link.to == here)]
            }
            _ => [None, None],
        })
        .flatten()
}

/// Output ports of a core whose every write counts, even of an unchanged value.
fn watched(description: &Description, core: usize) -> BTreeSet<Register> {
    let here = End::Core(core);
    let mut ports = BTreeSet::new();
    for link in &description.links {
        let fields = link.fields.iter().filter_map(|field| field.output);
        match &link.kind {
            LinkKind::Wire if link.from == here => ports.extend(fields),
            LinkKind::Snapshot { strobe } if link.from == here => ports.extend(fields.chain(*strobe)),
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

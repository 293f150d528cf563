// SPDX-License-Identifier: MIT OR Apache-2.0
//! The emulator of a system. Each core runs ahead on its own until it needs to know what another one did.
//!
//! A core's reads of linked inputs are where it can see others, and nothing arrives earlier than [`MIN_LATENCY`](crate::MIN_LATENCY) cycles
//! after it was sent. So a core runs to the next bundle that reads such an input whose value is not known yet (or tick that takes
//! one), and goes on once every sender has come within the link's latency of that cycle. The core that is behind all others can
//! always go on.

mod host;
mod links;
mod run;

use crate::fifo::{Fifo, FifoCounts};
use crate::gate::Gate;
use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;
use takt_emu::{Emulator, Event, Fault, LoadError, PeriodReport};
use takt_isa::system::{Description, End, Link, LinkKind, Mailbox, Source, Status};
use takt_isa::timing::Cycle;
use takt_isa::{BundleAddress, Program, Register};

/// A core that stopped with a fault: the system stands.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("core {name}: {fault}")]
pub struct SystemFault {
    /// The core.
    pub core: usize,
    /// Its name.
    pub name: String,
    /// The core's own fault.
    #[source]
    pub fault: Fault,
}

/// An error of the host's.
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
    /// The kind of the event.
    pub kind: LinkEventKind,
}

/// The kind of an event on a link.
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

/// A value on a core's input pins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct InputEvent {
    /// The cycle.
    pub cycle: Cycle,
    /// The core.
    pub core: usize,
    /// The input port.
    pub register: Register,
    /// Its new value.
    pub value: u32,
}

impl LinkEventKind {
    /// In words.
    pub fn text(self) -> String {
        match self {
            LinkEventKind::Value(value) => format!("the value 0x{value:08x} arrives"),
            other => other.name().to_owned(),
        }
    }

    /// In a word or two, without the value.
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

/// An action of the host.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum HostAction {
    /// [`System::set_input`].
    Input {
        /// The input's name.
        name: String,
        /// Its value.
        bits: u32,
    },
    /// [`System::publish`] of a link.
    Publish(usize),
    /// [`System::push`] of a link.
    Push(usize),
    /// [`System::pop`] of a link that had an entry.
    Pop(usize),
}

/// Figures over a core's periods.
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
    mailboxes: Arc<[Mailbox]>,
    gate: Gate,
    /// Of links that drive its input ports at any time, a source of each kind of arrival.
    moving: Arc<[Source]>,
    /// Cycles of which all is known that arrives ([`System::know`] finds more).
    known: Cycle,
    /// True if it has no tick to come, for good.
    halted: bool,
    /// The cycle of its first `wait`, or of its halt before that.
    waited: Option<Cycle>,
    /// Its next tick; there only once ticks have started.
    tick: Cycle,
    /// True if its snapshots for that tick are dealt with.
    taken: bool,
    periods: CorePeriods,
    last: Option<PeriodReport>,
}

#[derive(Clone)]
enum LinkState {
    Wire {
        /// The value that the sender's `wait` publishes, if its ports are latched.
        changed: Option<u32>,
        /// Values on the way to the host, with the cycle in which they arrive.
        host: VecDeque<(Cycle, u32)>,
        /// The value that the host sees.
        shown: u32,
    },
    Snapshot {
        /// As written, of a link with a strobe, or of the host's.
        working: Vec<u32>,
        /// Published, with the first cycle in which it can be taken.
        published: VecDeque<(Cycle, Vec<u32>)>,
        /// The values published last, of those that could be seen.
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
    /// The cycle at which the present run ends.
    until: Cycle,
    /// The first base tick.
    start: Option<Cycle>,
    /// True if the present run ends where that is known.
    starting: bool,
    fault: Option<SystemFault>,
    events: Option<Vec<LinkEvent>>,
    /// Events of the cores, each with its core.
    recorded: Option<Vec<(usize, Event)>>,
    /// Values on the cores' input pins.
    inputs: Option<Vec<InputEvent>>,
    /// The host's actions, each with its cycle.
    actions: Option<Vec<(Cycle, HostAction)>>,
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
            let mailboxes: Arc<[Mailbox]> = description.mailboxes(number).into();
            for port in &core.program.inputs {
                let mailbox = mailboxes.iter().find(|mailbox| mailbox.register == port.register);
                let initial = mailbox.map_or(0, |mailbox| description.initial(mailbox.source));
                // The port is the program's own.
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

    /// Figures over a core's periods.
    pub fn periods(&self, core: usize) -> CorePeriods {
        self.cores[core].periods
    }

    /// A core's last period that ended.
    pub fn last_period(&self, core: usize) -> Option<&PeriodReport> {
        self.cores[core].last.as_ref()
    }

    /// True if every core has halted.
    pub fn halted(&self) -> bool {
        self.cores.iter().all(|core| core.halted)
    }

    /// The fault that it stands with.
    pub fn fault(&self) -> Option<&SystemFault> {
        self.fault.as_ref()
    }

    /// Counts of the events of a FIFO; `None` for other links.
    pub fn fifo_counts(&self, link: usize) -> Option<FifoCounts> {
        match self.links.get(link)? {
            LinkState::Fifo { fifo, .. } => Some(fifo.store.counts),
            _ => None,
        }
    }

    /// A status of a FIFO now; `None` for other links.
    pub fn fifo_status(&self, link: usize, status: Status) -> Option<u32> {
        match self.links.get(link)? {
            LinkState::Fifo { fifo, .. } => Some(fifo.store.status(status)),
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

    /// Keeps what the cores do from now on, until it is taken. Cores then run slower: no block of bundles runs as a whole.
    pub fn keep_core_events(&mut self) {
        self.recorded.get_or_insert_default();
        self.inputs.get_or_insert_default();
    }

    /// Keeps them no longer.
    pub fn drop_core_events(&mut self) {
        (self.recorded, self.inputs) = (None, None);
    }

    /// The values on the cores' input pins since this was last asked, by cycle; those of the last
    /// [`INPUT_DELAY`](takt_isa::timing::INPUT_DELAY) cycles comes with the next run.
    pub fn take_input_events(&mut self) -> Vec<InputEvent> {
        let mut inputs = self.inputs.as_mut().map(std::mem::take).unwrap_or_default();
        inputs.sort();
        inputs
    }

    /// The cores' events since this was last asked: of each core in the order of its run. After a fault, cores that had run
    /// ahead of it are in it with what came later.
    pub fn take_core_events(&mut self) -> Vec<(usize, Event)> {
        self.recorded.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// Keeps what the host does from now on.
    pub fn keep_host_actions(&mut self) {
        self.actions.get_or_insert_default();
    }

    /// The host's actions since, each with the cycle before which it was done.
    pub fn host_actions(&self) -> &[(Cycle, HostAction)] {
        self.actions.as_deref().unwrap_or_default()
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
}

pub(super) fn latched(description: &Description, end: End) -> bool {
    description.core(end).is_some_and(|core| core.program.latched)
}

/// True if arrivals from two sources are known up to the same cycle.
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

/// The output ports of a core that change what it sees of a FIFO itself.
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

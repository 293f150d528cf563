// SPDX-License-Identifier: MIT OR Apache-2.0
//! Description of a multi-core system, as plain data: the cores, and the links between their ports. `takt-system` parses and checks
//! such files.

use crate::timing::{Cycle, ENDED_DELAY, INPUT_DELAY, LATCHED_INPUT_DELAY};
use crate::{Program, Register, Type};
use std::sync::Arc;

/// Limit on the cores of a system.
pub const MAX_CORES: usize = 16;
/// Limit on the entries of a FIFO.
pub const MAX_DEPTH: u32 = 4096;
/// The least latency of a link: [`INPUT_DELAY`] cycles from a core's pins to its bundles, plus one in the gate before the pins.
pub const MIN_LATENCY: Cycle = INPUT_DELAY + 1;
/// The greatest latency of a link.
pub const MAX_LATENCY: Cycle = 1024;
/// Limit on the cycles between base ticks, and between a core's ticks.
pub const MAX_TICK: u64 = 100_000_000;
/// Limit on the bytes of a system's file.
pub const TEXT_BYTES: usize = 1 << 20;

/// A system: cores and links.
#[derive(Clone, Debug)]
pub struct Description {
    /// Cycles between base ticks.
    pub tick: u64,
    /// The cores, in the order of the file.
    pub cores: Vec<Core>,
    /// The links: wires, then snapshots, then FIFOs, each in the order of the file.
    pub links: Vec<Link>,
}

/// A core of a system.
#[derive(Clone, Debug)]
pub struct Core {
    /// Name of the core, unique in the system.
    pub name: String,
    /// Path of the program as written in the file.
    pub path: String,
    /// Program that the core runs.
    pub program: Arc<Program>,
    /// Divider of the core's ticks: one at every n-th base tick.
    pub every: u64,
    /// Phase of the core's ticks, in cycles after the base tick.
    pub offset: u64,
}

/// An end of a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// Outside of the system.
    Host,
    /// A core, by its place in [`Description::cores`].
    Core(usize),
}

/// A value that a link carries.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Field {
    /// Name of the sender's port; if the sender is the host, the name of the system's input port.
    pub from: String,
    /// Output port of the sender; `None` for the host.
    pub output: Option<Register>,
    /// Name of the receiver's port; if the receiver is the host, the name of the system's output port.
    pub to: String,
    /// Input port of the receiver; `None` for the host.
    pub input: Option<Register>,
    /// Type by which tools read and show the bits.
    pub ty: Type,
    /// The receiver's value before any arrival: the sender's loader's value for the port, or 0.
    pub initial: u32,
}

/// A link of a system.
#[derive(Clone, Debug)]
pub struct Link {
    /// Name of the link; for a wire `from -> to`.
    pub name: String,
    /// End that sends the values.
    pub from: End,
    /// End that receives the values.
    pub to: End,
    /// Cycles from the sender's write to the receiver (docs/system.md).
    pub latency: Cycle,
    /// Values that the link carries; exactly one for a wire.
    pub fields: Vec<Field>,
    /// Kind, with the parameters of the kind.
    pub kind: LinkKind,
}

/// The kinds of links.
#[derive(Clone, Debug)]
pub enum LinkKind {
    /// Carries each value upon its write.
    Wire,
    /// Publishes all values together.
    Snapshot {
        /// The output port whose writes publish the values; without one, the sender's `wait` does.
        strobe: Option<Register>,
    },
    /// A queue of entries.
    Fifo {
        /// Number of entries that the queue holds.
        depth: u32,
        /// The sender's output port whose writes push an entry; `None` if the sender is the host.
        push: Option<Register>,
        /// The receiver's output port whose writes pop an entry; `None` if the receiver is the host.
        pop: Option<Register>,
        /// The status values that the sender sees, each with its input port.
        sender: Vec<(Status, Register)>,
        /// The status values that the receiver sees, each with its input port.
        receiver: Vec<(Status, Register)>,
    },
}

/// The status values of a FIFO.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Status {
    /// 1 if the FIFO is empty, else 0.
    Empty,
    /// 1 if the FIFO is full, else 0.
    Full,
    /// Number of entries in the FIFO.
    Count,
    /// 1 once a push was refused because the FIFO was full, else 0; sticky.
    Overflow,
    /// 1 once a pop came while the FIFO was empty, else 0; sticky.
    Underflow,
}

impl Status {
    /// Every status value, in display order.
    pub const ALL: [Status; 5] =
        [Status::Empty, Status::Full, Status::Count, Status::Overflow, Status::Underflow];

    /// The key in the file.
    pub fn name(self) -> &'static str {
        match self {
            Status::Empty => "empty",
            Status::Full => "full",
            Status::Count => "count",
            Status::Overflow => "overflow",
            Status::Underflow => "underflow",
        }
    }

    /// Value before the first push: 1 for `empty`, else 0.
    pub fn initial(self) -> u32 {
        u32::from(self == Status::Empty)
    }
}

/// An end of a FIFO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The end at which entries are put in.
    Sender,
    /// The end at which entries are taken out.
    Receiver,
}

/// The source of the values of an input port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// A field of a link.
    Field {
        /// Index of the link.
        link: usize,
        /// Index of the field in the link.
        field: usize,
    },
    /// The status of a FIFO.
    Status {
        /// Index of the FIFO's link.
        link: usize,
        /// End whose view of the status it is.
        side: Side,
        /// Status value shown at the port.
        status: Status,
    },
}

impl Source {
    /// Index of the link.
    pub fn link(self) -> usize {
        match self {
            Source::Field { link, .. } | Source::Status { link, .. } => link,
        }
    }
}

/// An input port of a core that a link drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mailbox {
    /// Address of the port.
    pub register: Register,
    /// Source of the port's values.
    pub source: Source,
}

/// A host's end of a link.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SystemPort {
    /// Name: `x` for a wire, `link.x` for others.
    pub name: String,
    /// Type by which tools read and show the bits.
    pub ty: Type,
    /// Index of the link.
    pub link: usize,
    /// Index of the field in the link.
    pub field: usize,
}

impl Core {
    /// Cycles between the core's ticks.
    pub fn period(&self, tick: u64) -> u64 {
        self.every * tick
    }

    /// Cycles from a value's arrival at the core's pins to the first cycle in which it can be read or, if latched, taken by a
    /// tick.
    pub fn input_delay(&self) -> Cycle {
        if self.program.latched { LATCHED_INPUT_DELAY } else { INPUT_DELAY }
    }
}

impl Link {
    /// Number of registers in the link, not counting those of gate and core.
    pub fn transit(&self) -> Cycle {
        self.latency - MIN_LATENCY
    }

    /// The link publishes its values together.
    pub fn is_snapshot(&self) -> bool {
        matches!(self.kind, LinkKind::Snapshot { .. })
    }
}

impl Description {
    /// The core at an end; `None` for the host.
    pub fn core(&self, end: End) -> Option<&Core> {
        match end {
            End::Host => None,
            End::Core(core) => self.cores.get(core),
        }
    }

    /// Index of the core with a name.
    pub fn core_named(&self, name: &str) -> Option<usize> {
        self.cores.iter().position(|core| core.name == name)
    }

    /// The mailboxes of a core, in the order of their priority: fields of snapshots first.
    pub fn mailboxes(&self, core: usize) -> Vec<Mailbox> {
        let here = End::Core(core);
        let mut mailboxes = Vec::new();
        for snapshots in [true, false] {
            for (number, link) in self.links.iter().enumerate().filter(|(_, l)| l.is_snapshot() == snapshots)
            {
                if link.to == here {
                    let fields = link.fields.iter().enumerate();
                    mailboxes.extend(fields.filter_map(|(field, names)| {
                        let source = Source::Field { link: number, field };
                        Some(Mailbox { register: names.input?, source })
                    }));
                }
                if let LinkKind::Fifo { sender, receiver, .. } = &link.kind {
                    for (end, side, ports) in
                        [(link.to, Side::Receiver, receiver), (link.from, Side::Sender, sender)]
                    {
                        if end == here {
                            mailboxes.extend(ports.iter().map(|&(status, register)| {
                                let source = Source::Status { link: number, side, status };
                                Mailbox { register, source }
                            }));
                        }
                    }
                }
            }
        }
        mailboxes
    }

    /// The number of a core's mailboxes that are fields of snapshots.
    pub fn snapshot_mailboxes(&self, core: usize) -> u64 {
        let snapshots = self.links.iter().filter(|link| link.is_snapshot() && link.to == End::Core(core));
        snapshots.map(|link| link.fields.len() as u64).sum()
    }

    /// Cycles before its tick at which a core latches its snapshots: mailboxes are served one per cycle, and the last value must have
    /// arrived when the first bundle issues.
    pub fn taking(&self, core: usize) -> Cycle {
        self.snapshot_mailboxes(core) + ENDED_DELAY
    }

    /// Cycles before a base tick at which the host must write values for the periods that begin there.
    pub fn lead(&self) -> Cycle {
        let mailboxes = |core| {
            let mailboxes = self.mailboxes(core);
            let host = mailboxes
                .iter()
                .filter(|mailbox| self.links[mailbox.source.link()].from == End::Host)
                .count();
            self.snapshot_mailboxes(core) + host as u64
        };
        let transit = self.links.iter().filter(|link| link.from == End::Host).map(Link::transit);
        (0..self.cores.len()).map(mailboxes).max().unwrap_or(0) + transit.max().unwrap_or(0) + MIN_LATENCY + 2
    }

    /// The system's input ports: the host's ends of links that it drives.
    pub fn inputs(&self) -> Vec<SystemPort> {
        self.host_ports(|link| link.from, |field| &field.from)
    }

    /// The system's output ports.
    pub fn outputs(&self) -> Vec<SystemPort> {
        self.host_ports(|link| link.to, |field| &field.to)
    }

    /// Input ports of cores that an input of the system drives, each with its core.
    pub fn receivers(&self, input: &SystemPort) -> Vec<(usize, Register)> {
        let mut found = Vec::new();
        for (number, link) in self.links.iter().enumerate().filter(|(_, link)| link.from == End::Host) {
            // Several wires may carry the same value of the host.
            let is_driven = |(index, field): &(usize, &Field)| match link.kind {
                LinkKind::Wire => field.from == input.name,
                _ => (number, *index) == (input.link, input.field),
            };
            let driven = link.fields.iter().enumerate().filter(is_driven);
            found.extend(driven.filter_map(|(_, field)| match link.to {
                End::Core(core) => Some((core, field.input?)),
                End::Host => None,
            }));
        }
        found
    }

    fn host_ports(&self, end: impl Fn(&Link) -> End, name: impl Fn(&Field) -> &String) -> Vec<SystemPort> {
        let mut ports: Vec<SystemPort> = Vec::new();
        for (number, link) in self.links.iter().enumerate().filter(|(_, link)| end(link) == End::Host) {
            for (field, names) in link.fields.iter().enumerate() {
                let name = match link.kind {
                    LinkKind::Wire => name(names).clone(),
                    _ => format!("{}.{}", link.name, name(names)),
                };
                // Several wires may carry the same value of the host.
                if !ports.iter().any(|port| port.name == name) {
                    ports.push(SystemPort { name, ty: names.ty, link: number, field });
                }
            }
        }
        ports
    }

    /// The value of a mailbox's port before anything has arrived.
    pub fn initial(&self, source: Source) -> u32 {
        match source {
            Source::Field { link, field } => {
                let link = &self.links[link];
                let fifo = matches!(link.kind, LinkKind::Fifo { .. });
                if fifo { 0 } else { link.fields[field].initial }
            }
            Source::Status { status, .. } => status.initial(),
        }
    }

    /// Index of the link with a name.
    pub fn link_named(&self, name: &str) -> Option<usize> {
        self.links.iter().position(|link| link.name == name)
    }
}

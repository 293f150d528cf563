// SPDX-License-Identifier: MIT OR Apache-2.0
//! Naming of the generated part of a system, and the top's pins.

use crate::plan::Plan;
use crate::plan::names::net;
use crate::verilog::{Direction, Expr, Net, no};
use takt_isa::Register;
use takt_isa::system::{Description, End, LinkKind, Mailbox, Status};
use takt_isa::timing::Cycle;

/// The base tick is due.
pub(super) const DUE: Net = Net::bit("due");

/// Status ports that every core's module passes on from its core unchanged.
pub(super) const STATUS: [Net; 8] = [
    net::ENDED,
    net::WAITING,
    net::HALTED,
    net::DEADLINE_MISSED,
    net::FAULT,
    net::FAULT_KIND,
    net::FAULT_SLOT,
    net::FAULT_ADDRESS,
];

/// The driver of a system's cores, which loads them and gives them their ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Driver {
    /// The top itself: its loader, and base ticks that start by themselves.
    Itself,
    /// The surroundings, as on a board: the top has ports for that, and shows the cores' ports.
    Board,
}

/// The plan of a system's circuit.
#[derive(Clone, Debug)]
pub struct SystemPlan {
    /// The driver.
    pub driver: Driver,
    /// Cores and links.
    pub description: Description,
    /// The plan of each core.
    pub cores: Vec<Plan>,
    /// The top's module.
    pub top: String,
    /// The mailboxes of each core's gate.
    pub mailboxes: Vec<Vec<Mailbox>>,
}

/// A pin of the top that is a host's end of a link.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pin {
    /// Its name and width.
    pub net: Net,
    /// Input or output.
    pub direction: Direction,
    /// Its kind; for a value carried by several wires, that on the first.
    pub kind: PinKind,
    /// The link.
    pub link: usize,
}

/// The kinds of a host's pins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PinKind {
    /// A field of the link.
    Field(usize),
    /// Input, high for one cycle to write the wire, publish the snapshot or push the entry.
    Send,
    /// Input, high for one cycle to pop the FIFO's head.
    Pop,
    /// A status of the FIFO.
    Status(Status),
}

/// The output ports of a core that a link uses, with the names of their nets.
pub(super) struct OutputPort {
    pub(super) register: Register,
    pub(super) name: String,
    /// True if its value is sent; false if only the event of a write is used.
    pub(super) sent: bool,
}

impl SystemPlan {
    pub(super) fn new(description: Description, cores: Vec<Plan>, name: &str, driver: Driver) -> SystemPlan {
        let plain: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
        let mailboxes = (0..cores.len()).map(|core| description.mailboxes(core)).collect();
        SystemPlan { driver, description, cores, top: format!("takt_system_{plain}"), mailboxes }
    }

    /// The module of a core with its gate.
    pub fn core_module(&self, core: usize) -> String {
        format!("{}_{}", self.top, self.description.cores[core].name)
    }

    /// Its instance in the top.
    pub fn core_instance(&self, core: usize) -> String {
        format!("core_{}", self.description.cores[core].name)
    }

    /// The instance of a link in the top.
    pub fn link_instance(&self, link: usize) -> String {
        let known = &self.description.links[link];
        match known.kind {
            LinkKind::Wire => format!("wire{link}_{}", known.fields[0].to),
            LinkKind::Snapshot { .. } => format!("snapshot_{}", known.name),
            LinkKind::Fifo { .. } => format!("fifo_{}", known.name),
        }
    }

    /// The net that a port of a link's instance is connected to.
    pub(super) fn of_link(&self, link: usize, port: &str) -> Net {
        Net::named(format!("{}_{port}", self.link_instance(link)))
    }

    /// A net of a core in the top.
    pub fn of_core(&self, core: usize, what: &str) -> Net {
        Net::named(format!("{}_{what}", self.description.cores[core].name))
    }

    /// Bits of the number of a FIFO's entries.
    pub fn count_bits(depth: u32) -> u32 {
        (u32::BITS - depth.leading_zeros()).max(2)
    }

    /// The output ports of a core that links use, each once.
    pub(super) fn outputs(&self, core: usize) -> Vec<OutputPort> {
        let here = End::Core(core);
        let mut used: Vec<(Register, bool)> = Vec::new();
        for link in &self.description.links {
            let mut add =
                |register: Register, sent: bool| match used.iter_mut().find(|(own, _)| *own == register) {
                    Some((_, known)) => *known |= sent,
                    None => used.push((register, sent)),
                };
            if link.from == here {
                link.fields.iter().filter_map(|field| field.output).for_each(|register| add(register, true));
                match link.kind {
                    LinkKind::Snapshot { strobe: Some(strobe) } => add(strobe, false),
                    LinkKind::Fifo { push: Some(push), .. } => add(push, false),
                    _ => {}
                }
            }
            if let (LinkKind::Fifo { pop: Some(pop), .. }, true) = (&link.kind, link.to == here) {
                add(*pop, false);
            }
        }
        let program = &self.description.cores[core].program;
        let name = |register: Register| {
            let port = program.outputs.iter().find(|port| port.register == register);
            port.map_or_else(|| program.register_text(register), |port| port.name.clone())
        };
        used.into_iter().map(|(register, sent)| OutputPort { register, name: name(register), sent }).collect()
    }

    /// True if a link sends at the `wait`s of a core.
    pub(super) fn is_waited_for(&self, core: usize) -> bool {
        let latched = self.description.cores[core].program.latched;
        let own = self.description.links.iter().filter(|link| link.from == End::Core(core));
        own.into_iter().any(|link| match link.kind {
            LinkKind::Wire => latched,
            LinkKind::Snapshot { strobe } => strobe.is_none(),
            LinkKind::Fifo { .. } => false,
        })
    }

    fn port_net(&self, end: End, register: Option<Register>, what: &str) -> Option<Net> {
        let (End::Core(core), Some(register)) = (end, register) else { return None };
        let port = self.outputs(core).into_iter().find(|port| port.register == register)?;
        Some(self.of_core(core, &format!("{}_{what}", port.name)))
    }

    /// 1 if an output port of a core is written in this cycle; constant 0 if there is no such port.
    pub(super) fn write(&self, end: End, register: Option<Register>) -> Expr {
        self.port_net(end, register, "write").map_or_else(no, Into::into)
    }

    /// The value that is written to an output port of a core.
    pub(super) fn value(&self, end: End, register: Option<Register>) -> Option<Expr> {
        Some(self.port_net(end, register, "value")?.wide(32).into())
    }

    /// Cycles from `due` to a base tick.
    pub(super) fn lead(&self) -> Cycle {
        self.description.lead()
    }

    /// The host's ends of links, in the order of the links.
    pub fn pins(&self) -> Vec<Pin> {
        let mut pins: Vec<Pin> = Vec::new();
        for (link, known) in self.description.links.iter().enumerate() {
            let stem = |name: &str| match known.kind {
                LinkKind::Wire => name.to_owned(),
                _ => format!("{}_{name}", known.name),
            };
            let mut put = |direction: Direction, name: String, width: u32, kind: PinKind| {
                let prefix = if direction == Direction::Input { "in" } else { "out" };
                let net = Net::named(format!("{prefix}_{name}"));
                let net = if width > 1 { net.wide(width) } else { net };
                // A value of the host may be carried by several wires.
                if !(known.from == End::Host
                    && matches!(known.kind, LinkKind::Wire)
                    && pins.iter().any(|pin: &Pin| pin.net == net))
                {
                    pins.push(Pin { net, direction, kind, link });
                }
            };
            let fields = || known.fields.iter().enumerate();
            if known.from == End::Host {
                let send = match known.kind {
                    LinkKind::Wire => format!("{}_write", known.fields[0].from),
                    LinkKind::Snapshot { .. } => stem("publish"),
                    LinkKind::Fifo { .. } => stem("push"),
                };
                put(Direction::Input, send, 1, PinKind::Send);
                for (i, field) in fields() {
                    put(Direction::Input, stem(&field.from), 32, PinKind::Field(i));
                }
            }
            if known.to == End::Host {
                if let LinkKind::Fifo { .. } = known.kind {
                    put(Direction::Input, stem("pop"), 1, PinKind::Pop);
                }
                for (i, field) in fields() {
                    put(Direction::Output, stem(&field.to), 32, PinKind::Field(i));
                }
            }
            if let LinkKind::Fifo { depth, .. } = known.kind
                && (known.from == End::Host || known.to == End::Host)
            {
                for status in Status::ALL {
                    let width = if status == Status::Count { SystemPlan::count_bits(depth) } else { 1 };
                    put(Direction::Output, stem(status.name()), width, PinKind::Status(status));
                }
            }
        }
        pins
    }

    /// The top's status pins: `due`, then the status of all cores, core 0 lowest.
    pub fn status_pins(&self) -> Vec<Net> {
        let cores = self.cores.len() as u32;
        let told =
            STATUS.into_iter().skip(1).map(|net| Net::named(net.name().to_owned()).wide(net.width() * cores));
        [DUE].into_iter().chain(told).collect()
    }

    /// The name, in a top that a board drives, of a port that belongs to a core.
    pub fn board_port(&self, core: usize, port: &Net) -> Net {
        let net = Net::named(format!("board{core}_{}", port.name()));
        if port.width() > 1 { net.wide(port.width()) } else { net }
    }

    /// The pin of a host's end.
    pub(super) fn pin(&self, link: usize, kind: PinKind) -> Option<Net> {
        let pins = self.pins();
        let own = pins.iter().find(|pin| pin.link == link && pin.kind == kind);
        // The value of a wire may be that of an earlier one.
        let first = || {
            let known = &self.description.links[link];
            let same = |pin: &&Pin| {
                let other = &self.description.links[pin.link];
                pin.kind == kind
                    && pin.direction == Direction::Input
                    && matches!((&other.kind, &known.kind), (LinkKind::Wire, LinkKind::Wire))
                    && other.fields[0].from == known.fields[0].from
            };
            pins.iter().find(same)
        };
        own.or_else(first).map(|pin| pin.net.clone())
    }
}

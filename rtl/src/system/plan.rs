// SPDX-License-Identifier: MIT OR Apache-2.0
//! Names in the generated part of a system, and the top's pins.

use crate::export::Safety;
use crate::plan::Plan;
use crate::plan::names::net;
use crate::verilog::{Direction, Expr, Net, no};
use takt_isa::Register;
use takt_isa::system::{Description, End, LinkKind, Mailbox, Status};
use takt_isa::timing::Cycle;

/// A base tick is due.
pub(super) const DUE: Net = Net::bit("due");

/// Outputs that say when a core's outputs are its period's: a board takes them, and some links.
pub(super) const PUBLISHING: [Net; 2] = [net::ENDED, net::PUBLISHED];

/// Status outputs of a core, for which every top has pins.
pub(super) const STATUS: [Net; 7] = [
    net::WAITING,
    net::HALTED,
    net::DEADLINE_MISSED,
    net::FAULT,
    net::FAULT_KIND,
    net::FAULT_SLOT,
    net::FAULT_ADDRESS,
];

/// Outputs that a core's module passes on from its core.
pub(super) fn core_outputs() -> impl Iterator<Item = Net> {
    PUBLISHING.into_iter().chain(STATUS)
}

/// Driver of a system's cores, which loads them and sends their ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Driver {
    /// The top: it has a loader, and base ticks that start by themselves.
    Itself,
    /// A board around the top: the top has ports for loading and ticks, and exposes the cores' ports.
    Board,
}

/// Names and mailboxes of a system's circuit.
#[derive(Clone, Debug)]
pub struct SystemPlan {
    /// Source of loading and ticks.
    pub driver: Driver,
    /// Mechanisms of every core.
    pub safety: Safety,
    /// Cores and links of the system.
    pub description: Description,
    /// Plan of each core, in order.
    pub cores: Vec<Plan>,
    /// Module name of the top.
    pub top: String,
    /// Mailboxes of each core's gate.
    pub mailboxes: Vec<Vec<Mailbox>>,
}

/// Pin of the top: a host's end of a link.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pin {
    /// Name and width of the pin.
    pub net: Net,
    /// Direction, as seen from the top.
    pub direction: Direction,
    /// Kind of the pin; wires that share a value have one pin, of the first wire's kind.
    pub kind: PinKind,
    /// Index of the link.
    pub link: usize,
}

/// Kind of a host's pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PinKind {
    /// Field of the link, by index.
    Field(usize),
    /// Input, high for one cycle to write the wire, publish the snapshot or push the entry.
    Send,
    /// Input, high for one cycle to pop the FIFO's head.
    Pop,
    /// Status output of the FIFO.
    Status(Status),
}

/// Output port of a core that links use.
pub(super) struct OutputPort {
    pub(super) register: Register,
    pub(super) name: String,
    /// A link sends the value; otherwise links use only the event of a write.
    pub(super) sent: bool,
}

impl SystemPlan {
    pub(super) fn new(description: Description, cores: Vec<Plan>, name: &str, driver: Driver) -> SystemPlan {
        let plain: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
        let mailboxes = (0..cores.len()).map(|core| description.mailboxes(core)).collect();
        SystemPlan {
            driver,
            safety: Safety::default(),
            description,
            cores,
            top: format!("takt_system_{plain}"),
            mailboxes,
        }
    }

    /// Module name of a core with its gate.
    pub fn core_module(&self, core: usize) -> String {
        format!("{}_{}", self.top, self.description.cores[core].name)
    }

    /// Instance of a core's module in the top.
    pub fn core_instance(&self, core: usize) -> String {
        format!("core_{}", self.description.cores[core].name)
    }

    /// Instance of a link in the top.
    pub fn link_instance(&self, link: usize) -> String {
        let known = &self.description.links[link];
        match known.kind {
            LinkKind::Wire => format!("wire{link}_{}", known.fields[0].to),
            LinkKind::Snapshot { .. } => format!("snapshot_{}", known.name),
            LinkKind::Fifo { .. } => format!("fifo_{}", known.name),
        }
    }

    /// Net at a port of a link's instance.
    pub(super) fn of_link(&self, link: usize, port: &str) -> Net {
        Net::named(format!("{}_{port}", self.link_instance(link)))
    }

    /// Net of a core in the top.
    pub fn of_core(&self, core: usize, what: &str) -> Net {
        Net::named(format!("{}_{what}", self.description.cores[core].name))
    }

    /// Width of the number of a FIFO's entries.
    pub fn count_bits(depth: u32) -> u32 {
        (u32::BITS - depth.leading_zeros()).max(2)
    }

    /// Output ports of a core that links use, each once.
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

    /// Some link sends when the core publishes its outputs.
    pub(super) fn sends_published(&self, core: usize) -> bool {
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

    /// Expression that is 1 if an output port of a core is written in this cycle; constant 0 without a port.
    pub(super) fn write(&self, end: End, register: Option<Register>) -> Expr {
        self.port_net(end, register, "write").map_or_else(no, Into::into)
    }

    /// Value that is written to an output port of a core.
    pub(super) fn value(&self, end: End, register: Option<Register>) -> Option<Expr> {
        Some(self.port_net(end, register, "value")?.wide(32).into())
    }

    /// Cycles from `due` to a base tick.
    pub(super) fn lead(&self) -> Cycle {
        self.description.lead()
    }

    /// Host's ends of links, in the order of the links.
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
                // Several wires may carry one value of the host.
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

    /// Status pins of the top: `due`, then the status of all cores, core 0 lowest.
    pub fn status_pins(&self) -> Vec<Net> {
        [DUE].into_iter().chain(STATUS.map(|status| self.over_cores(&status))).collect()
    }

    /// Pin with a status output of all cores, core 0 lowest.
    pub(super) fn over_cores(&self, status: &Net) -> Net {
        Net::named(status.name().to_owned()).wide(status.width() * self.cores.len() as u32)
    }

    /// Name of a core's port in a top that a board drives.
    pub fn board_port(&self, core: usize, port: &Net) -> Net {
        let net = Net::named(format!("board{core}_{}", port.name()));
        if port.width() > 1 { net.wide(port.width()) } else { net }
    }

    /// Net of the pin of a host's end.
    pub(super) fn pin(&self, link: usize, kind: PinKind) -> Option<Net> {
        let pins = self.pins();
        let own = pins.iter().find(|pin| pin.link == link && pin.kind == kind);
        // A wire may share its value with an earlier wire, whose pin it uses.
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

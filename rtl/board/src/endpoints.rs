// SPDX-License-Identifier: MIT OR Apache-2.0
//! Host endpoints: the host's ends of a system's links, by name, with their addresses on a board (docs/protocol.md).

use crate::protocol::{DRIVEN, FIFO_WORDS, FIFOS, Place, SEEN};
use takt_isa::Type;
use takt_system::{Description, End, LinkKind, SystemPort};

/// Most values of wires and snapshots in one direction.
pub const MOST_VALUES: usize = (SEEN - DRIVEN) as usize;
/// Most FIFOs of the host.
pub const MOST_FIFOS: usize = ((0x4000 - FIFOS) / FIFO_WORDS) as usize;
/// Most fields of a FIFO's entry.
pub const MOST_FIELDS: usize = FIFO_WORDS as usize - 2;

/// FIFO with an end at the host.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fifo {
    /// Name of the link.
    pub name: String,
    /// Index of the link.
    pub link: usize,
    /// Address of the status; fields and act follow.
    pub address: u16,
    /// Fields of an entry, by the host's names.
    pub fields: Vec<(String, Type)>,
    /// The host pops entries; otherwise it pushes them.
    pub to_host: bool,
}

impl Fifo {
    /// Address of a field.
    pub fn field(&self, field: usize) -> u16 {
        self.address + 1 + field as u16
    }

    /// Address whose write pushes or pops.
    pub fn act(&self) -> u16 {
        self.field(self.fields.len())
    }
}

/// Host endpoints of a system.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Endpoints {
    /// Values of wires and snapshots that the host, or a peripheral, drives.
    pub inputs: Vec<SystemPort>,
    /// Values of wires and snapshots that the host sees.
    pub outputs: Vec<SystemPort>,
    /// FIFOs between the host and cores.
    pub fifos: Vec<Fifo>,
}

impl Endpoints {
    /// Finds the endpoints of a system.
    pub fn of(description: &Description) -> Endpoints {
        let is_fifo = |link: usize| matches!(description.links[link].kind, LinkKind::Fifo { .. });
        let plain = |ports: Vec<SystemPort>| ports.into_iter().filter(|port| !is_fifo(port.link)).collect();
        let at_host =
            description.links.iter().enumerate().filter(|(number, link)| {
                is_fifo(*number) && (link.from == End::Host || link.to == End::Host)
            });
        let fifos = at_host.enumerate().map(|(i, (number, link))| {
            let to_host = link.to == End::Host;
            let name =
                |field: &takt_system::Field| if to_host { field.to.clone() } else { field.from.clone() };
            let fields = link.fields.iter().map(|field| (name(field), field.ty)).collect();
            let address = FIFOS.saturating_add(FIFO_WORDS.saturating_mul(i.min(MOST_FIFOS) as u16));
            Fifo { name: link.name.clone(), link: number, address, fields, to_host }
        });
        Endpoints {
            inputs: plain(description.inputs()),
            outputs: plain(description.outputs()),
            fifos: fifos.collect(),
        }
    }

    /// A message, if there are too many for a board.
    pub fn too_many(&self) -> Option<String> {
        for (all, what) in [(&self.inputs, "drives"), (&self.outputs, "sees")] {
            if all.len() > MOST_VALUES {
                return Some(format!(
                    "the host {what} {} values; on a board at most {MOST_VALUES} are possible",
                    all.len()
                ));
            }
        }
        if self.fifos.len() > MOST_FIFOS {
            return Some(format!(
                "the host has {} FIFOs; on a board at most {MOST_FIFOS} are possible",
                self.fifos.len()
            ));
        }
        let long = self.fifos.iter().find(|fifo| fifo.fields.len() > MOST_FIELDS)?;
        Some(format!(
            "entries of `{}` have {} fields; with an end at a board's host, {MOST_FIELDS} are possible",
            long.name,
            long.fields.len()
        ))
    }

    /// Address of a value that the host drives.
    pub fn input(number: usize) -> u16 {
        DRIVEN + number as u16
    }

    /// Address of a value that the host sees.
    pub fn output(number: usize) -> u16 {
        SEEN + number as u16
    }

    /// Address of an endpoint's value, by name: `x`, or `link.x`.
    pub fn place(&self, name: &str) -> Option<Place> {
        let at = |all: &[SystemPort]| all.iter().position(|port| port.name == name);
        if let Some(number) = at(&self.inputs) {
            let read = Endpoints::input(number);
            return Some(Place { read, set: Some(read), ty: self.inputs[number].ty });
        }
        let number = at(&self.outputs)?;
        Some(Place { read: Endpoints::output(number), set: None, ty: self.outputs[number].ty })
    }

    /// Finds a FIFO by name that the host pops (`to_host`), or pushes.
    ///
    /// # Errors
    /// A message about the name.
    pub fn fifo(&self, name: &str, to_host: bool) -> Result<&Fifo, String> {
        let found = self.fifos.iter().find(|fifo| fifo.name == name);
        let way = if to_host { "to" } else { "from" };
        match found {
            Some(fifo) if fifo.to_host == to_host => Ok(fifo),
            Some(fifo) if fifo.to_host => {
                Err(format!("`{name}` is a FIFO to the host, whose entries `pop` takes out"))
            }
            Some(_) => Err(format!("`{name}` is a FIFO from the host, into which `push` puts entries")),
            None => {
                let names =
                    self.fifos.iter().filter(|fifo| fifo.to_host == to_host).map(|fifo| fifo.name.as_str());
                let names: Vec<&str> = names.collect();
                let names = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
                Err(format!("the system has no FIFO `{name}` {way} the host; there are {names}"))
            }
        }
    }
}

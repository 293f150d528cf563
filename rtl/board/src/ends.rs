//! The host's ends of a system's links: what they are called, and at which addresses a board has them (docs/protocol.md).

use crate::application::Place;
use takt_isa::Type;
use takt_system::{Description, End, LinkKind, SystemPort};

/// Address of the first value that the host drives.
pub const INPUT_ENDS: u16 = 0x3000;
/// Address of the first that it sees.
pub const OUTPUT_ENDS: u16 = 0x3400;
/// Address of the first FIFO.
pub const FIFOS: u16 = 0x3800;
/// Addresses of a FIFO: its status, its fields, and the one that is written to push or pop.
pub const FIFO_WORDS: u16 = 0x20;
/// Values of wires and snapshots in one direction, at most.
pub const MOST_ENDS: usize = (OUTPUT_ENDS - INPUT_ENDS) as usize;
/// FIFOs of the host, at most.
pub const MOST_FIFOS: usize = ((0x4000 - FIFOS) / FIFO_WORDS) as usize;
/// Fields of an entry, at most.
pub const MOST_FIELDS: usize = FIFO_WORDS as usize - 2;

/// A FIFO with an end at the host.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fifo {
    /// Its name.
    pub name: String,
    /// The link.
    pub link: usize,
    /// The address of its status; fields and act follow.
    pub address: u16,
    /// The fields of an entry, as the host calls them.
    pub fields: Vec<(String, Type)>,
    /// Whether the host takes entries out; else it puts them in.
    pub to_host: bool,
}

impl Fifo {
    /// The address of a field.
    pub fn field(&self, field: usize) -> u16 {
        self.address + 1 + field as u16
    }

    /// What is written to push or pop.
    pub fn act(&self) -> u16 {
        self.field(self.fields.len())
    }
}

/// The host's ends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ends {
    /// Values of wires and snapshots that the host, or a peripheral, drives.
    pub inputs: Vec<SystemPort>,
    /// Values of wires and snapshots that it sees.
    pub outputs: Vec<SystemPort>,
    /// FIFOs.
    pub fifos: Vec<Fifo>,
}

impl Ends {
    /// The ends of a system.
    pub fn of(description: &Description) -> Ends {
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
        Ends {
            inputs: plain(description.inputs()),
            outputs: plain(description.outputs()),
            fifos: fifos.collect(),
        }
    }

    /// Why there are too many for a board, if there are.
    pub fn too_many(&self) -> Option<String> {
        for (ends, what) in [(&self.inputs, "drives"), (&self.outputs, "sees")] {
            if ends.len() > MOST_ENDS {
                return Some(format!(
                    "the host {what} {} values; on a board it can be {MOST_ENDS}",
                    ends.len()
                ));
            }
        }
        if self.fifos.len() > MOST_FIFOS {
            return Some(format!(
                "the host has {} FIFOs; on a board it can have {MOST_FIFOS}",
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

    /// The address of a value that the host drives.
    pub fn input(number: usize) -> u16 {
        INPUT_ENDS + number as u16
    }

    /// The address of one that it sees.
    pub fn output(number: usize) -> u16 {
        OUTPUT_ENDS + number as u16
    }

    /// Where the host finds the value of an end: `x`, or `link.x`.
    pub fn place(&self, name: &str) -> Option<Place> {
        let at = |ends: &[SystemPort]| ends.iter().position(|end| end.name == name);
        if let Some(number) = at(&self.inputs) {
            let read = Ends::input(number);
            return Some(Place { read, set: Some(read), ty: self.inputs[number].ty });
        }
        let number = at(&self.outputs)?;
        Some(Place { read: Ends::output(number), set: None, ty: self.outputs[number].ty })
    }

    /// The FIFO of this name that the host pops, or pushes.
    ///
    /// # Errors
    /// In words, what is wrong with the name.
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

// SPDX-License-Identifier: MIT OR Apache-2.0
//! The application of a board: one program, or a system of several. A program is a system of one core without links, whose ports the host
//! and the peripherals reach directly.

use crate::endpoints::Endpoints;
use crate::kind::Direction;
use crate::protocol::{CORE, CORE_DATA, CORE_REGISTERS, DRIVEN, INPUTS, OUTPUTS, Place, SEEN, core_words};
use std::borrow::Cow;
use std::sync::Arc;
use takt_isa::program::{Port, Space};
use takt_isa::{BankIndex, Program, Register, Type};
use takt_system::{Core, Description, End, LinkKind, Source};

/// Names shown in a message at most.
const NAMES: usize = 40;

/// A program, or a system of several.
#[derive(Clone, Debug)]
pub struct Application<'a> {
    description: Cow<'a, Description>,
    endpoints: Endpoints,
    is_program: bool,
}

impl<'a> From<&'a Program> for Application<'a> {
    fn from(program: &'a Program) -> Application<'a> {
        let core = Core {
            name: String::new(),
            path: String::new(),
            program: Arc::new(program.clone()),
            every: 1,
            offset: 0,
        };
        // The wiring states the tick.
        let description = Description { tick: 0, cores: vec![core], links: Vec::new() };
        let endpoints = Endpoints::of(&description);
        Application { description: Cow::Owned(description), endpoints, is_program: true }
    }
}

impl<'a> From<&'a Description> for Application<'a> {
    fn from(description: &'a Description) -> Application<'a> {
        let endpoints = Endpoints::of(description);
        Application { description: Cow::Borrowed(description), endpoints, is_program: false }
    }
}

/// The value that a wiring connects to a register of a peripheral.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Connection {
    /// Of a program, the number of the port; of a system, that of the host's endpoint, among [`Endpoints`]' inputs or outputs.
    pub(crate) number: usize,
    /// The core that an output comes from.
    pub(crate) core: Option<usize>,
    /// Its type.
    pub(crate) ty: Type,
}

/// The meaning of a name.
enum Named<'n, T> {
    /// A host endpoint.
    Endpoint(T),
    /// A port, register or data word of a core.
    Core(usize, &'n str),
    /// A link, of which the name after the point is no host endpoint.
    Link(&'n str),
    /// No core has such a port.
    Nothing,
}

fn listed<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    let names: Vec<&str> = names.into_iter().take(NAMES).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

fn word(direction: Direction) -> &'static str {
    match direction {
        Direction::Input => "input",
        Direction::Output => "output",
    }
}

fn ports(program: &Program, direction: Direction) -> &[Port] {
    match direction {
        Direction::Input => &program.inputs,
        Direction::Output => &program.outputs,
    }
}

fn has(program: &Program, direction: Direction, name: &str) -> bool {
    ports(program, direction).iter().any(|port| port.name == name)
}

/// A port's number, as the core's pins and the protocol count.
fn number(program: &Program, port: &Port, direction: Direction) -> Option<u16> {
    match direction {
        Direction::Input => program.machine.inputs.index(port.register).map(BankIndex::get),
        Direction::Output => program.machine.output_number(port.register),
    }
}

impl Application<'_> {
    /// Its cores and links.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// The host's ends of its links.
    pub fn endpoints(&self) -> &Endpoints {
        &self.endpoints
    }

    /// The same, with a copy of the system.
    pub fn into_owned(self) -> Application<'static> {
        let Application { description, endpoints, is_program } = self;
        Application { description: Cow::Owned(description.into_owned()), endpoints, is_program }
    }

    /// True if it is a single program, whose ports are no ends of links.
    pub fn is_program(&self) -> bool {
        self.is_program
    }

    /// Its kind, as messages call it.
    pub fn kind(&self) -> &'static str {
        if self.is_program { "program" } else { "system" }
    }

    /// Its cores in words: `t1`, or `profile t1, servo t3`.
    pub fn cores(&self) -> String {
        let cores = self.description.cores.iter().map(|core| {
            let machine = core.program.machine.name;
            if self.is_program { machine.to_owned() } else { format!("{} {machine}", core.name) }
        });
        cores.collect::<Vec<_>>().join(", ")
    }

    /// A core, as messages call it.
    fn core_text(&self, core: usize) -> String {
        if self.is_program {
            "the program".to_owned()
        } else {
            format!("core `{}`", self.description.cores[core].name)
        }
    }

    /// The name of a core's port, register or data word, as [`Application::find`] takes it.
    pub fn name(&self, core: usize, name: &str) -> String {
        if self.is_program {
            name.to_owned()
        } else {
            format!("{}.{name}", self.description.cores[core].name)
        }
    }

    /// The value that a port's name in a wiring stands for: `n`, or `core.n` of a system. Direction is the port's.
    ///
    /// # Errors
    /// In words, what is wrong with the name.
    pub(crate) fn connect(&self, direction: Direction, name: &str) -> Result<Connection, String> {
        let all = match direction {
            Direction::Input => &self.endpoints.inputs,
            Direction::Output => &self.endpoints.outputs,
        };
        let names = || listed(all.iter().map(|end| end.name.as_str()));
        let by_name = all.iter().position(|end| end.name == name);
        let found = match self.named(name, by_name, |program| has(program, direction, name))? {
            Named::Endpoint(number) => Ok(number),
            Named::Core(core, name) if self.is_program => {
                let port = self.port(direction, core, name)?;
                let number = number(&self.description.cores[core].program, port, direction);
                return Ok(Connection { number: number.unwrap_or(0).into(), core: Some(core), ty: port.ty });
            }
            Named::Core(core, port) => self.endpoint_at(direction, core, port),
            Named::Link(link) if self.is_fifo(link) => Err(format!(
                "`{link}` is a FIFO, whose entries the host takes and gives; a wire or a snapshot can be a register"
            )),
            Named::Link(_) => {
                Err(format!("the host has no {} `{name}`; there are {}", word(direction), names()))
            }
            Named::Nothing => Err(format!(
                "no core of the system has an {} port `{name}`, and the host's ends of links are {}",
                word(direction),
                names()
            )),
        };
        let number = found?;
        let core = match self.description.links[all[number].link].from {
            End::Core(core) => Some(core),
            End::Host => None,
        };
        Ok(Connection { number, core, ty: all[number].ty })
    }

    /// The meaning of a name: `x`, `core.x` or `link.x`; `endpoint` is the host endpoint of exactly this name. An error if several cores, or
    /// none, have it.
    fn named<'n, T>(
        &self,
        name: &'n str,
        endpoint: Option<T>,
        has: impl Fn(&Program) -> bool,
    ) -> Result<Named<'n, T>, String> {
        let cores = &self.description.cores;
        match (name.split_once('.'), endpoint) {
            _ if self.is_program => Ok(Named::Core(0, name)),
            (Some((first, port)), endpoint) => match (self.description.core_named(first), endpoint) {
                (Some(core), _) => Ok(Named::Core(core, port)),
                (None, Some(endpoint)) => Ok(Named::Endpoint(endpoint)),
                (None, None) if self.description.link_named(first).is_some() => Ok(Named::Link(first)),
                (None, None) => {
                    let names = listed(cores.iter().map(|core| core.name.as_str()));
                    Err(format!("the system has no core `{first}`; there are {names}"))
                }
            },
            (None, Some(endpoint)) => Ok(Named::Endpoint(endpoint)),
            (None, None) => {
                let has: Vec<usize> = (0..cores.len()).filter(|core| has(&cores[*core].program)).collect();
                match has[..] {
                    [] => Ok(Named::Nothing),
                    [core] => Ok(Named::Core(core, name)),
                    _ => {
                        let names = has.iter().map(|core| format!("`{}`", self.name(*core, name)));
                        let names = names.collect::<Vec<_>>().join(" or ");
                        Err(format!("`{name}` is a port of several cores: {names}"))
                    }
                }
            }
        }
    }

    /// A port of a core's program.
    fn port(&self, direction: Direction, core: usize, name: &str) -> Result<&Port, String> {
        let all = ports(&self.description.cores[core].program, direction);
        all.iter().find(|port| port.name == name).ok_or_else(|| {
            let names = listed(all.iter().map(|port| port.name.as_str()));
            format!("{} has no {} port `{name}`; there are {names}", self.core_text(core), word(direction))
        })
    }

    /// The number of the host's endpoint of the link at a core's port.
    fn endpoint_at(&self, direction: Direction, core: usize, name: &str) -> Result<usize, String> {
        let (description, here) = (self.description(), self.endpoints());
        let full = self.name(core, name);
        let port = self.port(direction, core, name)?;
        if direction == Direction::Output {
            let found = here.outputs.iter().position(|end| {
                let link = &description.links[end.link];
                link.from == End::Core(core) && link.fields[end.field].output == Some(port.register)
            });
            return found.ok_or_else(|| {
                format!("`{full}` is on no wire or snapshot to the host: `[[wire]]` with `from = \"{full}\"` and `to = \"host.{name}\"` makes it one")
            });
        }
        let mailboxes = description.mailboxes(core);
        let source = mailboxes.iter().find(|mailbox| mailbox.register == port.register).map(|m| m.source);
        let wanted = format!(
            "a register can be a port that the host drives, as with `from = \"host.{name}\"` and `to = \"{full}\"`"
        );
        let Some(source) = source else { return Err(format!("nothing drives `{full}`; {wanted}")) };
        let link = &description.links[source.link()];
        match source {
            Source::Field { field, .. } if link.from == End::Host => {
                let end = match link.kind {
                    LinkKind::Wire => link.fields[field].from.clone(),
                    _ => format!("{}.{}", link.name, link.fields[field].from),
                };
                let found = here.inputs.iter().position(|known| known.name == end);
                found.ok_or_else(|| format!("`{full}` comes from the FIFO `{}`; {wanted}", link.name))
            }
            _ => Err(format!("`{full}` comes from the link `{}`; {wanted}", link.name)),
        }
    }

    /// The place at which the host finds a port (`n`, `core.n`, or the name of the host's end of a link), another register of a core (`x`,
    /// `@m12`), or a data word (`table[3]`).
    ///
    /// # Errors
    /// In words, what is wrong with the name.
    pub fn find(&self, name: &str) -> Result<Place, String> {
        let here = self.endpoints();
        let is_port =
            |program: &Program| has(program, Direction::Input, name) || has(program, Direction::Output, name);
        match self.named(name, here.place(name), is_port)? {
            Named::Endpoint(place) => Ok(place),
            Named::Core(core, port) => self.of_core(core, port),
            Named::Link(link) if self.is_fifo(link) => {
                Err(format!("`{link}` is a FIFO: `push` and `pop` give and take its entries"))
            }
            Named::Link(_) => {
                let names = listed(here.inputs.iter().chain(&here.outputs).map(|end| end.name.as_str()));
                Err(format!("the host has no end `{name}` of a link; there are {names}"))
            }
            Named::Nothing => Err(format!(
                "no core of the system has a port `{name}`; there are {}",
                listed(self.names().iter().map(String::as_str))
            )),
        }
    }

    /// The address at which a port is set, and its type.
    ///
    /// # Errors
    /// In words, what is wrong with the name, or why the host cannot set the port.
    pub fn settable(&self, name: &str) -> Result<(u16, Type), String> {
        let place = self.find(name)?;
        if let Some(address) = place.set {
            return Ok((address, place.ty));
        }
        if place.read >= CORE_REGISTERS {
            return Err(format!("`{name}` is no port but the core's own, which only its program writes"));
        }
        let is_output = (OUTPUTS..DRIVEN).contains(&place.read) || place.read >= SEEN;
        match self.connect(Direction::Input, name) {
            Err(text) if !is_output => Err(text),
            _ => Err(format!("`{name}` is an output port, which the program sets")),
        }
    }

    /// The address at which the host reads a core's register. The bank's next registers have the next addresses. An input port is read at
    /// the port's own address. None if there is no such register.
    pub fn register(&self, core: usize, register: Register) -> Option<u16> {
        let machine = self.description.cores.get(core)?.program.machine;
        let offset = core as u16;
        match machine.inputs.index(register) {
            Some(index) => Some(INPUTS + CORE * offset + index.get()),
            None => machine
                .has_register(register)
                .then(|| CORE_REGISTERS + self.core_words() * offset + register.get()),
        }
    }

    /// The address at which the host reads a core's data word. The next words have the next addresses. None if there is no such word, or
    /// it lies beyond the addresses that a core has.
    pub fn word(&self, core: usize, word: u32) -> Option<u16> {
        let depth = self.description.cores.get(core)?.program.machine.data_depth;
        let words = self.core_words();
        (word < depth.min(words.into())).then(|| CORE_DATA + words * core as u16 + word as u16)
    }

    /// Addresses of each core's registers, and of its data words.
    pub(crate) fn core_words(&self) -> u16 {
        core_words(self.description.cores.len())
    }

    /// The place of a core's port, register or data word.
    fn of_core(&self, core: usize, name: &str) -> Result<Place, String> {
        let program = &self.description.cores[core].program;
        let port = |direction: Direction, base: u16| {
            let port = ports(program, direction).iter().find(|port| port.name == name)?;
            Some((base + CORE * core as u16 + number(program, port, direction)?, port.ty))
        };
        if let Some((read, ty)) = port(Direction::Input, INPUTS) {
            // A program's input port is set itself, a system's at the host's end of its link.
            let set = match self.is_program {
                true => Some(read),
                false => self.endpoint_at(Direction::Input, core, name).ok().map(Endpoints::input),
            };
            return Ok(Place { read, set, ty });
        }
        if let Some((read, ty)) = port(Direction::Output, OUTPUTS) {
            return Ok(Place { read, set: None, ty });
        }
        self.held(core, name).ok_or_else(|| {
            let names = listed(program.inputs.iter().chain(&program.outputs).map(|port| port.name.as_str()));
            format!(
                "{} has no port, register or data word `{name}`; there are the ports {names}",
                self.core_text(core)
            )
        })
    }

    /// The place of a register that is no port, or of a data word.
    fn held(&self, core: usize, name: &str) -> Option<Place> {
        let program = &self.description.cores[core].program;
        let place = |read: u16, ty: Type| Some(Place { read, set: None, ty });
        if let Some(register) = name.strip_prefix('@') {
            return place(self.register(core, program.machine.register_address(register)?)?, Type::F);
        }
        if let Some(known) = program.registers.iter().find(|known| known.name == name) {
            return place(self.register(core, known.register)?, known.ty);
        }
        let (label, index) = match name.strip_suffix(']') {
            Some(name) => name.split_once('[')?,
            None => (name, "0"),
        };
        let base = match label {
            "" => 0,
            _ => {
                let mut data = program.symbols.iter().filter(|symbol| symbol.space == Space::Data);
                data.find(|symbol| symbol.name == label)?.address
            }
        };
        place(self.word(core, base.checked_add(index.parse().ok()?)?)?, Type::F)
    }

    /// The names of all ports of cores, as [`Application::find`] takes them.
    pub fn names(&self) -> Vec<String> {
        let of = |(core, known): (usize, &Core)| {
            let ports = known.program.inputs.iter().chain(&known.program.outputs);
            ports.map(|port| self.name(core, &port.name)).collect::<Vec<_>>()
        };
        self.description.cores.iter().enumerate().flat_map(of).collect()
    }

    fn is_fifo(&self, name: &str) -> bool {
        self.endpoints.fifos.iter().any(|fifo| fifo.name == name)
    }
}

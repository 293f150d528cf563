//! What a board runs: a program on one core, or a system of several.

use crate::ends::{Ends, INPUT_ENDS, OUTPUT_ENDS};
use crate::kind::Direction;
use crate::protocol::{CORE_DATA, CORE_REGISTERS, CORE_WORDS, INPUTS, OUTPUTS};
use takt_isa::program::{Port, Space};
use takt_isa::{BankIndex, Program, Register, Type};
use takt_system::{Description, End, LinkKind, Source};

/// Addresses of each core's ports, and of its registers: core *n*'s are *n* times as many further on.
pub const CORE: u16 = 0x100;

/// A program, or a system.
#[derive(Clone, Copy, Debug)]
pub enum Application<'a> {
    /// A program on one core.
    Program(&'a Program),
    /// Several cores and their links.
    System(&'a Description),
}

impl<'a> From<&'a Program> for Application<'a> {
    fn from(program: &'a Program) -> Application<'a> {
        Application::Program(program)
    }
}

impl<'a> From<&'a Description> for Application<'a> {
    fn from(description: &'a Description) -> Application<'a> {
        Application::System(description)
    }
}

/// What a wiring connects to a register of a peripheral.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Connection {
    /// Of a program, the number of the port; of a system, that of the host's end, among [`Ends`]' inputs or outputs.
    pub(crate) number: usize,
    /// Its name.
    pub(crate) name: String,
    /// Its type.
    pub(crate) ty: Type,
}

/// Where the host finds a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// The address at which it is read.
    pub read: u16,
    /// The address at which it is set, if the host can.
    pub set: Option<u16>,
    /// Its type.
    pub ty: Type,
}

fn listed<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let names: Vec<&str> = names.take(40).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

fn what(direction: Direction) -> &'static str {
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

/// A port's number, as the core's pins and the protocol count.
fn number(program: &Program, port: &Port, direction: Direction) -> Option<u16> {
    match direction {
        Direction::Input => program.machine.inputs.index(port.register).map(BankIndex::get),
        Direction::Output => program.machine.output_number(port.register),
    }
}

impl Application<'_> {
    /// Each core's name and machine; a single core has no name.
    pub fn machines(self) -> Vec<(Option<String>, &'static str)> {
        match self {
            Application::Program(program) => vec![(None, program.machine.name)],
            Application::System(description) => {
                let cores = description.cores.iter();
                cores.map(|core| (Some(core.name.clone()), core.program.machine.name)).collect()
            }
        }
    }

    /// Its cores in words: `t1`, or `profile t1, servo t3`.
    pub fn cores(self) -> String {
        let cores = self.machines().into_iter().map(|(name, machine)| match name {
            Some(name) => format!("{name} {machine}"),
            None => machine.to_owned(),
        });
        cores.collect::<Vec<_>>().join(", ")
    }

    /// What a port's name in a wiring stands for: `n`, or `core.n` of a system. Direction is the port's.
    ///
    /// # Errors
    /// In words, what is wrong with the name.
    pub(crate) fn connect(self, direction: Direction, name: &str) -> Result<Connection, String> {
        match self {
            Application::Program(program) => {
                let all = ports(program, direction);
                let port = all.iter().find(|port| port.name == name);
                let port = port.ok_or_else(|| {
                    let names = listed(all.iter().map(|port| port.name.as_str()));
                    format!("the program has no {} port `{name}`; there are {names}", what(direction))
                })?;
                let number = number(program, port, direction).unwrap_or(0).into();
                Ok(Connection { number, name: name.to_owned(), ty: port.ty })
            }
            Application::System(description) => connect(description, direction, name),
        }
    }

    /// Where the host finds a port (`n`, `core.n`, or what the system's file calls the host's end of a link), another register of a core
    /// (`x`, `@m12`), or a data word (`table[3]`).
    ///
    /// # Errors
    /// In words, what is wrong with the name.
    pub fn find(self, name: &str) -> Result<Place, String> {
        match self {
            Application::Program(program) => {
                let found = port_of(program, 0, name).map(|(place, _)| place);
                found.or_else(|| self.held(0, name)).ok_or_else(|| {
                    let names = program.inputs.iter().chain(&program.outputs);
                    format!(
                        "the program has no port, register or data word `{name}`; there are the ports {}",
                        listed(names.map(|port| port.name.as_str()))
                    )
                })
            }
            Application::System(description) => find(description, name),
        }
    }

    /// The address at which a port is set, and its type.
    ///
    /// # Errors
    /// In words, what is wrong with the name, or why the host cannot set the port.
    pub fn settable(self, name: &str) -> Result<(u16, Type), String> {
        let place = self.find(name)?;
        if let Some(address) = place.set {
            return Ok((address, place.ty));
        }
        if place.read >= CORE_REGISTERS {
            return Err(format!("`{name}` is no port but the core's own, which only its program writes"));
        }
        let is_output = (OUTPUTS..INPUT_ENDS).contains(&place.read) || place.read >= OUTPUT_ENDS;
        match self.connect(Direction::Input, name) {
            Err(text) if !is_output => Err(text),
            _ => Err(format!("`{name}` is an output port, which the program sets")),
        }
    }

    /// A core's program; a single program is that of core 0.
    fn program(&self, core: usize) -> Option<&Program> {
        match self {
            Application::Program(program) => (core == 0).then_some(*program),
            Application::System(description) => description.cores.get(core).map(|core| core.program.as_ref()),
        }
    }

    /// The address at which the host reads a core's register. The bank's next registers have the next addresses. An input port is read at
    /// the port's own address. None if there is no such register.
    pub fn register(&self, core: usize, register: Register) -> Option<u16> {
        let machine = self.program(core)?.machine;
        let offset = core as u16;
        match machine.inputs.index(register) {
            Some(index) => Some(INPUTS + CORE * offset + index.get()),
            None => {
                machine.has_register(register).then(|| CORE_REGISTERS + CORE_WORDS * offset + register.get())
            }
        }
    }

    /// The address at which the host reads a core's data word. The next words have the next addresses. None if there is no such word. In
    /// a system, words from 1024 on have no address.
    pub fn word(&self, core: usize, word: u32) -> Option<u16> {
        let mut depth = self.program(core)?.machine.data_depth;
        if let Application::System(_) = self {
            depth = depth.min(CORE_WORDS.into());
        }
        (word < depth).then(|| CORE_DATA + CORE_WORDS * core as u16 + word as u16)
    }

    /// Where a register that is no port, or a data word, is.
    fn held(&self, core: usize, name: &str) -> Option<Place> {
        let program = self.program(core)?;
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

    /// The names of all ports, as [`Application::find`] takes them; of a system, those of cores.
    pub fn names(self) -> Vec<String> {
        let all = |program: &Program, prefix: &str| -> Vec<String> {
            let ports = program.inputs.iter().chain(&program.outputs);
            ports.map(|port| format!("{prefix}{}", port.name)).collect()
        };
        match self {
            Application::Program(program) => all(program, ""),
            Application::System(description) => {
                let cores = description.cores.iter();
                cores.flat_map(|core| all(&core.program, &format!("{}.", core.name))).collect()
            }
        }
    }
}

/// A port of a core's program, by its name.
fn port_of(program: &Program, core: usize, name: &str) -> Option<(Place, Direction)> {
    [(Direction::Input, INPUTS), (Direction::Output, OUTPUTS)].into_iter().find_map(|(direction, base)| {
        let port = ports(program, direction).iter().find(|port| port.name == name)?;
        let read = base + CORE * core as u16 + number(program, port, direction)?;
        let set = (direction == Direction::Input).then_some(read);
        Some((Place { read, set, ty: port.ty }, direction))
    })
}

/// The cores that have such a port.
fn cores_with(description: &Description, has: impl Fn(&Program) -> bool) -> Vec<usize> {
    let cores = description.cores.iter().enumerate();
    cores.filter(|(_, core)| has(&core.program)).map(|(number, _)| number).collect()
}

/// The core that a name's part before the point names; none if it names a link; an error if nothing has the name.
fn core_of(description: &Description, name: &str) -> Result<Option<usize>, String> {
    if let Some(core) = description.core_named(name) {
        return Ok(Some(core));
    }
    if description.link_named(name).is_some() {
        return Ok(None);
    }
    let names = listed(description.cores.iter().map(|core| core.name.as_str()));
    Err(format!("the system has no core `{name}`; there are {names}"))
}

fn several(description: &Description, cores: &[usize], name: &str) -> String {
    let names = cores.iter().map(|core| format!("`{}.{name}`", description.cores[*core].name));
    format!("`{name}` is a port of several cores: {}", names.collect::<Vec<_>>().join(" or "))
}

fn connect(description: &Description, direction: Direction, name: &str) -> Result<Connection, String> {
    let ends = Ends::of(description);
    let all = match direction {
        Direction::Input => &ends.inputs,
        Direction::Output => &ends.outputs,
    };
    let by_end = |name: &str| all.iter().position(|end| end.name == name);
    let found = match name.split_once('.') {
        None => match by_end(name) {
            Some(number) => number,
            None => {
                let cores = cores_with(description, |program| {
                    ports(program, direction).iter().any(|port| port.name == name)
                });
                match cores[..] {
                    [core] => end_of(description, &ends, direction, core, name)?,
                    [] => {
                        let names = listed(all.iter().map(|end| end.name.as_str()));
                        return Err(format!(
                            "no core of the system has an {} port `{name}`, and the host's ends of links are {names}",
                            what(direction)
                        ));
                    }
                    _ => return Err(several(description, &cores, name)),
                }
            }
        },
        Some((first, port)) => match core_of(description, first)? {
            Some(core) => end_of(description, &ends, direction, core, port)?,
            None => by_end(name).ok_or_else(|| {
                let fifo = ends.fifos.iter().any(|fifo| fifo.name == first);
                let names = listed(all.iter().map(|end| end.name.as_str()));
                match fifo {
                    true => format!("`{first}` is a FIFO, whose entries the host takes and gives; a wire or a snapshot can be a register"),
                    false => format!("the host has no {} `{name}`; there are {names}", what(direction)),
                }
            })?,
        },
    };
    Ok(Connection { number: found, name: all[found].name.clone(), ty: all[found].ty })
}

/// The host's end of the link at a core's port.
fn end_of(
    description: &Description,
    ends: &Ends,
    direction: Direction,
    core: usize,
    name: &str,
) -> Result<usize, String> {
    let known = &description.cores[core];
    let all = ports(&known.program, direction);
    let full = format!("{}.{name}", known.name);
    let Some(port) = all.iter().find(|port| port.name == name) else {
        let names = listed(all.iter().map(|port| port.name.as_str()));
        return Err(format!(
            "core `{}` has no {} port `{name}`; there are {names}",
            known.name,
            what(direction)
        ));
    };
    if direction == Direction::Input {
        let mailboxes = description.mailboxes(core);
        let source = mailboxes.iter().find(|mailbox| mailbox.register == port.register).map(|m| m.source);
        let wanted = format!(
            "a register can be a port that the host drives, as with `from = \"host.{name}\"` and `to = \"{full}\"`"
        );
        return match source {
            Some(Source::Field { link, field }) if description.links[link].from == End::Host => {
                let link = &description.links[link];
                let end = match link.kind {
                    LinkKind::Wire => link.fields[field].from.clone(),
                    _ => format!("{}.{}", link.name, link.fields[field].from),
                };
                let found = ends.inputs.iter().position(|known| known.name == end);
                found.ok_or_else(|| format!("`{full}` comes from the FIFO `{}`; {wanted}", link.name))
            }
            Some(source) => Err(format!(
                "`{full}` comes from the link `{}`; {wanted}",
                description.links[source.link()].name
            )),
            None => Err(format!("nothing drives `{full}`; {wanted}")),
        };
    }
    let found = ends.outputs.iter().position(|end| {
        let link = &description.links[end.link];
        link.from == End::Core(core) && link.fields[end.field].output == Some(port.register)
    });
    found.ok_or_else(|| {
        format!("`{full}` is on no wire or snapshot to the host: `[[wire]]` with `from = \"{full}\"` and `to = \"host.{name}\"` makes it one")
    })
}

fn find(description: &Description, name: &str) -> Result<Place, String> {
    let ends = Ends::of(description);
    let by_end = || ends.place(name);
    let of_core = |core: usize, port: &str| {
        let known = &description.cores[core];
        let Some((place, direction)) = port_of(&known.program, core, port) else {
            return Application::System(description).held(core, port).ok_or_else(|| {
                let all = known.program.inputs.iter().chain(&known.program.outputs);
                let names = listed(all.map(|port| port.name.as_str()));
                format!(
                    "core `{}` has no port, register or data word `{port}`; there are the ports {names}",
                    known.name
                )
            });
        };
        // What a core's port gets, the host sets at its end of the link.
        let set = match direction {
            Direction::Input => end_of(description, &ends, direction, core, port).ok().map(Ends::input),
            Direction::Output => None,
        };
        Ok(Place { set, ..place })
    };
    let Some((first, port)) = name.split_once('.') else {
        if let Some(place) = by_end() {
            return Ok(place);
        }
        let cores = cores_with(description, |program| port_of(program, 0, name).is_some());
        return match cores[..] {
            [core] => of_core(core, name),
            [] => Err(format!(
                "no core of the system has a port `{name}`; there are {}",
                listed(Application::System(description).names().iter().map(String::as_str))
            )),
            _ => Err(several(description, &cores, name)),
        };
    };
    match core_of(description, first)? {
        Some(core) => of_core(core, port),
        None => by_end().ok_or_else(|| {
            let names = listed(ends.inputs.iter().chain(&ends.outputs).map(|end| end.name.as_str()));
            match ends.fifos.iter().any(|fifo| fifo.name == first) {
                true => format!("`{first}` is a FIFO: `push` and `pop` give and take its entries"),
                false => format!("the host has no end `{name}` of a link; there are {names}"),
            }
        }),
    }
}

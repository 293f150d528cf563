// SPDX-License-Identifier: MIT OR Apache-2.0
//! Application of a board: one program, or a system of several cores. A program is a system of one core without links, whose ports the host
//! and the peripherals reach directly.

use crate::endpoints::Endpoints;
use crate::kind::Direction;
use crate::protocol::{CORE, CORE_DATA, CORE_REGISTERS, DRIVEN, INPUTS, OUTPUTS, Place, SEEN, core_words};
use std::borrow::Cow;
use std::sync::Arc;
use takt_isa::program::{ParameterError, Port, Space};
use takt_isa::text::element_names;
use takt_isa::{BankIndex, Program, Register, Type};
use takt_system::{Core, Description, End, LinkKind, Source};

/// Most names listed in a message.
const NAMES: usize = 40;

/// Array of a core's source in data memory, with consecutive words in row-major order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Array {
    /// Name in the source.
    pub name: String,
    /// Data word of the first element.
    pub base: u32,
    /// Number of elements in each dimension; indices start at 1.
    pub sizes: Vec<u32>,
    /// Type of the elements.
    pub ty: Type,
}

impl Array {
    /// Data word of the element with the given indices, as written in the source: `2,3`.
    ///
    /// # Errors
    /// A message, if there is no such element.
    fn word(&self, indices: &str) -> Result<u32, String> {
        let Array { name, base, sizes, .. } = self;
        let parts: Vec<&str> = indices.split(',').map(str::trim).collect();
        let least = vec!["1"; sizes.len()].join(",");
        let most = sizes.iter().map(u32::to_string).collect::<Vec<_>>().join(",");
        let wrong = || {
            format!("`{name}` has no element [{indices}]; there are `{name}[{least}]` to `{name}[{most}]`")
        };
        if parts.len() != sizes.len() {
            return Err(wrong());
        }
        let index = parts.iter().zip(sizes).try_fold(0, |sum: u32, (part, size)| {
            let index = part.parse::<u32>().ok().filter(|index| (1..=*size).contains(index))?;
            sum.checked_mul(*size)?.checked_add(index - 1)
        });
        base.checked_add(index.ok_or_else(wrong)?).ok_or_else(wrong)
    }
}

/// A program, or a system of several cores.
#[derive(Clone, Debug)]
pub struct Application<'a> {
    description: Cow<'a, Description>,
    endpoints: Endpoints,
    is_program: bool,
    /// Arrays of each core, as far as known.
    arrays: Vec<Vec<Array>>,
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
        // The wiring sets the tick.
        let description = Description { tick: 0, cores: vec![core], links: Vec::new() };
        let endpoints = Endpoints::of(&description);
        Application { description: Cow::Owned(description), endpoints, is_program: true, arrays: Vec::new() }
    }
}

impl<'a> From<&'a Description> for Application<'a> {
    fn from(description: &'a Description) -> Application<'a> {
        let endpoints = Endpoints::of(description);
        Application {
            description: Cow::Borrowed(description),
            endpoints,
            is_program: false,
            arrays: Vec::new(),
        }
    }
}

/// Value that a wiring connects to a register of a peripheral.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Connection {
    /// Number of the port, for a program; for a system, index of the host's endpoint among [`Endpoints`]' inputs or outputs.
    pub(crate) number: usize,
    /// Core that writes an output.
    pub(crate) core: Option<usize>,
    /// Type of the value.
    pub(crate) ty: Type,
}

/// Meaning of a name.
enum NameMeaning<'n, T> {
    /// Endpoint of a link at the host.
    Endpoint(T),
    /// Port, register or data word of a core.
    Core(usize, &'n str),
    /// Link, whose part after the point names no endpoint.
    Link(&'n str),
    /// Unknown name: no core has such a port.
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

/// Number of a port, as the core's pins and the protocol count.
fn number(program: &Program, port: &Port, direction: Direction) -> Option<u16> {
    match direction {
        Direction::Input => program.machine.inputs.index(port.register).map(BankIndex::get),
        Direction::Output => program.machine.output_number(port.register),
    }
}

impl Application<'_> {
    /// Cores and links of the application.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// Endpoints of the links at the host.
    pub fn endpoints(&self) -> &Endpoints {
        &self.endpoints
    }

    /// Detaches the application from a borrowed system, by a copy.
    pub fn into_owned(self) -> Application<'static> {
        let Application { description, endpoints, is_program, arrays } = self;
        Application { description: Cow::Owned(description.into_owned()), endpoints, is_program, arrays }
    }

    /// Adds the arrays of each core's source, so that [`Application::find`] knows their elements as written in the source.
    #[must_use]
    pub fn with_arrays(self, arrays: Vec<Vec<Array>>) -> Self {
        Application { arrays, ..self }
    }

    /// Names of an array's elements, in order of indices; `None` if the name is not an array's (`M`, in a system `core.M`).
    pub fn elements(&self, name: &str) -> Option<Vec<String>> {
        let (core, own) = match name.split_once('.') {
            Some((core, own)) if !self.is_program => (self.description.core_named(core)?, own),
            _ if self.is_program => (0, name),
            _ => return None,
        };
        let known = self.arrays.get(core).and_then(|arrays| arrays.iter().find(|array| array.name == own));
        let elements = match known {
            Some(array) => element_names(&array.name, &array.sizes),
            // Elements of an array in registers are registers.
            None => {
                let registers = self.description.cores[core].program.named_registers();
                let is_element =
                    |name: &str| name.strip_prefix(own).is_some_and(|rest| rest.starts_with('['));
                registers.map(|register| register.name.clone()).filter(|name| is_element(name)).collect()
            }
        };
        let full = |element: String| self.name(core, &element);
        (!elements.is_empty()).then(|| elements.into_iter().map(full).collect())
    }

    /// The application is a single program, whose ports are not endpoints of links.
    pub fn is_program(&self) -> bool {
        self.is_program
    }

    /// Word for the application in messages: program or system.
    pub fn kind(&self) -> &'static str {
        if self.is_program { "program" } else { "system" }
    }

    /// Text of the cores: `t1`, or `profile t1, servo t3`.
    pub fn cores(&self) -> String {
        let cores = self.description.cores.iter().map(|core| {
            let machine = core.program.machine.name;
            if self.is_program { machine.to_owned() } else { format!("{} {machine}", core.name) }
        });
        cores.collect::<Vec<_>>().join(", ")
    }

    /// Text of a core in messages.
    fn core_text(&self, core: usize) -> String {
        if self.is_program {
            "the program".to_owned()
        } else {
            format!("core `{}`", self.description.cores[core].name)
        }
    }

    /// Full name of a core's port, register or data word, as [`Application::find`] accepts it.
    pub fn name(&self, core: usize, name: &str) -> String {
        if self.is_program {
            name.to_owned()
        } else {
            format!("{}.{name}", self.description.cores[core].name)
        }
    }

    /// Value behind a port's name in a wiring: `n`, or `core.n` in a system. The direction is the port's.
    ///
    /// # Errors
    /// A message about the name.
    pub(crate) fn connect(&self, direction: Direction, name: &str) -> Result<Connection, String> {
        let all = match direction {
            Direction::Input => &self.endpoints.inputs,
            Direction::Output => &self.endpoints.outputs,
        };
        let names = || listed(all.iter().map(|end| end.name.as_str()));
        let by_name = all.iter().position(|end| end.name == name);
        let found = match self.named(name, by_name, |program| has(program, direction, name))? {
            NameMeaning::Endpoint(number) => Ok(number),
            NameMeaning::Core(core, name) if self.is_program => {
                let port = self.port(direction, core, name)?;
                let number = number(&self.description.cores[core].program, port, direction);
                return Ok(Connection { number: number.unwrap_or(0).into(), core: Some(core), ty: port.ty });
            }
            NameMeaning::Core(core, port) => self.endpoint_at(direction, core, port),
            NameMeaning::Link(link) if self.is_fifo(link) => Err(format!(
                "`{link}` is a FIFO, whose entries the host takes and gives; a wire or a snapshot can be a register"
            )),
            NameMeaning::Link(_) => {
                Err(format!("the host has no {} `{name}`; there are {}", word(direction), names()))
            }
            NameMeaning::Nothing => Err(format!(
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

    /// Meaning of a name: `x`, `core.x` or `link.x`; `endpoint` is the host's endpoint with exactly this name. An error if the name is
    /// ambiguous or unknown.
    fn named<'n, T>(
        &self,
        name: &'n str,
        endpoint: Option<T>,
        has: impl Fn(&Program) -> bool,
    ) -> Result<NameMeaning<'n, T>, String> {
        let cores = &self.description.cores;
        match (name.split_once('.'), endpoint) {
            _ if self.is_program => Ok(NameMeaning::Core(0, name)),
            (Some((first, port)), endpoint) => match (self.description.core_named(first), endpoint) {
                (Some(core), _) => Ok(NameMeaning::Core(core, port)),
                (None, Some(endpoint)) => Ok(NameMeaning::Endpoint(endpoint)),
                (None, None) if self.description.link_named(first).is_some() => Ok(NameMeaning::Link(first)),
                (None, None) => {
                    let names = listed(cores.iter().map(|core| core.name.as_str()));
                    Err(format!("the system has no core `{first}`; there are {names}"))
                }
            },
            (None, Some(endpoint)) => Ok(NameMeaning::Endpoint(endpoint)),
            (None, None) => {
                let has: Vec<usize> = (0..cores.len()).filter(|core| has(&cores[*core].program)).collect();
                match has[..] {
                    [] => Ok(NameMeaning::Nothing),
                    [core] => Ok(NameMeaning::Core(core, name)),
                    _ => {
                        let names = has.iter().map(|core| format!("`{}`", self.name(*core, name)));
                        let names = names.collect::<Vec<_>>().join(" or ");
                        Err(format!("`{name}` is a port of several cores: {names}"))
                    }
                }
            }
        }
    }

    /// Finds a port of a core's program.
    fn port(&self, direction: Direction, core: usize, name: &str) -> Result<&Port, String> {
        let all = ports(&self.description.cores[core].program, direction);
        all.iter().find(|port| port.name == name).ok_or_else(|| {
            let names = listed(all.iter().map(|port| port.name.as_str()));
            format!("{} has no {} port `{name}`; there are {names}", self.core_text(core), word(direction))
        })
    }

    /// Index of the host's endpoint that is linked to a core's port.
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

    /// Finds the address of a port (`n`, `core.n`, or the name of the host's end of a link), of another register of a core (`x`, `@m12`),
    /// or of a data word (`table[3]`).
    ///
    /// # Errors
    /// A message about the name.
    pub fn find(&self, name: &str) -> Result<Place, String> {
        let here = self.endpoints();
        let is_port = |program: &Program| {
            program.host_registers().chain(&program.outputs).any(|port| port.name == name)
        };
        match self.named(name, here.place(name), is_port)? {
            NameMeaning::Endpoint(place) => Ok(place),
            NameMeaning::Core(core, port) => self.of_core(core, port),
            NameMeaning::Link(link) if self.is_fifo(link) => {
                Err(format!("`{link}` is a FIFO: `push` and `pop` give and take its entries"))
            }
            NameMeaning::Link(_) => {
                let names = listed(here.inputs.iter().chain(&here.outputs).map(|end| end.name.as_str()));
                Err(format!("the host has no end `{name}` of a link; there are {names}"))
            }
            NameMeaning::Nothing => Err(format!(
                "no core of the system has a port `{name}`; there are {}",
                listed(self.names().iter().map(String::as_str))
            )),
        }
    }

    /// Address at which the host sets a port, and the port's type.
    ///
    /// # Errors
    /// A message about the name, or the reason why the host cannot set the port.
    pub fn settable(&self, name: &str) -> Result<(u16, Type), String> {
        let place = self.find(name)?;
        if let Some(address) = place.set {
            return Ok((address, place.ty));
        }
        if place.read >= CORE_REGISTERS {
            return Err(format!(
                "`{name}` is not a port but internal to the core: only its program writes it"
            ));
        }
        if self.parameter(name).is_ok() {
            return Err(format!(
                "`{name}` is a parameter of a core; in a system, it keeps the value that it is loaded with (`takt load --param`)"
            ));
        }
        let is_output = (OUTPUTS..DRIVEN).contains(&place.read) || place.read >= SEEN;
        match self.connect(Direction::Input, name) {
            Err(text) if !is_output => Err(text),
            _ => Err(format!("`{name}` is an output port, which the program sets")),
        }
    }

    /// Parameter with a name (`kp`, in a system `core.kp`), and the program that has it.
    ///
    /// # Errors
    /// If there is none.
    pub fn parameter(&self, name: &str) -> Result<(&Program, &Port), ParameterError> {
        let (core, own) = match name.split_once('.') {
            Some((core, own)) if !self.is_program => (self.description.core_named(core), own),
            _ => (self.is_program.then_some(0), name),
        };
        let Some(core) = core else {
            let cores = self.description.cores.iter().enumerate();
            let known = cores.flat_map(|(core, known)| {
                known.program.parameters.iter().map(move |port| format!("`{}`", self.name(core, &port.name)))
            });
            let known = known.collect::<Vec<_>>().join(", ");
            return Err(ParameterError::Unknown { name: name.to_owned(), known });
        };
        let program = &*self.description.cores[core].program;
        Ok((program, program.parameter(own)?))
    }

    /// Checks a value for a name: if it is a parameter's, the range of the source holds.
    ///
    /// # Errors
    /// If the parameter may not have the value.
    pub fn check_parameter(&self, name: &str, bits: u32) -> Result<(), ParameterError> {
        self.parameter(name).map_or(Ok(()), |(program, port)| program.check_parameter(port, bits))
    }

    /// Address at which the host reads a core's register. The bank's next registers have the next addresses. An input port is read at the
    /// port's own address. `None` if there is no such register.
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

    /// Address at which the host reads a core's data word. The next words have the next addresses. `None` if there is no such word, or it
    /// lies beyond the addresses of a core.
    pub fn word(&self, core: usize, word: u32) -> Option<u16> {
        let depth = self.description.cores.get(core)?.program.machine.data_depth;
        let words = self.core_words();
        (word < depth.min(words.into())).then(|| CORE_DATA + words * core as u16 + word as u16)
    }

    /// Number of addresses for each core's registers, and for its data words.
    pub(crate) fn core_words(&self) -> u16 {
        core_words(self.description.cores.len())
    }

    /// Address and type of a core's port, register or data word.
    fn of_core(&self, core: usize, name: &str) -> Result<Place, String> {
        let program = &self.description.cores[core].program;
        if let Some(port) = program.parameters.iter().find(|port| port.name == name) {
            let number = number(program, port, Direction::Input).unwrap_or(0);
            let read = INPUTS + CORE * core as u16 + number;
            return Ok(Place { read, set: self.is_program.then_some(read), ty: port.ty });
        }
        let port = |direction: Direction, base: u16| {
            let port = ports(program, direction).iter().find(|port| port.name == name)?;
            Some((base + CORE * core as u16 + number(program, port, direction)?, port.ty))
        };
        if let Some((read, ty)) = port(Direction::Input, INPUTS) {
            // The host sets a program's input port itself, a system's at the host's end of its link.
            let set = match self.is_program {
                true => Some(read),
                false => self.endpoint_at(Direction::Input, core, name).ok().map(Endpoints::input),
            };
            return Ok(Place { read, set, ty });
        }
        if let Some((read, ty)) = port(Direction::Output, OUTPUTS) {
            return Ok(Place { read, set: None, ty });
        }
        if let Some(found) = self.element(core, name) {
            return found;
        }
        self.held(core, name).ok_or_else(|| {
            let names =
                listed(program.host_registers().chain(&program.outputs).map(|port| port.name.as_str()));
            format!(
                "{} has no port, register or data word `{name}`; there are the ports {names}",
                self.core_text(core)
            )
        })
    }

    /// Address and type of an array's element in data memory; `None` if the name does not begin with an array's.
    fn element(&self, core: usize, name: &str) -> Option<Result<Place, String>> {
        let (head, indices) = match name.strip_suffix(']') {
            Some(name) => name.split_once('[')?,
            None => (name, ""),
        };
        let array = self.arrays.get(core)?.iter().find(|array| array.name == head)?;
        let place = |word: u32| {
            let read = self
                .word(core, word)
                .ok_or_else(|| format!("`{name}` lies beyond the words that a host can read"))?;
            Ok(Place { read, set: None, ty: array.ty })
        };
        Some(array.word(indices).and_then(place))
    }

    /// Address and type of a register other than a port, or of a data word.
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

    /// Names of all ports of cores, as [`Application::find`] accepts them.
    pub fn names(&self) -> Vec<String> {
        let of = |(core, known): (usize, &Core)| {
            let ports = known.program.host_registers().chain(&known.program.outputs);
            ports.map(|port| self.name(core, &port.name)).collect::<Vec<_>>()
        };
        self.description.cores.iter().enumerate().flat_map(of).collect()
    }

    fn is_fifo(&self, name: &str) -> bool {
        self.endpoints.fifos.iter().any(|fifo| fifo.name == name)
    }
}

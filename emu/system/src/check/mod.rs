// SPDX-License-Identifier: MIT OR Apache-2.0
//! Checks a system's file: returns a description, or all mistakes in the file.

mod links;

use crate::file::{CoreTable, File};
use std::collections::{BTreeMap, HashMap};
use std::ops::Range;
use std::sync::Arc;
use takt_diagnostics::diag::{Diagnostic, Diagnostics};
use takt_diagnostics::machine::{MachineMistake, machine_from};
use takt_diagnostics::source::{Sources, Span};
use takt_diagnostics::{nearest, toml_mistake};
use takt_isa::program::Port;
use takt_isa::system::{Core, Description, End, Field, Link, MAX_CORES, MAX_LATENCY, MAX_TICK, MIN_LATENCY};
use takt_isa::{Machine, Program, Type};
use toml::Spanned;

/// Minimum cycles between the ticks of a core, in addition to the cycles in which its snapshots enter.
const LEAST_PERIOD: u64 = 16;
/// Name that files use for the host as a link's end.
const HOST: &str = "host";

/// Request for a core's program, as the file names it.
pub struct Request<'a> {
    /// Path as written in the file: relative to the file's folder.
    pub path: &'a str,
    /// Machine, if the file names one.
    pub machine: Option<&'static Machine>,
}

/// Reason why there is no program.
#[derive(Debug)]
pub enum ProgramError<E> {
    /// The program does not exist or cannot be read: a mistake in the system's file.
    Missing {
        /// Description of the mistake.
        message: String,
        /// Suggested correction, if known.
        help: Option<String>,
    },
    /// The program has mistakes of its own.
    Invalid(E),
}

/// Reason why there is no description.
#[derive(Debug, thiserror::Error)]
pub enum ReadError<E> {
    /// Mistakes in the file, in the order of their places.
    #[error("{}", .0.render(false))]
    Mistakes(Diagnostics),
    /// A program has mistakes of its own.
    #[error("{0}")]
    Program(E),
}

/// Reads a system's file, whose text is at most [`TEXT_BYTES`](crate::TEXT_BYTES) long. `load` loads each program. Machines from files need
/// [`read_with`].
///
/// # Errors
/// The mistakes in the file, as many as can be found at once.
pub fn read<E>(
    name: &str,
    text: &str,
    load: impl FnMut(&Request<'_>) -> Result<Program, ProgramError<E>>,
) -> Result<Description, ReadError<E>> {
    read_with(name, text, |_| Err("machine files cannot be read here".to_owned()), load)
}

/// Reads a system's file like [`read`]; `machines` returns the bytes of a machine's file, given its path as written in the system's file:
/// relative to the system file's folder.
///
/// # Errors
/// The mistakes in the file, like [`read`].
pub fn read_with<E>(
    name: &str,
    text: &str,
    mut machines: impl FnMut(&str) -> Result<Vec<u8>, String>,
    load: impl FnMut(&Request<'_>) -> Result<Program, ProgramError<E>>,
) -> Result<Description, ReadError<E>> {
    let mut sources = Sources::default();
    sources.add(name, text.into());
    let mut mistakes = Mistakes { list: Vec::new() };
    let description = match parse(text) {
        Ok(file) => {
            Checker::new(&mut mistakes).check(&file, &mut machines, load).map_err(ReadError::Program)?
        }
        Err(error) => {
            mistakes.list.push(syntax(&error, text));
            None
        }
    };
    match description {
        Some(description) if mistakes.list.is_empty() => Ok(description),
        _ => {
            mistakes.list.sort_by_key(|diagnostic| diagnostic.labels.first().map(|label| label.span));
            Err(ReadError::Mistakes(Diagnostics {
                sources: Arc::new(sources),
                list: mistakes.list,
                ..Diagnostics::default()
            }))
        }
    }
}

/// Parses the file's tables. A function of its own, so that the parser is compiled here and not with each caller of [`read`].
fn parse(text: &str) -> Result<File, toml::de::Error> {
    toml::from_str(text)
}

fn span(range: Range<usize>) -> Span {
    Span::new(range.start as u32, range.end as u32)
}

/// Diagnostic for an error of the TOML parser.
fn syntax(error: &toml::de::Error, text: &str) -> Diagnostic {
    let diagnostic = toml_mistake(error, text);
    let has = |file: &toml::Table, keys: &[&str]| keys.iter().any(|key| file.contains_key(*key));
    let other = toml::from_str::<toml::Table>(text).ok().filter(|file| !file.contains_key("core"));
    if other.as_ref().is_some_and(|file| has(file, &["board", "peripheral"])) {
        let message = "expected a system of cores, found a board's wiring";
        return Diagnostic { message: message.to_owned(), ..diagnostic }
            .help("a wiring is for `takt board`; docs/system.md says what a system's file has");
    }
    if other.as_ref().is_some_and(|file| has(file, &["slot"])) {
        let message = "expected a system of cores, found a machine";
        return Diagnostic { message: message.to_owned(), ..diagnostic }
            .help("a machine's file is for `-m`; docs/system.md says what a system's file has");
    }
    if diagnostic.message.starts_with("missing") && diagnostic.message.contains("`tick`") {
        return diagnostic.help("say how many cycles there are from base tick to base tick: `tick = 12500`");
    }
    diagnostic
}

struct Mistakes {
    list: Vec<Diagnostic>,
}

impl Mistakes {
    fn add(&mut self, code: &'static str, place: Range<usize>, message: String) -> &mut Diagnostic {
        self.list.push(Diagnostic::error(code, span(place), message));
        let last = self.list.len() - 1;
        &mut self.list[last]
    }
}

/// Place of each name's first definition.
type Places = HashMap<String, Range<usize>>;

struct Checker<'m> {
    mistakes: &'m mut Mistakes,
    cores: Vec<Core>,
    /// Cores by name; `None` for a core whose mistakes have been reported.
    names: BTreeMap<String, Option<usize>>,
    links: Vec<Link>,
    /// Links of latency 0, with their places in the file.
    zero: Vec<(usize, Range<usize>)>,
    link_names: Places,
    /// Place of the driver of each input port (`core.port`) and each output of the system.
    driven: Places,
    /// Inputs driven by the host, each with its type.
    host_types: HashMap<String, Type>,
}

/// Port at a link's end.
struct EndPort {
    name: String,
    /// Core's port; `None` at the host, whose ports only have names.
    port: Option<Port>,
}

impl<'m> Checker<'m> {
    fn new(mistakes: &'m mut Mistakes) -> Checker<'m> {
        Checker {
            mistakes,
            cores: Vec::new(),
            names: BTreeMap::new(),
            links: Vec::new(),
            zero: Vec::new(),
            link_names: Places::new(),
            driven: Places::new(),
            host_types: HashMap::new(),
        }
    }

    fn check<E>(
        mut self,
        file: &File,
        machines: &mut dyn FnMut(&str) -> Result<Vec<u8>, String>,
        mut load: impl FnMut(&Request<'_>) -> Result<Program, ProgramError<E>>,
    ) -> Result<Option<Description>, E> {
        let tick = self.number(&file.tick, "the base tick", 1, MAX_TICK);
        if file.core.is_empty() {
            let help = "a core: `[[core]]` with `name` and `program`";
            self.mistakes.add("core", 0..0, "a system without a core".to_owned()).help =
                Some(help.to_owned());
        }
        if let Some(extra) = file.core.get(MAX_CORES) {
            let text = format!("{} cores; a system has at most {MAX_CORES}", file.core.len());
            self.mistakes.add("core", extra.name.span(), text);
        }
        for core in file.core.iter().take(MAX_CORES) {
            let made = self.core(core, tick, machines, &mut load)?;
            let name = core.name.get_ref();
            if !self.names.contains_key(name) {
                let number = made.map(|core| {
                    self.cores.push(core);
                    self.cores.len() - 1
                });
                self.names.insert(name.clone(), number);
            }
        }
        file.wire.iter().for_each(|wire| self.wire(wire));
        file.snapshot.iter().for_each(|snapshot| self.snapshot(snapshot));
        file.fifo.iter().for_each(|fifo| self.fifo(fifo));
        self.zero_latencies();
        if self.mistakes.list.is_empty() {
            self.undriven(file);
        }
        let Some(tick) = tick else { return Ok(None) };
        let description = Description { tick, cores: self.cores, links: self.links };
        for (number, core) in description.cores.iter().enumerate() {
            let (mailboxes, period) = (description.snapshot_mailboxes(number), core.period(tick));
            if self.mistakes.list.is_empty() && period < mailboxes + LEAST_PERIOD {
                let least = mailboxes + LEAST_PERIOD;
                let place =
                    file.core.get(number).and_then(|core| core.tick.as_ref()).unwrap_or(&file.tick).span();
                let text = format!(
                    "core `{}` has a tick every {period} cycles and needs {least} at least: {LEAST_PERIOD}, and \
                     one for each of its {mailboxes} values from snapshots",
                    core.name
                );
                self.mistakes.add("tick", place, text).help = Some("a longer `tick`".to_owned());
            }
        }
        Ok(Some(description))
    }

    fn number(&mut self, value: &Spanned<i64>, what: &str, least: u64, most: u64) -> Option<u64> {
        let number = u64::try_from(*value.get_ref()).ok().filter(|number| (least..=most).contains(number));
        if number.is_none() {
            let text = format!("{what} is {}; expected {least} to {most}", value.get_ref());
            self.mistakes.add("number", value.span(), text);
        }
        number
    }

    /// Checks a name; reports an invalid one.
    fn name(&mut self, name: &Spanned<String>, what: &str) -> bool {
        let text = name.get_ref();
        let letters = |c: char| c.is_ascii_alphanumeric() || c == '_';
        let good = text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
            && text.chars().all(letters)
            && text.len() <= 64;
        if !good {
            let help = "letters, digits and `_`, a letter first, 64 at most";
            self.mistakes.add("name", name.span(), format!("`{text}` is not a name for a {what}")).help =
                Some(help.to_owned());
        } else if text == HOST {
            self.mistakes
                .add("name", name.span(), format!("`{HOST}` stands for the outside and cannot name a {what}"))
                .help = Some("choose another name".to_owned());
        }
        good && text != HOST
    }

    fn core<E>(
        &mut self,
        table: &CoreTable,
        tick: Option<u64>,
        machines: &mut dyn FnMut(&str) -> Result<Vec<u8>, String>,
        load: &mut impl FnMut(&Request<'_>) -> Result<Program, ProgramError<E>>,
    ) -> Result<Option<Core>, E> {
        let mut good = self.name(&table.name, "core");
        let name = table.name.get_ref();
        if let Some(first) = self.link_names.get(name).cloned() {
            let diagnostic =
                self.mistakes.add("name", table.name.span(), format!("two cores named `{name}`"));
            *diagnostic = diagnostic.clone().also(span(first), "the first").help("rename one of them");
            good = false;
        }
        self.link_names.insert(name.clone(), table.name.span());
        let most = tick.map_or(MAX_TICK, |tick| MAX_TICK / tick.max(1)).max(1);
        let every = table.tick.as_ref().map_or(Some(1), |every| self.number(every, "a core's tick", 1, most));
        if every.is_none()
            && let Some(last) = self.mistakes.list.last_mut()
        {
            last.help = Some("`tick = n`: the core gets every n-th base tick".to_owned());
        }
        let period = every.unwrap_or(1) * tick.unwrap_or(1);
        let offset = table
            .offset
            .as_ref()
            .map_or(Some(0), |offset| self.number(offset, "a core's offset", 0, period.saturating_sub(1)));
        if offset.is_none()
            && let Some(last) = self.mistakes.list.last_mut()
        {
            last.help = Some(format!("fewer cycles than from tick to tick, which is {period}"));
        }
        let mut machine = None;
        if let Some(wanted) = &table.machine {
            match machine_from(wanted.get_ref(), &mut *machines) {
                Ok(found) => machine = Some(found),
                Err(mistake) => {
                    let diagnostic = self.mistakes.add("machine", wanted.span(), String::new());
                    *diagnostic = mistake.diagnose(span(wanted.span()));
                    if let MachineMistake::Name(error) = &mistake
                        && let Some((unknown, known)) = error.unknown()
                    {
                        // Keep the help to one line, as for other names in the file.
                        let near = nearest(unknown, known.iter().copied());
                        diagnostic.notes.clear();
                        *diagnostic = diagnostic
                            .clone()
                            .help(format!("{}: {}", error.kind(), known.join(", ")))
                            .did_you_mean(near);
                    }
                    return Ok(None);
                }
            }
        }
        let program = match load(&Request { path: table.program.get_ref(), machine }) {
            Ok(program) => Some(program),
            Err(ProgramError::Invalid(error)) => return Err(error),
            Err(ProgramError::Missing { message, help }) => {
                self.mistakes.add("program", table.program.span(), message).help = help;
                None
            }
        };
        let (Some(program), Some(every), Some(offset), true) = (program, every, offset, good) else {
            return Ok(None);
        };
        let (path, program) = (table.program.get_ref().clone(), Arc::new(program));
        Ok(Some(Core { name: name.clone(), path, program, every, offset }))
    }

    /// End with this name; reports an unknown core. Returns `None` without a report for a core whose own mistakes have been reported.
    fn end(&mut self, name: &str, place: Range<usize>) -> Option<End> {
        if name == HOST {
            return Some(End::Host);
        }
        if let Some(known) = self.names.get(name) {
            return known.map(End::Core);
        }
        let near = nearest(name, self.names.keys().map(String::as_str).chain([HOST]));
        let text = format!("there is no core `{name}`");
        let diagnostic = self.mistakes.add("core", place, text);
        *diagnostic = diagnostic.clone().did_you_mean(near);
        None
    }

    /// Port with this name at an end.
    fn port(&mut self, end: End, name: &str, input: bool, place: Range<usize>) -> Option<EndPort> {
        let End::Core(number) = end else {
            let spanned = name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
                && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
            if !spanned {
                self.mistakes.add("name", place, format!("`{name}` is not a name for a port"));
                return None;
            }
            return Some(EndPort { name: name.to_owned(), port: None });
        };
        let core = &self.cores[number];
        let (ports, others) = match input {
            true => (&core.program.inputs, &core.program.outputs),
            false => (&core.program.outputs, &core.program.inputs),
        };
        if let Some(port) = ports.iter().find(|port| port.name == name) {
            return Some(EndPort { name: name.to_owned(), port: Some(port.clone()) });
        }
        let kind = |input| if input { "input" } else { "output" };
        let near = nearest(name, ports.iter().map(|port| port.name.as_str()));
        let mistaken = others.iter().any(|port| port.name == name);
        let listed: Vec<&str> = ports.iter().take(12).map(|port| port.name.as_str()).collect();
        let text = format!("core `{}` has no {} port `{name}`", core.name, kind(input));
        let path = core.path.clone();
        let diagnostic = self.mistakes.add("port", place, text);
        let help = match (mistaken, listed.is_empty()) {
            (true, _) => format!("`{name}` is an {} port of {path}", kind(!input)),
            (false, true) => format!("{path} has no {} port", kind(input)),
            (false, false) => format!("its {} ports: {}", kind(input), listed.join(", ")),
        };
        *diagnostic = diagnostic.clone().help(help).did_you_mean(near);
        None
    }

    /// Records the driver of a core's input port or of an output of the system. Returns false and reports a second driver.
    fn drive(&mut self, end: End, link: Option<&str>, name: &str, place: Range<usize>) -> bool {
        let (key, what) = match (end, link) {
            (End::Core(number), _) => (format!("{}.{name}", self.cores[number].name), "input port"),
            (End::Host, None) => (format!("{HOST}.{name}"), "output of the system"),
            (End::Host, Some(link)) => (format!("{link}.{name}"), "output of the system"),
        };
        if let Some(first) = self.driven.get(&key).cloned() {
            let diagnostic =
                self.mistakes.add("drivers", place, format!("two drivers of the {what} `{key}`"));
            let help = "each port has one driver: leave one of the links out, or give it a port of its own";
            *diagnostic = diagnostic.clone().also(span(first), "the first").help(help);
            return false;
        }
        self.driven.insert(key, place);
        true
    }

    /// Field from port to port, if both exist.
    fn field(
        &mut self,
        (from, from_place): (Option<EndPort>, Range<usize>),
        (to, to_place): (Option<EndPort>, Range<usize>),
        ends: (End, End),
    ) -> Option<Field> {
        let (from, to) = (from?, to?);
        let ty = match (&from.port, &to.port) {
            (Some(from), Some(to)) => {
                let (a, b) = (from.ty, to.ty);
                if a != b && a != Type::B && b != Type::B {
                    let text =
                        format!("`{}` carries {}, `{}` takes {}", from.name, a.name(), to.name, b.name());
                    let help = "declare both ports with the same type, or one of them `:bits`";
                    let diagnostic = self.mistakes.add("type", to_place, text);
                    diagnostic.help = Some(help.to_owned());
                    if span(from_place.clone()) != diagnostic.labels[0].span {
                        *diagnostic = diagnostic.clone().also(span(from_place), "");
                    }
                    return None;
                }
                if a == Type::B { b } else { a }
            }
            (Some(port), None) | (None, Some(port)) => port.ty,
            (None, None) => Type::B,
        };
        let initial = match (&from.port, ends.0) {
            (Some(port), End::Core(number)) => self.cores[number].program.initial(port.register).unwrap_or(0),
            _ => 0,
        };
        let register = |found: &EndPort| found.port.as_ref().map(|port| port.register);
        let (output, input) = (register(&from), register(&to));
        Some(Field { from: from.name, output, to: to.name, input, ty, initial })
    }

    fn latency(&mut self, value: Option<&Spanned<i64>>) -> Option<u64> {
        let Some(value) = value else { return Some(MIN_LATENCY) };
        // A latency of zero is reported later, with the loop that it closes, if any.
        if *value.get_ref() == 0 {
            return Some(0);
        }
        let latency = self.number(value, "a link's latency", MIN_LATENCY, MAX_LATENCY);
        if latency.is_none()
            && let Some(last) = self.mistakes.list.last_mut()
        {
            last.help = Some(LATENCY_HELP.to_owned());
        }
        latency
    }

    fn add(&mut self, link: Link, latency: Option<&Spanned<i64>>) {
        if let Some(latency) = latency.filter(|latency| *latency.get_ref() == 0) {
            self.zero.push((self.links.len(), latency.span()));
        }
        self.links.push(link);
    }

    /// Reports latencies of 0; a loop of such links once, at its first link.
    fn zero_latencies(&mut self) {
        let mut told: Vec<Vec<String>> = Vec::new();
        for (number, place) in std::mem::take(&mut self.zero) {
            let text = match self.closed(&self.links[number]) {
                Some(way) => {
                    let mut cores = way.clone();
                    cores.sort();
                    cores.dedup();
                    if told.contains(&cores) {
                        continue;
                    }
                    told.push(cores);
                    format!("a loop of zero latency: {}", way.join(" -> "))
                }
                None => {
                    format!("a latency of 0: a value takes {MIN_LATENCY} cycles from core to core at least")
                }
            };
            self.mistakes.add("latency", place, text).help = Some(LATENCY_HELP.to_owned());
        }
    }

    /// Cycle of zero-latency links through this link: the cores on the path back from its receiver to its sender.
    fn closed(&self, last: &Link) -> Option<Vec<String>> {
        let mut ways = vec![vec![last.to]];
        let mut seen = vec![last.to];
        while let Some(way) = ways.pop() {
            let here = *way.last()?;
            if here == last.from {
                let name = |end: &End| match end {
                    End::Host => HOST.to_owned(),
                    End::Core(number) => self.cores[*number].name.clone(),
                };
                return Some([last.from].iter().chain(&way).map(name).collect());
            }
            for link in self.links.iter().filter(|link| link.latency == 0 && link.from == here) {
                if link.to == last.from || !seen.contains(&link.to) {
                    seen.push(link.to);
                    ways.push(way.iter().copied().chain([link.to]).collect());
                }
            }
        }
        None
    }

    /// Reports input ports without a driver.
    fn undriven(&mut self, file: &File) {
        for core in &self.cores {
            let free = |port: &&Port| !self.driven.contains_key(&format!("{}.{}", core.name, port.name));
            let free: Vec<&str> =
                core.program.inputs.iter().filter(free).map(|port| port.name.as_str()).collect();
            let Some(first) = free.first() else { continue };
            let Some(table) = file.core.iter().find(|table| *table.name.get_ref() == core.name) else {
                continue;
            };
            let ports = if free.len() == 1 { "input port" } else { "input ports" };
            let text = format!("nothing drives the {ports} {} of core `{}`", free.join(", "), core.name);
            let help =
                format!("`[[wire]]` with `from = \"{HOST}.{first}\"`, `to = \"{}.{first}\"`", core.name);
            self.mistakes.add("port", table.name.span(), text).help = Some(help);
        }
    }
}

const LATENCY_HELP: &str =
    "the cycles from the writeback of a value to the first bundle that reads it: 4 or more";
const _: () = assert!(MIN_LATENCY == 4, "say so in the help");

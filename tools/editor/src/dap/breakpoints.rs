// SPDX-License-Identifier: MIT OR Apache-2.0
//! Breakpoints: the client's requests as stops of the session, with two features that the session lacks: hit counts and log messages.

use super::protocol::{
    Answer, Body, Breakpoint, BreakpointRequest, DataBreakpointInfo, NamedArguments, SetBreakpointsArguments,
    answer,
};
use super::{CORE, DebuggedSession};
use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};
use takt_debug::console::Target;
use takt_debug::session::{BreakpointLocation, Session, Stop, Test};
use takt_debug::system::SystemStop;
use takt_isa::BundleAddress;
use takt_isa::Program;

/// Hit condition: hits of a breakpoint at which the run stops.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Hits {
    /// Every hit from this number on.
    AtLeast(u64),
    /// Only the hit with this number.
    Exactly(u64),
    /// Every hit whose number is a multiple of this one.
    Every(u64),
}

/// A stop that a breakpoint requests.
enum RequestedStop {
    /// A stop in a core's session.
    Core(usize, Stop),
    /// A stop at an event on a link, with its text.
    Link(SystemStop, String),
}

/// Converts a breakpoint of a request to at least one stop, and to the actual line if it is known.
type Make<'m> =
    &'m dyn Fn(&DebuggedSession, &BreakpointRequest) -> Result<(Vec<RequestedStop>, Option<u64>), String>;

impl Hits {
    fn parse(text: &str) -> Result<Hits, String> {
        let text = text.trim();
        let number = |rest: &str| rest.trim().parse::<u64>().ok().filter(|number| *number > 0);
        let hits = match text.split_at(text.find(|c: char| c.is_ascii_digit()).unwrap_or(text.len())) {
            (">=" | ">= ", rest) => number(rest).map(Hits::AtLeast),
            (">" | "> ", rest) => number(rest).map(|number| Hits::AtLeast(number.saturating_add(1))),
            ("==" | "=" | "== " | "= ", rest) => number(rest).map(Hits::Exactly),
            ("%" | "% ", rest) => number(rest).map(Hits::Every),
            ("", rest) => number(rest).map(Hits::AtLeast),
            _ => None,
        };
        hits.ok_or_else(|| format!("`{text}` is not a number of hits: write `5`, `>= 5`, `== 5` or `% 5`"))
    }

    pub(super) fn stops(self, met: u64) -> bool {
        match self {
            Hits::AtLeast(number) => met >= number,
            Hits::Exactly(number) => met == number,
            Hits::Every(number) => met.is_multiple_of(number),
        }
    }
}

/// Features of a stop that the session lacks.
#[derive(Clone, Debug, Default)]
pub(super) struct StopFeatures {
    pub(super) reason: &'static str,
    pub(super) hits: Option<Hits>,
    pub(super) met: u64,
    /// Text to log instead of stopping.
    pub(super) log: Option<String>,
    /// Additional condition of a data breakpoint.
    pub(super) condition: Option<String>,
}

impl StopFeatures {
    /// The additional condition is true or absent.
    pub(super) fn holds(&self, id: u32, session: &Session) -> bool {
        let meets = |condition: &String| session.parse(condition).is_ok_and(|live| session.meets(id, &live));
        self.condition.as_ref().is_none_or(meets)
    }
}

/// Breakpoints, identified by their first stop, in groups that a request replaces as a whole: one group per source or per kind.
#[derive(Debug, Default)]
pub(super) struct Breakpoints {
    /// Stops in each group.
    groups: BTreeMap<String, Vec<u32>>,
    /// Breakpoint that each stop belongs to: a breakpoint in a source of several cores has one stop in each.
    stops: BTreeMap<u32, u32>,
    more: BTreeMap<u32, StopFeatures>,
}

impl Breakpoints {
    /// Breakpoint that a stop belongs to.
    pub(super) fn of(&self, stop: u32) -> u32 {
        self.stops.get(&stop).copied().unwrap_or(stop)
    }

    pub(super) fn more_of(&mut self, stop: u32) -> Option<&mut StopFeatures> {
        self.more.get_mut(&self.stops.get(&stop).copied()?)
    }
}

impl DebuggedSession {
    /// Replaces the breakpoints of a group.
    fn replace(
        &mut self,
        group: String,
        reason: &'static str,
        wanted: Option<Vec<BreakpointRequest>>,
        make: Make<'_>,
    ) -> Answer {
        for stop in self.breakpoints.groups.remove(&group).unwrap_or_default() {
            self.console.remove_stop(stop);
            self.breakpoints.stops.remove(&stop);
            self.breakpoints.more.remove(&stop);
        }
        let mut stops = Vec::new();
        let mut answers = Vec::new();
        for one in wanted.unwrap_or_default() {
            answers.push(match self.add(reason, &one, make) {
                Ok((added, line)) => {
                    let id = added.first().copied();
                    stops.extend(added);
                    Breakpoint { verified: true, id, line, message: None }
                }
                Err(message) => Breakpoint { message: Some(message), ..Breakpoint::default() },
            });
        }
        self.breakpoints.groups.insert(group, stops);
        answer(Body::Breakpoints(answers))
    }

    /// Adds a breakpoint with its stops, and with its actual line if it is known.
    fn add(
        &mut self,
        reason: &'static str,
        one: &BreakpointRequest,
        make: Make<'_>,
    ) -> Result<(Vec<u32>, Option<u64>), String> {
        let (wanted, line) = make(self, one)?;
        let hits = one.hit_condition().map(Hits::parse).transpose()?;
        let log = one.log_message().map(str::to_owned);
        let mut condition = None;
        for wanted in &wanted {
            let RequestedStop::Core(core, stop) = wanted else { continue };
            let session = self.session(*core);
            if let Some(log) = &log {
                check_log(session, log)?;
            }
            if let Stop::Watch { .. } = stop {
                condition = one.condition().filter(|text| test(session, text).is_none());
            }
        }
        let condition = condition.map(str::to_owned);
        let mut stops = Vec::new();
        for wanted in wanted {
            stops.extend(match wanted {
                RequestedStop::Core(core, stop) => Some(self.console.add_stop(core, stop)),
                RequestedStop::Link(stop, text) => self.console.add_link_stop(stop, text),
            });
        }
        if let Some(&first) = stops.first() {
            self.breakpoints.stops.extend(stops.iter().map(|stop| (*stop, first)));
            self.breakpoints.more.insert(first, StopFeatures { reason, hits, met: 0, log, condition });
        }
        Ok((stops, line))
    }

    /// Core and file name of a source, for each core whose program contains it.
    fn files(&self, path: &str, reference: u64) -> Vec<(usize, String)> {
        let cores = || 0..self.console.cores();
        let files = |core: usize| self.session(core).program().files.iter();
        if reference > 0 {
            // A source without a file is matched by name and text.
            let Some(core) = self.checked(reference / CORE) else { return Vec::new() };
            let number = (reference % CORE).wrapping_sub(1);
            let text = |core: usize, number: usize| self.session(core).source(number as u32);
            let Some(name) = files(core).nth(number as usize) else { return Vec::new() };
            let same = |other: usize| {
                let at = files(other).position(|other| other == name)?;
                (text(other, at) == text(core, number as usize)).then(|| (other, name.clone()))
            };
            return cores().filter_map(same).collect();
        }
        let path = Path::new(path);
        let whole = |path: &Path| -> Option<PathBuf> { path.canonicalize().ok() };
        let wanted = whole(path);
        // Sources on this disk are compared as files; others, such as those in an image from elsewhere, by name.
        let on_disk = |core: usize| {
            let is = |name: &&String| wanted.is_some() && whole(&self.folders[core].join(name)) == wanted;
            Some((core, files(core).find(is)?.clone()))
        };
        let found: Vec<(usize, String)> = cores().filter_map(on_disk).collect();
        if !found.is_empty() {
            return found;
        }
        let named = |core: usize| Some((core, file_of(self.session(core).program(), path)?));
        cores().filter_map(named).collect()
    }

    pub(super) fn set_lines(&mut self, arguments: SetBreakpointsArguments, from_one: bool) -> Answer {
        let SetBreakpointsArguments { source, breakpoints } = arguments;
        let path = source.path.or(source.name).ok_or("`source` needs a `path`")?;
        let files = self.files(&path, source.source_reference.unwrap_or(0));
        let make = |debugged: &DebuggedSession, one: &BreakpointRequest| {
            if files.is_empty() {
                let programs = (0..debugged.console.cores()).map(|core| debugged.session(core).program());
                let mut sources: Vec<&str> =
                    programs.flat_map(|program| program.files.iter().map(String::as_str)).collect();
                sources.sort_unstable();
                sources.dedup();
                return Err(format!("no code comes from {path} (sources: {})", sources.join(" ")));
            }
            let asked = one.line.ok_or("a breakpoint needs a `line`")?;
            let line = asked.saturating_add(u64::from(!from_one));
            let stops = files.iter().map(|(core, file)| {
                let session = debugged.session(*core);
                let text = format!("{file}:{line}");
                let at = BreakpointLocation::parse(&text, session.program())?;
                Ok(RequestedStop::Core(*core, break_at(session, at, one, text)?))
            });
            Ok((any(stops)?, Some(asked)))
        };
        self.replace(format!("source {path}"), "breakpoint", breakpoints, &make)
    }

    pub(super) fn set_functions(&mut self, arguments: SetBreakpointsArguments) -> Answer {
        let make = |debugged: &DebuggedSession, one: &BreakpointRequest| {
            let name = one.name.as_deref().ok_or("a breakpoint needs a `name`")?;
            if let Some(stop) = debugged.console.link_stop(name) {
                return Ok((vec![no_condition(stop?, one, name)?], None));
            }
            // `servo.period` names a place in one core; `period`, a place in each core that has it.
            let (cores, place) = match debugged.split(name, '.') {
                Some((core, place)) => (core..core + 1, place),
                None => (0..debugged.console.cores(), name),
            };
            let stops = cores.map(|core| {
                let session = debugged.session(core);
                let at = BreakpointLocation::parse(place, session.program())?;
                Ok(RequestedStop::Core(core, break_at(session, at, one, name.to_owned())?))
            });
            Ok((any(stops)?, None))
        };
        self.replace("functions".to_owned(), "function breakpoint", arguments.breakpoints, &make)
    }

    pub(super) fn set_instructions(&mut self, arguments: SetBreakpointsArguments) -> Answer {
        let make = |debugged: &DebuggedSession, one: &BreakpointRequest| {
            let reference =
                one.instruction_reference.as_deref().ok_or("a breakpoint needs an `instructionReference`")?;
            let (core, address) = debugged
                .address(reference)
                .ok_or_else(|| format!("`{reference}` is not a bundle's address"))?;
            let address = i64::from(address.get()).saturating_add(one.offset.unwrap_or(0));
            let session = debugged.session(core);
            let at = BreakpointLocation::parse(&format!("bundle {address}"), session.program())?;
            let stop = break_at(session, at, one, format!("bundle {address}"))?;
            Ok((vec![RequestedStop::Core(core, stop)], None))
        };
        self.replace("instructions".to_owned(), "instruction breakpoint", arguments.breakpoints, &make)
    }

    /// Tells whether a value can be watched: an expression over a core, or a link.
    pub(super) fn data_info(&mut self, NamedArguments { name, of }: NamedArguments) -> Answer {
        let info = |id: String, conditions: String| {
            let description = format!("{id} ({conditions})");
            DataBreakpointInfo { data_id: Some(id), description, access_types: &["write"], can_persist: true }
        };
        if let Some(Ok(_)) = self.console.link_stop(&format!("link {name}")) {
            let conditions = "condition: an event, as `pushed`; without one, any".to_owned();
            return answer(info(format!("link {name}"), conditions));
        }
        let core = self.core_of(&of)?;
        // Expressions that currently have no value can also be watched.
        if let Err(description) = self.session(core).parse(&name) {
            return answer(DataBreakpointInfo {
                data_id: None,
                description,
                access_types: &[],
                can_persist: false,
            });
        }
        let id = match self.console.target() {
            Target::System => format!("{}:{name}", self.name(core)),
            Target::Program | Target::Board => name,
        };
        answer(info(id, "conditions: `nan`, `subnormal`, `== e`, `> e`, or an expression".to_owned()))
    }

    pub(super) fn set_data(&mut self, arguments: SetBreakpointsArguments) -> Answer {
        let make = |debugged: &DebuggedSession, one: &BreakpointRequest| {
            let name = one.data_id.as_deref().ok_or("a breakpoint needs a `dataId`")?;
            let condition = one.condition();
            if name.starts_with("link ") {
                let text = condition.map_or(name.to_owned(), |event| format!("{name} {event}"));
                let stop = debugged.console.link_stop(&text).ok_or("a program alone has no links")??;
                return Ok((vec![RequestedStop::Link(stop, text)], None));
            }
            let (core, name) = match debugged.split(name, ':') {
                Some(found) => found,
                None => (debugged.console.selected(), name),
            };
            let session = debugged.session(core);
            let what = Box::new(session.parse(name)?);
            let test = match condition.map(|text| test(session, text)) {
                None | Some(None) => Test::Changed,
                Some(Some(test)) => test?,
            };
            if let (Test::Changed, Some(condition)) = (&test, condition) {
                session.parse(condition)?;
            }
            let condition = condition.map_or(String::new(), |condition| format!(" {condition}"));
            let stop = Stop::Watch { what, test, text: format!("{name}{condition}") };
            Ok((vec![RequestedStop::Core(core, stop)], None))
        };
        self.replace("data".to_owned(), "data breakpoint", arguments.breakpoints, &make)
    }
}

/// Collects the stops that can be set; if there are none, returns the first error.
fn any(stops: impl Iterator<Item = Result<RequestedStop, String>>) -> Result<Vec<RequestedStop>, String> {
    let (made, refused): (Vec<_>, Vec<_>) = stops.partition(Result::is_ok);
    match refused.into_iter().next() {
        Some(Err(error)) if made.is_empty() => Err(error),
        _ => Ok(made.into_iter().flatten().collect()),
    }
}

/// Rejects conditions on a link event: there is no core for whose expressions they could be evaluated.
fn no_condition(stop: SystemStop, one: &BreakpointRequest, text: &str) -> Result<RequestedStop, String> {
    match one.condition() {
        Some(_) => Err(
            "a breakpoint on a link cannot have a condition; it can name an event, as `link moves pushed`"
                .to_owned(),
        ),
        None => Ok(RequestedStop::Link(stop, text.to_owned())),
    }
}

/// Parses the test in a data breakpoint's condition; `None` if the condition is an expression.
fn test(session: &Session, condition: &str) -> Option<Result<Test, String>> {
    let with = |rest: &str, make: fn(Box<takt_debug::session::WatchExpression>) -> Test| {
        Some(session.parse(rest).map(|live| make(Box::new(live))))
    };
    match condition {
        "nan" => Some(Ok(Test::Nan)),
        "subnormal" => Some(Ok(Test::Subnormal)),
        _ if condition.starts_with("==") => with(&condition[2..], Test::Equals),
        _ if condition.starts_with('>') && !condition.starts_with(">=") => with(&condition[1..], Test::Above),
        _ => None,
    }
}

fn break_at(
    session: &Session,
    at: BreakpointLocation,
    one: &BreakpointRequest,
    text: String,
) -> Result<Stop, String> {
    let condition = one.condition().map(|condition| session.parse(condition).map(Box::new)).transpose()?;
    Ok(Stop::Break { at, condition, text })
}

/// Name of a file in the program: the longest name that the path ends with.
fn file_of(program: &Program, path: &Path) -> Option<String> {
    let parts: Vec<Component<'_>> = path.components().collect();
    let ends = |name: &&String| {
        let bare = name.trim_start_matches('<').trim_end_matches('>');
        let name: Vec<Component<'_>> =
            Path::new(bare).components().filter(|part| *part != Component::CurDir).collect();
        parts.ends_with(&name)
    };
    program.files.iter().filter(ends).max_by_key(|name| name.len()).cloned()
}

/// Parses a memory reference of a bundle or word, decimal or `0x15`, with the core in the upper 32 bits.
pub(super) fn address(text: &str) -> Option<(u64, BundleAddress)> {
    let text = text.trim();
    let number: u64 = match text.strip_prefix("0x") {
        Some(digits) => u64::from_str_radix(digits, 16).ok()?,
        None => text.parse().ok()?,
    };
    Some((number >> 32, BundleAddress::new(number as u32)))
}

/// Memory reference of an address: the core in the upper 32 bits.
pub(super) fn reference(core: usize, address: u64) -> String {
    format!("0x{:x}", (core as u64) << 32 | address)
}

/// Splits a log message into text and the expressions in braces.
fn pieces(log: &str) -> impl Iterator<Item = Result<&str, &str>> {
    log.split_inclusive(['{', '}']).scan(false, |inside, piece| {
        let is = *inside;
        *inside = piece.ends_with('{');
        let bare = piece.trim_end_matches(['{', '}']);
        Some(if is { Err(bare) } else { Ok(bare) })
    })
}

fn check_log(session: &Session, log: &str) -> Result<(), String> {
    for expression in pieces(log).filter_map(Result::err) {
        session.parse(expression)?;
    }
    Ok(())
}

/// Log message with its expressions evaluated.
pub(super) fn logged(session: &Session, log: &str) -> String {
    let evaluated = |expression: &str| {
        let live = session.parse(expression)?;
        let note = session.note(&live).map_or(String::new(), |note| format!(" ({note})"));
        Ok::<_, String>(format!("{}{note}", session.evaluate(&live)?))
    };
    let value = |expression: &str| match evaluated(expression) {
        Ok(value) => value,
        Err(error) => format!("({})", error.lines().next().unwrap_or("")),
    };
    pieces(log).map(|piece| piece.map_or_else(value, str::to_owned)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hits_are_counted() {
        let stops = |text: &str| -> Vec<u64> {
            let hits = Hits::parse(text).expect("it is one");
            (1..=6).filter(|met| hits.stops(*met)).collect()
        };
        assert_eq!(stops("3"), [3, 4, 5, 6]);
        assert_eq!(stops(">= 3"), [3, 4, 5, 6]);
        assert_eq!(stops("> 3"), [4, 5, 6]);
        assert_eq!(stops("==3"), [3]);
        assert_eq!(stops("% 3"), [3, 6]);
        for wrong in ["", "x", "0", "< 3", "3x", "-3"] {
            assert!(Hits::parse(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn pieces_of_a_log_message() {
        let all: Vec<_> = pieces("x is {x + 1}, y {y}").collect();
        assert_eq!(all, [Ok("x is "), Err("x + 1"), Ok(", y "), Err("y")]);
    }
}

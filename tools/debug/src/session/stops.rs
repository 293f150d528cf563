// SPDX-License-Identifier: MIT OR Apache-2.0
//! Breakpoints and watchpoints.

use super::expression::{self, Live, Reads};
use super::{Session, Why};
use std::sync::Arc;
use takt_asm::expr::Value;
use takt_isa::program::{Location, Space};
use takt_isa::timing::Cycle;
use takt_isa::{BundleAddress, Program};

/// The place where a breakpoint stops.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Where {
    /// The position where this bundle is about to issue.
    Bundle(BundleAddress),
    /// The position where a bundle with an operation of this line is about to issue; these have one. A line of a macro
    /// or a repetition has several.
    Line(Location, Vec<BundleAddress>),
    /// When so many cycles have passed.
    Cycle(Cycle),
    /// When so many periods have ended.
    Period(u64),
}

/// The test of a watchpoint: it holds, and did not hold the cycle before.
#[derive(Clone, Debug)]
pub enum Test {
    /// The value is another.
    Changed,
    /// It equals another.
    Equals(Box<Live>),
    /// It is above another.
    Above(Box<Live>),
    /// It is a NaN.
    Nan,
    /// It is a subnormal number.
    Subnormal,
}

/// A breakpoint or watchpoint.
#[derive(Clone, Debug)]
pub enum Stop {
    /// Stops at a place, if the condition, if any, holds.
    Break {
        /// The place.
        at: Where,
        /// The condition.
        condition: Option<Box<Live>>,
        /// As the user wrote it.
        text: String,
    },
    /// Stops when a value becomes what is waited for.
    Watch {
        /// The value.
        what: Box<Live>,
        /// The test.
        test: Test,
        /// As the user wrote it.
        text: String,
    },
}

impl Stop {
    /// As the user wrote it.
    pub fn text(&self) -> &str {
        match self {
            Stop::Break { text, .. } | Stop::Watch { text, .. } => text,
        }
    }

    /// Adds what its expressions read.
    pub(super) fn reads(&self, reads: &mut Reads) {
        match self {
            Stop::Break { condition, .. } => condition.iter().for_each(|condition| condition.reads(reads)),
            Stop::Watch { what, test, .. } => {
                what.reads(reads);
                if let Test::Equals(other) | Test::Above(other) = test {
                    other.reads(reads);
                }
            }
        }
    }
}

impl Where {
    /// The place that a text names: `label`, `label+2`, `file.s:12` or `:12`, `bundle 3`, `cycle 100`, `period 5`.
    ///
    /// # Errors
    /// If something is wrong with it.
    pub fn parse(text: &str, program: &Program) -> Result<Where, String> {
        let text = text.trim();
        let number = |rest: &str, what: &str| {
            rest.trim().parse::<u64>().map_err(|_| format!("`{}` is no number of a {what}", rest.trim()))
        };
        let known = ["bundle", "cycle", "period"];
        if let Some((word, rest)) = text.split_once(' ').filter(|(word, _)| known.contains(word)) {
            let number = number(rest, word)?;
            return match word {
                "cycle" => Ok(Where::Cycle(number)),
                "period" => Ok(Where::Period(number)),
                _ => bundle(number, program),
            };
        }
        if let Some((file, line)) = text.rsplit_once(':') {
            return line_bundles(file, number(line, "line")?, program);
        }
        if let Ok(number) = text.parse() {
            return bundle(number, program);
        }
        if let Some(address) = expression::code_address(text, program) {
            return bundle(address.into(), program);
        }
        let labels = program.symbols.iter().filter(|symbol| symbol.space == Space::Code);
        let near = takt_asm::nearest(text, labels.map(|symbol| symbol.name.as_str()));
        let near = near.map_or(String::new(), |near| format!("; did you mean `{near}`?"));
        Err(format!(
            "no label is named `{text}`{near} (places: label, label+2, file.s:12, :12, bundle 3, cycle 100, period 5)"
        ))
    }
}

fn bundle(number: u64, program: &Program) -> Result<Where, String> {
    let bundles = program.bundles();
    let address = u32::try_from(number).ok().filter(|address| *address < bundles);
    address
        .map(|address| Where::Bundle(BundleAddress::new(address)))
        .ok_or_else(|| format!("bundle {number}: the program has bundles 0 to {}", bundles - 1))
}

/// The bundles with an operation of a source line, ascending.
fn line_bundles(file: &str, line: u64, program: &Program) -> Result<Where, String> {
    let names = || program.files.iter().map(String::as_str);
    // A file by its name alone, whichever folder or library it is of.
    let alone =
        |name: &str| name.trim_start_matches('<').trim_end_matches('>').rsplit('/').next() == Some(file);
    let ends = |name: &str| name == file || alone(name);
    let file = if file.is_empty() { Some(0) } else { names().position(ends) };
    let Some(file) = file else {
        return Err(format!("no such source (sources: {})", names().collect::<Vec<_>>().join(" ")));
    };
    let places = || {
        let places = program.addresses().flat_map(|address| {
            program.locations(address).iter().flatten().map(move |location| (address, *location))
        });
        places.filter(|(_, location)| location.file as usize == file)
    };
    let mut of_line = places().filter(|(_, place)| u64::from(place.line) == line).peekable();
    if let Some(&(_, place)) = of_line.peek() {
        let mut bundles: Vec<BundleAddress> = of_line.map(|(address, _)| address).collect();
        bundles.dedup();
        return Ok(Where::Line(place, bundles));
    }
    let next = places().map(|(_, location)| location.line).filter(|next| u64::from(*next) > line).min();
    let next = next.map_or(String::new(), |next| format!("; the next line with one is {next}"));
    Err(format!("line {line} of {} has no instruction{next}", program.files[file]))
}

/// Sees from position to position whether there is a reason to stop.
///
/// A value that is not there everywhere, because it shares its register or is one of several of its name, is compared with
/// what it was where it was there last. That may be long before the position at which a search begins; a watcher that does
/// not know yet is not complete, and [`Session::watcher`] completes it.
#[derive(Clone)]
pub(super) struct Watcher {
    /// For each stop, its number and what it watches, in each of the ways in which its names can be read.
    watched: Vec<(u32, Vec<Watched>)>,
}

/// A watched value and what it was where it was there last; `None`: that is not known, or it was not there yet.
#[derive(Clone)]
struct Watched {
    live: Arc<Live>,
    last: Option<Seen>,
}

/// A watched value and whether it was as waited for.
#[derive(Clone, Copy, Default)]
struct Seen {
    value: Option<Value>,
    is: bool,
}

impl Watcher {
    /// One that knows what there is to see where the session looks now.
    pub(super) fn new(session: &Session) -> Watcher {
        let each = |stop: &Stop| match stop {
            Stop::Break { .. } => Vec::new(),
            Stop::Watch { what, .. } => {
                let each = what.each().into_iter();
                each.map(|live| Watched { live: Arc::new(live), last: None }).collect()
            }
        };
        let watched = session.stops.iter().map(|(id, stop)| (*id, each(stop))).collect();
        let mut watcher = Watcher { watched };
        watcher.visit(session, None);
        watcher
    }

    /// True if it knows each value as it was last.
    pub(super) fn is_complete(&self) -> bool {
        self.watched.iter().flat_map(|(_, each)| each).all(|watched| watched.last.is_some())
    }

    /// True if it is one for the session's stops as they are now.
    pub(super) fn is_of(&self, session: &Session) -> bool {
        self.watched.iter().map(|(id, _)| id).eq(session.stops.iter().map(|(id, _)| id))
    }

    /// Takes from a watcher of an earlier position what this one does not know.
    pub(super) fn complete(&mut self, earlier: &Watcher) {
        for (id, each) in &mut self.watched {
            let Some((_, known)) = earlier.watched.iter().find(|(known, _)| known == id) else { continue };
            for (watched, known) in each.iter_mut().zip(known) {
                watched.last = watched.last.or(known.last);
            }
        }
    }

    pub(super) fn visit(&mut self, session: &Session, issuing: Option<BundleAddress>) -> Option<Why> {
        let mut why = None;
        for ((id, stop), (_, each)) in session.stops.iter().zip(&mut self.watched) {
            match stop {
                Stop::Break { at, condition, text } => {
                    let here = match at {
                        Where::Bundle(address) => issuing == Some(*address),
                        Where::Line(_, bundles) => issuing.is_some_and(|address| bundles.contains(&address)),
                        Where::Cycle(cycle) => session.cycle() == *cycle,
                        Where::Period(period) => session.core.boundary && session.period() == *period,
                    };
                    if here
                        && why.is_none()
                        && condition.as_ref().is_none_or(|condition| match at {
                            Where::Line(line, _) => session.holds_at(*line, condition),
                            _ => session.holds(condition),
                        })
                    {
                        why = Some(Why::Stop { id: *id, text: text.clone(), change: None });
                    }
                }
                Stop::Watch { test, text, .. } => {
                    for Watched { live, last } in each {
                        // That it is not there is no change.
                        let Some(now) = see(session, live, test) else { continue };
                        let before = last.replace(now).unwrap_or_default();
                        let hit = match test {
                            Test::Changed => !same(before.value, now.value),
                            _ => now.is && !before.is,
                        };
                        if hit && why.is_none() {
                            let change = Some((shown(before.value), shown(now.value)));
                            let label = live.held().map_or(String::new(), |label| format!(" ({label})"));
                            why = Some(Why::Stop { id: *id, text: format!("{text}{label}"), change });
                        }
                    }
                }
            }
        }
        why
    }
}

/// Bit for bit: a NaN is the same as itself, the two zeros are not.
fn same(a: Option<Value>, b: Option<Value>) -> bool {
    let bits = |value: Option<Value>| match value {
        None => (0, 0),
        Some(Value::Int(value)) => (1, value.cast_unsigned()),
        Some(Value::Real(value)) => (2, value.to_bits()),
    };
    bits(a) == bits(b)
}

/// A value in the fewest digits that tell it from its neighbours.
fn shown(value: Option<Value>) -> String {
    match value {
        None => "(no value)".to_owned(),
        Some(Value::Int(value)) => value.to_string(),
        Some(Value::Real(value)) if f64::from(value as f32) == value => format!("{:?}", value as f32),
        Some(Value::Real(value)) => format!("{value:?}"),
    }
}

/// The visible state of a value; `None` if it, or the value that it is compared with, is not there.
fn see(session: &Session, what: &Live, test: &Test) -> Option<Seen> {
    let compared = match test {
        Test::Equals(other) | Test::Above(other) => Some(&**other),
        Test::Changed | Test::Nan | Test::Subnormal => None,
    };
    if !session.is_there(what) || !compared.is_none_or(|other| session.is_there(other)) {
        return None;
    }
    let value = session.evaluate(what).ok();
    let real = value.map(Value::real);
    let other = |live: &Live| session.evaluate(live).ok().map(Value::real);
    let is = match test {
        Test::Changed => false,
        Test::Equals(live) => real.is_some() && real == other(live),
        Test::Above(live) => real.zip(other(live)).is_some_and(|(value, other)| value > other),
        Test::Nan => real.is_some_and(f64::is_nan),
        Test::Subnormal => real.is_some_and(|value| (value as f32).is_subnormal()),
    };
    Some(Seen { value, is })
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Breakpoints and watchpoints of a session, and the watcher that tests them.

use super::expression::{self, ReadSet, WatchExpression};
use super::{Session, StopReason};
use std::sync::Arc;
use takt_asm::expr::Value;
use takt_isa::program::{Location, Space};
use takt_isa::timing::Cycle;
use takt_isa::{BundleAddress, Program};

/// Place of a breakpoint: in the program, or in the time of the run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BreakpointLocation {
    /// Just before this bundle issues.
    Bundle(BundleAddress),
    /// Just before a bundle with an operation of this line issues. A line of a macro or a repetition has several bundles.
    Line(Location, Vec<BundleAddress>),
    /// A number of cycles since reset.
    Cycle(Cycle),
    /// A number of completed periods.
    Period(u64),
}

/// Condition of a watchpoint, which triggers when the condition becomes true.
#[derive(Clone, Debug)]
pub enum Test {
    /// The value differs from the previous one.
    Changed,
    /// The value equals that of another expression.
    Equals(Box<WatchExpression>),
    /// The value is above that of another expression.
    Above(Box<WatchExpression>),
    /// The value is a NaN.
    Nan,
    /// The value is a subnormal number.
    Subnormal,
}

/// A breakpoint or a watchpoint.
#[derive(Clone, Debug)]
pub enum Stop {
    /// Stops at a place, if the condition holds or is absent.
    Break {
        /// Place in the program or time in the run.
        at: BreakpointLocation,
        /// Expression that must be nonzero at the place.
        condition: Option<Box<WatchExpression>>,
        /// Text of the breakpoint, as the user wrote it.
        text: String,
    },
    /// Stops when the test becomes true for a value.
    Watch {
        /// Expression whose value is tested.
        what: Box<WatchExpression>,
        /// Test of the expression's value.
        test: Test,
        /// Text of the watchpoint, as the user wrote it.
        text: String,
    },
}

impl Stop {
    /// Text of the stop, as the user wrote it.
    pub fn text(&self) -> &str {
        match self {
            Stop::Break { text, .. } | Stop::Watch { text, .. } => text,
        }
    }

    /// Adds the registers and memory that the stop's expressions read.
    pub(super) fn reads(&self, reads: &mut ReadSet) {
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

impl BreakpointLocation {
    /// The session is at this location, where `issuing` is about to issue.
    fn is_here(&self, session: &Session, issuing: Option<BundleAddress>) -> bool {
        match self {
            BreakpointLocation::Bundle(address) => issuing == Some(*address),
            BreakpointLocation::Line(_, bundles) => issuing.is_some_and(|address| bundles.contains(&address)),
            BreakpointLocation::Cycle(cycle) => session.cycle() == *cycle,
            BreakpointLocation::Period(period) => session.core.boundary && session.period() == *period,
        }
    }

    /// Parses a location: `label`, `label+2`, `file.s:12` or `:12`, `bundle 3`, `cycle 100`, `period 5`.
    ///
    /// # Errors
    /// If the text is not a location in this program.
    pub fn parse(text: &str, program: &Program) -> Result<BreakpointLocation, String> {
        let text = text.trim();
        let number = |rest: &str, what: &str| {
            rest.trim().parse::<u64>().map_err(|_| format!("`{}` is not the number of a {what}", rest.trim()))
        };
        let known = ["bundle", "cycle", "period"];
        if let Some((word, rest)) = text.split_once(' ').filter(|(word, _)| known.contains(word)) {
            let number = number(rest, word)?;
            return match word {
                "cycle" => Ok(BreakpointLocation::Cycle(number)),
                "period" => Ok(BreakpointLocation::Period(number)),
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

fn bundle(number: u64, program: &Program) -> Result<BreakpointLocation, String> {
    let bundles = program.bundles();
    let address = u32::try_from(number).ok().filter(|address| *address < bundles);
    address
        .map(|address| BreakpointLocation::Bundle(BundleAddress::new(address)))
        .ok_or_else(|| format!("bundle {number}: the program has bundles 0 to {}", bundles - 1))
}

/// Bundles with an operation of a source line, ascending.
fn line_bundles(file: &str, line: u64, program: &Program) -> Result<BreakpointLocation, String> {
    let names = || program.files.iter().map(String::as_str);
    // Match the file name alone, in any folder or library.
    let alone =
        |name: &str| name.trim_start_matches('<').trim_end_matches('>').rsplit('/').next() == Some(file);
    let ends = |name: &str| name == file || alone(name);
    let file = if file.is_empty() { Some(0) } else { names().position(ends) };
    let Some(file) = file else {
        return Err(format!("no such source (sources: {})", names().collect::<Vec<_>>().join(" ")));
    };
    // A line of another language is where its translation is.
    let of_file = |location: &Location| {
        let both = [Some(*location), program.origin(*location)];
        both.into_iter().flatten().find(|place| place.file as usize == file)
    };
    let places = || {
        program.addresses().flat_map(|address| {
            let places = program.locations(address).iter().flatten().filter_map(of_file);
            places.map(move |place| (address, place))
        })
    };
    let mut of_line = places().filter(|(_, place)| u64::from(place.line) == line).peekable();
    if let Some(&(_, place)) = of_line.peek() {
        let mut bundles: Vec<BundleAddress> = of_line.map(|(address, _)| address).collect();
        bundles.dedup();
        return Ok(BreakpointLocation::Line(place, bundles));
    }
    let next = places().map(|(_, location)| location.line).filter(|next| u64::from(*next) > line).min();
    let next = next.map_or(String::new(), |next| format!("; the next line with one is {next}"));
    Err(format!("line {line} of {} has no instruction{next}", program.files[file]))
}

/// Tests the stops at each position.
///
/// A value that is only temporarily in its register (shared register, or one of several values of a name) is compared with its last
/// occurrence, possibly long before the start of the search. A watcher with unknown previous values is incomplete; [`Session::watcher`]
/// completes it.
#[derive(Clone)]
pub(super) struct Watcher {
    /// Stops with watched expressions: number, and all variants of the expression.
    watched: Vec<(u32, Vec<Watchpoint>)>,
}

/// Watched expression with its last known value; `None` before the first value, or if the value is unknown.
#[derive(Clone)]
struct Watchpoint {
    live: Arc<WatchExpression>,
    last: Option<WatchState>,
}

/// State of a watched expression: value, and outcome of the test.
#[derive(Clone, Copy, Default)]
struct WatchState {
    value: Option<Value>,
    is: bool,
}

impl Watcher {
    /// A watcher that takes the values at the session's position as previous values.
    pub(super) fn new(session: &Session) -> Watcher {
        let each = |stop: &Stop| match stop {
            Stop::Break { .. } => Vec::new(),
            Stop::Watch { what, .. } => {
                let each = what.each().into_iter();
                each.map(|live| Watchpoint { live: Arc::new(live), last: None }).collect()
            }
        };
        let watched = session.stops.iter().map(|(id, stop)| (*id, each(stop))).collect();
        let mut watcher = Watcher { watched };
        watcher.visit(session, None);
        watcher
    }

    /// The last value of each watched expression is known.
    pub(super) fn is_complete(&self) -> bool {
        self.watched.iter().flat_map(|(_, each)| each).all(|watched| watched.last.is_some())
    }

    /// The watcher is for the session's current stops.
    pub(super) fn is_of(&self, session: &Session) -> bool {
        self.watched.iter().map(|(id, _)| id).eq(session.stops.iter().map(|(id, _)| id))
    }

    /// Copies missing previous values from a watcher at an earlier position.
    pub(super) fn complete(&mut self, earlier: &Watcher) {
        for (id, each) in &mut self.watched {
            let Some((_, known)) = earlier.watched.iter().find(|(known, _)| known == id) else { continue };
            for (watched, known) in each.iter_mut().zip(known) {
                watched.last = watched.last.or(known.last);
            }
        }
    }

    pub(super) fn visit(&mut self, session: &Session, issuing: Option<BundleAddress>) -> Option<StopReason> {
        let mut why = None;
        for ((id, stop), (_, each)) in session.stops.iter().zip(&mut self.watched) {
            match stop {
                Stop::Break { at, condition, text } => {
                    if why.is_none()
                        && at.is_here(session, issuing)
                        && let Some(note) = passes_condition(session, *id, at, condition.as_deref())
                    {
                        why = Some(StopReason::Stop { id: *id, text: format!("{text}{note}"), change: None });
                    }
                }
                Stop::Watch { test, text, .. } => {
                    for Watchpoint { live, last } in each {
                        // A missing value is not a change.
                        let Some(now) = see(session, live, test) else { continue };
                        let before = last.replace(now).unwrap_or_default();
                        let hit = match test {
                            Test::Changed => !same(before.value, now.value),
                            _ => now.is && !before.is,
                        };
                        if hit && why.is_none() {
                            let change = Some((shortest_decimal(before.value), shortest_decimal(now.value)));
                            let label = live.held().map_or(String::new(), |label| format!(" ({label})"));
                            let other = match test {
                                Test::Equals(other) | Test::Above(other) => session.note(other),
                                Test::Changed | Test::Nan | Test::Subnormal => None,
                            };
                            let note = noted(session.note(live).or(other));
                            why = Some(StopReason::Stop {
                                id: *id,
                                text: format!("{text}{label}{note}"),
                                change,
                            });
                        }
                    }
                }
            }
        }
        why
    }
}

/// Checks a breakpoint's condition; if it holds or is absent, returns the note to print.
fn passes_condition(
    session: &Session,
    id: u32,
    at: &BreakpointLocation,
    condition: Option<&WatchExpression>,
) -> Option<String> {
    let Some(condition) = condition else { return Some(String::new()) };
    let line = if let BreakpointLocation::Line(line, _) = at { Some(*line) } else { None };
    let (holds, doubt) = session.judge(line, condition);
    if !holds {
        session.remember(id, doubt);
        return None;
    }
    Some(noted(doubt))
}

/// A note in parentheses, to append to other text.
pub(crate) fn noted(note: Option<String>) -> String {
    note.map_or(String::new(), |note| format!("  ({note})"))
}

/// Bitwise comparison: a NaN equals itself, the two zeros differ.
fn same(a: Option<Value>, b: Option<Value>) -> bool {
    let bits = |value: Option<Value>| match value {
        None => (0, 0),
        Some(Value::Int(value)) => (1, value.cast_unsigned()),
        Some(Value::Real(value)) => (2, value.to_bits()),
    };
    bits(a) == bits(b)
}

/// Shortest decimal that identifies a value in its format.
fn shortest_decimal(value: Option<Value>) -> String {
    match value {
        None => "(no value)".to_owned(),
        Some(Value::Int(value)) => value.to_string(),
        Some(Value::Real(value)) if f64::from(value as f32) == value => format!("{:?}", value as f32),
        Some(Value::Real(value)) => format!("{value:?}"),
    }
}

/// State of a watched expression; `None` if an operand of the expression or of the comparison is not in its register.
fn see(session: &Session, what: &WatchExpression, test: &Test) -> Option<WatchState> {
    let compared = match test {
        Test::Equals(other) | Test::Above(other) => Some(&**other),
        Test::Changed | Test::Nan | Test::Subnormal => None,
    };
    if !session.is_there(what) || !compared.is_none_or(|other| session.is_there(other)) {
        return None;
    }
    let value = session.evaluate(what).ok();
    let real = value.map(Value::real);
    let other = |live: &WatchExpression| session.evaluate(live).ok().map(Value::real);
    let is = match test {
        Test::Changed => false,
        Test::Equals(live) => real.is_some() && real == other(live),
        Test::Above(live) => real.zip(other(live)).is_some_and(|(value, other)| value > other),
        Test::Nan => real.is_some_and(f64::is_nan),
        Test::Subnormal => real.is_some_and(|value| (value as f32).is_subnormal()),
    };
    Some(WatchState { value, is })
}

//! Breakpoints: what the client asks for as stops of the session, and what the session does not know of: how often one must be
//! met, and what it logs.

use crate::dap::{Answer, Debugged, text};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Component, Path};
use takt_debug::session::{Session, Stop, Test, Where};
use takt_isa::BundleAddress;
use takt_isa::Program;

/// When a breakpoint that is met stops.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Hits {
    /// From so many times on.
    AtLeast(u64),
    /// At so many times only.
    Exactly(u64),
    /// Every so many times.
    Every(u64),
}

/// What makes a stop of a request's entry, and what the answer says of it.
type Make<'m> = &'m dyn Fn(&Session, &Value) -> Result<(Stop, Option<Value>), String>;

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
        hits.ok_or_else(|| format!("`{text}` is no number of hits: write `5`, `>= 5`, `== 5` or `% 5`"))
    }

    pub(super) fn stops(self, met: u64) -> bool {
        match self {
            Hits::AtLeast(number) => met >= number,
            Hits::Exactly(number) => met == number,
            Hits::Every(number) => met.is_multiple_of(number),
        }
    }
}

/// What the session does not know of a stop.
#[derive(Clone, Debug, Default)]
pub(super) struct More {
    pub(super) reason: &'static str,
    pub(super) hits: Option<Hits>,
    pub(super) met: u64,
    /// What is logged, in place of stopping.
    pub(super) log: Option<String>,
    /// Of a data breakpoint: what must hold besides.
    pub(super) condition: Option<String>,
}

impl More {
    /// Whether what must hold besides does.
    pub(super) fn holds(&self, session: &Session) -> bool {
        let value = |condition: &String| session.parse(condition).and_then(|live| session.evaluate(&live));
        self.condition.as_ref().is_none_or(|condition| value(condition).is_ok_and(|value| !value.is_zero()))
    }
}

/// The breakpoints by number, and which of them were asked for together: those of one source, or of one kind.
#[derive(Debug, Default)]
pub(super) struct Breakpoints {
    groups: BTreeMap<String, Vec<u32>>,
    pub(super) more: BTreeMap<u32, More>,
}

impl Debugged {
    /// Replaces the breakpoints of a group.
    fn replace(&mut self, group: String, reason: &'static str, wanted: &Value, make: Make<'_>) -> Answer {
        let wanted = wanted.as_array().cloned().unwrap_or_default();
        for id in self.breakpoints.groups.remove(&group).unwrap_or_default() {
            self.session().remove_stop(id);
            self.breakpoints.more.remove(&id);
        }
        let mut ids = Vec::new();
        let mut answers = Vec::new();
        for one in &wanted {
            let string = |name: &str| one[name].as_str().map(str::trim).filter(|text| !text.is_empty());
            let made = make(&self.console.session, one).and_then(|made| {
                let hits = string("hitCondition").map(Hits::parse).transpose()?;
                let log = string("logMessage").map(str::to_owned);
                if let Some(log) = &log {
                    check_log(&self.console.session, log)?;
                }
                Ok((made, hits, log))
            });
            answers.push(match made {
                Ok(((stop, place), hits, log)) => {
                    let condition = match &stop {
                        Stop::Watch { .. } => {
                            string("condition").filter(|text| test(&self.console.session, text).is_none())
                        }
                        Stop::Break { .. } => None,
                    };
                    let condition = condition.map(str::to_owned);
                    let id = self.session().add_stop(stop);
                    ids.push(id);
                    self.breakpoints.more.insert(id, More { reason, hits, met: 0, log, condition });
                    let mut answer = place.unwrap_or_else(|| json!({}));
                    answer["id"] = id.into();
                    answer["verified"] = true.into();
                    answer
                }
                Err(message) => json!({ "verified": false, "message": message }),
            });
        }
        self.breakpoints.groups.insert(group, ids);
        Ok(json!({ "breakpoints": answers }))
    }

    pub(super) fn set_lines(&mut self, arguments: &Value, from_one: bool) -> Answer {
        let source = &arguments["source"];
        let path =
            source["path"].as_str().or(source["name"].as_str()).ok_or("`source` has a `path`")?.to_owned();
        let number = source["sourceReference"].as_u64().filter(|number| *number > 0);
        let file = match number {
            Some(number) => self.session().program().files.get(number as usize - 1).cloned(),
            None => file_of(self.session().program(), Path::new(&path)),
        };
        let make = |session: &Session, one: &Value| {
            let Some(file) = &file else {
                let sources = session.program().files.join(" ");
                return Err(format!("no code of the program comes from {path} (sources: {sources})"));
            };
            let line = one["line"].as_u64().ok_or("a breakpoint has a `line`")? + u64::from(!from_one);
            let at = Where::parse(&format!("{file}:{line}"), session.program())?;
            let place = json!({ "line": line - u64::from(!from_one) });
            Ok((break_at(session, at, one, format!("{file}:{line}"))?, Some(place)))
        };
        self.replace(format!("source {path}"), "breakpoint", &arguments["breakpoints"], &make)
    }

    pub(super) fn set_functions(&mut self, arguments: &Value) -> Answer {
        let make = |session: &Session, one: &Value| {
            let name = text(one, "name")?;
            Ok((break_at(session, Where::parse(name, session.program())?, one, name.to_owned())?, None))
        };
        self.replace("functions".to_owned(), "function breakpoint", &arguments["breakpoints"], &make)
    }

    pub(super) fn set_instructions(&mut self, arguments: &Value) -> Answer {
        let make = |session: &Session, one: &Value| {
            let reference = text(one, "instructionReference")?;
            let address =
                address(reference).ok_or_else(|| format!("`{reference}` is no bundle's address"))?;
            let address = i64::from(address.get()) + one["offset"].as_i64().unwrap_or(0);
            let at = Where::parse(&format!("bundle {address}"), session.program())?;
            Ok((break_at(session, at, one, format!("bundle {address}"))?, None))
        };
        self.replace("instructions".to_owned(), "instruction breakpoint", &arguments["breakpoints"], &make)
    }

    pub(super) fn data_info(&mut self, arguments: &Value) -> Answer {
        let name = text(arguments, "name")?;
        let session = self.session();
        match session
            .parse(name)
            .and_then(|live| session.evaluate(&live).map(|_| live).or_else(|_| session.parse(name)))
        {
            Ok(_) => Ok(json!({
                "dataId": name,
                "description": format!("{name} (conditions: `nan`, `subnormal`, `== e`, `> e`, or an expression)"),
                "accessTypes": ["write"],
                "canPersist": true,
            })),
            Err(message) => Ok(json!({ "dataId": null, "description": message })),
        }
    }

    pub(super) fn set_data(&mut self, arguments: &Value) -> Answer {
        let make = |session: &Session, one: &Value| {
            let name = text(one, "dataId")?;
            let what = Box::new(session.parse(name)?);
            let condition = one["condition"].as_str().map(str::trim).filter(|text| !text.is_empty());
            let test = match condition.map(|text| test(session, text)) {
                None | Some(None) => Test::Changed,
                Some(Some(test)) => test?,
            };
            if let (Test::Changed, Some(condition)) = (&test, condition) {
                session.parse(condition)?;
            }
            let condition = condition.map_or(String::new(), |condition| format!(" {condition}"));
            Ok((Stop::Watch { what, test, text: format!("{name}{condition}") }, None))
        };
        self.replace("data".to_owned(), "data breakpoint", &arguments["breakpoints"], &make)
    }
}

/// What a data breakpoint's condition waits for, if it is no expression.
fn test(session: &Session, condition: &str) -> Option<Result<Test, String>> {
    let with = |rest: &str, make: fn(Box<takt_debug::session::Live>) -> Test| {
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

fn break_at(session: &Session, at: Where, one: &Value, text: String) -> Result<Stop, String> {
    let condition = one["condition"].as_str().map(str::trim).filter(|condition| !condition.is_empty());
    let condition = condition.map(|condition| session.parse(condition).map(Box::new)).transpose()?;
    Ok(Stop::Break { at, condition, text })
}

/// The program's name for a file: the longest that the path ends with.
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

/// A bundle's address as `instructionReference` has it: decimal or `0x15`.
pub(super) fn address(text: &str) -> Option<BundleAddress> {
    let text = text.trim();
    let number = match text.strip_prefix("0x") {
        Some(digits) => u32::from_str_radix(digits, 16).ok(),
        None => text.parse().ok(),
    };
    number.map(BundleAddress::new)
}

/// The pieces of a log message: text, and expressions in braces.
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

/// A log message with its values.
pub(super) fn logged(session: &Session, log: &str) -> String {
    let value = |expression: &str| match session.parse(expression).and_then(|live| session.evaluate(&live)) {
        Ok(value) => value.to_string(),
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

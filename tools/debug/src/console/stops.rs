// SPDX-License-Identifier: MIT OR Apache-2.0
//! Console commands for breakpoints and watchpoints.

use super::table::inside;
use super::{Console, Engine};
use crate::info;
use crate::session::{BreakpointLocation, Session, Stop, Test};
use crate::system::SystemStop;
use crate::target::Target;

impl Console {
    // ---- For editors: stops as plain data.

    /// Adds a stop of a core; returns its number, unique in the console.
    pub fn add_stop(&mut self, core: usize, stop: Stop) -> u32 {
        let next = self.next_stop();
        let session = &mut self.cores[core].session;
        *session.next_stop() = next;
        session.add_stop(stop)
    }

    /// Parses `link NAME [EVENT]`; `None` for any other text, or without a system.
    pub fn link_stop(&self, text: &str) -> Option<Result<SystemStop, String>> {
        SystemStop::parse(text, self.system()?.system().description())
    }

    /// Adds a stop at an event on a link; returns its number, or `None` without a system.
    pub fn add_link_stop(&mut self, stop: SystemStop, text: String) -> Option<u32> {
        let next = self.next_stop();
        let Engine::System(system) = &mut self.engine else { return None };
        *system.next_stop() = next;
        Some(system.add_stop(stop, text))
    }

    /// Next stop number, counted over links and all cores' sessions together.
    fn next_stop(&mut self) -> u32 {
        let links = match &mut self.engine {
            Engine::System(system) => *system.next_stop(),
            Engine::Program | Engine::Board(_) => 0,
        };
        self.cores.iter_mut().fold(links, |next, core| next.max(*core.session.next_stop()))
    }

    /// Removes a stop of a link or of a core; returns whether it existed.
    pub fn remove_stop(&mut self, id: u32) -> bool {
        let of_link = match &mut self.engine {
            Engine::System(system) => system.remove_stop(id),
            Engine::Program | Engine::Board(_) => false,
        };
        of_link || self.cores.iter_mut().any(|core| core.session.remove_stop(id))
    }

    /// Numbers and texts of all stops, in order of number.
    fn all_stops(&self) -> Vec<(u32, String)> {
        let links = self.system().into_iter().flat_map(|system| system.stops());
        let mut stops: Vec<(u32, String)> = links.map(|(id, text)| (id, text.to_owned())).collect();
        for (number, core) in self.cores.iter().enumerate() {
            let of = match self.target() {
                Target::System => format!(" of core {}", self.name(number)),
                Target::Program | Target::Board => String::new(),
            };
            let text = |stop: &Stop| match stop {
                Stop::Break { at: BreakpointLocation::Line(_, bundles), text, .. } if bundles.len() > 1 => {
                    format!("{text}{of}  ({} places)", bundles.len())
                }
                Stop::Break { text, .. } | Stop::Watch { text, .. } => format!("{text}{of}"),
            };
            stops.extend(core.session.stops().iter().map(|(id, stop)| (*id, text(stop))));
        }
        stops.sort();
        stops
    }

    // ---- For the command line.

    pub(super) fn add_break(&mut self, arguments: &str) -> Result<String, String> {
        let text = format!("break {arguments}");
        if let Some(stop) = self.link_stop(arguments) {
            let id = self.add_link_stop(stop?, text.clone()).unwrap_or_default();
            return Ok(format!("stop {id}: {text}\n"));
        }
        let (place, condition) = match arguments.split_once(" if ") {
            Some((place, condition)) => (place, Some(Box::new(self.session().parse(condition)?))),
            None => (arguments, None),
        };
        let program = self.session().program();
        let at = BreakpointLocation::parse(place, program)?;
        if self.target() == Target::Board && !matches!(at, BreakpointLocation::Period(_)) {
            return Err(inside(&format!("break {place}")));
        }
        let places = info::places(program, &at);
        let id = self.add_stop(self.selected, Stop::Break { at, condition, text });
        Ok(format!("stop {id} at {places}\n"))
    }

    pub(super) fn add_watch(&mut self, arguments: &str) -> Result<String, String> {
        let (what, test) = watched(arguments, self.session())?;
        let what = self.session().parse(what)?;
        what.variants()?;
        let now = self.inspector().short(&what);
        let stop = Stop::Watch { what: Box::new(what), test, text: format!("watch {arguments}") };
        let id = self.add_stop(self.selected, stop);
        Ok(format!("stop {id}; now {now}\n"))
    }

    pub(super) fn delete(&mut self, arguments: &str) -> Result<String, String> {
        if arguments.is_empty() {
            let all = self.all_stops();
            let removed = all.into_iter().filter(|(id, _)| self.remove_stop(*id)).count();
            return Ok(format!("{removed} removed\n"));
        }
        let id = arguments.parse().ok().filter(|id| self.remove_stop(*id));
        id.map(|_| String::new()).ok_or_else(|| format!("there is no stop {arguments} (`stops` lists them)"))
    }

    pub(super) fn stops(&self) -> String {
        self.all_stops().into_iter().map(|(id, text)| format!("{id:>3}  {text}\n")).collect()
    }
}

/// Splits the arguments of `watch` into the watched expression and the test.
fn watched<'t>(text: &'t str, session: &Session) -> Result<(&'t str, Test), String> {
    let other = |text: &str| session.parse(text).map(Box::new);
    Ok(if let Some(what) = text.strip_suffix(" nan") {
        (what, Test::Nan)
    } else if let Some(what) = text.strip_suffix(" subnormal") {
        (what, Test::Subnormal)
    } else if let Some((what, value)) = text.split_once(" == ") {
        (what, Test::Equals(other(value)?))
    } else if let Some((what, value)) = text.split_once(" > ") {
        (what, Test::Above(other(value)?))
    } else {
        (text, Test::Changed)
    })
}

//! Breakpoints and watchpoints, and why a run stopped.

use super::Console;
use crate::info;
use crate::session::{Session, Stop, Test, Where, Why};

/// Why it stopped, in whole lines.
pub(crate) fn told(why: Why, session: &Session) -> String {
    match why {
        Why::Done => String::new(),
        Why::Stop { id, text, change: None } => format!("stop {id}: {text}\n"),
        Why::Stop { id, text, change: Some((before, now)) } => {
            format!("stop {id}: {text}: {before} -> {now}\n")
        }
        Why::Holds => "the expression holds\n".to_owned(),
        Why::Start => "the beginning of the run\n".to_owned(),
        Why::Halted => "the program has halted\n".to_owned(),
        Why::InputsEnd => "the recorded inputs end here\n".to_owned(),
        Why::Fault(fault) => session.diagnose(&fault).render(false),
        Why::Limit(cycles) => format!("nothing to stop at in {cycles} cycles\n"),
        Why::Interrupted => "interrupted\n".to_owned(),
    }
}

impl Console {
    pub(super) fn add_break(&mut self, arguments: &str) -> Result<String, String> {
        let (place, condition) = match arguments.split_once(" if ") {
            Some((place, condition)) => (place, Some(Box::new(self.session.parse(condition)?))),
            None => (arguments, None),
        };
        let at = Where::parse(place, self.session.program())?;
        let text = format!("break {arguments}");
        let id = self.session.add_stop(Stop::Break { at: at.clone(), condition, text });
        let at = info::places(self.session.program(), &at);
        Ok(format!("stop {id} at {at}\n"))
    }

    pub(super) fn add_watch(&mut self, arguments: &str) -> Result<String, String> {
        let (what, test) = if let Some(what) = arguments.strip_suffix(" nan") {
            (what, Test::Nan)
        } else if let Some(what) = arguments.strip_suffix(" subnormal") {
            (what, Test::Subnormal)
        } else if let Some((what, other)) = arguments.split_once(" == ") {
            (what, Test::Equals(Box::new(self.session.parse(other)?)))
        } else if let Some((what, other)) = arguments.split_once(" > ") {
            (what, Test::Above(Box::new(self.session.parse(other)?)))
        } else {
            (arguments, Test::Changed)
        };
        let what = self.session.parse(what)?;
        what.variants()?;
        let now = self.short(&what);
        let id = self.session.add_stop(Stop::Watch {
            what: Box::new(what),
            test,
            text: format!("watch {arguments}"),
        });
        Ok(format!("stop {id}; now {now}\n"))
    }

    pub(super) fn delete(&mut self, arguments: &str) -> Result<String, String> {
        if arguments.is_empty() {
            let all: Vec<u32> = self.session.stops().iter().map(|(id, _)| *id).collect();
            all.iter().for_each(|id| {
                self.session.remove_stop(*id);
            });
            return Ok(format!("{} removed\n", all.len()));
        }
        let id = arguments.parse().ok().filter(|id| self.session.remove_stop(*id));
        id.map(|_| String::new()).ok_or_else(|| format!("there is no stop {arguments} (`stops` lists them)"))
    }

    pub(super) fn stops(&self) -> String {
        let places = |stop: &Stop| match stop {
            Stop::Break { at: Where::Line(_, bundles), .. } if bundles.len() > 1 => {
                format!("  ({} places)", bundles.len())
            }
            _ => String::new(),
        };
        let row = |(id, stop): &(u32, Stop)| format!("{id:>3}  {}{}\n", stop.text(), places(stop));
        self.session.stops().iter().map(row).collect()
    }
}

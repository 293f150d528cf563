// SPDX-License-Identifier: MIT OR Apache-2.0
//! Moves of the run, forward and back, with the messages at the position reached.

use super::table::inside;
use super::{Console, Engine, sessions};
use crate::accuracy;
use crate::session::{Move, StopReason, Unit};
use crate::system::{SystemSession, SystemStopReason};
use crate::target::Target;
use std::fmt::Write as _;
use takt_analysis::accuracy::Shadow;
use takt_asm::nearest;

/// End of a move: core and reason.
#[derive(Clone, Debug, PartialEq)]
pub struct End {
    /// Index of the core that ended the move.
    pub core: usize,
    /// Reason why the move ended.
    pub why: StopReason,
}

impl Console {
    /// Moves the run. Steps and periods are counted on `core`.
    ///
    /// # Errors
    /// If a board cannot make this move, or does not answer.
    pub fn go(&mut self, core: usize, to: &Move) -> Result<End, String> {
        if let Engine::Board(board) = &mut self.engine {
            return Ok(End { core: 0, why: board.go(&mut self.cores[0], to)? });
        }
        let now = self.cores[0].session.cycle();
        Ok(match to {
            Move::Back(Unit::Cycle, _) if now == 0 => End { core, why: StopReason::Start },
            // A step by any number of cycles is a single move.
            Move::Back(Unit::Cycle, count) => self.go_once(core, &Move::Cycle(now.saturating_sub(*count))),
            Move::Step(Unit::Cycle, count) => self.go_once(core, &Move::Cycle(now.saturating_add(*count))),
            Move::Step(_, count) | Move::Back(_, count) => {
                let mut end = End { core, why: StopReason::Done };
                for _ in 0..*count {
                    end = self.go_once(core, to);
                    if end.why != StopReason::Done {
                        break;
                    }
                }
                end
            }
            _ => self.go_once(core, to),
        })
    }

    /// Executes a single move or step of an emulated run, and selects the core in which it ends.
    fn go_once(&mut self, core: usize, to: &Move) -> End {
        let Engine::System(system) = &mut self.engine else {
            return End { core: 0, why: self.cores[0].session.go(to) };
        };
        let mut views = sessions(&mut self.cores);
        let why = system.go(&mut views, core, to);
        system.show(&mut views);
        let (found, why) = end(system, why);
        self.selected = found.unwrap_or(self.selected);
        End { core: found.unwrap_or(core), why }
    }

    /// Executes a move command; returns the message at its end.
    fn goes(&mut self, to: &Move) -> Result<String, String> {
        let end = self.go(self.selected, to)?;
        self.arrive(end)
    }

    /// Breakpoints that the last move passed because their conditions could not be evaluated, one line each.
    pub fn doubts(&self) -> Vec<String> {
        let doubts = self.cores.iter().flat_map(|core| core.session.control().take_doubts());
        let line = |(id, doubt)| format!("stop {id} was passed, its condition reads an old value: {doubt}");
        doubts.map(line).collect()
    }

    /// Message at the end of a move: reason, position, and displayed values. A difference is returned as an error, so that a script fails.
    pub(super) fn arrive(&mut self, end: End) -> Result<String, String> {
        let mut text: String = self.doubts().iter().map(|doubt| format!("{doubt}\n")).collect();
        text.push_str(&self.render(&end));
        text.push_str(&self.place());
        for (name, value) in self.displayed(self.selected) {
            let _ = writeln!(text, "    {name} = {value}");
        }
        match end.why {
            StopReason::Differs(different) => Err(format!("{different}\n{}", text.trim_end())),
            _ => Ok(text),
        }
    }

    /// Reason for the end of a move, as complete lines.
    fn render(&self, End { core, why }: &End) -> String {
        match why {
            StopReason::Done | StopReason::Differs(_) => String::new(),
            StopReason::Stop { id, text, change: None } => format!("stop {id}: {text}\n"),
            StopReason::Stop { id, text, change: Some((before, now)) } => {
                format!("stop {id}: {text}: {before} -> {now}\n")
            }
            StopReason::Holds => "the expression holds\n".to_owned(),
            StopReason::Start => "the beginning of the run\n".to_owned(),
            StopReason::Halted if self.target() == Target::System => "every core has halted\n".to_owned(),
            StopReason::Halted => "the program has halted\n".to_owned(),
            StopReason::InputsEnd => "the recorded inputs end here\n".to_owned(),
            StopReason::Fault(fault) => {
                let rendered = self.cores[*core].session.diagnose(fault).render(false);
                match self.target() {
                    Target::System => format!("core {}:\n{rendered}", self.name(*core)),
                    Target::Program | Target::Board => rendered,
                }
            }
            StopReason::Limit(count) => format!("nothing to stop at in {count} {}s\n", self.counts()),
            StopReason::Interrupted => "interrupted\n".to_owned(),
            StopReason::Other(text) => format!("{text}\n"),
        }
    }

    pub(super) fn step(&mut self, arguments: &str, back: bool) -> Result<String, String> {
        let unit = if self.target() == Target::Board { Unit::Period } else { Unit::Bundle };
        let (unit, count) = steps(arguments, unit)?;
        self.goes(&if back { Move::Back(unit, count) } else { Move::Step(unit, count) })
    }

    pub(super) fn resume(&mut self, back: bool) -> Result<String, String> {
        self.goes(if back { &Move::ResumeBack } else { &Move::Resume })
    }

    pub(super) fn until(&mut self, arguments: &str) -> Result<String, String> {
        let live = self.session().parse(arguments)?;
        let end = self.go(self.selected, &Move::Until(Box::new(live.clone())))?;
        let note = self.session().note(&live).filter(|_| end.why == StopReason::Holds);
        let text = self.arrive(end)?;
        Ok(match note {
            Some(note) => format!("with old values: {note}\n{text}"),
            None => text,
        })
    }

    pub(super) fn go_to(&mut self, arguments: &str) -> Result<String, String> {
        let to = match arguments.split_whitespace().collect::<Vec<_>>()[..] {
            ["start"] => Move::Start,
            ["cycle", _] if self.target() == Target::Board => return Err(inside("goto cycle")),
            [unit @ ("cycle" | "period"), number] => {
                let number =
                    number.parse().map_err(|_| format!("`{number}` is not the number of a {unit}"))?;
                if unit == "cycle" { Move::Cycle(number) } else { Move::Period(number) }
            }
            _ => return Err("goto takes `cycle N`, `period N` or `start`".to_owned()),
        };
        self.goes(&to)
    }

    pub(super) fn accuracy(&mut self, arguments: &str) -> Result<String, String> {
        let registers = accuracy::registers(self.session(), arguments)?;
        let mut shadow = Shadow::new(self.session().program());
        let mut issued = |emulator: &_, address| shadow.issued(emulator, address);
        let why = match &mut self.engine {
            Engine::System(system) => {
                let why = system.replay(self.selected, &mut issued);
                end(system, why).1
            }
            Engine::Program | Engine::Board(_) => self.cores[0].session.replay(&mut issued),
        };
        match why {
            StopReason::Interrupted => Err("interrupted on the way from reset to here".to_owned()),
            _ => Ok(accuracy::report(self.session(), &shadow, &registers)),
        }
    }
}

/// Core in which a system's move ended, and the reason.
fn end(system: &SystemSession, why: SystemStopReason) -> (Option<usize>, StopReason) {
    let why = match why {
        SystemStopReason::Core(core, StopReason::Halted) => {
            let name = &system.system().description().cores[core].name;
            return (Some(core), StopReason::Other(format!("core {name} has halted")));
        }
        SystemStopReason::Core(core, why) => return (Some(core), why),
        SystemStopReason::Fault(fault) => return (Some(fault.core), StopReason::Fault(fault.fault)),
        SystemStopReason::Stop(id) => {
            let known = system.stops().find(|(known, _)| *known == id);
            StopReason::Stop {
                id,
                text: known.map_or(String::new(), |(_, text)| text.to_owned()),
                change: None,
            }
        }
        SystemStopReason::Done => StopReason::Done,
        SystemStopReason::Start => StopReason::Start,
        SystemStopReason::Halted => StopReason::Halted,
        SystemStopReason::InputsEnd => StopReason::InputsEnd,
        SystemStopReason::Limit(cycles) => StopReason::Limit(cycles),
        SystemStopReason::Interrupted => StopReason::Interrupted,
        SystemStopReason::Host(error) => StopReason::Other(error.to_string()),
    };
    (None, why)
}

/// Unit and number of steps, from the arguments.
fn steps(arguments: &str, unit: Unit) -> Result<(Unit, u64), String> {
    let (mut unit, mut count) = (unit, 1);
    for word in arguments.split_whitespace() {
        if let Some(named) = Unit::named(word) {
            unit = named;
            continue;
        }
        count = word.parse().ok().filter(|count| *count > 0).ok_or_else(|| {
            let near = nearest(word, Unit::NAMES.iter().copied());
            let near = near.map_or(String::new(), |near| format!("; did you mean `{near}`?"));
            format!("`{word}` is neither a count nor one of {}{near}", Unit::NAMES.join(" "))
        })?;
    }
    Ok((unit, count))
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Moves of the run, forward and back, and what is said where they end.

use super::table::inside;
use super::{Console, Engine, sessions};
use crate::accuracy;
use crate::session::{Move, Unit, Why};
use crate::system::{SystemSession, SystemWhy};
use crate::target::Target;
use std::fmt::Write as _;
use takt_analysis::accuracy::Shadow;
use takt_asm::nearest;

/// The end of a move: the core that it is about, and the reason.
#[derive(Clone, Debug, PartialEq)]
pub struct End {
    /// The core.
    pub core: usize,
    /// The reason.
    pub why: Why,
}

impl Console {
    /// Moves the run; `core` is the one whose steps and periods are meant.
    ///
    /// # Errors
    /// If a board does not move so, or does not answer.
    pub fn go(&mut self, core: usize, to: &Move) -> Result<End, String> {
        if let Engine::Board(board) = &mut self.engine {
            return Ok(End { core: 0, why: board.go(&mut self.cores[0], to)? });
        }
        let now = self.cores[0].session.cycle();
        Ok(match to {
            Move::Back(Unit::Cycle, _) if now == 0 => End { core, why: Why::Start },
            // At once, however many.
            Move::Back(Unit::Cycle, count) => self.go_once(core, &Move::Cycle(now.saturating_sub(*count))),
            Move::Step(Unit::Cycle, count) => self.go_once(core, &Move::Cycle(now.saturating_add(*count))),
            Move::Step(_, count) | Move::Back(_, count) => {
                let mut end = End { core, why: Why::Done };
                for _ in 0..*count {
                    end = self.go_once(core, to);
                    if end.why != Why::Done {
                        break;
                    }
                }
                end
            }
            _ => self.go_once(core, to),
        })
    }

    /// Moves the run of an emulator, by one step only, and selects the core that it ends in.
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

    /// Does what a command asks for, and says where that ends.
    fn goes(&mut self, to: &Move) -> Result<String, String> {
        let end = self.go(self.selected, to)?;
        self.arrive(end)
    }

    /// The end of a move, the position, and displayed values. A difference is an error, so that a script fails.
    pub(super) fn arrive(&mut self, end: End) -> Result<String, String> {
        let mut text = self.render(&end);
        text.push_str(&self.place());
        for (name, value) in self.displayed(self.selected) {
            let _ = writeln!(text, "    {name} = {value}");
        }
        match end.why {
            Why::Differs(different) => Err(format!("{different}\n{}", text.trim_end())),
            _ => Ok(text),
        }
    }

    /// The end of a move in whole lines.
    fn render(&self, End { core, why }: &End) -> String {
        match why {
            Why::Done | Why::Differs(_) => String::new(),
            Why::Stop { id, text, change: None } => format!("stop {id}: {text}\n"),
            Why::Stop { id, text, change: Some((before, now)) } => {
                format!("stop {id}: {text}: {before} -> {now}\n")
            }
            Why::Holds => "the expression holds\n".to_owned(),
            Why::Start => "the beginning of the run\n".to_owned(),
            Why::Halted if self.target() == Target::System => "every core has halted\n".to_owned(),
            Why::Halted => "the program has halted\n".to_owned(),
            Why::InputsEnd => "the recorded inputs end here\n".to_owned(),
            Why::Fault(fault) => {
                let rendered = self.cores[*core].session.diagnose(fault).render(false);
                match self.target() {
                    Target::System => format!("core {}:\n{rendered}", self.name(*core)),
                    Target::Program | Target::Board => rendered,
                }
            }
            Why::Limit(count) => format!("nothing to stop at in {count} {}s\n", self.counts()),
            Why::Interrupted => "interrupted\n".to_owned(),
            Why::Other(text) => format!("{text}\n"),
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
        self.goes(&Move::Until(Box::new(live)))
    }

    pub(super) fn go_to(&mut self, arguments: &str) -> Result<String, String> {
        let to = match arguments.split_whitespace().collect::<Vec<_>>()[..] {
            ["start"] => Move::Start,
            ["cycle", _] if self.target() == Target::Board => return Err(inside("goto cycle")),
            [unit @ ("cycle" | "period"), number] => {
                let number = number.parse().map_err(|_| format!("`{number}` is no number of a {unit}"))?;
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
            Why::Interrupted => Err("interrupted on the way from reset to here".to_owned()),
            _ => Ok(accuracy::report(self.session(), &shadow, &registers)),
        }
    }
}

/// The core and the reason for which a move of a system ended.
fn end(system: &SystemSession, why: SystemWhy) -> (Option<usize>, Why) {
    let why = match why {
        SystemWhy::Core(core, Why::Halted) => {
            let name = &system.system().description().cores[core].name;
            return (Some(core), Why::Other(format!("core {name} has halted")));
        }
        SystemWhy::Core(core, why) => return (Some(core), why),
        SystemWhy::Fault(fault) => return (Some(fault.core), Why::Fault(fault.fault)),
        SystemWhy::Stop(id) => {
            let known = system.stops().find(|(known, _)| *known == id);
            Why::Stop { id, text: known.map_or(String::new(), |(_, text)| text.to_owned()), change: None }
        }
        SystemWhy::Done => Why::Done,
        SystemWhy::Start => Why::Start,
        SystemWhy::Halted => Why::Halted,
        SystemWhy::InputsEnd => Why::InputsEnd,
        SystemWhy::Limit(cycles) => Why::Limit(cycles),
        SystemWhy::Interrupted => Why::Interrupted,
        SystemWhy::Host(error) => Why::Other(error.to_string()),
    };
    (None, why)
}

/// The unit of a step, and how many steps.
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

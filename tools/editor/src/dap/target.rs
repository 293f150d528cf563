//! What is debugged: a program on one core, or a system of several cores in one time. What the adapter does, it does to a core of
//! it; of a program there is one.

use std::path::PathBuf;
use takt_debug::console::{Commands, Console};
use takt_debug::session::{Place, Session, Stop, Unit, Why};
use takt_debug::system::{SystemConsole, SystemStop, SystemWhy, link_text};

/// A session that can be debugged.
pub enum Target {
    /// One program.
    Program(Box<Console>),
    /// The cores of a system.
    System(Box<SystemConsole>),
}

/// In which core a run ended, and why; if no core's session has a word for it, what to say.
pub(super) type End = (usize, Result<Why, String>);

impl Target {
    /// A program's session.
    pub fn program(session: Session) -> Target {
        Target::Program(Box::new(Console::new(session)))
    }

    /// A system's.
    pub fn system(console: SystemConsole) -> Target {
        Target::System(Box::new(console))
    }

    // ---- What there is to see.

    pub(super) fn cores(&self) -> usize {
        match self {
            Target::Program(_) => 1,
            Target::System(system) => system.cores(),
        }
    }

    /// The number of a core, if there is such a one.
    pub(super) fn checked(&self, core: u64) -> Option<usize> {
        usize::try_from(core).ok().filter(|core| *core < self.cores())
    }

    /// A core that there is.
    pub(super) fn core(&self, core: usize) -> &Console {
        match self {
            Target::Program(console) => console,
            Target::System(system) => system.core(core).expect("a core's number has been checked"),
        }
    }

    pub(super) fn core_mut(&mut self, core: usize) -> &mut Console {
        match self {
            Target::Program(console) => console,
            Target::System(system) => system.core_mut(core).expect("a core's number has been checked"),
        }
    }

    pub(super) fn session(&self, core: usize) -> &Session {
        &self.core(core).session
    }

    pub(super) fn name(&self, core: usize) -> String {
        match self {
            Target::Program(_) => format!("core {core}"),
            Target::System(system) => system.session.system().description().cores[core].name.clone(),
        }
    }

    /// The core that a name before a separator says, and what follows: of a system.
    pub(super) fn split<'t>(&self, text: &'t str, separator: char) -> Option<(usize, &'t str)> {
        let Target::System(system) = self else { return None };
        let (name, rest) = text.split_once(separator)?;
        Some((system.session.system().description().core_named(name.trim())?, rest))
    }

    /// The core that stopped last.
    pub(super) fn selected(&self) -> usize {
        match self {
            Target::Program(_) => 0,
            Target::System(system) => system.selected(),
        }
    }

    /// Has commands that look be about this core.
    pub(super) fn select(&mut self, core: usize) {
        if let Target::System(system) = self {
            system.select_core(core);
        }
    }

    /// Links, each with what is on it.
    pub(super) fn links(&self) -> Vec<(String, String)> {
        let Target::System(system) = self else { return Vec::new() };
        let system = system.session.system();
        let links = system.description().links.iter().enumerate();
        links.map(|(number, link)| (link.name.clone(), link_text(system, number))).collect()
    }

    pub(super) fn cycle(&self) -> u64 {
        self.session(0).cycle()
    }

    /// Executes a command that only looks; `None` if the line is none.
    pub(super) fn look(&mut self, line: &str) -> Option<Result<String, String>> {
        match self {
            Target::Program(console) => console.look(line),
            Target::System(system) => system.look(line),
        }
    }

    // ---- Stops.

    pub(super) fn add_stop(&mut self, core: usize, stop: Stop) -> u32 {
        match self {
            Target::Program(console) => console.session.add_stop(stop),
            Target::System(system) => {
                system.add_core_stop(core, stop).expect("a core's number has been checked")
            }
        }
    }

    /// The stop at an event that `link NAME [EVENT]` means; `None` if the text means none, or this is no system.
    pub(super) fn link_stop(&self, text: &str) -> Option<Result<SystemStop, String>> {
        let Target::System(system) = self else { return None };
        SystemStop::parse(text, system.session.system().description())
    }

    pub(super) fn add_link_stop(&mut self, stop: SystemStop, text: String) -> Option<u32> {
        match self {
            Target::Program(_) => None,
            Target::System(system) => Some(system.session.add_stop(stop, text)),
        }
    }

    pub(super) fn remove_stop(&mut self, id: u32) {
        match self {
            Target::Program(console) => console.session.remove_stop(id),
            Target::System(system) => system.remove_stop(id),
        };
    }

    // ---- Moving, and changing.

    /// Does this to the program, or that to the system.
    fn run(
        &mut self,
        program: impl FnOnce(&mut Session) -> Why,
        system: impl FnOnce(&mut takt_debug::system::SystemSession, &mut [&mut Session]) -> SystemWhy,
    ) -> End {
        match self {
            Target::Program(console) => (0, Ok(program(&mut console.session))),
            Target::System(console) => {
                let why = console.run(system);
                end(console, why)
            }
        }
    }

    pub(super) fn resume(&mut self) -> End {
        self.run(Session::resume, |system, views| system.resume(views))
    }

    pub(super) fn resume_back(&mut self) -> End {
        self.run(Session::resume_back, |system, views| system.resume_back(views))
    }

    pub(super) fn step(&mut self, core: usize, unit: Unit) -> End {
        let (_, why) = self.run(|one| one.step(unit), |system, views| system.step(views, core, unit));
        (core, why)
    }

    pub(super) fn step_back(&mut self, core: usize, unit: Unit) -> End {
        let (_, why) =
            self.run(|one| one.step_back(unit), |system, views| system.step_back(views, core, unit));
        (core, why)
    }

    pub(super) fn go_to(&mut self, cycle: u64) -> End {
        self.run(|one| one.go_to(cycle), |system, _| system.go_to(cycle))
    }

    pub(super) fn go_to_period(&mut self, core: usize, period: u64) -> End {
        self.run(|one| one.go_to_period(period), |system, _| system.go_to_period(core, period))
    }

    /// Sets for how many cycles a command may run; for how many it might.
    pub(super) fn limit(&mut self, cycles: u64) -> u64 {
        let limit = match self {
            Target::Program(console) => &mut console.session.run_limit,
            Target::System(system) => &mut system.session.run_limit,
        };
        std::mem::replace(limit, cycles)
    }

    pub(super) fn set(&mut self, core: usize, place: Place, bits: u32) -> Result<(), String> {
        match self {
            Target::Program(console) => console.session.set(place, bits),
            Target::System(system) => system.set_place(core, place, bits),
        }
    }
}

/// What is debugged, and where its sources are.
pub struct Launched {
    /// The session, at its beginning or where there is something to see.
    pub target: Target,
    /// What to tell the user, if anything.
    pub note: Option<String>,
    /// For each core, the folder that its program's sources lie in.
    pub folders: Vec<PathBuf>,
}

fn end(console: &SystemConsole, why: SystemWhy) -> End {
    let why = match why {
        SystemWhy::Core(core, Why::Halted) => {
            let name = &console.session.system().description().cores[core].name;
            return (core, Err(format!("core {name} has halted")));
        }
        SystemWhy::Core(core, why) => return (core, Ok(why)),
        SystemWhy::Fault(fault) => return (fault.core, Ok(Why::Fault(fault.fault))),
        SystemWhy::Stop(id) => {
            let known = console.session.stops().find(|(known, _)| *known == id);
            Why::Stop { id, text: known.map_or(String::new(), |(_, text)| text.to_owned()), change: None }
        }
        SystemWhy::Done => Why::Done,
        SystemWhy::Start => Why::Start,
        SystemWhy::Halted => Why::Halted,
        SystemWhy::InputsEnd => Why::InputsEnd,
        SystemWhy::Limit(cycles) => Why::Limit(cycles),
        SystemWhy::Interrupted => Why::Interrupted,
        SystemWhy::Host(error) => return (console.selected(), Err(error.to_string())),
    };
    (console.selected(), Ok(why))
}

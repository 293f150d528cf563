// SPDX-License-Identifier: MIT OR Apache-2.0
//! Commands in, text out: the console that a prompt, a script, an editor and the full-screen view share. It is the same for
//! a program, the cores of a system, and a board.

mod board;
mod inspector;
mod moves;
mod stops;
mod system;
mod table;
mod values;

pub use crate::target::Target;
pub use moves::End;
pub use table::{KEYS, commands, first_mistake, keys};

use crate::panes::Panes;
use crate::remote::RemoteSession;
use crate::session::{Place, Session};
use crate::system::SystemSession;
use board::Board;
use inspector::Inspector;
use table::{Does, find, split};

/// The run that the commands move. There is an [`Inspector`] for each of its cores.
enum Engine {
    /// A program: its inspector's own session is the run.
    Program,
    /// The cores of a system, whose state the inspectors' sessions show.
    System(Box<SystemSession>),
    /// A board, whose state the inspector's session shows.
    Board(Box<Board>),
}

/// A session with what commands add to it.
pub struct Console {
    engine: Engine,
    cores: Vec<Inspector>,
    /// The core that commands are about: the last one that stopped, or was selected.
    selected: usize,
    /// True once `quit` was said.
    pub quit: bool,
    /// The last step, which an empty line repeats.
    last: String,
}

impl Console {
    fn with(engine: Engine, sessions: Vec<Session>) -> Console {
        let cores = sessions.into_iter().map(Inspector::new).collect();
        Console { engine, cores, selected: 0, quit: false, last: String::new() }
    }

    /// Commands on a program's session.
    pub fn new(session: Session) -> Console {
        Console::with(Engine::Program, vec![session])
    }

    /// Commands on a system's session; `cores` has a session for each core, of its program, with its names and sources.
    pub fn of_system(session: SystemSession, cores: Vec<Session>) -> Console {
        let mut console = Console::with(Engine::System(Box::new(session)), cores);
        console.look_at_cores();
        console
    }

    /// Commands on a machine that runs elsewhere, which is held, or started again if `restart` is set; `view` is a session of
    /// its program, with its names and sources. Somebody can press Ctrl-C if `interactive`. Returned with them: what to print
    /// first.
    ///
    /// # Errors
    /// If the machine does not answer. A program that does not reach its `wait` is no error.
    pub fn of_board(
        session: RemoteSession,
        view: Session,
        restart: bool,
        interactive: bool,
    ) -> Result<(Console, String), String> {
        let board = Board::new(session, restart, interactive);
        let mut console = Console::with(Engine::Board(Box::new(board)), vec![view]);
        let said = console.begin(restart)?;
        Ok((console, said))
    }

    /// The kind of run.
    pub fn target(&self) -> Target {
        match &self.engine {
            Engine::Program => Target::Program,
            Engine::System(_) => Target::System,
            Engine::Board(_) => Target::Board,
        }
    }

    // ---- Cores.

    /// The number of cores.
    pub fn cores(&self) -> usize {
        self.cores.len()
    }

    /// A core's name in its system; `core` of a program.
    pub fn name(&self, core: usize) -> &str {
        let description = self.system().map(|system| system.system().description());
        description.and_then(|description| description.cores.get(core)).map_or("core", |core| &core.name)
    }

    /// The core that commands are about.
    pub fn selected(&self) -> usize {
        self.selected
    }

    /// Selects a core, if there is such a one.
    pub fn select(&mut self, core: usize) {
        if core < self.cores.len() {
            self.selected = core;
        }
    }

    fn shown(&self) -> &Inspector {
        &self.cores[self.selected]
    }

    fn shown_mut(&mut self) -> &mut Inspector {
        &mut self.cores[self.selected]
    }

    /// The session that shows the selected core.
    pub fn session(&self) -> &Session {
        &self.shown().session
    }

    /// The same, to change it. Of a system, [`Console::go`] moves the run, and [`Console::set`] changes it.
    pub fn session_mut(&mut self) -> &mut Session {
        &mut self.shown_mut().session
    }

    /// The session that shows a core, if there is such a one.
    pub fn core(&self, core: usize) -> Option<&Session> {
        self.cores.get(core).map(|core| &core.session)
    }

    /// The same, to change it.
    pub fn core_mut(&mut self, core: usize) -> Option<&mut Session> {
        self.cores.get_mut(core).map(|core| &mut core.session)
    }

    /// The system's session, if it is one.
    pub fn system(&self) -> Option<&SystemSession> {
        match &self.engine {
            Engine::System(system) => Some(system),
            Engine::Program | Engine::Board(_) => None,
        }
    }

    fn look_at_cores(&mut self) {
        if let Engine::System(system) = &self.engine {
            system.show(&mut sessions(&mut self.cores));
        }
    }

    /// Sets for how many cycles a command may run; returns for how many it might.
    pub fn set_run_limit(&mut self, cycles: u64) -> u64 {
        let limit = match &mut self.engine {
            Engine::System(system) => &mut system.run_limit,
            Engine::Program | Engine::Board(_) => &mut self.cores[0].session.run_limit,
        };
        std::mem::replace(limit, cycles)
    }

    /// The unit of [`Control::cycle`](crate::session::Control::cycle).
    pub fn counts(&self) -> &'static str {
        match self.target() {
            Target::Program | Target::System => "cycle",
            Target::Board => "period",
        }
    }

    // ---- Commands.

    /// Executes a line; returns what it has to say, in whole lines.
    ///
    /// # Errors
    /// If something is wrong with it. The session is as it was.
    pub fn execute(&mut self, line: &str) -> Result<String, String> {
        let repeated = self.last.clone();
        let line = if line.trim().is_empty() { &repeated } else { line };
        let Some((name, arguments)) = split(line) else { return Ok(String::new()) };
        let command = find(name, self.target())?;
        self.last = if command.does == Does::Steps { line.to_owned() } else { String::new() };
        if let (Engine::Board(board), Does::Shows) = (&self.engine, command.does) {
            board.needs_values()?;
        }
        let before: Vec<_> = self.cores.iter().map(Inspector::position).collect();
        let result = self.about_a_core(arguments, command.run);
        for (core, before) in self.cores.iter_mut().zip(before) {
            core.moved_from(before);
        }
        result
    }

    /// The position: that of the selected core.
    pub fn place(&mut self) -> String {
        let inspector = &mut self.cores[self.selected];
        let place = match &self.engine {
            Engine::Board(board) => board.place(inspector),
            Engine::Program | Engine::System(_) => inspector.place(),
        };
        match self.target() {
            Target::System => format!("core {}: {place}", self.name(self.selected)),
            Target::Program | Target::Board => place,
        }
    }

    /// The displayed expressions of a core, with their values.
    pub fn displayed(&self, core: usize) -> Vec<(String, String)> {
        self.cores.get(core).map_or(Vec::new(), Inspector::displayed)
    }

    /// The contents of the panes at this position.
    pub fn panes(&mut self) -> Panes {
        let mut panes = self.shown_mut().panes();
        panes.target = self.target();
        panes.cores = self.core_lines();
        if let Some(core) = panes.cores.get(self.selected) {
            panes.head = format!("core {}: {}", core.name, panes.head);
        }
        panes
    }

    fn set_command(&mut self, arguments: &str) -> Result<String, String> {
        if let Engine::Board(board) = &self.engine {
            board.needs_values()?;
        }
        let (place, bits, text) = self.shown().setting(arguments)?;
        self.set(self.selected, place, bits)?;
        Ok(text)
    }

    /// Sets a register or a data word of a core. What was recorded of the run after this position is forgotten.
    ///
    /// # Errors
    /// If there is no such place, or it cannot be set.
    pub fn set(&mut self, core: usize, place: Place, bits: u32) -> Result<(), String> {
        let inspector = self.cores.get_mut(core).ok_or("there is no such core")?;
        match &mut self.engine {
            Engine::Board(board) => return board.set(&mut inspector.session, place, bits),
            Engine::Program => inspector.session.set(place, bits)?,
            Engine::System(system) => {
                // The core's session knows which places there are.
                inspector.session.set(place, bits)?;
                system.set(core, place, bits);
            }
        }
        self.look_at_cores();
        Ok(())
    }

    /// Ends the session; returns what there is to say of what it leaves behind.
    ///
    /// # Errors
    /// If a board cannot be left as it should be.
    pub fn leave(&mut self) -> Result<String, String> {
        match &mut self.engine {
            Engine::Board(board) => board.release(),
            Engine::Program | Engine::System(_) => Ok(String::new()),
        }
    }
}

/// The sessions that show the cores.
fn sessions(cores: &mut [Inspector]) -> Vec<&mut Session> {
    cores.iter_mut().map(|core| &mut core.session).collect()
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Console: commands in, text out. Shared by prompt, scripts, editors and the full-screen view, for programs, systems and boards.

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
use table::{CommandEffect, find, split};

/// The run that the console controls. Each of its cores has an [`Inspector`].
enum Engine {
    /// A program; the inspector's session executes it.
    Program,
    /// A system; the inspectors' sessions show its cores.
    System(Box<SystemSession>),
    /// A board; the inspector's session shows its state.
    Board(Box<Board>),
}

/// A console: a run, a session for each of its cores, and the state of the command language.
pub struct Console {
    engine: Engine,
    cores: Vec<Inspector>,
    /// Selected core, to which commands refer. A core that stops becomes the selected one.
    selected: usize,
    /// The user entered `quit`.
    pub quit: bool,
    /// Last step command; an empty line repeats it.
    last: String,
}

impl Console {
    fn with(engine: Engine, sessions: Vec<Session>) -> Console {
        let cores = sessions.into_iter().map(Inspector::new).collect();
        Console { engine, cores, selected: 0, quit: false, last: String::new() }
    }

    /// A console for the session of a program.
    pub fn new(session: Session) -> Console {
        Console::with(Engine::Program, vec![session])
    }

    /// A console for the session of a system. `cores` has a session of each core's program, with names and sources.
    pub fn of_system(session: SystemSession, cores: Vec<Session>) -> Console {
        let mut console = Console::with(Engine::System(Box::new(session)), cores);
        console.look_at_cores();
        console
    }

    /// A console for a remote machine, which is held, or restarted if `restart`. `view` is a session of the machine's program, with names
    /// and sources. `interactive`: a user can press Ctrl-C. Also returns the first message.
    ///
    /// # Errors
    /// If the machine does not answer. A program that does not reach its `wait` is not an error.
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

    /// Kind of the run.
    pub fn target(&self) -> Target {
        match &self.engine {
            Engine::Program => Target::Program,
            Engine::System(_) => Target::System,
            Engine::Board(_) => Target::Board,
        }
    }

    // ---- Cores.

    /// Number of cores under the console.
    pub fn cores(&self) -> usize {
        self.cores.len()
    }

    /// Name of a core in its system; `core` for a program.
    pub fn name(&self, core: usize) -> &str {
        let description = self.system().map(|system| system.system().description());
        description.and_then(|description| description.cores.get(core)).map_or("core", |core| &core.name)
    }

    /// Core that commands refer to.
    pub fn selected(&self) -> usize {
        self.selected
    }

    /// Selects a core; does nothing if the core does not exist.
    pub fn select(&mut self, core: usize) {
        if core < self.cores.len() {
            self.selected = core;
        }
    }

    fn inspector(&self) -> &Inspector {
        &self.cores[self.selected]
    }

    fn inspector_mut(&mut self) -> &mut Inspector {
        &mut self.cores[self.selected]
    }

    /// Session of the selected core.
    pub fn session(&self) -> &Session {
        &self.inspector().session
    }

    /// Mutable session of the selected core. Use [`Console::go`] and [`Console::set`] to move and change a system.
    pub fn session_mut(&mut self) -> &mut Session {
        &mut self.inspector_mut().session
    }

    /// Session that shows a core; `None` if the core does not exist.
    pub fn core(&self, core: usize) -> Option<&Session> {
        self.cores.get(core).map(|core| &core.session)
    }

    /// Mutable session of a core, if the core exists.
    pub fn core_mut(&mut self, core: usize) -> Option<&mut Session> {
        self.cores.get_mut(core).map(|core| &mut core.session)
    }

    /// Session of the system; `None` for other runs.
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

    /// Sets the maximum number of cycles of a command; returns the previous limit.
    pub fn set_run_limit(&mut self, cycles: u64) -> u64 {
        let limit = match &mut self.engine {
            Engine::System(system) => &mut system.run_limit,
            Engine::Program | Engine::Board(_) => &mut self.cores[0].session.run_limit,
        };
        std::mem::replace(limit, cycles)
    }

    /// Unit in which [`Control::cycle`](crate::session::Control::cycle) counts.
    pub fn counts(&self) -> &'static str {
        match self.target() {
            Target::Program | Target::System => "cycle",
            Target::Board => "period",
        }
    }

    // ---- Commands.

    /// Executes a command line; returns the answer in whole lines.
    ///
    /// # Errors
    /// If the command fails; the session is then unchanged.
    pub fn execute(&mut self, line: &str) -> Result<String, String> {
        let repeated = self.last.clone();
        let line = if line.trim().is_empty() { &repeated } else { line };
        let Some((name, arguments)) = split(line) else { return Ok(String::new()) };
        let command = find(name, self.target())?;
        self.last = if command.does == CommandEffect::Steps { line.to_owned() } else { String::new() };
        if let (Engine::Board(board), CommandEffect::Shows) = (&self.engine, command.does) {
            board.needs_values()?;
        }
        let before: Vec<_> = self.cores.iter().map(Inspector::position).collect();
        let result = self.about_a_core(arguments, command.run);
        for (core, before) in self.cores.iter_mut().zip(before) {
            core.moved_from(before);
        }
        result
    }

    /// Position of the selected core.
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

    /// Expressions on display of a core, with their values.
    pub fn displayed(&self, core: usize) -> Vec<(String, String)> {
        self.cores.get(core).map_or(Vec::new(), Inspector::displayed)
    }

    /// Contents of the panes at this position.
    pub fn panes(&mut self) -> Panes {
        let mut panes = self.inspector_mut().panes();
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
        let (place, bits, text) = self.inspector().setting(arguments)?;
        self.set(self.selected, place, bits)?;
        Ok(text)
    }

    /// Sets a register or a data word of a core. Discards records of the run after this position.
    ///
    /// # Errors
    /// If the place does not exist, or cannot be set.
    pub fn set(&mut self, core: usize, place: Place, bits: u32) -> Result<(), String> {
        let inspector = self.cores.get_mut(core).ok_or("there is no such core")?;
        match &mut self.engine {
            Engine::Board(board) => return board.set(&mut inspector.session, place, bits),
            Engine::Program => inspector.session.set(place, bits)?,
            Engine::System(system) => {
                // Check the place through the core's session.
                inspector.session.set(place, bits)?;
                system.set(core, place, bits);
            }
        }
        self.look_at_cores();
        Ok(())
    }

    /// Ends the session; returns a message about the final state of the board.
    ///
    /// # Errors
    /// If the board cannot be brought to its final state.
    pub fn leave(&mut self) -> Result<String, String> {
        match &mut self.engine {
            Engine::Board(board) => board.release(),
            Engine::Program | Engine::System(_) => Ok(String::new()),
        }
    }
}

/// Sessions of all cores.
fn sessions(cores: &mut [Inspector]) -> Vec<&mut Session> {
    cores.iter_mut().map(|core| &mut core.session).collect()
}

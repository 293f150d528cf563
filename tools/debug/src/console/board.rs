// SPDX-License-Identifier: MIT OR Apache-2.0
//! Console commands on a board: hold the machine, run single periods, let it run freely, and restore its original state at the end.

use super::inspector::Inspector;
use super::moves::End;
use super::table::{BACK, inside};
use super::{Console, Engine};
use crate::panes;
use crate::remote::{Activity, RemoteError, RemoteSession};
use crate::session::{Move, Place, Session, StopReason, Unit};

/// State in which the session leaves the machine.
#[derive(Clone, Copy, PartialEq, Eq)]
enum FinalState {
    Running,
    AsItIs,
}

/// A remote machine, with the console's settings.
pub(super) struct Board {
    session: RemoteSession,
    /// A user at a terminal is present, and can press Ctrl-C.
    interactive: bool,
    /// State in which to leave the machine; `None` once `release` has run.
    leave: Option<FinalState>,
}

impl Board {
    pub(super) fn new(session: RemoteSession, restart: bool, interactive: bool) -> Board {
        let runs = session.state().activity == Activity::Runs;
        let leave = Some(if runs && !restart { FinalState::Running } else { FinalState::AsItIs });
        Board { session, interactive, leave }
    }

    fn drive(&self) -> &'static str {
        if self.session.state().drives { "outputs drive" } else { "outputs are safe" }
    }

    /// Position of the program, as precisely as the board reports it.
    pub(super) fn place(&self, view: &mut Inspector) -> String {
        let (state, drive, program) = (self.session.state(), self.drive(), self.session.program());
        let (periods, issued) = (state.periods, program.bundle_text(state.issued));
        match &state.activity {
            Activity::Runs => format!("period {periods}: runs; {drive}\n"),
            Activity::Stopped => format!("stopped, in reset; {drive}\n"),
            Activity::InPeriod => {
                format!("period {periods}: has not come to its `wait`; {issued} issued last; {drive}\n")
            }
            _ if !self.session.is_settled() => {
                format!("period {periods}: not known further; {issued} issued last\n")
            }
            Activity::Faulted(address, reason) => {
                let at = program.bundle_text(*address);
                format!("period {periods}: stopped with a fault, {reason}, in {at}; {drive}\n")
            }
            Activity::Held | Activity::Halted => {
                format!("{}; {drive}\n{}", panes::head(&mut view.session), view.at_hand())
            }
        }
    }

    /// Checks that values can be read; the error explains why not.
    pub(super) fn needs_values(&self) -> Result<(), String> {
        let why = match &self.session.state().activity {
            Activity::Runs => "the program runs: `hold` first",
            Activity::InPeriod => {
                "the program is in a period: `hold` waits for its end, `goto start` starts it again"
            }
            _ if !self.session.is_settled() => "the program's state is unknown: `hold` asks again",
            _ => return Ok(()),
        };
        Err(why.to_owned())
    }

    /// Checks that a period can be run; the error explains why not.
    fn needs_held(&self) -> Result<(), String> {
        self.needs_values()?;
        let state = match self.session.state().activity {
            Activity::Stopped => "is stopped",
            Activity::Halted => "has halted",
            Activity::Faulted(..) => "has stopped with a fault",
            _ => return Ok(()),
        };
        Err(format!("the program {state}: `goto start` starts it again"))
    }

    /// Moves the machine and shows it in `view`.
    pub(super) fn go(&mut self, view: &mut Inspector, to: &Move) -> Result<StopReason, String> {
        let session = &mut view.session;
        let moved = match to {
            Move::Start => {
                self.leave = Some(FinalState::AsItIs);
                self.session.restart()
            }
            Move::Step(Unit::Period, count) => {
                self.needs_held()?;
                self.session.advance(session, Some(*count), None)
            }
            Move::Period(period) => {
                self.needs_held()?;
                let count = period.checked_sub(self.session.state().periods);
                let count = count.ok_or_else(|| format!("`goto period {period}`: {BACK}"))?;
                self.session.advance(session, Some(count), None)
            }
            Move::Resume => {
                self.needs_held()?;
                match self.session.goal(session, None) {
                    Some(goal) => self.session.advance(session, None, Some(goal)),
                    None if self.interactive => self.session.run_freely(),
                    None => {
                        let text = "there is nothing to stop at: `break period N`, `watch EXPR` or `until EXPR`; `go` lets it run";
                        return Err(text.to_owned());
                    }
                }
            }
            Move::Until(live) => {
                self.needs_held()?;
                let goal = self.session.goal(session, Some((**live).clone()));
                self.session.advance(session, None, goal)
            }
            Move::Step(unit, _) => return Err(inside(&format!("step {}", unit.name()))),
            Move::Cycle(_) => return Err(inside("goto cycle")),
            Move::Back(..) | Move::ResumeBack => return Err(BACK.to_owned()),
        };
        self.moved(view, moved)
    }

    /// Holds the machine, or restarts its program.
    fn stop(&mut self, view: &mut Inspector, restart: bool) -> Result<StopReason, String> {
        let moved = if restart { self.session.restart() } else { self.session.hold() };
        self.moved(view, moved)
    }

    /// Shows the machine after a move; on an error, reports the state that the machine is in.
    fn moved(
        &mut self,
        view: &mut Inspector,
        moved: Result<StopReason, RemoteError>,
    ) -> Result<StopReason, String> {
        match moved {
            Ok(why) => {
                self.session.show(&mut view.session);
                Ok(why)
            }
            Err(error) if self.session.state().activity == Activity::InPeriod => {
                Err(format!("{error}\n{}", self.place(view).trim_end()))
            }
            Err(error) => Err(error.to_string()),
        }
    }

    /// Sets an input port of the machine.
    pub(super) fn set(&mut self, view: &mut Session, place: Place, bits: u32) -> Result<(), String> {
        let program = self.session.program();
        let ports = program.host_registers().map(|port| port.register);
        let port = ports.into_iter().find(|port| place == Place::Register(*port));
        let port = port.ok_or(
            "only input ports and parameters can be set on a board: the host cannot write other registers or data words",
        )?;
        program.check_register(port, bits).map_err(|error| error.to_string())?;
        self.session.set_input(port, bits).map_err(|error| error.to_string())?;
        self.session.show(view);
        Ok(())
    }

    fn let_run(&mut self) -> Result<(), String> {
        if !matches!(self.session.state().activity, Activity::Runs | Activity::InPeriod) {
            self.needs_held()?;
        }
        self.session.go().map_err(|error| error.to_string())?;
        self.leave = Some(FinalState::Running);
        Ok(())
    }

    /// Leaves the machine in its original state, or in the state that the last `hold` or `go` demands; returns that state in words.
    ///
    /// # Errors
    /// If the board does not answer.
    pub(super) fn release(&mut self) -> Result<String, String> {
        let Some(leave) = self.leave.take() else { return Ok(String::new()) };
        let known = if self.session.is_settled() { Ok(()) } else { self.session.ask() };
        let held = matches!(self.session.state().activity, Activity::Held | Activity::InPeriod);
        let left = match known {
            Ok(()) if leave == FinalState::Running && held => self.session.go(),
            known => known,
        };
        left.map_err(|error| error.to_string())?;
        let state = match self.session.state().activity {
            Activity::Runs => "runs",
            Activity::Held | Activity::InPeriod => "stays held",
            Activity::Stopped => "is stopped",
            Activity::Halted => "has halted",
            Activity::Faulted(..) => "has stopped with a fault",
        };
        Ok(format!("the program {state}; {}\n", self.drive()))
    }
}

/// However a session ends, even by a panic, the machine is not left held.
impl Drop for Board {
    fn drop(&mut self) {
        let _ = self.release();
    }
}

impl Console {
    fn board(&mut self) -> Result<(&mut Board, &mut Inspector), String> {
        match &mut self.engine {
            Engine::Board(board) => Ok((board, &mut self.cores[0])),
            Engine::Program | Engine::System(_) => Err("this is not a board".to_owned()),
        }
    }

    /// Holds or restarts the board; returns the first message.
    pub(super) fn begin(&mut self, restart: bool) -> Result<String, String> {
        let (board, view) = self.board()?;
        let begun = board.stop(view, restart).and_then(|why| self.arrive(End { core: 0, why }));
        let (board, _) = self.board()?;
        begun.or_else(|said| {
            // The session continues after a difference, or if the program does not reach its `wait`.
            let goes_on = board.session.is_settled() || board.session.state().activity == Activity::InPeriod;
            if goes_on { Ok(format!("{said}\n")) } else { Err(said) }
        })
    }

    pub(super) fn hold(&mut self) -> Result<String, String> {
        let (board, view) = self.board()?;
        board.leave = Some(FinalState::AsItIs);
        if board.needs_values().is_ok() {
            return Ok(board.place(view));
        }
        let why = board.stop(view, false)?;
        self.arrive(End { core: 0, why })
    }

    pub(super) fn let_run(&mut self) -> Result<String, String> {
        self.board()?.0.let_run()?;
        Ok(self.place())
    }
}

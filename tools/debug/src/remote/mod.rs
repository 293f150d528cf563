// SPDX-License-Identifier: MIT OR Apache-2.0
//! Debug session on a remote machine, such as a board. The machine can be held at the end of a period, inspected, and run for single
//! periods.
//!
//! **State.** The session reads the machine's state into an emulator ([`RemoteSession::show`]), so that all code for a [`Session`] works.
//! Unknown state is left out: operations in flight (none exist between two periods), cycles, and the return stack.
//!
//! **Shadow.** A second emulator runs in step with the machine on the same inputs, which are read back after each period. If the two
//! differ, the difference is reported, and the shadow continues from the machine's values.

mod extent;
mod machine;
mod reference_run;

pub use machine::{Activity, Remote, RemoteError, State};

use crate::session::{Control, Search, Session, StopReason, WatchExpression};
use extent::Extent;
use reference_run::{End, Shadow};
use std::sync::Arc;
use takt_emu::{Emulator, MachineState, Position};
use takt_isa::fp::Flags;
use takt_isa::{Program, Register};

/// Maximum number of periods of one command.
pub const PERIODS: u64 = 1_000_000;

/// End condition of a command, with the registers and memory words that it reads.
pub(crate) struct Goal {
    search: Search,
    registers: Vec<Register>,
    memory: bool,
}

/// Debug session on a remote machine, with an emulator in step as its shadow.
pub struct RemoteSession {
    remote: Box<dyn Remote + Send>,
    control: Arc<Control>,
    extent: Extent,
    /// Program after reset; copies of this emulator take over the machine's state.
    base: Emulator,
    state: State,
    /// Machine state that was read last.
    seen: MachineState,
    shadow: Shadow,
    /// `seen` matches the machine's current state.
    settled: bool,
    /// Search that has the last known values of watched expressions.
    watched: Option<Search>,
}

impl RemoteSession {
    /// Starts a session on a machine that runs this program. Call [`RemoteSession::hold`] or [`RemoteSession::restart`] next.
    ///
    /// # Errors
    /// If the machine does not answer, or the emulator cannot hold the program. A program that does not reach its `wait` is no error.
    pub fn attach(
        program: &Program,
        mut remote: Box<dyn Remote + Send>,
        control: Arc<Control>,
    ) -> Result<RemoteSession, RemoteError> {
        let base = Emulator::new(program)?;
        let mut memory = program.data.clone();
        memory.resize(base.memory().len(), 0);
        let registers = program.constants.iter().copied().collect();
        let seen = MachineState { at: Position::Reset, registers, memory, flags: Flags::NONE };
        let shadow = Shadow::placed(&base, &seen);
        let (extent, state) = (Extent::of(program), remote.state()?);
        Ok(RemoteSession {
            remote,
            control,
            extent,
            base,
            state,
            seen,
            shadow,
            settled: false,
            watched: None,
        })
    }

    /// State of the machine at the last query.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Displayed values match the machine's.
    pub fn is_settled(&self) -> bool {
        self.settled
    }

    /// Program that the machine carries.
    pub fn program(&self) -> &Program {
        self.base.program()
    }

    /// Shows the machine's state in a session of its program.
    pub fn show(&self, view: &mut Session) {
        let mut emulator = self.base.clone();
        let mut seen = self.seen.clone();
        seen.registers.retain(|register, _| self.has_value(*register));
        emulator.restore(&seen);
        view.look_afar(emulator, self.state.periods);
    }

    /// A register has a value once it is written. Input ports always have one.
    fn has_value(&self, register: Register) -> bool {
        self.program().machine.is_input(register) || self.shadow.register(register).is_some()
    }

    // ---- Moving.

    /// Holds the machine at the end of its period, and reads its state. The shadow continues from there.
    ///
    /// # Errors
    /// If the machine does not answer, or does not reach its `wait`.
    pub fn hold(&mut self) -> Result<StopReason, RemoteError> {
        self.settled = false;
        self.state = self.remote.state()?;
        if !self.state.is_still() {
            let held = self.remote.hold();
            self.state = self.remote.state()?;
            held?;
        }
        self.read_inputs()?;
        let extent = self.extent.clone();
        self.read(&extent.registers, &extent.words)?;
        self.synchronise()?;
        // Registers and words that the program does not write must still have their loaded values.
        let started = self.state.activity != Activity::Stopped;
        let loaded = if started { reference_run::loaded(&self.base, &self.seen, &self.extent) } else { None };
        self.settled = true;
        Ok(loaded.map_or_else(|| self.stop_reason(None), StopReason::Differs))
    }

    /// Queries the machine's state.
    ///
    /// # Errors
    /// If the machine does not answer.
    pub fn ask(&mut self) -> Result<(), RemoteError> {
        self.state = self.remote.state()?;
        Ok(())
    }

    /// Lets the machine run freely.
    ///
    /// # Errors
    /// If the machine does not answer.
    pub fn go(&mut self) -> Result<(), RemoteError> {
        self.settled = false;
        self.remote.go()?;
        self.ask()
    }

    /// Lets the machine run until it stops or the user interrupts; then holds it.
    ///
    /// # Errors
    /// If the machine does not answer, or does not reach its `wait`.
    pub fn run_freely(&mut self) -> Result<StopReason, RemoteError> {
        self.go()?;
        let mut interrupted = false;
        while self.state.activity == Activity::Runs && !interrupted {
            self.state = self.remote.poll()?;
            interrupted = self.interrupted();
        }
        match self.hold()? {
            StopReason::Done if interrupted => Ok(StopReason::Interrupted),
            why => Ok(why),
        }
    }

    /// Restarts the program, held at its first `wait`, together with the shadow.
    ///
    /// # Errors
    /// If the machine does not answer, or does not reach its `wait`.
    pub fn restart(&mut self) -> Result<StopReason, RemoteError> {
        self.settled = false;
        self.watched = None;
        let restarted = self.remote.restart();
        self.state = self.remote.state()?;
        restarted?;
        self.read_inputs()?;
        let extent = self.extent.clone();
        self.read(&extent.registers, &extent.words)?;
        let (shadow, end) = Shadow::started(&self.base, &self.inputs());
        self.shadow = shadow;
        let outputs = self.remote.outputs()?;
        let different = self.compare(&outputs, end.as_ref()).or_else(|| self.compare_all());
        self.end_of_move(different, end)
    }

    /// Runs `count` periods, or fewer if `goal` is reached; at most [`PERIODS`].
    ///
    /// # Errors
    /// If the machine does not answer, or does not reach its `wait`.
    pub(crate) fn advance(
        &mut self,
        view: &mut Session,
        count: Option<u64>,
        mut goal: Option<Goal>,
    ) -> Result<StopReason, RemoteError> {
        let (mut why, mut different, mut end) = (StopReason::Done, None, None);
        self.settled = false;
        let most = count.filter(|count| *count <= PERIODS);
        for number in 0.. {
            if most == Some(number) {
                break;
            }
            if number == PERIODS {
                why = StopReason::Limit(PERIODS);
                break;
            }
            if self.interrupted() {
                why = StopReason::Interrupted;
                break;
            }
            (different, end) = self.period()?;
            if different.is_some() || self.state.activity != Activity::Held {
                break;
            }
            let Some(Goal { search, registers, memory }) = &mut goal else { continue };
            let words = if *memory { self.extent.written_words.clone() } else { Vec::new() };
            self.read(registers, &words)?;
            self.show(view);
            if let Some(found) = search.visit(view, None) {
                why = view.stopped(found);
                break;
            }
        }
        if let Some(Goal { search, .. }) = goal
            && search.is_of(view)
        {
            self.watched = Some(search);
        }
        let extent = self.extent.clone();
        self.read(&extent.written, &extent.written_words)?;
        let different = different.or_else(|| self.compare_all());
        match self.end_of_move(different, end)? {
            StopReason::Done => Ok(why),
            other => Ok(other),
        }
    }

    /// Ends a command: reads everything that the program writes, and compares it. After a difference, the shadow continues from the
    /// machine's state.
    fn end_of_move(
        &mut self,
        different: Option<String>,
        end: Option<End>,
    ) -> Result<StopReason, RemoteError> {
        self.record_position()?;
        let why = match different {
            Some(different) => {
                self.synchronise()?;
                StopReason::Differs(different)
            }
            None => self.stop_reason(end),
        };
        self.settled = true;
        Ok(why)
    }

    /// Reason why the machine cannot continue, if the emulator agrees; otherwise `Done`.
    fn stop_reason(&self, end: Option<End>) -> StopReason {
        match (&self.state.activity, end) {
            (Activity::Halted, _) => StopReason::Halted,
            (Activity::Faulted(..), Some(End::Fault(fault))) => StopReason::Fault(fault),
            _ => StopReason::Done,
        }
    }

    /// Runs one period on machine and shadow; returns the first difference at the outputs, and the event that stopped the shadow.
    fn period(&mut self) -> Result<(Option<String>, Option<End>), RemoteError> {
        let before = self.state.periods;
        let stepped = self.remote.step();
        self.state = self.remote.state()?;
        stepped?;
        if self.state.activity == Activity::Held
            && self.state.periods as u32 != (before as u32).wrapping_add(1)
        {
            let text = "it did not run the requested period: is another host connected?";
            return Err(RemoteError::Other(text.to_owned()));
        }
        self.read_inputs()?;
        let outputs = self.remote.outputs()?;
        let end = self.shadow.period(&self.inputs());
        Ok((self.compare(&outputs, end.as_ref()), end))
    }

    fn interrupted(&self) -> bool {
        let interrupted = self.control.report(self.state.periods);
        if interrupted {
            self.control.clear();
        }
        interrupted
    }

    // ---- Reading and setting.

    /// Sets an input port of the machine.
    ///
    /// # Errors
    /// If the machine does not answer.
    pub fn set_input(&mut self, port: Register, bits: u32) -> Result<(), RemoteError> {
        self.remote.set_input(port, bits)?;
        self.seen.registers.insert(port, bits);
        Ok(())
    }

    fn read(&mut self, registers: &[Register], words: &[u32]) -> Result<(), RemoteError> {
        let read = self.remote.registers(registers)?;
        self.seen.registers.extend(registers.iter().copied().zip(read));
        for (word, bits) in words.iter().zip(self.remote.words(words)?) {
            if let Some(place) = self.seen.memory.get_mut(*word as usize) {
                *place = bits;
            }
        }
        Ok(())
    }

    fn read_inputs(&mut self) -> Result<(), RemoteError> {
        let read = self.remote.inputs()?;
        let ports = self.base.program().host_registers().map(|port| port.register);
        self.seen.registers.extend(ports.zip(read));
        Ok(())
    }

    fn inputs(&self) -> Vec<(Register, u32)> {
        let ports = self.program().host_registers().map(|port| port.register);
        ports.filter_map(|port| Some((port, *self.seen.registers.get(&port)?))).collect()
    }

    /// Updates the machine's position in `seen`.
    fn record_position(&mut self) -> Result<(), RemoteError> {
        let State { activity, issued, flags, .. } = &self.state;
        self.seen.flags = *flags;
        self.seen.at = match activity {
            Activity::Stopped => Position::Reset,
            Activity::Halted => Position::Stopped(*issued),
            Activity::Faulted(address, _) => Position::Stopped(*address),
            _ => Position::Wait(*issued),
        };
        if self.base.clone().restore(&self.seen) {
            return Ok(());
        }
        let text = format!("it waits at bundle {issued}, where the program has no `wait`");
        Err(RemoteError::Other(text))
    }

    /// Copies the machine's state into the shadow.
    fn synchronise(&mut self) -> Result<(), RemoteError> {
        self.record_position()?;
        self.shadow = Shadow::placed(&self.base, &self.seen);
        Ok(())
    }

    // ---- Comparing.

    /// First difference in the outcome of the period, or at the outputs.
    fn compare(&self, outputs: &[u32], end: Option<&End>) -> Option<String> {
        let different = self.shadow.ended(&self.state, end, self.program()).or_else(|| {
            let inputs = self.inputs();
            self.shadow.outputs(outputs, &inputs, self.program())
        })?;
        Some(format!("period {}: {different}", self.state.periods))
    }

    /// First difference in a register or data word that the program writes.
    fn compare_all(&self) -> Option<String> {
        let different = self.shadow.values(&self.seen, &self.extent, self.program())?;
        Some(format!("after period {}: {different}", self.state.periods))
    }

    /// Goal of a run: the expression, or without one the session's stops. `None` if there are no stops.
    pub(crate) fn goal(&self, view: &Session, live: Option<WatchExpression>) -> Option<Goal> {
        let reads = view.reads(live.as_ref());
        let search = match live {
            Some(live) => Search::value(live, view),
            None => {
                let mut search = Search::stops(view)?;
                // A remote machine cannot go back to find previous values; take them from the last command.
                self.watched.iter().for_each(|watched| search.complete(watched));
                search
            }
        };
        let written = |register: &Register| self.extent.registers.binary_search(register).is_ok();
        Some(Goal {
            search,
            registers: reads.registers.into_iter().filter(written).collect(),
            memory: reads.memory,
        })
    }
}

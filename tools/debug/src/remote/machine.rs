// SPDX-License-Identifier: MIT OR Apache-2.0
//! Interface to a remote machine: state and commands.

use takt_emu::LoadError;
use takt_isa::fp::Flags;
use takt_isa::{BundleAddress, Register};

/// Activity of a remote machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Activity {
    /// In reset; the program does not run.
    Stopped,
    /// Executing one period after another.
    Runs,
    /// Held at its `wait`, without ticks.
    Held,
    /// In a period: the `wait` has not been reached, and ticks are off.
    InPeriod,
    /// Stopped by the program's `halt`.
    Halted,
    /// Stopped by a fault in this bundle, with the reason.
    Faulted(BundleAddress, String),
}

/// State that the machine reports at any time, even while it runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct State {
    /// Activity at the time of the query.
    pub activity: Activity,
    /// Bundle that issued last.
    pub issued: BundleAddress,
    /// Periods completed since the start.
    pub periods: u64,
    /// Sticky exception flags of the machine.
    pub flags: Flags,
    /// The output pins are driven by the program; otherwise they are at their safe levels.
    pub drives: bool,
}

impl State {
    /// Values can be read, and remain unchanged until a command moves the machine.
    pub(super) fn is_still(&self) -> bool {
        !matches!(self.activity, Activity::Runs | Activity::InPeriod)
    }
}

/// Errors of a remote machine.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RemoteError {
    /// The program does not reach its `wait`.
    #[error("the program does not come to its `wait`, and values can be read only where it waits")]
    Busy,
    /// Another error, in words, for example no answer.
    #[error("{0}")]
    Other(String),
}

impl From<LoadError> for RemoteError {
    fn from(error: LoadError) -> RemoteError {
        RemoteError::Other(error.to_string())
    }
}

/// A remote machine. Each method fails if the machine does not answer.
#[allow(clippy::missing_errors_doc, reason = "said above, once")]
pub trait Remote {
    /// Queries the state without delay.
    fn state(&mut self) -> Result<State, RemoteError>;

    /// Queries the state after a short delay, which limits the rate of queries in a waiting loop.
    fn poll(&mut self) -> Result<State, RemoteError>;

    /// Stops the ticks. Afterwards the machine waits between two periods, or has stopped.
    fn hold(&mut self) -> Result<(), RemoteError>;

    /// Resumes the ticks after `hold`.
    fn go(&mut self) -> Result<(), RemoteError>;

    /// Runs one period of a held machine. Afterwards the machine waits again, or has stopped.
    fn step(&mut self) -> Result<(), RemoteError>;

    /// Restarts the program and holds it at its first `wait`, unless it stops earlier.
    fn restart(&mut self) -> Result<(), RemoteError>;

    /// Sets an input port for all later periods.
    fn set_input(&mut self, port: Register, bits: u32) -> Result<(), RemoteError>;

    /// Values of the input ports during the last period, in the program's port order.
    fn inputs(&mut self) -> Result<Vec<u32>, RemoteError>;

    /// Values of the output ports as visible outside the core, in the program's port order.
    fn outputs(&mut self) -> Result<Vec<u32>, RemoteError>;

    /// Values of the given registers, which must be in ascending order.
    fn registers(&mut self, registers: &[Register]) -> Result<Vec<u32>, RemoteError>;

    /// Values of the given data words, which must be in ascending order.
    fn words(&mut self, words: &[u32]) -> Result<Vec<u32>, RemoteError>;
}

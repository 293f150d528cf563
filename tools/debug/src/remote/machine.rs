// SPDX-License-Identifier: MIT OR Apache-2.0
//! A machine that runs elsewhere: what it does, and what it can be asked to do.

use takt_emu::LoadError;
use takt_isa::fp::Flags;
use takt_isa::{BundleAddress, Register};

/// The activity of a machine that runs elsewhere.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Activity {
    /// It is in reset.
    Stopped,
    /// Its periods follow one another.
    Runs,
    /// It gets no tick, and waits for one.
    Held,
    /// It gets no tick, but has not come to its `wait` yet.
    InPeriod,
    /// `halt` stopped it.
    Halted,
    /// A fault stopped it, at this bundle, for this reason.
    Faulted(BundleAddress, String),
}

/// The state that such a machine reports at any time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct State {
    /// Its activity.
    pub activity: Activity,
    /// The bundle that issued last.
    pub issued: BundleAddress,
    /// Periods that have ended since its start.
    pub periods: u64,
    /// The sticky exception flags.
    pub flags: Flags,
    /// True if its outputs drive.
    pub drives: bool,
}

impl State {
    /// True if values can be read, and stay the same until a command moves the machine.
    pub(super) fn is_still(&self) -> bool {
        !matches!(self.activity, Activity::Runs | Activity::InPeriod)
    }
}

/// The reason why the machine did not do what was asked.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RemoteError {
    /// The program does not come to its `wait`.
    #[error("the program does not come to its `wait`, and values can be read only where it waits")]
    Busy,
    /// Anything else, such as no answer, in words.
    #[error("{0}")]
    Other(String),
}

impl From<LoadError> for RemoteError {
    fn from(error: LoadError) -> RemoteError {
        RemoteError::Other(error.to_string())
    }
}

/// A machine that runs elsewhere. Each method may fail because the machine does not answer.
#[allow(clippy::missing_errors_doc, reason = "said above, once")]
pub trait Remote {
    /// Its state now.
    fn state(&mut self) -> Result<State, RemoteError>;

    /// The same, after a short time, so that it is not asked all the time.
    fn poll(&mut self) -> Result<State, RemoteError>;

    /// Gives no more ticks. On return, the machine waits between two periods, or has stopped.
    fn hold(&mut self) -> Result<(), RemoteError>;

    /// Gives ticks again.
    fn go(&mut self) -> Result<(), RemoteError>;

    /// Runs one period while the machine is held. On return, it waits again, or has stopped.
    fn step(&mut self) -> Result<(), RemoteError>;

    /// Runs from the beginning to the first `wait`, where the machine is held, or to where it stops.
    fn restart(&mut self) -> Result<(), RemoteError>;

    /// Sets an input port for the periods to come.
    fn set_input(&mut self, port: Register, bits: u32) -> Result<(), RemoteError>;

    /// Input ports as the period had them, in the program's order.
    fn inputs(&mut self) -> Result<Vec<u32>, RemoteError>;

    /// Output ports as the outside sees them, in the program's order.
    fn outputs(&mut self) -> Result<Vec<u32>, RemoteError>;

    /// The values of registers, given in ascending order.
    fn registers(&mut self, registers: &[Register]) -> Result<Vec<u32>, RemoteError>;

    /// The values of data words, given in ascending order.
    fn words(&mut self, words: &[u32]) -> Result<Vec<u32>, RemoteError>;
}

//! A machine that runs elsewhere: what it does, and what can be asked of it.

use takt_emu::LoadError;
use takt_isa::fp::Flags;
use takt_isa::{BundleAddress, Register};

/// What a machine does that runs elsewhere.
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

/// What it tells about itself at any time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct State {
    /// What it does.
    pub activity: Activity,
    /// The bundle that issued last.
    pub issued: BundleAddress,
    /// Periods that have ended since its start.
    pub periods: u64,
    /// The sticky exception flags.
    pub flags: Flags,
    /// Whether its outputs drive.
    pub drives: bool,
}

impl State {
    /// Whether values can be read, and stay as they are until somebody moves it.
    pub(super) fn is_still(&self) -> bool {
        !matches!(self.activity, Activity::Runs | Activity::InPeriod)
    }
}

/// Why it did not do what was asked.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RemoteError {
    /// The program does not come to its `wait`.
    #[error("the program does not come to its `wait`, and values can be read only where it waits")]
    Busy,
    /// It does not answer, or something else, in words.
    #[error("{0}")]
    Other(String),
}

impl From<LoadError> for RemoteError {
    fn from(error: LoadError) -> RemoteError {
        RemoteError::Other(error.to_string())
    }
}

/// A machine that runs elsewhere. Each may fail because it does not answer.
#[allow(clippy::missing_errors_doc, reason = "said above, once")]
pub trait Remote {
    /// What it does now.
    fn state(&mut self) -> Result<State, RemoteError>;

    /// The same, after a little time in which it may have done something.
    fn poll(&mut self) -> Result<State, RemoteError>;

    /// No more ticks. It then waits between two periods, or has stopped.
    fn hold(&mut self) -> Result<(), RemoteError>;

    /// Ticks again.
    fn go(&mut self) -> Result<(), RemoteError>;

    /// One period while it is held. It then waits again, or has stopped.
    fn step(&mut self) -> Result<(), RemoteError>;

    /// From its beginning to its first `wait`, and held there, or to where it has stopped.
    fn restart(&mut self) -> Result<(), RemoteError>;

    /// Sets an input port for the periods to come.
    fn set_input(&mut self, port: Register, bits: u32) -> Result<(), RemoteError>;

    /// Input ports as the period had them, in the program's order.
    fn inputs(&mut self) -> Result<Vec<u32>, RemoteError>;

    /// Output ports as the outside sees them, in the program's order.
    fn outputs(&mut self) -> Result<Vec<u32>, RemoteError>;

    /// Registers, which ascend.
    fn registers(&mut self, registers: &[Register]) -> Result<Vec<u32>, RemoteError>;

    /// Data words, which ascend.
    fn words(&mut self, words: &[u32]) -> Result<Vec<u32>, RemoteError>;
}

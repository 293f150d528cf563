// SPDX-License-Identifier: MIT OR Apache-2.0
//! Cycle-accurate emulator of Takt machines.
//!
//! [`Emulator`] holds a machine with a program in it and gives plain data: load it, step a cycle or a bundle, run it, run a period with
//! named inputs, read any state, ask where the cycles went. To observe every issue, writeback and tick, run it through
//! [`Emulator::observed`]. The crate prints nothing.
//!
//! ```
//! # use takt_emu::{Emulator, Number};
//! # fn run(program: &takt_isa::Program) -> Result<(), Box<dyn std::error::Error>> {
//! let mut emulator = Emulator::new(program)?;
//! for _ in 0..100 {
//!     let report = emulator.run_period(&[("position", Number::Float(0.1))])?;
//!     println!("{} cycles, force {:?}", report.cycles, emulator.output("force")?);
//! }
//! println!("{:?}", emulator.statistics());
//! # Ok(())
//! # }
//! ```
//!
//! Two modes of execution agree in all observable state. The *stepper* (`cycle`) executes cycle by cycle, by the rules of
//! [`takt_isa::timing`], which `docs/timing.md` states in prose. *Blocks* (`block`, `fast_path`) are a translation cache: since timing
//! does not depend on data, straight-line code is timed once, and from then on only its arithmetic is executed. Special cases (a fault,
//! the cycle limit, an observer) are left to the stepper. `tests/agreement.rs` compares the two.
//!
//! The modes handle instructions by their effects; no instruction is named.

mod batch;
mod block;
mod code;
mod cycle;
mod emulator;
mod event;
mod execute;
mod fast_path;
mod fault;
mod io;
#[cfg(all(feature = "jit", target_arch = "x86_64"))]
mod jit;
/// Substitute for the compiler where the host has none: blocks are interpreted.
#[cfg(not(all(feature = "jit", target_arch = "x86_64")))]
#[path = "jit/unsupported.rs"]
mod jit;
mod lane;
mod machine;
mod micro;
mod restore;
mod statistics;

#[cfg(feature = "testing")]
pub mod testing;

pub use batch::Batch;
pub use emulator::{CompiledRuns, Emulator, MAX_CYCLE, ObservedEmulator, PredictedIssue, Status, Step, Stop};
pub use event::{Event, PortWrite, Retire};
pub use fault::{Fault, FaultDisplay, FaultKind, LoadError};
pub use io::{LONGEST_TICK, Number, PeriodError, PeriodReport, PortError, Row, Rows};
pub use machine::MAX_NAN_WRITES;
pub use restore::{MachineState, Position, WaitingState};
pub use statistics::Statistics;

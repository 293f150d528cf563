//! A run up to the period that is looked at.

use crate::accuracy::Shadow;
use crate::{Trace, TraceError, trace};
use takt_emu::{Emulator, LoadError, PeriodError, PortError, Status};
use takt_isa::timing::Cycle;
use takt_isa::{Program, Register};

/// Cycles in which a period ends, or nobody expects it to any more.
pub const PERIOD_LIMIT: Cycle = 1_000_000_000;
/// Periods that are run at most on the way to the one to look at.
pub const MOST_PERIODS: u64 = 1_000_000;
/// Periods that are run where nobody says how many.
pub const PERIODS: u64 = 2;

/// Why a period cannot be looked at.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PeriodRunError {
    /// The program does not fit its machine.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// What runs once cannot be followed.
    #[error(transparent)]
    Once(TraceError),
    /// An input cannot be set.
    #[error(transparent)]
    Port(#[from] PortError),
    /// A period on the way failed.
    #[error("period {period}")]
    Period {
        /// Which.
        period: u64,
        /// Why.
        source: PeriodError,
    },
    /// The period itself failed.
    #[error("period {period}")]
    Trace {
        /// Which.
        period: u64,
        /// Why.
        source: TraceError,
    },
    /// There is no such period.
    #[error("the program halts before period {wanted}; the last is {halted}")]
    Halted {
        /// The one that is asked for.
        wanted: u64,
        /// The one that it halted in.
        halted: u64,
    },
}

/// A period that was looked at.
#[derive(Clone)]
pub struct PeriodRun {
    /// When everything happened.
    pub trace: Trace,
    /// Which period; 0 is what runs once.
    pub period: u64,
    /// How exact it was, by itself.
    pub shadow: Shadow,
}

/// Runs the program and follows period `wanted`, or else the last of `rows`, which has register and bits of the
/// inputs of each period.
///
/// # Errors
/// See [`PeriodRunError`].
pub fn run_to_period(
    program: &Program,
    rows: &[Vec<(Register, u32)>],
    wanted: Option<u64>,
) -> Result<PeriodRun, PeriodRunError> {
    let given = wanted.is_some();
    let wanted = wanted.unwrap_or(rows.len() as u64);
    let mut emulator = Emulator::new(program)?;
    let set = |emulator: &mut Emulator, period: u64| -> Result<(), PeriodRunError> {
        for &(register, bits) in rows.get(period.saturating_sub(1) as usize).into_iter().flatten() {
            emulator.set_input_bits(register, bits)?;
        }
        emulator.set_cycle_limit(emulator.now() + PERIOD_LIMIT);
        Ok(())
    };
    set(&mut emulator, 0)?;
    let mut before = emulator.clone();
    let mut found = trace(&mut emulator).map_err(PeriodRunError::Once)?;
    let mut period = 0;
    while period < wanted && !matches!(emulator.status(), Status::Halted { .. }) {
        period += 1;
        set(&mut emulator, period)?;
        if period < wanted {
            emulator.run_period(&[]).map_err(|source| PeriodRunError::Period { period, source })?;
        } else {
            before = emulator.clone();
            found = trace(&mut emulator).map_err(|source| PeriodRunError::Trace { period, source })?;
        }
    }
    if period < wanted && (given || period > 0) {
        return Err(PeriodRunError::Halted { wanted, halted: period });
    }
    let mut shadow = Shadow::new(program);
    // It goes through what has been traced without a fault.
    let _ = shadow.run_period(&mut before);
    Ok(PeriodRun { trace: found, period, shadow })
}

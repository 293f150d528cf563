// SPDX-License-Identifier: MIT OR Apache-2.0
//! Runs a program up to the period under examination, and traces that period.

use crate::accuracy::Shadow;
use crate::{Trace, TraceError, trace};
use takt_emu::{Emulator, LoadError, PeriodError, PortError, Status};
use takt_isa::timing::Cycle;
use takt_isa::{Program, Register};

/// Cycle limit of one period: a longer period counts as endless.
pub const PERIOD_LIMIT: Cycle = 1_000_000_000;
/// Greatest number of periods that a user can ask for.
pub const MOST_PERIODS: u64 = 1_000_000;
/// Number of periods to run by default.
pub const PERIODS: u64 = 2;

/// Reason why a period has no trace.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PeriodRunError {
    /// The program does not fit its machine.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// The section `.once`, which runs before the first period, cannot be traced.
    #[error(transparent)]
    Once(TraceError),
    /// An input cannot be set.
    #[error(transparent)]
    Port(#[from] PortError),
    /// A period before the traced one failed.
    #[error("period {period}")]
    Period {
        /// Number of the failed period.
        period: u64,
        /// Fault, or input that cannot be set.
        source: PeriodError,
    },
    /// The period to be traced failed.
    #[error("period {period}")]
    Trace {
        /// Number of the traced period.
        period: u64,
        /// Reason why the trace failed.
        source: TraceError,
    },
    /// The program halts before the period to be traced.
    #[error("the program halts before period {wanted}; the last is {halted}")]
    Halted {
        /// Number of the requested period.
        wanted: u64,
        /// Period in which the program halts.
        halted: u64,
    },
}

/// Traced period, with its rounding errors.
#[derive(Clone)]
pub struct PeriodRun {
    /// Issues and stalls of the period.
    pub trace: Trace,
    /// Number of the period, from 1; 0 is the section that runs once.
    pub period: u64,
    /// Rounding errors made in this period alone: the values at its start count as exact.
    pub shadow: Shadow,
}

/// Runs the program up to period `wanted`, by default the period of the last row, and traces that period. Each of `rows` holds the inputs
/// of one period, as registers and bits.
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
    // The trace of the same period has shown no fault, so this run has none either.
    let _ = shadow.run_period(&mut before);
    Ok(PeriodRun { trace: found, period, shadow })
}

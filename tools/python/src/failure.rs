// SPDX-License-Identifier: MIT OR Apache-2.0
//! Events that end a run early, for Python.

use pyo3::prelude::*;
use takt_debug::fault::diagnose;
use takt_emu::{Fault, FaultKind, PeriodError};
use takt_isa::Program;
use takt_programs::plants::LoopError;

/// An event that ended a run.
#[pyclass(name = "Fault", frozen, get_all, module = "takt")]
#[derive(Clone, Debug)]
pub(crate) struct Failure {
    /// Number of the run in a batch, from 0.
    pub(crate) run: usize,
    /// Number of the period in which the event occurred, from 0.
    pub(crate) period: usize,
    /// Kind of the event in a word or two, such as `data address`; `halted` if the program has halted, `plant` if the
    /// plant failed or diverged.
    pub(crate) kind: String,
    /// Description of the event.
    pub(crate) message: String,
    /// Cycle of the event, counted from reset.
    pub(crate) cycle: Option<u64>,
    /// Address of the bundle.
    pub(crate) bundle: Option<u32>,
    /// Slot of the operation, if a single operation caused the event.
    pub(crate) slot: Option<String>,
    /// Source file, if the program knows it.
    pub(crate) file: Option<String>,
    /// Line number in the source file, from 1.
    pub(crate) line: Option<u32>,
    /// Complete message, with the source line if its text is available.
    pub(crate) text: String,
}

/// Fields of a failure for pickling, in order; the text comes last.
type Parts = (
    (usize, usize),
    (String, String, String),
    (Option<u64>, Option<u32>, Option<String>),
    (Option<String>, Option<u32>),
);

/// Restores a pickled failure.
#[pyfunction]
pub(crate) fn restored_fault(place: Parts) -> Failure {
    let ((run, period), (kind, message, text), (cycle, bundle, slot), (file, line)) = place;
    Failure { run, period, kind, message, cycle, bundle, slot, file, line, text }
}

#[pymethods]
impl Failure {
    /// Reduces the failure for `pickle`.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (Parts,))> {
        let Failure { run, period, kind, message, cycle, bundle, slot, file, line, text } = self.clone();
        let parts = ((run, period), (kind, message, text), (cycle, bundle, slot), (file, line));
        Ok((py.import("takt._takt")?.getattr("restored_fault")?, (parts,)))
    }

    fn __repr__(&self) -> String {
        let place = match (&self.file, self.line) {
            (Some(file), Some(line)) => format!("{file}:{line}: "),
            _ => String::new(),
        };
        format!("<Fault in run {}, period {}: {place}{}>", self.run, self.period, self.message)
    }

    fn __str__(&self) -> &str {
        &self.text
    }
}

/// Failure for an error of a period.
pub(crate) fn of_period(
    error: &PeriodError,
    (run, period): (usize, usize),
    program: &Program,
    sources: &[(String, String)],
) -> Failure {
    match error {
        PeriodError::Fault(fault) => of_fault(fault, (run, period), program, sources),
        PeriodError::Halted => plain("halted", error.to_string(), (run, period)),
        PeriodError::Port(error) => plain("port", error.to_string(), (run, period)),
    }
}

/// Failure of a plant.
pub(crate) fn of_loop(error: &LoopError) -> Failure {
    let (LoopError::Failed { period, .. } | LoopError::Diverged { period, .. }) = error;
    plain("plant", error.to_string(), (0, *period as usize))
}

/// Failure without a place in the program.
pub(crate) fn plain(kind: &str, message: String, (run, period): (usize, usize)) -> Failure {
    Failure {
        run,
        period,
        kind: kind.to_owned(),
        text: message.clone(),
        message,
        cycle: None,
        bundle: None,
        slot: None,
        file: None,
        line: None,
    }
}

/// Failure for a fault, with its source line.
pub(crate) fn of_fault(
    fault: &Fault,
    (run, period): (usize, usize),
    program: &Program,
    sources: &[(String, String)],
) -> Failure {
    let mut diagnostics = diagnose(fault, program, sources);
    for diagnostic in &mut diagnostics.list {
        if let (FaultKind::CycleLimit { .. }, Some(help)) = (&fault.kind, &mut diagnostic.help) {
            help.push_str(" (`max_cycles` sets the limit)");
        }
    }
    let location = fault.location(program);
    Failure {
        run,
        period,
        kind: fault.kind.name().to_owned(),
        message: fault.show(program).message(),
        cycle: Some(fault.cycle),
        bundle: Some(fault.address.get()),
        slot: fault.slot.map(|slot| program.machine.slot(slot).name.to_owned()),
        file: location.and_then(|location| program.files.get(location.file as usize).cloned()),
        line: location.map(|location| location.line),
        text: diagnostics.render(false).trim_end().to_owned(),
    }
}

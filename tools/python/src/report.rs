// SPDX-License-Identifier: MIT OR Apache-2.0
//! Report on the cycles of a period, as in `takt analyse`.

use crate::failure::{self, Failure};
use crate::program::Program;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use takt_analysis::TraceError;
use takt_analysis::period::{MOST_PERIODS, PeriodRun, PeriodRunError, run_to_period};
use takt_analysis::picture::Picture;
use takt_analysis::what_if::{Candidate, what_if};
use takt_asm::schedule::BlockReport;
use takt_emu::PeriodError;
use takt_isa::timing::Cycle;
use takt_isa::{Machine, Register};

/// Text, JSON and page; or the event that ended the run early.
type AnalysisResult = (Option<(String, String, String)>, Option<Failure>);

/// Runs the program with the given words on its input ports, one row per period, and analyses period `wanted`, or else the last. With
/// `reassemble`, the program is also assembled for each faster machine.
#[pyfunction]
pub(crate) fn analyse(
    py: Python<'_>,
    program: &Program,
    name: String,
    rows: Vec<Vec<u32>>,
    wanted: Option<u64>,
    reassemble: bool,
) -> PyResult<AnalysisResult> {
    let ports = &program.program.inputs;
    if let Some(row) = rows.iter().find(|row| row.len() != ports.len()) {
        let text = format!("{} inputs; the program has {}", row.len(), ports.len());
        return Err(PyValueError::new_err(text));
    }
    if let Some(many) = wanted.into_iter().chain([rows.len() as u64]).find(|many| *many > MOST_PERIODS) {
        let text = format!("{many} periods: at most {MOST_PERIODS} are run to reach the selected period");
        return Err(PyValueError::new_err(text));
    }
    let registers: Vec<Register> = ports.iter().map(|port| port.register).collect();
    let rows: Vec<Vec<(Register, u32)>> =
        rows.into_iter().map(|row| registers.iter().copied().zip(row).collect()).collect();
    let assemble = |machine: &'static Machine| {
        let assembled = reassemble.then(|| program.again(machine))??;
        let above = |block: &BlockReport| Cycle::from(block.cycles.saturating_sub(block.bound.cycles()));
        let spare = assembled.blocks.iter().map(|block| (block.address, above(block))).collect();
        Some(Candidate { program: assembled.program, spare })
    };
    let source = &*program.program;
    let again = |program: &takt_isa::Program| Some(run_to_period(program, &rows, wanted).ok()?.trace);
    let made = py.detach(|| {
        let PeriodRun { trace, period, .. } = run_to_period(source, &rows, wanted)?;
        let faster = what_if(source, &trace, &assemble, &again);
        let picture = Picture { faster, ..Picture::new(source, name, period, trace) };
        Ok((picture.text(), picture.json().to_string(), picture.html()))
    });
    let failed = |fault, period: u64| {
        let place = (0, period.saturating_sub(1) as usize);
        Ok((None, Some(failure::of_fault(fault, place, &program.program, &program.sources))))
    };
    match made {
        Ok(made) => Ok((Some(made), None)),
        Err(PeriodRunError::Once(TraceError::Fault(fault))) => failed(&fault, 0),
        Err(PeriodRunError::Period { period, source: PeriodError::Fault(fault) })
        | Err(PeriodRunError::Trace { period, source: TraceError::Fault(fault) }) => failed(&fault, period),
        Err(PeriodRunError::Once(error)) => Err(PyValueError::new_err(error.to_string())),
        Err(PeriodRunError::Period { period, source }) => {
            Err(PyValueError::new_err(format!("period {period}: {source}")))
        }
        Err(PeriodRunError::Trace { period, source }) => {
            Err(PyValueError::new_err(format!("period {period}: {source}")))
        }
        Err(error) => Err(PyValueError::new_err(error.to_string())),
    }
}

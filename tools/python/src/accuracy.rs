// SPDX-License-Identifier: MIT OR Apache-2.0
//! Errors of a run's outputs against binary64, and bounds on the errors of all runs, as in `takt accuracy`.

use crate::failure::{self, Failure};
use crate::interrupt::Interrupt;
use crate::program::{NoBoundError, Program};
use crate::run::{loaded, port_error};
use numpy::{PyReadonlyArray, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::num::NonZeroU64;
use takt_analysis::accuracy::{ErrorShare, Interval, LargestError, Moment, OutputAccuracy, Shadow};
use takt_emu::{Emulator, Fault};

/// Largest error: error, period from 0, value of the output, and value in binary64.
type LargestErrorOf = (f64, u64, f64, f64);

/// Measured accuracy of an output.
#[derive(IntoPyObject)]
pub(crate) struct MeasuredOutput {
    name: String,
    periods: u64,
    absolute: Option<LargestErrorOf>,
    ulp: Option<LargestErrorOf>,
    relative: Option<LargestErrorOf>,
    /// Places of operations, each with its share of the largest absolute error.
    operations: Vec<(String, f64)>,
}

impl MeasuredOutput {
    fn of(output: &OutputAccuracy, program: &takt_isa::Program) -> MeasuredOutput {
        let largest = |worst: Option<LargestError>| {
            worst.map(|LargestError { error, period, value, exact }| {
                (error, period.saturating_sub(1), value, exact)
            })
        };
        let place = |part: &ErrorShare| (program.word_text(part.word as usize), part.error);
        MeasuredOutput {
            name: output.name.clone(),
            periods: output.periods,
            absolute: largest(output.absolute),
            ulp: largest(output.ulp),
            relative: largest(output.relative),
            operations: output.parts.iter().map(place).collect(),
        }
    }
}

/// Lower and upper end of an interval.
type IntervalEnds = (f64, f64);

fn ends(interval: Interval) -> IntervalEnds {
    (interval.low, interval.high)
}

/// Proved bounds of an output.
#[derive(IntoPyObject)]
pub(crate) struct OutputBound {
    name: String,
    range: Option<IntervalEnds>,
    error: Option<f64>,
    ulp: Option<f64>,
    /// Places of operations, each with the largest error that its rounding contributes.
    operations: Vec<(String, f64)>,
}

/// Warning: text, place, and the operation's operands with their ranges.
type Hazard = (String, String, Vec<(String, Option<IntervalEnds>)>);

/// Assumption on a state: name, range, whether it concerns the start of the first period instead of the end of every period, and the
/// range found.
type StateAssumption = (String, IntervalEnds, bool, Option<IntervalEnds>);

/// Encloses the results of every period.
#[pyfunction]
pub(crate) fn enclose(
    py: Python<'_>,
    program: &Program,
) -> PyResult<(Vec<OutputBound>, Vec<Hazard>, Vec<StateAssumption>)> {
    let program = &program.program;
    let found = py
        .detach(|| {
            takt_analysis::accuracy::enclose_in_boxes(program, &takt_analysis::accuracy::Reals::default())
        })
        .map_err(|error| NoBoundError::new_err(format!("no bound: {error}")))?;
    let output = |output: &takt_analysis::accuracy::OutputBound| OutputBound {
        name: output.name.clone(),
        range: output.range.map(ends),
        error: output.error,
        ulp: output.ulps(),
        operations: output
            .parts
            .iter()
            .map(|(word, error)| (program.word_text(*word as usize), *error))
            .collect(),
    };
    let hazard = |hazard: &takt_analysis::accuracy::Hazard| {
        let operands = hazard.operands.iter();
        let operands = operands.map(|(register, range)| (program.register_text(*register), range.map(ends)));
        (program.word_text(hazard.word as usize), hazard.problem.to_string(), operands.collect())
    };
    let assumed = |state: &takt_analysis::accuracy::UnprovedRange| {
        let first = state.moment == Moment::First;
        (state.range.name(program), state.range.ends(), first, state.found.map(ends))
    };
    Ok((
        found.outputs.iter().map(output).collect(),
        found.hazards.iter().map(hazard).collect(),
        found.assumed.iter().map(assumed).collect(),
    ))
}

/// Runs the program on input words by period and port, in parallel with the same operations in binary64.
#[pyfunction]
pub(crate) fn accuracy(
    py: Python<'_>,
    program: &Program,
    inputs: PyReadonlyArray<'_, u32, numpy::Ix2>,
    each_period: bool,
    max_cycles: NonZeroU64,
) -> PyResult<(Vec<MeasuredOutput>, Option<Failure>)> {
    let ports = &program.program.inputs;
    if inputs.shape().get(1) != Some(&ports.len()) {
        let text = format!("inputs of shape {:?}; the program has {}", inputs.shape(), ports.len());
        return Err(PyValueError::new_err(text));
    }
    let words = inputs.as_slice().map_err(|_| PyValueError::new_err("inputs is not contiguous"))?;
    let periods = inputs.shape().first().copied().unwrap_or(0);
    let row = |period: usize| &words[period * ports.len()..][..ports.len()];
    let measured = || -> PyResult<Result<Vec<MeasuredOutput>, (Fault, usize)>> {
        let mut emulator = loaded(Emulator::new(&program.program))?;
        let shadow = Shadow::new(&program.program);
        let mut shadow = if each_period { shadow.each_period_afresh() } else { shadow };
        let mut interrupt = Interrupt::new();
        'run: for period in 0..periods {
            for (port, bits) in ports.iter().zip(row(period)) {
                emulator.set_input_bits(port.register, *bits).map_err(port_error)?;
            }
            // The code that runs once also sees the first period's inputs.
            for _ in 0..if period == 0 { 2 } else { 1 } {
                interrupt.check_now()?;
                emulator.set_cycle_limit(emulator.now().saturating_add(max_cycles.get()));
                match shadow.run_period(&mut emulator) {
                    Ok(true) => {}
                    Ok(false) => break 'run,
                    Err(fault) => return Ok(Err((fault, period))),
                }
            }
        }
        Ok(Ok(shadow.outputs().iter().map(|output| MeasuredOutput::of(output, &program.program)).collect()))
    };
    Ok(match py.detach(measured)? {
        Ok(outputs) => (outputs, None),
        Err((fault, period)) => {
            let failure = failure::of_fault(&fault, (0, period), &program.program, &program.sources);
            (Vec::new(), Some(failure))
        }
    })
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Many closed loops at once: a batch that Python steps over arrays.

use crate::failure::{self, Failure};
use crate::program::Program;
use crate::run::{UNWRITTEN, loaded, misses, output_state, port_error, shaped, writable};
use numpy::{PyReadonlyArray, PyReadwriteArray};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::num::NonZeroU64;
use std::sync::Arc;
use takt_emu::Batch;

/// Machines that run the same program, stepped together period by period.
#[pyclass(module = "takt._takt")]
pub(crate) struct Lanes {
    program: Arc<takt_isa::Program>,
    sources: Arc<Vec<(String, String)>>,
    tick: Option<NonZeroU64>,
    max_cycles: u64,
    batch: Batch,
    /// Addresses of data memory words that serve as outputs, after the ports.
    words: Vec<usize>,
    /// Whether each run has failed.
    failed: Vec<bool>,
    #[pyo3(get)]
    failures: Vec<Failure>,
    #[pyo3(get)]
    periods: usize,
}

impl Lanes {
    fn set(&mut self) {
        self.batch.set_tick_period(self.tick);
        self.batch.set_period_limit(self.max_cycles);
    }

    /// Runs a period of all runs; `inputs` and `outputs` are indexed by port and run.
    fn run(
        &mut self,
        inputs: &[u32],
        outputs: &mut [u32],
        cycles: &mut [u64],
        missed: &mut [u64],
    ) -> PyResult<()> {
        let runs = self.failed.len();
        for (port, series) in self.program.inputs.iter().zip(inputs.chunks_exact(runs)) {
            self.batch.set_input_bits(port.register, series).map_err(port_error)?;
        }
        self.batch.run_period();
        for run in 0..runs {
            (cycles[run], missed[run]) = (0, 0);
            match self.batch.outcome(run) {
                Some(Ok(report)) if !self.failed[run] => {
                    (cycles[run], missed[run]) = (report.cycles, misses(&report));
                }
                Some(Err(error)) if !self.failed[run] => {
                    let place = (run, self.periods);
                    self.failed[run] = true;
                    self.failures.push(failure::of_period(&error, place, &self.program, &self.sources));
                }
                _ => {}
            }
        }
        for (port, series) in self.program.outputs.iter().zip(outputs.chunks_exact_mut(runs)) {
            for (run, value) in series.iter_mut().enumerate() {
                let bits = (!self.failed[run]).then(|| self.batch.output_bits(run, port.register));
                *value = output_state(port, bits.flatten());
            }
        }
        let behind = &mut outputs[self.program.outputs.len() * runs..];
        for run in (0..runs).filter(|_| !self.words.is_empty()) {
            let memory = if self.failed[run] { Vec::new() } else { self.batch.memory(run) };
            for (address, series) in self.words.iter().zip(behind.chunks_exact_mut(runs)) {
                series[run] = memory.get(*address).copied().unwrap_or(UNWRITTEN);
            }
        }
        self.periods += 1;
        Ok(())
    }
}

#[pymethods]
impl Lanes {
    /// Creates machines that run the program in step; `words` are addresses of data memory that are outputs, behind the ports.
    #[new]
    fn new(
        program: &Program,
        words: Vec<usize>,
        runs: usize,
        tick: Option<NonZeroU64>,
        max_cycles: NonZeroU64,
    ) -> PyResult<Lanes> {
        let (program, sources) = (Arc::clone(&program.program), Arc::clone(&program.sources));
        let most = Batch::most_lanes(&program);
        if !(1..=most).contains(&runs) {
            return Err(PyValueError::new_err(format!("runs is {runs}: it is between 1 and {most}")));
        }
        let batch = loaded(Batch::new(&program, runs))?;
        let mut lanes = Lanes {
            program,
            sources,
            tick,
            max_cycles: max_cycles.get(),
            batch,
            words,
            failed: vec![false; runs],
            failures: Vec::new(),
            periods: 0,
        };
        lanes.set();
        Ok(lanes)
    }

    /// Runs a period with the words in `inputs`, by port and run. Fills `outputs`, by port and run, and `cycles` and `missed`, by run.
    /// Returns true if no run has failed.
    fn step(
        &mut self,
        py: Python<'_>,
        inputs: PyReadonlyArray<'_, u32, numpy::Ix2>,
        mut outputs: PyReadwriteArray<'_, u32, numpy::Ix2>,
        mut cycles: PyReadwriteArray<'_, u64, numpy::Ix1>,
        mut missed: PyReadwriteArray<'_, u64, numpy::Ix1>,
    ) -> PyResult<bool> {
        let runs = self.failed.len();
        let inputs = shaped(&inputs, "inputs", &[self.program.inputs.len(), runs])?;
        let outputs =
            writable(&mut outputs, "outputs", &[self.program.outputs.len() + self.words.len(), runs])?;
        let cycles = writable(&mut cycles, "cycles", &[runs])?;
        let missed = writable(&mut missed, "missed", &[runs])?;
        py.detach(|| self.run(inputs, outputs, cycles, missed))?;
        Ok(self.failures.is_empty())
    }

    /// Restores the state after loading.
    fn reset(&mut self) -> PyResult<()> {
        self.batch = loaded(Batch::new(&self.program, self.failed.len()))?;
        self.set();
        self.failed.fill(false);
        self.failures.clear();
        self.periods = 0;
        Ok(())
    }

    /// Sticky exception flags of each run, as bits.
    #[getter]
    fn flags(&self) -> Vec<u8> {
        (0..self.failed.len()).map(|run| self.batch.flags(run).bits()).collect()
    }
}

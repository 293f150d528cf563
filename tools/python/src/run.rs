// SPDX-License-Identifier: MIT OR Apache-2.0
//! Runs over arrays: a single run on an emulator, several in a batch.

use crate::failure::{self, Failure};
use crate::interrupt::{Interrupt, SLICE};
use crate::plant::{Plant, ProgramLoop};
use crate::program::Program;
use numpy::{Element, PyReadonlyArray, PyReadwriteArray, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::num::NonZeroU64;
use takt_emu::{Batch, Emulator, PeriodError, PeriodReport, Row, Status, Stop};
use takt_isa::Type;
use takt_isa::program::Port;
use takt_programs::plants::LoopError;

/// Maximum number of lanes that run together; more runs are split into groups. (A lane takes 5 kB plus its data memory.)
const LANES: usize = 4096;
/// Maximum number of data memory words in all lanes, unless a single group needs more.
const WORDS: usize = LANES * 1024;
/// Value of a binary32 output that has never been written.
pub(crate) const UNWRITTEN: u32 = 0x7fc0_0000;

/// Results of a run apart from outputs and cycles.
#[derive(IntoPyObject)]
pub(crate) struct RunResults {
    /// Number of completed periods, for each run.
    completed: Vec<usize>,
    /// Sticky exception flags of each run, as bits.
    flags: Vec<u8>,
    /// Events that ended runs early.
    failures: Vec<Failure>,
    /// For each output port, the number of periods that ended before it was ever written.
    unwritten: Vec<u64>,
    /// Number of NaNs written to output ports, in all runs.
    nan_writes: u64,
}

/// Arrays that a call reads and fills.
struct Arrays<'a> {
    ports: usize,
    periods: usize,
    runs: usize,
    /// Input words, indexed by port, period and run.
    inputs: &'a [u32],
    /// Output words, indexed by port or data word, period and run.
    outputs: &'a mut [u32],
    /// Cycles, indexed by period and run.
    cycles: &'a mut [u64],
    missed: &'a mut [u64],
}

/// Source of a single run's inputs.
enum Feed<'a> {
    /// The input words of [`Arrays`].
    Arrays,
    /// A plant; the inputs that it does not give are given.
    Loop {
        closed: &'a mut ProgramLoop,
        given: &'a [bool],
        /// Input words, indexed by port and period; those of the plant are filled in.
        inputs: &'a mut [u32],
        /// States at the beginning of each period, indexed by state and period.
        states: &'a mut [f64],
    },
}

impl Feed<'_> {
    /// Sets the inputs of a period, number `number` of `periods`; `recorded` are the words of [`Arrays`].
    fn set(
        &mut self,
        program: &takt_isa::Program,
        emulator: &mut Emulator,
        recorded: &[u32],
        (number, periods): (usize, usize),
    ) -> PyResult<Result<(), LoopError>> {
        let ports = program.inputs.iter().map(|port| port.register);
        match self {
            Feed::Arrays => {
                for (register, series) in ports.zip(recorded.chunks_exact(periods)) {
                    emulator.set_input_bits(register, series[number]).map_err(port_error)?;
                }
            }
            Feed::Loop { closed, given, inputs, states } => {
                let series = ports.zip(inputs.chunks_exact(periods)).zip(*given);
                let own = series.filter(|(_, is_given)| **is_given);
                let mut row: Row = own.map(|((register, series), _)| (register, series[number])).collect();
                if let Err(error) = closed.begin(&mut row, |register| emulator.output_bits(register)) {
                    return Ok(Err(error));
                }
                for (register, bits) in row {
                    let at = program.inputs.iter().position(|port| port.register == register);
                    if let Some(series) = at.and_then(|at| inputs.chunks_exact_mut(periods).nth(at)) {
                        series[number] = bits;
                    }
                    emulator.set_input_bits(register, bits).map_err(port_error)?;
                }
                for (state, series) in closed.states().iter().zip(states.chunks_exact_mut(periods)) {
                    series[number] = *state;
                }
            }
        }
        Ok(Ok(()))
    }
}

struct Settings<'a> {
    program: &'a takt_isa::Program,
    /// Addresses of data memory words that serve as outputs.
    words: &'a [usize],
    sources: &'a [(String, String)],
    tick: Option<NonZeroU64>,
    max_cycles: u64,
}

pub(crate) fn shaped<'a, T: Element, D: numpy::ndarray::Dimension>(
    array: &'a PyReadonlyArray<'_, T, D>,
    what: &str,
    shape: &[usize],
) -> PyResult<&'a [T]> {
    if array.shape() != shape {
        return Err(PyValueError::new_err(format!("{what} has shape {:?}, not {shape:?}", array.shape())));
    }
    array.as_slice().map_err(|_| PyValueError::new_err(format!("{what} is not contiguous")))
}

pub(crate) fn writable<'a, T: Element, D: numpy::ndarray::Dimension>(
    array: &'a mut PyReadwriteArray<'_, T, D>,
    what: &str,
    shape: &[usize],
) -> PyResult<&'a mut [T]> {
    if array.shape() != shape {
        return Err(PyValueError::new_err(format!("{what} has shape {:?}, not {shape:?}", array.shape())));
    }
    array.as_slice_mut().map_err(|_| PyValueError::new_err(format!("{what} is not contiguous")))
}

/// Runs the program over arrays of words: `inputs` and `outputs` are indexed by port, period and run, `cycles` and `missed` by period and
/// run. The data memory words at the given addresses are further outputs, after the ports. A single run uses an emulator, several runs a
/// batch.
#[pyfunction]
#[pyo3(signature = (program, words, inputs, outputs, cycles, missed, tick, max_cycles))]
#[allow(clippy::too_many_arguments)]
pub(crate) fn run(
    py: Python<'_>,
    program: &Program,
    words: Vec<usize>,
    inputs: PyReadonlyArray<'_, u32, numpy::Ix3>,
    mut outputs: PyReadwriteArray<'_, u32, numpy::Ix3>,
    mut cycles: PyReadwriteArray<'_, u64, numpy::Ix2>,
    mut missed: PyReadwriteArray<'_, u64, numpy::Ix2>,
    tick: Option<NonZeroU64>,
    max_cycles: NonZeroU64,
) -> PyResult<RunResults> {
    let &[ports, periods, runs] = inputs.shape() else {
        return Err(PyValueError::new_err("inputs: by port, period and run"));
    };
    if ports != program.program.inputs.len() {
        let text = format!("inputs of {ports} ports; the program has {}", program.program.inputs.len());
        return Err(PyValueError::new_err(text));
    }
    let arrays = Arrays {
        ports,
        periods,
        runs,
        inputs: shaped(&inputs, "inputs", &[ports, periods, runs])?,
        outputs: writable(
            &mut outputs,
            "outputs",
            &[program.program.outputs.len() + words.len(), periods, runs],
        )?,
        cycles: writable(&mut cycles, "cycles", &[periods, runs])?,
        missed: writable(&mut missed, "missed", &[periods, runs])?,
    };
    let settings = Settings {
        program: &program.program,
        words: &words,
        sources: &program.sources,
        tick,
        max_cycles: max_cycles.get(),
    };
    py.detach(|| match runs {
        1 => alone(&settings, Feed::Arrays, arrays),
        _ => together(&settings, arrays),
    })
}

/// Runs the program in the loop that a plant closes: `inputs` and `outputs` are indexed by port and period, `states` by the plant's state
/// and period, `cycles` and `missed` by period. `given` says which inputs have values; the others, which the plant or its file gives, are
/// filled in.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
pub(crate) fn run_loop(
    py: Python<'_>,
    program: &Program,
    plant: &Plant,
    words: Vec<usize>,
    given: Vec<bool>,
    mut inputs: PyReadwriteArray<'_, u32, numpy::Ix2>,
    mut outputs: PyReadwriteArray<'_, u32, numpy::Ix2>,
    mut states: PyReadwriteArray<'_, f64, numpy::Ix2>,
    mut cycles: PyReadwriteArray<'_, u64, numpy::Ix1>,
    mut missed: PyReadwriteArray<'_, u64, numpy::Ix1>,
    tick: Option<NonZeroU64>,
    max_cycles: NonZeroU64,
) -> PyResult<RunResults> {
    let ports = program.program.inputs.len();
    let periods = cycles.shape().first().copied().unwrap_or_default();
    if given.len() != ports {
        return Err(PyValueError::new_err(format!("{} inputs; the program has {ports}", given.len())));
    }
    let mut closed = py.detach(|| plant.close(program, Some(&given)))?;
    let states = writable(&mut states, "states", &[closed.interface().states.len(), periods])?;
    let from = writable(&mut inputs, "inputs", &[ports, periods])?;
    let arrays = Arrays {
        ports,
        periods,
        runs: 1,
        inputs: &[],
        outputs: writable(&mut outputs, "outputs", &[program.program.outputs.len() + words.len(), periods])?,
        cycles: writable(&mut cycles, "cycles", &[periods])?,
        missed: writable(&mut missed, "missed", &[periods])?,
    };
    let settings = Settings {
        program: &program.program,
        words: &words,
        sources: &program.sources,
        tick,
        max_cycles: max_cycles.get(),
    };
    let feed = Feed::Loop { closed: &mut closed, given: &given, inputs: from, states };
    py.detach(|| alone(&settings, feed, arrays))
}

/// Runs the program to its `halt`, with the given words on the input ports. Returns cycles, outputs (`None` if never written) followed by
/// the data memory words at the given addresses, exception flags, and the event that ended the run otherwise.
#[pyfunction]
#[allow(clippy::type_complexity)]
pub(crate) fn run_to_halt(
    py: Python<'_>,
    program: &Program,
    words: Vec<usize>,
    inputs: Vec<u32>,
    max_cycles: NonZeroU64,
) -> PyResult<(u64, Vec<Option<u32>>, u8, Option<Failure>)> {
    if inputs.len() != program.program.inputs.len() {
        return Err(PyValueError::new_err(format!(
            "{} inputs; the program has {}",
            inputs.len(),
            program.program.inputs.len()
        )));
    }
    let mut emulator = loaded(Emulator::new(&program.program))?;
    for (port, bits) in program.program.inputs.iter().zip(inputs) {
        emulator.set_input_bits(port.register, bits).map_err(port_error)?;
    }
    emulator.set_cycle_limit(max_cycles.get());
    let stop = py.detach(|| {
        let mut interrupt = Interrupt::new();
        loop {
            interrupt.check_now()?;
            if matches!(emulator.status(), Status::Waiting { .. }) && emulator.next_tick().is_none() {
                return Ok(Ok(Stop::Idle));
            }
            let until = emulator.now().saturating_add(SLICE);
            match emulator.run_until(until) {
                Ok(Stop::Reached | Stop::Paused) => {}
                Ok(stop) => return Ok::<_, PyErr>(Ok(stop)),
                Err(fault) => return Ok(Err(fault)),
            }
        }
    })?;
    let failure = match stop {
        Ok(Stop::Idle) => {
            let text = "the program waits for the tick: give it periods";
            return Err(PyValueError::new_err(text));
        }
        Ok(_) => None,
        Err(fault) => Some(failure::of_fault(&fault, (0, 0), &program.program, &program.sources)),
    };
    let outputs = program.program.outputs.iter().map(|port| emulator.output_bits(port.register));
    let words = words.iter().map(|address| emulator.memory().get(*address).copied());
    let outputs = outputs.chain(words).collect();
    Ok((emulator.now(), outputs, emulator.flags().bits(), failure))
}

/// Runs a period while checking for Ctrl-C.
pub(crate) fn period(
    emulator: &mut Emulator,
    max_cycles: u64,
    interrupt: &mut Interrupt,
) -> PyResult<Result<PeriodReport, PeriodError>> {
    emulator.set_cycle_limit(emulator.now().saturating_add(max_cycles));
    loop {
        interrupt.check()?;
        let begin = emulator.now();
        let ran = emulator.run_period_until(begin.saturating_add(SLICE));
        interrupt.count(emulator.now().saturating_sub(begin));
        match ran {
            Ok(Some(report)) => return Ok(Ok(report)),
            Ok(None) => {}
            Err(error) => return Ok(Err(error)),
        }
    }
}

/// Number of deadlines missed in a period.
pub(crate) fn misses(report: &PeriodReport) -> u64 {
    u64::from(report.missed) + report.lost
}

/// Value of an output; if it has never been written, NaN or 0.
pub(crate) fn output_state(port: &Port, bits: Option<u32>) -> u32 {
    bits.unwrap_or(if port.ty == Type::F { UNWRITTEN } else { 0 })
}

pub(crate) fn loaded<T>(result: Result<T, takt_emu::LoadError>) -> PyResult<T> {
    result.map_err(|error| PyValueError::new_err(format!("the program cannot be loaded: {error}")))
}

pub(crate) fn port_error(error: takt_emu::PortError) -> PyErr {
    PyValueError::new_err(error.to_string())
}

fn alone(settings: &Settings<'_>, mut feed: Feed<'_>, arrays: Arrays<'_>) -> PyResult<RunResults> {
    let Settings { program, words, sources, tick, max_cycles } = *settings;
    let Arrays { periods, inputs, outputs, cycles, missed, .. } = arrays;
    let mut emulator = loaded(Emulator::new(program))?;
    emulator.set_tick_period(tick);
    let mut interrupt = Interrupt::new();
    let mut ran = RunResults::new(1, program);
    fill(program, outputs, periods);
    for number in 0..periods {
        if let Err(error) = feed.set(program, &mut emulator, inputs, (number, periods))? {
            ran.failures.push(failure::of_loop(&error));
            break;
        }
        match period(&mut emulator, max_cycles, &mut interrupt)? {
            Ok(report) => {
                cycles[number] = report.cycles;
                missed[number] = misses(&report);
            }
            Err(error) => {
                ran.failures.push(failure::of_period(&error, (0, number), program, sources));
                break;
            }
        }
        ran.completed[0] += 1;
        let ports = program.outputs.iter().zip(outputs.chunks_exact_mut(periods)).zip(&mut ran.unwritten);
        for ((port, series), unwritten) in ports {
            let bits = emulator.output_bits(port.register);
            *unwritten += u64::from(bits.is_none());
            series[number] = output_state(port, bits);
        }
        let behind = outputs.chunks_exact_mut(periods).skip(program.outputs.len());
        for (address, series) in words.iter().zip(behind) {
            series[number] = emulator.memory().get(*address).copied().unwrap_or(UNWRITTEN);
        }
    }
    ran.flags[0] = emulator.flags().bits();
    ran.nan_writes = emulator.statistics().nan_writes;
    Ok(ran)
}

/// Fills the outputs as if none had ever been written.
fn fill(program: &takt_isa::Program, outputs: &mut [u32], each: usize) {
    if each > 0 {
        // Data words follow the ports.
        outputs.fill(UNWRITTEN);
        let ports = program.outputs.iter().zip(outputs.chunks_exact_mut(each));
        ports.for_each(|(port, series)| series.fill(output_state(port, None)));
    }
}

fn together(settings: &Settings<'_>, arrays: Arrays<'_>) -> PyResult<RunResults> {
    let Settings { program, words, sources, tick, max_cycles } = *settings;
    let Arrays { ports, periods, runs, inputs, outputs, cycles, missed } = arrays;
    let mut interrupt = Interrupt::new();
    let mut ran = RunResults::new(runs, program);
    fill(program, outputs, periods * runs);
    let at_once = (WORDS / program.machine.data_depth as usize).clamp(Batch::WIDTH, LANES);
    for first in (0..runs).step_by(at_once) {
        let lanes = (runs - first).min(at_once);
        let mut batch = loaded(Batch::new(program, lanes))?;
        batch.set_tick_period(tick);
        batch.set_period_limit(max_cycles);
        let mut failed = vec![false; lanes];
        for number in 0..periods {
            interrupt.check_now()?;
            for port in 0..ports {
                let at = (port * periods + number) * runs + first;
                let register = program.inputs[port].register;
                batch.set_input_bits(register, &inputs[at..at + lanes]).map_err(port_error)?;
            }
            batch.run_period();
            for (lane, failed) in failed.iter_mut().enumerate().filter(|(_, failed)| !**failed) {
                let (run, at) = (first + lane, number * runs + first + lane);
                match batch.outcome(lane) {
                    Some(Ok(report)) => {
                        cycles[at] = report.cycles;
                        missed[at] = misses(&report);
                        ran.nan_writes += report.nan_writes.len() as u64;
                        ran.completed[run] += 1;
                    }
                    Some(Err(error)) => {
                        *failed = true;
                        ran.failures.push(failure::of_period(&error, (run, number), program, sources));
                        continue;
                    }
                    None => continue,
                }
                for (index, port) in program.outputs.iter().enumerate() {
                    let bits = batch.output_bits(lane, port.register);
                    ran.unwritten[index] += u64::from(bits.is_none());
                    outputs[(index * periods + number) * runs + run] = output_state(port, bits);
                }
                let memory = if words.is_empty() { Vec::new() } else { batch.memory(lane) };
                for (index, address) in words.iter().enumerate() {
                    let index = program.outputs.len() + index;
                    let word = memory.get(*address).copied().unwrap_or(UNWRITTEN);
                    outputs[(index * periods + number) * runs + run] = word;
                }
            }
            if failed.iter().all(|failed| *failed) {
                break;
            }
        }
        (0..lanes).for_each(|lane| ran.flags[first + lane] = batch.flags(lane).bits());
    }
    ran.failures.sort_by_key(|failure| failure.run);
    Ok(ran)
}

impl RunResults {
    fn new(runs: usize, program: &takt_isa::Program) -> RunResults {
        RunResults {
            completed: vec![0; runs],
            flags: vec![0; runs],
            failures: Vec::new(),
            unwritten: vec![0; program.outputs.len()],
            nan_writes: 0,
        }
    }
}

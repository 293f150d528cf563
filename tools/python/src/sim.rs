// SPDX-License-Identifier: MIT OR Apache-2.0
//! A closed loop that Python steps.

use crate::failure::{self, Failure};
use crate::interrupt::Interrupt;
use crate::plant::{Plant, ProgramLoop};
use crate::program::{Program, suggest};
use crate::run::{loaded, misses, period, port_error};
use pyo3::IntoPyObjectExt;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyString};
use std::collections::{HashMap, HashSet};
use std::num::NonZeroU64;
use std::sync::{Arc, Mutex, PoisonError};
use takt_emu::{Emulator, Number, Row};
use takt_isa::program::Port;
use takt_isa::{Register, Type};

/// Maximum size of a machine's input history: input values plus periods since reset (8 bytes each).
const HISTORY: usize = 1 << 20;

/// Input history of a machine since reset: unpickling replays it to restore the state.
#[derive(Clone, Default)]
struct History {
    /// For each period: number of inputs that were set, then number and bits of each.
    words: Vec<u32>,
    /// Reason why there is no history.
    lost: Option<&'static str>,
}

impl History {
    /// Adds the inputs of a period.
    fn add(&mut self, given: &[(usize, u32)]) {
        if self.lost.is_some() {
            return;
        }
        if self.words.len() + 2 * given.len() >= 2 * HISTORY {
            *self = History {
                words: Vec::new(),
                lost: Some("it has run for so long that what it was given is no longer kept"),
            };
            return;
        }
        self.words.push(given.len() as u32);
        self.words.extend(given.iter().flat_map(|(index, bits)| [*index as u32, *bits]));
    }
}

/// A machine that runs a program, stepped period by period.
#[pyclass(module = "takt._takt")]
pub(crate) struct Sim {
    tick: Option<NonZeroU64>,
    history: History,
    emulator: Emulator,
    /// Loop that a plant closes; the lock is never waited for.
    closed: Option<Mutex<ProgramLoop>>,
    /// Inputs and parameters that were given, in a loop.
    kept: Row,
    sources: Arc<Vec<(String, String)>>,
    max_cycles: u64,
    inputs: HashMap<String, usize>,
    /// Whether each input has been set, then each parameter, which always has a value.
    given: Vec<bool>,
    /// The same before the first period.
    initially: Vec<bool>,
    /// Inputs that the plant gives.
    driven: HashSet<usize>,
    outputs: Vec<(Py<PyString>, Register, Type)>,
    /// Inputs to set at the start of the next period.
    next: Vec<(Register, u32)>,
    #[pyo3(get)]
    periods: usize,
    #[pyo3(get)]
    cycles: u64,
    #[pyo3(get)]
    missed: u64,
    #[pyo3(get)]
    failure: Option<Failure>,
    /// States of the plant at the beginning of the last period.
    #[pyo3(get)]
    states: Vec<f64>,
}

impl Sim {
    /// Converts a Python value to the bits of a port.
    fn bits(port: &Port, value: &Bound<'_, PyAny>, period: usize) -> PyResult<u32> {
        let wrong =
            |text: String| PyValueError::new_err(format!("input `{}` of period {period}: {text}", port.name));
        let typed = |error: PyErr| {
            let text = format!("input `{}` takes {}: {error}", port.name, port.ty.name());
            PyTypeError::new_err(text)
        };
        match port.ty {
            Type::F => {
                let value: f64 = value.extract().map_err(typed)?;
                if value.is_nan() {
                    return Err(wrong("NaN is not an input for a controller".to_owned()));
                }
                let rounded = value as f32;
                if rounded.is_infinite() {
                    return Err(wrong(format!("{value:e} does not fit binary32")));
                }
                Ok(rounded.to_bits())
            }
            Type::I => {
                let value: i64 = value.extract().map_err(typed)?;
                let fits = i32::try_from(value);
                fits.map(i32::cast_unsigned)
                    .map_err(|_| wrong(format!("{value} does not fit 32 bits, signed")))
            }
            Type::B => {
                let value: i64 = value.extract().map_err(typed)?;
                u32::try_from(value).map_err(|_| wrong(format!("{value} does not fit 32 bits, unsigned")))
            }
        }
    }

    fn take(&mut self, inputs: &Bound<'_, PyDict>) -> PyResult<()> {
        let program = self.emulator.program();
        let ports: Vec<&Port> = program.host_registers().collect();
        self.next.clear();
        let mut given: Vec<(usize, u32)> = Vec::new();
        for (name, value) in inputs.iter() {
            let name = name.cast::<PyString>()?.to_str()?.to_owned();
            let Some(&index) = self.inputs.get(&name) else {
                let near = suggest(&name, ports.iter().map(|port| port.name.as_str()));
                return Err(PyValueError::new_err(format!("the program has no input `{name}`{near}")));
            };
            if self.driven.contains(&index) {
                return Err(PyValueError::new_err(format!(
                    "the plant gives the input `{name}`: leave it out of the inputs"
                )));
            }
            let bits = Self::bits(ports[index], &value, self.periods)?;
            if index >= program.inputs.len() {
                let checked = program.check_parameter(ports[index], bits);
                checked.map_err(|error| PyValueError::new_err(error.to_string()))?;
            }
            self.next.push((ports[index].register, bits));
            given.push((index, bits));
        }
        let missing = |(index, port): (usize, &&'_ Port)| {
            (!self.given[index] && given.iter().all(|(given, _)| *given != index))
                .then(|| format!("`{}`", port.name))
        };
        if self.given.iter().any(|given| !given) {
            let missing: Vec<String> = ports.iter().enumerate().filter_map(missing).collect();
            if !missing.is_empty() {
                let text = format!("no value for {}: the first step needs every input", missing.join(", "));
                return Err(PyValueError::new_err(text));
            }
        }
        given.iter().for_each(|(index, _)| self.given[*index] = true);
        self.history.add(&given);
        Ok(())
    }

    /// Adds to the inputs in `next` those that the plant gives; returns false if it failed.
    fn feed(&mut self, py: Python<'_>) -> bool {
        let Some(closed) = &mut self.closed else { return true };
        let closed = closed.get_mut().unwrap_or_else(PoisonError::into_inner);
        for (register, bits) in self.next.drain(..) {
            self.kept.retain(|(known, _)| *known != register);
            self.kept.push((register, bits));
        }
        self.next.clone_from(&self.kept);
        let (next, emulator) = (&mut self.next, &self.emulator);
        match py.detach(|| closed.begin(next, |register| emulator.output_bits(register))) {
            Ok(()) => self.states = closed.states().to_vec(),
            Err(error) => self.failure = Some(failure::of_loop(&error)),
        }
        self.failure.is_none()
    }

    /// Runs a period with the inputs in `next`; returns false if it failed.
    fn run(&mut self, py: Python<'_>) -> PyResult<bool> {
        if !self.feed(py) {
            return Ok(false);
        }
        for &(register, bits) in &self.next {
            self.emulator.set_input_bits(register, bits).map_err(port_error)?;
        }
        let (emulator, max_cycles) = (&mut self.emulator, self.max_cycles);
        let ran = py.detach(|| period(emulator, max_cycles, &mut Interrupt::new()));
        let ran = ran.inspect_err(|_| {
            self.history =
                History { words: Vec::new(), lost: Some("a period of it was interrupted in the middle") };
        });
        match ran? {
            Ok(report) => {
                self.cycles = report.cycles;
                self.missed = misses(&report);
                self.periods += 1;
                Ok(true)
            }
            Err(error) => {
                let place = (0, self.periods);
                self.failure =
                    Some(failure::of_period(&error, place, self.emulator.program(), &self.sources));
                Ok(false)
            }
        }
    }
}

/// For each input: not set. Parameters have a value from the start.
fn not_given(program: &takt_isa::Program) -> Vec<bool> {
    let inputs = program.inputs.len();
    (0..program.host_registers().count()).map(|index| index >= inputs).collect()
}

/// Python value of a port's bits.
fn number<'py>(py: Python<'py>, ty: Type, bits: Option<u32>) -> PyResult<Bound<'py, PyAny>> {
    Ok(match bits.map(|bits| Number::of(ty, bits)) {
        Some(Number::Float(value)) => f64::from(value).into_bound_py_any(py)?,
        Some(Number::Integer(value)) => value.into_bound_py_any(py)?,
        Some(Number::Bits(value)) => value.into_bound_py_any(py)?,
        None => py.None().into_bound(py),
    })
}

#[pymethods]
impl Sim {
    /// Creates a machine that runs the program, in the loop of a plant if there is one.
    #[new]
    fn new(
        py: Python<'_>,
        program: &Program,
        tick: Option<NonZeroU64>,
        max_cycles: NonZeroU64,
        plant: Option<Py<Plant>>,
    ) -> PyResult<Sim> {
        let mut given = not_given(&program.program);
        let mut driven = HashSet::new();
        let closed = match &plant {
            None => None,
            Some(plant) => {
                let closed = py.detach(|| plant.get().close(program, None))?;
                let connection = closed.connection();
                for (index, port) in program.program.inputs.iter().enumerate() {
                    given[index] = connection.rest.iter().all(|rest| rest.register != port.register);
                }
                let index = |port: &Port| {
                    program.program.inputs.iter().position(|known| known.register == port.register)
                };
                driven.extend(connection.driven().filter_map(index));
                Some(Mutex::new(closed))
            }
        };
        let mut emulator = loaded(Emulator::new(&program.program))?;
        emulator.set_tick_period(tick);
        let (inputs, outputs) = (program.program.host_registers(), &program.program.outputs);
        let named = |port: &Port| {
            Python::attach(|py| (PyString::intern(py, &port.name).unbind(), port.register, port.ty))
        };
        Ok(Sim {
            tick,
            history: History::default(),
            sources: Arc::clone(&program.sources),
            max_cycles: max_cycles.get(),
            closed,
            kept: Row::new(),
            states: Vec::new(),
            initially: given.clone(),
            given,
            driven,
            inputs: inputs.enumerate().map(|(index, port)| (port.name.clone(), index)).collect(),
            outputs: outputs.iter().map(named).collect(),
            next: Vec::new(),
            periods: 0,
            cycles: 0,
            missed: 0,
            failure: None,
            emulator,
        })
    }

    /// Sets inputs and runs a period. Returns `None` if it failed; `failure` then has the event.
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        inputs: &Bound<'py, PyDict>,
    ) -> PyResult<Option<Bound<'py, PyDict>>> {
        if self.failure.is_some() {
            return Ok(None);
        }
        self.take(inputs)?;
        if self.run(py)? { self.read(py).map(Some) } else { Ok(None) }
    }

    /// An independent machine in the same state. (The one of a loop is made from its history.)
    fn __copy__(&self, py: Python<'_>) -> PyResult<Sim> {
        if self.closed.is_some() {
            return Err(PyTypeError::new_err("a loop is copied by its history"));
        }
        let outputs = self.outputs.iter().map(|(name, register, ty)| (name.clone_ref(py), *register, *ty));
        Ok(Sim {
            tick: self.tick,
            history: self.history.clone(),
            closed: None,
            kept: Row::new(),
            states: Vec::new(),
            initially: self.initially.clone(),
            driven: HashSet::new(),
            emulator: self.emulator.clone(),
            sources: Arc::clone(&self.sources),
            max_cycles: self.max_cycles,
            inputs: self.inputs.clone(),
            given: self.given.clone(),
            outputs: outputs.collect(),
            next: self.next.clone(),
            periods: self.periods,
            cycles: self.cycles,
            missed: self.missed,
            failure: self.failure.clone(),
        })
    }

    /// State for pickling: cycles between ticks, cycle limit of a period, and input history since reset.
    fn state<'py>(&self, py: Python<'py>) -> PyResult<(Option<u64>, u64, Bound<'py, PyBytes>)> {
        if let Some(why) = self.history.lost {
            return Err(PyTypeError::new_err(format!(
                "this Sim cannot be pickled: {why} (copy.copy copies it in this process, and reset begins anew)"
            )));
        }
        let bytes: Vec<u8> = self.history.words.iter().flat_map(|word| word.to_le_bytes()).collect();
        Ok((self.tick.map(NonZeroU64::get), self.max_cycles, PyBytes::new(py, &bytes)))
    }

    /// Restores a pickled state: runs from reset with the recorded inputs.
    fn replay(&mut self, py: Python<'_>, history: &[u8]) -> PyResult<()> {
        let damaged = || PyValueError::new_err("the pickled Sim is damaged");
        if !history.len().is_multiple_of(4) {
            return Err(damaged());
        }
        if self.periods > 0 {
            self.reset();
        }
        let mut words =
            history.chunks_exact(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]));
        while let Some(count) = words.next() {
            self.next.clear();
            let mut given = Vec::new();
            for _ in 0..count {
                let (index, bits) = words.next().zip(words.next()).ok_or_else(damaged)?;
                let index = index as usize;
                let port = self.emulator.program().host_registers().nth(index).ok_or_else(damaged)?;
                self.next.push((port.register, bits));
                self.given[index] = true;
                given.push((index, bits));
            }
            self.history.add(&given);
            if !self.run(py)? {
                break;
            }
        }
        Ok(())
    }

    /// Values of the output ports; `None` for a port that has never been written.
    fn read<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let values = PyDict::new(py);
        for (name, register, ty) in &self.outputs {
            values.set_item(name, number(py, *ty, self.emulator.output_bits(*register))?)?;
        }
        Ok(values)
    }

    /// Values of the input ports; `None` for a port that has never been set.
    fn read_inputs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let values = PyDict::new(py);
        for port in &self.emulator.program().inputs {
            values.set_item(&port.name, number(py, port.ty, self.emulator.register(port.register))?)?;
        }
        Ok(values)
    }

    /// Data memory words at the given addresses.
    fn words(&self, addresses: Vec<usize>) -> Vec<Option<u32>> {
        addresses.into_iter().map(|address| self.emulator.memory().get(address).copied()).collect()
    }

    /// Restores the state after loading; a loop is made anew instead, with another plant.
    fn reset(&mut self) {
        self.emulator.reset();
        self.given.clone_from(&self.initially);
        self.history = History::default();
        (self.periods, self.cycles, self.missed, self.failure) = (0, 0, 0, None);
    }

    /// Cycles between ticks, and cycle limit of a period.
    #[getter]
    fn limits(&self) -> (Option<u64>, u64) {
        (self.tick.map(NonZeroU64::get), self.max_cycles)
    }

    /// Cycles since reset, including waits.
    #[getter]
    fn now(&self) -> u64 {
        self.emulator.now()
    }

    /// Sticky exception flags, as bits.
    #[getter]
    fn flags(&self) -> u8 {
        self.emulator.flags().bits()
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! A closed loop that Python steps.

use crate::failure::{self, Failure};
use crate::interrupt::Interrupt;
use crate::program::{Program, suggest};
use crate::run::{loaded, misses, period, port_error};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyString};
use std::collections::HashMap;
use std::num::NonZeroU64;
use std::sync::Arc;
use takt_emu::{Emulator, Number};
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
    sources: Arc<Vec<(String, String)>>,
    max_cycles: u64,
    inputs: HashMap<String, usize>,
    /// Whether each input has been set, then each parameter, which always has a value.
    given: Vec<bool>,
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

    /// Runs a period with the inputs in `next`; returns false if it failed.
    fn run(&mut self, py: Python<'_>) -> PyResult<bool> {
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

#[pymethods]
impl Sim {
    /// Creates a machine that runs the program.
    #[new]
    fn new(program: &Program, tick: Option<NonZeroU64>, max_cycles: NonZeroU64) -> PyResult<Sim> {
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
            given: not_given(&program.program),
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

    /// An independent machine in the same state.
    fn __copy__(&self, py: Python<'_>) -> Sim {
        let outputs = self.outputs.iter().map(|(name, register, ty)| (name.clone_ref(py), *register, *ty));
        Sim {
            tick: self.tick,
            history: self.history.clone(),
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
        }
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
        self.reset();
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
            match self.emulator.output_bits(*register).map(|bits| Number::of(*ty, bits)) {
                Some(Number::Float(value)) => values.set_item(name, f64::from(value))?,
                Some(Number::Integer(value)) => values.set_item(name, value)?,
                Some(Number::Bits(value)) => values.set_item(name, value)?,
                None => values.set_item(name, py.None())?,
            }
        }
        Ok(values)
    }

    /// Data memory words at the given addresses.
    fn words(&self, addresses: Vec<usize>) -> Vec<Option<u32>> {
        addresses.into_iter().map(|address| self.emulator.memory().get(address).copied()).collect()
    }

    /// Restores the state after loading.
    fn reset(&mut self) {
        self.emulator.reset();
        self.given = not_given(self.emulator.program());
        self.history = History::default();
        (self.periods, self.cycles, self.missed, self.failure) = (0, 0, 0, None);
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

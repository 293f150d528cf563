//! A closed loop, stepped from Python.

use crate::failure::{self, Failure};
use crate::interrupt::Interrupt;
use crate::program::{Program, kind, suggest};
use crate::run::{loaded, misses, period, port_error};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};
use std::collections::HashMap;
use std::num::NonZeroU64;
use std::sync::Arc;
use takt_emu::{Emulator, Number};
use takt_isa::program::Port;
use takt_isa::{Register, Type};

/// A machine with a program in it, stepped period by period.
#[pyclass(module = "takt._takt")]
pub(crate) struct Sim {
    emulator: Emulator,
    sources: Arc<Vec<(String, String)>>,
    max_cycles: u64,
    inputs: HashMap<String, usize>,
    /// Which inputs were ever given.
    given: Vec<bool>,
    outputs: Vec<(Py<PyString>, Register, Type)>,
    /// What the next period is to begin with.
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
    pub(crate) fn new(program: &Program, tick: Option<NonZeroU64>, max_cycles: NonZeroU64) -> PyResult<Sim> {
        let mut emulator = loaded(Emulator::new(&program.program))?;
        emulator.set_tick_period(tick);
        let (inputs, outputs) = (&program.program.inputs, &program.program.outputs);
        let named = |port: &Port| {
            Python::attach(|py| (PyString::intern(py, &port.name).unbind(), port.register, port.ty))
        };
        Ok(Sim {
            sources: Arc::clone(&program.sources),
            max_cycles: max_cycles.get(),
            given: vec![false; inputs.len()],
            inputs: inputs.iter().enumerate().map(|(index, port)| (port.name.clone(), index)).collect(),
            outputs: outputs.iter().map(named).collect(),
            next: Vec::with_capacity(inputs.len()),
            periods: 0,
            cycles: 0,
            missed: 0,
            failure: None,
            emulator,
        })
    }

    /// What Python gave, as the port's bits.
    fn bits(port: &Port, value: &Bound<'_, PyAny>) -> PyResult<u32> {
        let wrong = |text: String| PyValueError::new_err(format!("input `{}`: {text}", port.name));
        let typed = |error: PyErr| {
            let text = format!("input `{}` takes {}: {error}", port.name, kind(port.ty));
            PyTypeError::new_err(text)
        };
        match port.ty {
            Type::F => {
                let value: f64 = value.extract().map_err(typed)?;
                if value.is_nan() {
                    return Err(wrong("NaN is no input for a controller".to_owned()));
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
        let ports = &self.emulator.program().inputs;
        self.next.clear();
        let mut given = Vec::new();
        for (name, value) in inputs.iter() {
            let name = name.cast::<PyString>()?.to_str()?.to_owned();
            let Some(&index) = self.inputs.get(&name) else {
                let near = suggest(&name, ports.iter().map(|port| port.name.as_str()));
                return Err(PyValueError::new_err(format!("the program has no input `{name}`{near}")));
            };
            self.next.push((ports[index].register, Self::bits(&ports[index], &value)?));
            given.push(index);
        }
        let missing = |(index, port): (usize, &'_ Port)| {
            (!self.given[index] && !given.contains(&index)).then(|| format!("`{}`", port.name))
        };
        if self.given.iter().any(|given| !given) {
            let missing: Vec<String> = ports.iter().enumerate().filter_map(missing).collect();
            if !missing.is_empty() {
                let text = format!("no value for {}: the first step needs every input", missing.join(", "));
                return Err(PyValueError::new_err(text));
            }
        }
        given.into_iter().for_each(|index| self.given[index] = true);
        Ok(())
    }
}

#[pymethods]
impl Sim {
    /// Sets inputs and runs a period. `None` if it failed; then `failure` says how.
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        inputs: &Bound<'py, PyDict>,
    ) -> PyResult<Option<Bound<'py, PyDict>>> {
        if self.failure.is_some() {
            return Ok(None);
        }
        self.take(inputs)?;
        for &(register, bits) in &self.next {
            self.emulator.set_input_bits(register, bits).map_err(port_error)?;
        }
        let (emulator, max_cycles) = (&mut self.emulator, self.max_cycles);
        match py.detach(|| period(emulator, max_cycles, &mut Interrupt::new()))? {
            Ok(report) => {
                self.cycles = report.cycles;
                self.missed = misses(&report);
                self.periods += 1;
            }
            Err(error) => {
                let place = (0, self.periods);
                self.failure =
                    Some(failure::of_period(&error, place, self.emulator.program(), &self.sources));
                return Ok(None);
            }
        }
        self.read(py).map(Some)
    }

    /// What is on the output ports; `None` on one that was never written.
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

    /// Back to the state after loading.
    fn reset(&mut self) {
        self.emulator.reset();
        self.given.fill(false);
        (self.periods, self.cycles, self.missed, self.failure) = (0, 0, 0, None);
    }

    /// Cycles since reset, waiting included.
    #[getter]
    fn now(&self) -> u64 {
        self.emulator.now()
    }

    /// The sticky exception flags, as bits.
    #[getter]
    fn flags(&self) -> u8 {
        self.emulator.flags().bits()
    }
}

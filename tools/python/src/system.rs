// SPDX-License-Identifier: MIT OR Apache-2.0
//! Systems of several cores: read from a file, and stepped by Python.

use crate::failure::{self, Failure};
use crate::interrupt::{Interrupt, SLICE};
use crate::program::{AssemblyError, OptionTexts, read_program};
use crate::run::loaded;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::path::{Path, PathBuf};
use takt_system::{
    Description, End, LinkKind, ProgramError, ReadError, Request, System, SystemFault, SystemPort,
};

/// Cycle limit for all cores to reach their first `wait`.
const START: u64 = 1_000_000_000;

/// Reads a system from a file; paths of its programs are relative to that file.
pub(crate) fn read(path: &Path) -> PyResult<Description> {
    let text = std::fs::read_to_string(path).map_err(|error| crate::program::named(path, error))?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let machines = |path: &str| takt_asm::machine::load(&folder.join(path));
    let read =
        takt_system::read_with(&path.display().to_string(), &text, machines, |request: &Request<'_>| {
            let file = folder.join(request.path);
            if !file.is_file() {
                let message = format!("there is no program {}", request.path);
                let help = Some("programs are looked for beside the system's file".to_owned());
                return Err(ProgramError::Missing { message, help });
            }
            read_program(&file, request.machine, OptionTexts::default()).map_err(ProgramError::Invalid)
        });
    read.map_err(|error| match error {
        ReadError::Mistakes(mistakes) => AssemblyError::new_err((mistakes.render(false), mistakes.to_json())),
        ReadError::Program(error) => error,
    })
}

/// Names and types of ports.
type Ports = Vec<(String, &'static str)>;

/// A system and its host, stepped by base ticks. Between two steps, it is in the cycle in which the host writes inputs for the next tick.
#[pyclass(module = "takt._takt")]
pub(crate) struct SystemSim {
    description: Description,
    system: System,
    /// Cycle of the host's next write.
    next: u64,
    #[pyo3(get)]
    ticks: usize,
    #[pyo3(get)]
    failure: Option<Failure>,
}

impl SystemSim {
    fn links(&self, wanted: impl Fn(&takt_system::Link) -> bool) -> Vec<usize> {
        let links = self.description.links.iter().enumerate();
        links.filter(|(_, link)| wanted(link)).map(|(number, _)| number).collect()
    }

    /// Finds a FIFO by name that starts or ends at the host.
    fn fifo(&self, name: &str, to_host: bool) -> PyResult<usize> {
        let host =
            |link: &takt_system::Link| if to_host { link.to == End::Host } else { link.from == End::Host };
        let fifos = self.links(|link| matches!(link.kind, LinkKind::Fifo { .. }) && host(link));
        let named = |number: &usize| self.description.links[*number].name == name;
        fifos.iter().copied().find(named).ok_or_else(|| {
            let names: Vec<&str> =
                fifos.iter().map(|number| self.description.links[*number].name.as_str()).collect();
            let there = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
            let end = if to_host { "to" } else { "from" };
            PyValueError::new_err(format!(
                "the system has no FIFO `{name}` {end} the host (there are: {there})"
            ))
        })
    }

    /// Host ports that are fields of a link.
    fn of(&self, link: usize, ports: &[SystemPort]) -> Vec<SystemPort> {
        ports.iter().filter(|port| port.link == link).cloned().collect()
    }

    /// The port does not belong to a FIFO.
    fn steady(&self, port: &SystemPort) -> bool {
        !matches!(self.description.links[port.link].kind, LinkKind::Fifo { .. })
    }

    /// Runs until a cycle while checking for Ctrl-C; returns false after a fault.
    fn run_until(&mut self, py: Python<'_>, cycle: u64) -> PyResult<bool> {
        let mut interrupt = Interrupt::new();
        let system = &mut self.system;
        let ran = py.detach(|| -> PyResult<Result<(), SystemFault>> {
            loop {
                interrupt.check_now()?;
                let until = system.now().saturating_add(SLICE).min(cycle);
                if let Err(fault) = system.run_until(until) {
                    return Ok(Err(fault));
                }
                if system.now() >= cycle {
                    return Ok(Ok(()));
                }
            }
        })?;
        Ok(ran.map_err(|fault| self.fail(&fault)).is_ok())
    }

    fn fail(&mut self, SystemFault { core, name, fault }: &SystemFault) {
        let program = &self.description.cores[*core].program;
        let mut failure = failure::of_fault(fault, (*core, self.ticks), program, &[]);
        failure.message = format!("core `{name}`: {}", failure.message);
        failure.text = format!("core `{name}`: {}", failure.text);
        self.failure = Some(failure);
    }

    /// Runs to the cycle in which the host writes for the first base tick.
    fn begin(&mut self, py: Python<'_>) -> PyResult<()> {
        let system = &mut self.system;
        match py.detach(|| system.run_to_start(START)) {
            Ok(Some(start)) => {
                self.next = start - self.description.lead();
                let next = self.next;
                self.run_until(py, next).map(|_| ())
            }
            Ok(None) => {
                let why = if self.system.halted() { "every core has halted" } else { "not all cores wait" };
                Err(PyValueError::new_err(format!(
                    "{why} before the first tick: there are no periods to run"
                )))
            }
            Err(fault) => {
                self.fail(&fault);
                Ok(())
            }
        }
    }
}

#[pymethods]
impl SystemSim {
    #[new]
    fn new(py: Python<'_>, path: PathBuf) -> PyResult<SystemSim> {
        let description = read(&path)?;
        let system = loaded(System::new(&description))?;
        let mut sim = SystemSim { description, system, next: 0, ticks: 0, failure: None };
        sim.begin(py)?;
        Ok(sim)
    }

    /// Inputs and outputs that do not belong to a FIFO: name and type.
    fn ports(&self) -> (Ports, Ports) {
        let named = |ports: Vec<SystemPort>| {
            let steady = ports.into_iter().filter(|port| self.steady(port));
            steady.map(|port| (port.name, port.ty.name())).collect()
        };
        (named(self.description.inputs()), named(self.description.outputs()))
    }

    /// Names of the FIFOs from the host, and of those to the host.
    fn fifos(&self) -> (Vec<String>, Vec<String>) {
        let fifo = |link: &takt_system::Link| matches!(link.kind, LinkKind::Fifo { .. });
        let named = |numbers: Vec<usize>| {
            numbers.into_iter().map(|number| self.description.links[number].name.clone()).collect()
        };
        (
            named(self.links(|link| fifo(link) && link.from == End::Host)),
            named(self.links(|link| fifo(link) && link.to == End::Host)),
        )
    }

    /// Fields of a FIFO's entries: name and type.
    fn fields(&self, name: &str, to_host: bool) -> PyResult<Ports> {
        let link = self.fifo(name, to_host)?;
        let ports = if to_host { self.description.outputs() } else { self.description.inputs() };
        let field = |port: SystemPort| {
            let field = port.name.rsplit_once('.').map_or(port.name.as_str(), |(_, field)| field);
            (field.to_owned(), port.ty.name())
        };
        Ok(self.of(link, &ports).into_iter().map(field).collect())
    }

    /// Cores: name, and cycles between ticks.
    fn cores(&self) -> Vec<(String, u64)> {
        let core = |core: &takt_system::Core| (core.name.clone(), core.period(self.description.tick));
        self.description.cores.iter().map(core).collect()
    }

    /// For each core: number of periods, shortest and longest in cycles, and number of skipped ticks.
    fn periods(&self) -> Vec<(u64, u64, u64, u64)> {
        let of = |core| {
            let takt_system::CorePeriods { count, shortest, longest, skipped } = self.system.periods(core);
            (count, shortest, longest, skipped)
        };
        (0..self.description.cores.len()).map(of).collect()
    }

    /// Writes inputs, publishes the host's snapshots and runs a base tick. Returns the words of the outputs, or `None` after a fault.
    fn step(&mut self, py: Python<'_>, inputs: Vec<(String, u32)>) -> PyResult<Option<Vec<u32>>> {
        if self.failure.is_some() {
            return Ok(None);
        }
        let wrong = |error: takt_system::HostError| PyValueError::new_err(error.to_string());
        for (name, bits) in inputs {
            self.system.set_input(&name, bits).map_err(wrong)?;
        }
        for link in self.links(|link| link.is_snapshot() && link.from == End::Host) {
            self.system.publish(link).map_err(wrong)?;
        }
        let next = self.next + self.description.tick;
        if !self.run_until(py, next)? {
            return Ok(None);
        }
        self.next = next;
        self.ticks += 1;
        Ok(Some(self.read()))
    }

    /// Words of the outputs.
    fn read(&self) -> Vec<u32> {
        let outputs = self.description.outputs().into_iter().filter(|port| self.steady(port));
        outputs.map(|port| self.system.field_bits(port.link, port.field).unwrap_or(0)).collect()
    }

    /// Pushes an entry, one word per field, into a FIFO; returns false if it is full.
    fn push(&mut self, name: &str, entry: Vec<u32>) -> PyResult<bool> {
        let link = self.fifo(name, false)?;
        let wrong = |error: takt_system::HostError| PyValueError::new_err(error.to_string());
        for (port, bits) in self.of(link, &self.description.inputs()).iter().zip(entry) {
            self.system.set_input(&port.name, bits).map_err(wrong)?;
        }
        self.system.push(link).map_err(wrong)
    }

    /// Pops an entry from a FIFO; returns `None` if it is empty.
    fn pop(&mut self, name: &str) -> PyResult<Option<Vec<u32>>> {
        let link = self.fifo(name, true)?;
        self.system.pop(link).map_err(|error| PyValueError::new_err(error.to_string()))
    }

    /// Restores the state after loading.
    fn reset(&mut self, py: Python<'_>) -> PyResult<()> {
        self.system = loaded(System::new(&self.description))?;
        (self.ticks, self.failure) = (0, None);
        self.begin(py)
    }

    /// Cycles since reset.
    #[getter]
    fn now(&self) -> u64 {
        self.system.now()
    }

    /// Cycles per base tick.
    #[getter]
    fn tick(&self) -> u64 {
        self.description.tick
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! A board at a serial port, for Python.

use crate::program::Program;
use crate::system;
use pyo3::exceptions::PyValueError;
use pyo3::import_exception;
use pyo3::prelude::*;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::{SystemTime, UNIX_EPOCH};
use takt_board::host::{COUNTERS, fault_kind};
use takt_board::protocol::{self, ENABLE, HOLD, LinkError, RESTART, RUN};
use takt_board::scope::{Recording, ScopeError, ScopeState, Setup};
use takt_board::serial::Serial;
use takt_board::{Application, Host, Stream, top};

import_exception!(takt._errors, BoardError);

/// State of a core: activity, whether outputs drive, causes of the stop, fault, and counters by name.
type Status = (&'static str, bool, Vec<&'static str>, Option<(u32, String)>, Vec<(&'static str, u32)>);
/// Port names, each with `float`, `int` or `bits`.
type Ports = Vec<(String, &'static str)>;

/// Recording of a scope: periods, index and period of the trigger, causes, whether the program stopped, and type and bits of each channel.
type Recorded =
    (Vec<u32>, Option<(usize, u32)>, Vec<String>, bool, Vec<(String, &'static str, Vec<Option<u32>>)>);

/// A board at a serial port.
#[pyclass(module = "takt._takt")]
pub(crate) struct Board {
    host: Host<Serial>,
    application: Application<'static>,
    stream: Option<Stream>,
    /// Channels and trigger with which the scope was armed.
    setup: Option<Setup>,
}

fn failed(error: LinkError) -> PyErr {
    BoardError::new_err(error.to_string())
}

fn unrecorded(error: ScopeError) -> PyErr {
    match error {
        ScopeError::Channels { .. } | ScopeError::Samples { .. } | ScopeError::Before { .. } => {
            PyValueError::new_err(error.to_string())
        }
        error => BoardError::new_err(error.to_string()),
    }
}

fn wrong(text: String) -> PyErr {
    PyValueError::new_err(text)
}

#[pymethods]
impl Board {
    /// Opens a board that runs a program, or the system described in a file.
    #[new]
    fn new(
        py: Python<'_>,
        port: PathBuf,
        program: Option<&Program>,
        system: Option<PathBuf>,
        baud: u32,
    ) -> PyResult<Board> {
        let application = match (program, system) {
            (Some(program), _) => {
                Application::from(&*program.program).with_arrays(vec![program.arrays()]).into_owned()
            }
            (None, Some(file)) => Application::from(&py.detach(|| system::read(&file))?).into_owned(),
            (None, None) => return Err(wrong("a program, or a system's file".to_owned())),
        };
        let host = py.detach(|| {
            let opened = Serial::open(&port, baud);
            let line = opened
                .map_err(|error| BoardError::new_err(format!("cannot open {}: {error}", port.display())))?;
            // Number of the first request; it should differ from the last request of an earlier host.
            let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.subsec_micros());
            let mut host = Host::connect(line, now as u8).map_err(failed)?;
            host.fits(application.clone()).map_err(failed)?;
            Ok::<_, PyErr>(host)
        })?;
        Ok(Board { host, application, stream: None, setup: None })
    }

    /// Inputs that the host sets, and output ports of the cores.
    fn ports(&self) -> PyResult<(Ports, Ports)> {
        let names = self.application.names();
        let (description, endpoints) = (self.application.description(), self.application.endpoints());
        let mut inputs: Vec<String> = endpoints.inputs.iter().map(|input| input.name.clone()).collect();
        if self.application.is_program() {
            inputs = description.cores[0].program.inputs.iter().map(|port| port.name.clone()).collect();
        }
        let find = |name: String| {
            let place = self.application.find(&name).map_err(wrong)?;
            Ok::<_, PyErr>((name, place))
        };
        let places = names.into_iter().map(find).collect::<PyResult<Vec<_>>>()?;
        let is_output = |address: u16| (protocol::OUTPUTS..protocol::DRIVEN).contains(&address);
        let outputs = places.into_iter().filter(|(_, place)| is_output(place.read));
        let outputs = outputs.map(|(name, place)| (name, place.ty.name())).collect();
        let inputs = inputs.into_iter().map(|name| find(name).map(|(name, place)| (name, place.ty.name())));
        Ok((inputs.collect::<PyResult<Ports>>()?, outputs))
    }

    /// Names of the cores; empty for a single program.
    fn cores(&self) -> Vec<String> {
        self.application.description().cores.iter().map(|core| core.name.clone()).collect()
    }

    fn status(&mut self, py: Python<'_>, core: usize) -> PyResult<Status> {
        let host = &mut self.host;
        py.detach(|| {
            let (control, status) = (host.register("control")?, host.status_of(core)?);
            let fault = match status.fault() {
                true => {
                    let word = host.register_of(core, "fault")?;
                    Some((word & 0xffff, fault_kind(word).to_owned()))
                }
                false => None,
            };
            let mut counters = Vec::new();
            for name in COUNTERS {
                // Counters of the serial line belong to the board, not to a core.
                let of = if ["errors", "lost"].contains(&name) { 0 } else { core };
                counters.push((name, host.register_of(of, name)?));
            }
            counters.push(("corrections", status.corrections()));
            Ok((status.activity(control), status.drives(), status.causes().collect(), fault, counters))
        })
        .map_err(failed)
    }

    /// Pushes an entry, one word per field, into a FIFO from the host; returns false if the FIFO is full.
    fn push(&mut self, py: Python<'_>, name: &str, entry: Vec<u32>) -> PyResult<bool> {
        let fifo = self.application.endpoints().fifo(name, false).map_err(wrong)?;
        let host = &mut self.host;
        py.detach(|| host.push(fifo, &entry)).map_err(failed)
    }

    /// Pops an entry from a FIFO to the host, one word per field; returns `None` if the FIFO is empty.
    fn pop(&mut self, py: Python<'_>, name: &str) -> PyResult<Option<Vec<u32>>> {
        let fifo = self.application.endpoints().fifo(name, true).map_err(wrong)?;
        let host = &mut self.host;
        py.detach(|| host.pop(fifo)).map_err(failed)
    }

    /// Fields of a FIFO's entries, with their types.
    fn fields(&self, name: &str, to_host: bool) -> PyResult<Ports> {
        let fifo = self.application.endpoints().fifo(name, to_host).map_err(wrong)?;
        Ok(fifo.fields.iter().map(|(name, ty)| (name.clone(), ty.name())).collect())
    }

    /// Loads the program without starting it.
    fn load(&mut self, py: Python<'_>) -> PyResult<()> {
        let records = top::image(self.application.clone()).map_err(|error| wrong(error.to_string()))?.records;
        let host = &mut self.host;
        py.detach(|| host.load(&records)).map_err(failed)
    }

    /// Executes `start`, `stop`, `hold` or `go`.
    fn control(&mut self, py: Python<'_>, what: &str) -> PyResult<()> {
        let host = &mut self.host;
        py.detach(|| {
            let control = host.register("control")?;
            let next = match what {
                "start" => RUN | ENABLE | RESTART | control & HOLD,
                "stop" => control & HOLD,
                "hold" => control | HOLD,
                _ => control & !HOLD,
            };
            host.set("control", next)
        })
        .map_err(failed)
    }

    /// Runs one period of a held program.
    fn step(&mut self, py: Python<'_>) -> PyResult<()> {
        let host = &mut self.host;
        let held = py.detach(|| host.register("control")).map_err(failed)? & HOLD != 0;
        if !held {
            return Err(BoardError::new_err("the program is not held: `board.hold()` first"));
        }
        py.detach(|| host.set("step", 1)).map_err(failed)
    }

    /// Names of an array's elements; for any other name, the name itself.
    fn elements(&self, name: &str) -> Vec<String> {
        self.application.elements(name).unwrap_or_else(|| vec![name.to_owned()])
    }

    /// Reads values; returns type and bits for each name.
    fn read(&mut self, py: Python<'_>, names: Vec<String>) -> PyResult<Vec<(&'static str, u32)>> {
        let application = &self.application;
        let places = names.iter().map(|name| application.find(name)).collect::<Result<Vec<_>, _>>();
        let places = places.map_err(wrong)?;
        let host = &mut self.host;
        py.detach(|| {
            let addresses: Vec<u16> = places.iter().map(|place| place.read).collect();
            let words = host.read_each(&addresses)?;
            Ok(places.iter().map(|place| place.ty.name()).zip(words).collect())
        })
        .map_err(failed)
    }

    /// Sets input ports; those with consecutive numbers change together.
    fn set(&mut self, py: Python<'_>, values: Vec<(String, u32)>) -> PyResult<()> {
        let application = &self.application;
        let settings =
            values.iter().map(|(name, bits)| application.settable(name).map(|(at, _)| (at, *bits)));
        let mut settings = settings.collect::<Result<Vec<_>, _>>().map_err(wrong)?;
        settings.sort_unstable();
        let host = &mut self.host;
        py.detach(|| host.set_ports(&settings)).map_err(failed)
    }

    /// Starts a stream of the named values; returns their types.
    fn stream(&mut self, py: Python<'_>, names: Vec<String>, every: u32) -> PyResult<Vec<&'static str>> {
        let application = &self.application;
        let stream = Stream::of(application, &names).map_err(wrong)?;
        let types = names.iter().map(|name| application.find(name).map(|place| place.ty.name()));
        let types = types.collect::<Result<Vec<_>, _>>().map_err(wrong)?;
        let register = stream.register(every);
        let host = &mut self.host;
        py.detach(|| host.set("stream", register)).map_err(failed)?;
        self.stream = Some(stream);
        Ok(types)
    }

    /// Next frame: its period, and the bits of each value; `None` if no frame arrives within a tenth of a second.
    fn frame(&mut self, py: Python<'_>) -> PyResult<Option<(u32, Vec<u32>)>> {
        let host = &mut self.host;
        let frame = py.detach(|| host.streamed()).map_err(failed)?;
        let (Some(stream), Some(frame)) = (&self.stream, frame) else { return Ok(None) };
        Ok(stream.values(&frame).map(|(period, values)| (period, values.map(|(bits, _)| bits).collect())))
    }

    /// Size of the board's scope: samples and channels.
    fn scope(&mut self, py: Python<'_>) -> PyResult<(u32, u32)> {
        let host = &mut self.host;
        let scope = py.detach(|| host.scope()).map_err(unrecorded)?;
        Ok((scope.depth, scope.channels))
    }

    /// Arms the scope.
    fn arm(
        &mut self,
        py: Python<'_>,
        names: Vec<String>,
        triggers: Vec<String>,
        every: u32,
        samples: Option<u32>,
        before: Option<u32>,
    ) -> PyResult<()> {
        let mut setup = Setup::new(&self.application, &names, &triggers).map_err(wrong)?;
        (setup.every, setup.samples, setup.before) = (every, samples, before);
        let Board { host, application, .. } = self;
        py.detach(|| {
            let scope = host.scope()?;
            host.arm(application, &scope, &setup)
        })
        .map_err(unrecorded)?;
        self.setup = Some(setup);
        Ok(())
    }

    /// The recording can be read.
    fn is_recorded(&mut self, py: Python<'_>) -> PyResult<bool> {
        let host = &mut self.host;
        Ok(py.detach(|| host.scope_state()).map_err(failed)? == ScopeState::Done)
    }

    /// Reads the recording of the scope that was armed last.
    fn recording(&mut self, py: Python<'_>) -> PyResult<Recorded> {
        let Some(setup) = &self.setup else {
            return Err(BoardError::new_err("the scope is not armed: `board.arm(...)` first"));
        };
        let host = &mut self.host;
        let recording = py.detach(|| {
            let scope = host.scope()?;
            host.recording(&scope, setup, |_, _| ControlFlow::Continue(()))
        });
        let Recording { channels, periods, values, trigger, causes, is_stopped } =
            recording.map_err(unrecorded)?;
        let channels = channels.into_iter().zip(values).map(|((name, ty), values)| (name, ty.name(), values));
        Ok((periods, trigger, causes, is_stopped, channels.collect()))
    }

    /// Ends the stream.
    fn quiet(&mut self, py: Python<'_>) -> PyResult<()> {
        self.stream = None;
        let host = &mut self.host;
        py.detach(|| host.set("stream", 0)).map_err(failed)
    }
}

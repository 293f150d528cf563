// SPDX-License-Identifier: MIT OR Apache-2.0
//! Plants that close a program's loop, by the code of `takt run --plant`.

use crate::program::{AssemblyError, Program, named, suggest};
use pyo3::exceptions::PyValueError;
use pyo3::import_exception;
use pyo3::prelude::*;
use std::path::{Path, PathBuf};
use takt_asm::units;
use takt_diagnostics::diag::Diagnostics;
use takt_isa::program::Port;
use takt_programs::plants::file::{TEXT_BYTES, is_fmu};
use takt_programs::plants::{ClosedLoop, Connection, Interface, PlantFile};

import_exception!(takt._errors, PlantError);

/// A program's loop that a plant closes.
pub(crate) type ProgramLoop = ClosedLoop<Box<dyn takt_programs::plants::Plant>>;

/// A plant's file, or an FMU by itself, and its connection to programs. Each run starts a plant of its own.
#[pyclass(frozen, module = "takt._takt")]
pub(crate) struct Plant {
    file: PlantFile,
    path: PathBuf,
    interface: Interface,
    /// Signals of the plant, and ports in place of those that the file maps.
    connect: Vec<(String, String)>,
    /// Length of a period in s; `None`: the program states it.
    period: Option<f64>,
    /// Command that starts the process of an FMU.
    command: Vec<String>,
}

fn mistakes(mistakes: &Diagnostics) -> PyErr {
    AssemblyError::new_err((mistakes.render(false), mistakes.to_json()))
}

fn unfit(error: impl std::fmt::Display) -> PyErr {
    PlantError::new_err(error.to_string())
}

/// Reads a plant's file, or takes an FMU by itself.
fn read(path: &Path) -> PyResult<PlantFile> {
    let name = path.display().to_string();
    if is_fmu(path) {
        return Ok(PlantFile::of_fmu(&name));
    }
    if !path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml")) {
        return Err(PyValueError::new_err(format!("{name}: expected a file `….toml` or `….fmu`")));
    }
    let size = std::fs::metadata(path).map_err(|error| named(path, error))?.len();
    if size > TEXT_BYTES as u64 {
        return Err(PyValueError::new_err(format!("{name} is longer than {} MiB", TEXT_BYTES >> 20)));
    }
    let text = std::fs::read_to_string(path).map_err(|error| named(path, error))?;
    PlantFile::read(&name, &text).map_err(|found| mistakes(&found))
}

/// Signals of the plant.
fn interface(file: &PlantFile, path: &Path) -> PyResult<Interface> {
    #[cfg(unix)]
    if let Some(fmu) = file.fmu(path) {
        return Ok(takt_fmu_plant::Fmu::open(&fmu).map_err(unfit)?.interface());
    }
    file.interface().ok_or_else(|| unfit(format!("{}: FMUs run on Linux and macOS only", path.display())))
}

impl Plant {
    /// The plant in motion.
    #[cfg(unix)]
    fn open(&self, period: f64) -> PyResult<Box<dyn takt_programs::plants::Plant>> {
        use takt_fmu_plant::{FmuError, FmuPlant};
        if self.file.fmu(&self.path).is_none() {
            return self.simulation(period);
        }
        let [program, arguments @ ..] = &self.command[..] else {
            return Err(unfit(
                "an FMU runs in a process of its own, and `sys.executable` names no interpreter",
            ));
        };
        let mut command = std::process::Command::new(program);
        command.args(arguments);
        let plant =
            FmuPlant::of_file(&self.file, &self.path, command, period).map_err(|error| match error {
                FmuError::Plant(found) => mistakes(&found),
                error => unfit(error),
            })?;
        Ok(Box::new(plant))
    }

    #[cfg(not(unix))]
    fn open(&self, period: f64) -> PyResult<Box<dyn takt_programs::plants::Plant>> {
        self.simulation(period)
    }

    fn simulation(&self, period: f64) -> PyResult<Box<dyn takt_programs::plants::Plant>> {
        let (plant, _) = self.file.simulation(period).map_err(unfit)?;
        Ok(Box::new(plant))
    }

    /// Checks that each input port is given by the plant, its file, or the caller.
    fn check(&self, connection: &Connection, inputs: &[Port], given: &[bool]) -> PyResult<()> {
        let is_given = |port: &Port| {
            let at = inputs.iter().position(|known| known.register == port.register);
            at.and_then(|at| given.get(at)).is_some_and(|given| *given)
        };
        if let Some(port) = connection.driven().find(|port| is_given(port)) {
            return Err(PyValueError::new_err(format!(
                "the plant gives the input `{}`: leave it out of the inputs",
                port.name
            )));
        }
        connection.complete(is_given).map_err(unfit)
    }

    /// Loop of a program. `given` says of each input port whether the caller gives its values; `None`: that is not known yet.
    pub(crate) fn close(&self, program: &Program, given: Option<&[bool]>) -> PyResult<ProgramLoop> {
        let takt_isa::Program { inputs, outputs, .. } = &*program.program;
        let found = self.file.connect(&self.interface, inputs, outputs, &self.connect);
        let connection = found.map_err(|found| mistakes(&found))?;
        if let Some(given) = given {
            self.check(&connection, inputs, given)?;
        }
        let debug = program.debug_info();
        let stated =
            debug.as_ref().and_then(|debug| units::sampling_period(&debug.sources, &debug.constants));
        let period = self.period.or(stated).ok_or_else(|| {
            PyValueError::new_err(
                "a plant needs the length of a period: give it with `takt.Plant(…, period=1e-3)`, in s, or in the source, as in `.const T = \
                 1e-3 ; s`",
            )
        })?;
        let plant = self.open(period)?;
        Ok(ClosedLoop::new(plant, self.interface.clone(), connection, period))
    }
}

#[pymethods]
impl Plant {
    /// Reads a file, and an FMU that it names.
    #[new]
    fn new(
        py: Python<'_>,
        path: PathBuf,
        connect: Vec<(String, String)>,
        period: Option<f64>,
        settings: Vec<(String, f64)>,
        command: Vec<String>,
    ) -> PyResult<Plant> {
        let mut file = read(&path)?;
        for (name, value) in settings {
            let known: Vec<String> = file.settings().into_iter().map(|one| one.name).collect();
            let near = match known.contains(&name) {
                true => String::new(),
                false => suggest(&name, known.iter().map(String::as_str)),
            };
            file.set(&name, value).map_err(|text| PyValueError::new_err(text + &near))?;
        }
        let interface = py.detach(|| interface(&file, &path))?;
        Ok(Plant { file, path, interface, connect, period, command })
    }

    /// Names of the signals: the plant's, inputs, sensors, states.
    #[getter]
    fn signals(&self) -> (String, Vec<String>, Vec<String>, Vec<String>) {
        let Interface { name, inputs, sensors, states } = self.interface.clone();
        (name, inputs.into_iter().map(|(name, _)| name).collect(), sensors, states)
    }

    /// Numbers that may be set: name, value, unit, meaning.
    #[getter]
    fn settings(&self) -> Vec<(String, f64, &'static str, String)> {
        self.file.settings().into_iter().map(|one| (one.name, one.value, one.unit, one.text)).collect()
    }
}

#[cfg(unix)]
fn serve(folder: &Path) -> std::io::Result<()> {
    takt_fmu_plant::serve(folder)
}

#[cfg(not(unix))]
fn serve(folder: &Path) -> std::io::Result<()> {
    Err(std::io::Error::other(format!("{}: FMUs run on Linux and macOS only", folder.display())))
}

/// Answers the requests for an FMU that is unpacked in a folder; the process of the FMU calls this.
#[pyfunction]
pub(crate) fn serve_fmu(py: Python<'_>, folder: PathBuf) -> PyResult<()> {
    Ok(py.detach(|| serve(&folder))?)
}

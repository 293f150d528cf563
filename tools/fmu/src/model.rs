// SPDX-License-Identifier: MIT OR Apache-2.0
//! The program or system of an FMU with its settings, as the folder `resources` of the FMU holds them.

use crate::circuit::Circuit;
use crate::variables::{self, Variable};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use takt_asm::image::{self, ImageError};
use takt_asm::units;
use takt_emu::{Emulator, LoadError};
use takt_isa::Program;
use takt_isa::system::Description;
use takt_system::{MAX_CORES, ProgramError, ReadError, Request, System, TEXT_BYTES};

/// Image of the program, a file of `resources`.
pub(crate) const IMAGE: &str = "program.takt";
/// Cores and links of a system, a file of `resources` in place of [`IMAGE`].
pub(crate) const SYSTEM: &str = "system.toml";
/// Pins and host of a board, a file of `resources` in place of [`IMAGE`].
pub(crate) const CIRCUIT: &str = "circuit.json";
/// Program that simulates a board, a file of `resources` beside [`CIRCUIT`].
pub(crate) const SIMULATION: &str = "simulation";
/// Folder in `resources` with the files that the simulation reads.
pub(crate) const CIRCUIT_FOLDER: &str = "circuit";
/// Settings, a file of `resources`.
pub(crate) const SETTINGS: &str = "takt.json";

/// Image of a core's program, a file of `resources` beside [`SYSTEM`]. A core's name might be none of a file on Windows.
fn core_image(core: usize) -> String {
    format!("core{core}.takt")
}

/// Settings of an FMU.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// Time from tick to tick, of a system from base tick to base tick, in seconds: the step.
    pub period: f64,
    /// Cycles from tick to tick: a period of as many cycles or more has missed the next tick.
    pub tick: u64,
}

impl Settings {
    fn mistake(&self) -> Option<&'static str> {
        match () {
            () if !(self.period.is_finite() && self.period > 0.0) => Some("the period must be more than 0 s"),
            () if self.tick == 0 => Some("the tick must come after 1 cycle or more"),
            () => None,
        }
    }
}

/// Reason why a program or a system with its settings is no FMU.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// A file of `resources` cannot be read.
    #[error("cannot read {file}: {error}")]
    File {
        /// Path of the file.
        file: String,
        /// Reason from the system.
        error: std::io::Error,
    },
    /// An image is damaged, or cannot be written.
    #[error("{file}: {error}")]
    Image {
        /// Name of the file in `resources`.
        file: String,
        /// Reason.
        error: ImageError,
    },
    /// The system's file has mistakes.
    #[error("{0}")]
    System(String),
    /// The receivers of an input of a system state ranges without a common value.
    #[error(
        "the cores that receive the system's input `{0}` state ranges (`.range`) that have no value in common"
    )]
    Ranges(String),
    /// The settings cannot be parsed.
    #[error("{SETTINGS}: {0}")]
    Json(#[from] serde_json::Error),
    /// A setting has no meaning.
    #[error("{SETTINGS}: {0}")]
    Setting(&'static str),
    /// The machine cannot hold the program.
    #[error("{file}: {error}")]
    Load {
        /// Name of the file in `resources`.
        file: &'static str,
        /// Reason.
        error: LoadError,
    },
    /// The description of a board has no meaning.
    #[error("{CIRCUIT}: {0}")]
    Circuit(String),
    /// A program has no instruction.
    #[error("{0} has no instruction")]
    Empty(String),
}

/// Contents of an FMU.
#[derive(Clone, Debug)]
pub(crate) enum Application {
    Program(Box<Program>),
    System(Box<Description>),
    Circuit(Box<Circuit>),
}

/// Program or system with its settings and variables: what all instances of an FMU share.
#[derive(Clone, Debug)]
pub struct Model {
    pub(crate) application: Application,
    pub(crate) settings: Settings,
    pub(crate) variables: Vec<Variable>,
    /// Files of `resources`, each with its name.
    pub(crate) files: Vec<(String, Vec<u8>)>,
    /// Folder of these files, if they were read from one.
    pub(crate) folder: PathBuf,
}

/// File of `resources` with an image.
fn image_file(file: String, program: &Program) -> Result<(String, Vec<u8>), ModelError> {
    match image::write(program) {
        Ok(bytes) => Ok((file, bytes)),
        Err(error) => Err(ModelError::Image { file, error }),
    }
}

/// Program of an image.
fn program(file: &str, bytes: &[u8]) -> Result<Program, ModelError> {
    let read = image::read(bytes).map_err(|error| ModelError::Image { file: file.to_owned(), error });
    read.and_then(|program| match program.bundles() {
        0 => Err(ModelError::Empty(file.to_owned())),
        _ => Ok(program),
    })
}

impl Model {
    /// Model of a program.
    ///
    /// # Errors
    /// If the program cannot run, or a setting has no meaning.
    pub fn new(program: &Program, settings: Settings) -> Result<Model, ModelError> {
        Model::parse(vec![image_file(IMAGE.to_owned(), program)?, settings_file(settings)?])
    }

    /// Model of a system; the step is a base tick, which `settings` states too.
    ///
    /// # Errors
    /// If the system cannot run, or a setting has no meaning.
    pub fn of_system(description: &Description, settings: Settings) -> Result<Model, ModelError> {
        let text = takt_system::write(description, core_image);
        let mut files = vec![(SYSTEM.to_owned(), text.into_bytes())];
        for (number, core) in description.cores.iter().enumerate() {
            files.push(image_file(core_image(number), &core.program)?);
        }
        files.push(settings_file(settings)?);
        Model::parse(files)
    }

    /// Model of a board in simulation. `simulation` is the program that simulates it; `files` are those that it reads, each with its name,
    /// in the order of `circuit`.
    ///
    /// # Errors
    /// If a setting has no meaning, or the circuit has no such pins.
    pub fn of_circuit(
        circuit: &Circuit,
        simulation: Vec<u8>,
        files: Vec<(String, Vec<u8>)>,
        settings: Settings,
    ) -> Result<Model, ModelError> {
        let description = serde_json::to_vec(circuit)?;
        let mut all = vec![(CIRCUIT.to_owned(), description), (SIMULATION.to_owned(), simulation)];
        all.extend(files.into_iter().map(|(name, bytes)| (format!("{CIRCUIT_FOLDER}/{name}"), bytes)));
        all.push(settings_file(settings)?);
        Model::parse(all)
    }

    /// Writes the folder `resources` of an FMU.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write(&self, resources: &Path) -> std::io::Result<()> {
        self.files.iter().try_for_each(|(name, bytes)| {
            let path = resources.join(name);
            std::fs::create_dir_all(path.parent().unwrap_or(resources))?;
            std::fs::write(path, bytes)
        })
    }

    /// Reads the folder `resources` of an FMU.
    ///
    /// # Errors
    /// If a file is missing or damaged.
    pub fn read(resources: &Path) -> Result<Model, ModelError> {
        let read = |name: String| {
            let path = resources.join(&name);
            match std::fs::read(&path) {
                Ok(bytes) => Ok((name, bytes)),
                Err(error) => Err(ModelError::File { file: path.display().to_string(), error }),
            }
        };
        let settings = read(SETTINGS.to_owned())?;
        let mut files = Vec::new();
        if resources.join(CIRCUIT).exists() {
            let (name, description) = read(CIRCUIT.to_owned())?;
            let circuit: Circuit = circuit(&description)?;
            files.extend([(name, description), read(SIMULATION.to_owned())?]);
            for name in &circuit.files {
                files.push(read(format!("{CIRCUIT_FOLDER}/{name}"))?);
            }
        } else if resources.join(SYSTEM).exists() {
            files.push(read(SYSTEM.to_owned())?);
            let cores = (0..MAX_CORES).map(core_image).take_while(|name| resources.join(name).exists());
            for core in cores {
                files.push(read(core)?);
            }
        } else {
            files.push(read(IMAGE.to_owned())?);
        }
        files.push(settings);
        Ok(Model { folder: resources.to_owned(), ..Model::parse(files)? })
    }

    /// Model of the files of `resources`: [`CIRCUIT`] with the simulation, [`SYSTEM`] with the cores' images, or [`IMAGE`], then
    /// [`SETTINGS`].
    fn parse(files: Vec<(String, Vec<u8>)>) -> Result<Model, ModelError> {
        let bytes = |name: &str| {
            let found = files.iter().find(|(known, _)| known == name);
            found.map(|(_, bytes)| bytes.as_slice())
        };
        let settings: Settings = serde_json::from_slice(bytes(SETTINGS).unwrap_or_default())?;
        if let Some(mistake) = settings.mistake() {
            return Err(ModelError::Setting(mistake));
        }
        let (application, variables) = match (bytes(CIRCUIT), bytes(SYSTEM)) {
            (Some(description), _) => {
                let circuit = circuit(description)?;
                if u32::try_from(settings.tick).is_err() {
                    return Err(ModelError::Setting("a period of a board has less than 2^32 cycles"));
                }
                let variables = circuit.variables();
                (Application::Circuit(Box::new(circuit)), variables)
            }
            (None, None) => {
                let program = program(IMAGE, bytes(IMAGE).unwrap_or_default())?;
                Emulator::new(&program).map_err(|error| ModelError::Load { file: IMAGE, error })?;
                let variables = variables::of_program(&program);
                (Application::Program(Box::new(program)), variables)
            }
            (None, Some(text)) if text.len() > TEXT_BYTES => {
                return Err(ModelError::System(format!("{SYSTEM} has more than {TEXT_BYTES} bytes")));
            }
            (None, Some(text)) => {
                let description = description(&String::from_utf8_lossy(text), bytes)?;
                if description.tick != settings.tick {
                    return Err(ModelError::Setting("the tick is not that of the system"));
                }
                System::new(&description).map_err(|error| ModelError::Load { file: SYSTEM, error })?;
                let variables = variables::of_system(&description).map_err(ModelError::Ranges)?;
                (Application::System(Box::new(description)), variables)
            }
        };
        Ok(Model { application, settings, variables, files, folder: PathBuf::new() })
    }

    /// States the units of ports and parameters, with which the comments of their declarations begin. `sources` has the source files of
    /// each core's program, each file's name with its text.
    #[must_use]
    pub fn with_units(mut self, sources: &[&[(String, String)]]) -> Model {
        for variable in &mut self.variables {
            variable.unit = variable.declaration.as_ref().and_then(|declaration| {
                units::unit(sources.get(declaration.core)?, declaration.directive, &declaration.name)
            });
        }
        self
    }

    /// The states of an instance can be taken and set.
    pub(crate) fn has_states(&self) -> bool {
        !matches!(self.application, Application::Circuit(_))
    }

    /// Variables, in the order of their value references: the first has 1.
    pub fn variables(&self) -> &[Variable] {
        &self.variables
    }

    /// Settings of the FMU.
    pub fn settings(&self) -> Settings {
        self.settings
    }

    /// Digest of the files of `resources` (FNV-1a of 128 bits): equal for equal FMUs, and no secret.
    pub(crate) fn digest(&self) -> u128 {
        let bytes = self.files.iter().flat_map(|(_, bytes)| bytes);
        bytes.fold(0x6c62_272e_07bb_0142_62b8_2175_6295_c58d, |hash, &byte| {
            (hash ^ u128::from(byte)).wrapping_mul(0x0100_0000_0000_0000_0000_013b)
        })
    }

    /// The digest as the text by which master and library know that description and resources belong together: `guid` of FMI 2.0,
    /// `instantiationToken` of 3.0.
    pub fn token(&self) -> String {
        let hex = format!("{:032x}", self.digest());
        format!("{{{}-{}-{}-{}-{}}}", &hex[..8], &hex[8..12], &hex[12..16], &hex[16..20], &hex[20..])
    }
}

fn settings_file(settings: Settings) -> Result<(String, Vec<u8>), ModelError> {
    Ok((SETTINGS.to_owned(), serde_json::to_vec(&settings)?))
}

/// Description of a board.
fn circuit(bytes: &[u8]) -> Result<Circuit, ModelError> {
    let circuit: Circuit =
        serde_json::from_slice(bytes).map_err(|error| ModelError::Circuit(error.to_string()))?;
    match circuit.mistake() {
        Some(mistake) => Err(ModelError::Circuit(mistake.to_owned())),
        None => Ok(circuit),
    }
}

/// System of a file's text and its cores' images.
fn description<'f>(text: &str, bytes: impl Fn(&str) -> Option<&'f [u8]>) -> Result<Description, ModelError> {
    let read = takt_system::read(SYSTEM, text, |request: &Request<'_>| match bytes(request.path) {
        Some(image) => program(request.path, image).map_err(ProgramError::Invalid),
        None => {
            let message = format!("{} is no image beside the system", request.path);
            Err(ProgramError::Missing { message, help: None })
        }
    });
    read.map_err(|error| match error {
        ReadError::Mistakes(mistakes) => ModelError::System(mistakes.render(false)),
        ReadError::Program(error) => error,
    })
}

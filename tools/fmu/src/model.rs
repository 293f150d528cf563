// SPDX-License-Identifier: MIT OR Apache-2.0
//! The program of an FMU with its settings, as the folder `resources` of the FMU holds them.

use crate::variables::{self, Variable};
use serde::{Deserialize, Serialize};
use std::path::Path;
use takt_asm::image::{self, ImageError};
use takt_emu::{Emulator, LoadError};
use takt_isa::Program;

/// Image of the program, a file of `resources`.
pub(crate) const IMAGE: &str = "program.takt";
/// Settings, a file of `resources`.
pub(crate) const SETTINGS: &str = "takt.json";

/// Settings of an FMU.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// Time from tick to tick, in seconds: the step.
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

/// Reason why a program with its settings is no FMU.
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
    /// The image is damaged, or cannot be written.
    #[error("{IMAGE}: {0}")]
    Image(#[from] ImageError),
    /// The settings cannot be parsed.
    #[error("{SETTINGS}: {0}")]
    Json(#[from] serde_json::Error),
    /// A setting has no meaning.
    #[error("{SETTINGS}: {0}")]
    Setting(&'static str),
    /// The machine cannot hold the program.
    #[error("{IMAGE}: {0}")]
    Load(#[from] LoadError),
    /// The program has no instruction.
    #[error("{IMAGE} has no instruction")]
    Empty,
}

/// Program with its settings and variables: what all instances of an FMU share.
#[derive(Clone, Debug)]
pub struct Model {
    pub(crate) program: Program,
    pub(crate) settings: Settings,
    pub(crate) variables: Vec<Variable>,
    pub(crate) image: Vec<u8>,
    pub(crate) settings_text: String,
}

impl Model {
    /// Model of a program.
    ///
    /// # Errors
    /// If the program cannot run, or a setting has no meaning.
    pub fn new(program: &Program, settings: Settings) -> Result<Model, ModelError> {
        Model::parse(image::write(program)?, serde_json::to_string(&settings)?)
    }

    /// Reads the folder `resources` of an FMU.
    ///
    /// # Errors
    /// If a file is missing or damaged.
    pub fn read(resources: &Path) -> Result<Model, ModelError> {
        let read = |name: &str| {
            let path = resources.join(name);
            std::fs::read(&path).map_err(|error| ModelError::File { file: path.display().to_string(), error })
        };
        let settings = String::from_utf8_lossy(&read(SETTINGS)?).into_owned();
        Model::parse(read(IMAGE)?, settings)
    }

    fn parse(image: Vec<u8>, settings_text: String) -> Result<Model, ModelError> {
        let settings: Settings = serde_json::from_str(&settings_text)?;
        if let Some(mistake) = settings.mistake() {
            return Err(ModelError::Setting(mistake));
        }
        let program = image::read(&image)?;
        if program.bundles() == 0 {
            return Err(ModelError::Empty);
        }
        Emulator::new(&program)?;
        let variables = variables::of(&program);
        Ok(Model { program, settings, variables, image, settings_text })
    }

    /// Variables, in the order of their value references: the first has 1.
    pub fn variables(&self) -> &[Variable] {
        &self.variables
    }

    /// Settings of the FMU.
    pub fn settings(&self) -> Settings {
        self.settings
    }

    /// Digest of image and settings (FNV-1a of 128 bits): equal for equal FMUs, and no secret.
    pub(crate) fn digest(&self) -> u128 {
        let bytes = self.image.iter().chain(self.settings_text.as_bytes());
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

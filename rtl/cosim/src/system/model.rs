// SPDX-License-Identifier: MIT OR Apache-2.0
//! A system in Verilator: compiled once per circuit, run as a process with a memory image.

use super::probe::{self, PROBE};
use crate::model::sources;
use crate::simulation::{Folder, ModelError, Simulation, file_error};
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use takt_rtl::system::SystemDesign;

/// A system compiled for simulation.
#[derive(Clone, Debug)]
pub struct SystemModel {
    program: PathBuf,
    folder: PathBuf,
    image: String,
    pins: usize,
}

impl SystemModel {
    /// Compiles a system, or finds an earlier build in the folder. With `trace` the model can write waveforms.
    ///
    /// # Errors
    /// If Verilator or a C++ compiler is missing or fails.
    pub fn build(design: &SystemDesign, folder: &Path, trace: bool) -> Result<SystemModel, ModelError> {
        let module = probe::module(design);
        let name = format!("{PROBE}.v");
        let files = design.files.iter().map(|file| (file.name.as_str(), file.text.as_str()));
        let files = files.chain([(name.as_str(), module.as_str())]).collect();
        let header = probe::header(design);
        let sources = sources(PROBE, files, &header, trace);
        Ok(SystemModel {
            program: sources.build(folder)?,
            folder: folder.to_owned(),
            image: design.image.name.clone(),
            pins: design.plan.pins().len(),
        })
    }

    /// Starts a simulation with the contents of a memory image: the cores are loaded, and cycle 0 comes next. A model with `trace` writes
    /// its waveform to the first argument; other arguments are Verilog's plusargs.
    ///
    /// # Errors
    /// If the image cannot be written or the process cannot be started.
    pub fn start(&self, image: &str, arguments: &[&OsStr]) -> Result<Simulation, ModelError> {
        static NUMBER: AtomicU64 = AtomicU64::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let folder = self.folder.join(format!("{}.{}.{number}.run", self.image, std::process::id()));
        let run = Folder(folder);
        fs::create_dir_all(&run.0).map_err(file_error(&run.0))?;
        let path = run.0.join(&self.image);
        fs::write(&path, image).map_err(file_error(&path))?;
        Simulation::of_system(&self.program, arguments, self.pins, run)
    }
}

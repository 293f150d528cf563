//! A system in Verilator: compiled once for each circuit, run as a process with a memory image.

use super::probe::{self, PROBE};
use crate::model::{CircuitEvent, EVENT_WORDS, ModelError, Process, circuit_event, sources};
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use takt_isa::timing::Cycle;
use takt_rtl::system::SystemDesign;
use takt_system::{LinkEvent, LinkEventKind};

/// The other half of [`SystemSimulation`].
const DRIVER: &str = include_str!("driver.cpp");

/// Something that happens in a system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SystemEvent {
    /// In a core.
    Core {
        /// The core.
        core: usize,
        /// What.
        event: CircuitEvent,
    },
    /// On a link.
    Link(LinkEvent),
}

impl SystemEvent {
    /// Its cycle.
    pub fn cycle(&self) -> Cycle {
        match self {
            SystemEvent::Core { event, .. } => event.cycle,
            SystemEvent::Link(event) => event.cycle,
        }
    }
}

/// A system compiled for simulation.
#[derive(Clone, Debug)]
pub struct SystemModel {
    program: PathBuf,
    folder: PathBuf,
    image: String,
    pins: usize,
}

impl SystemModel {
    /// Compiles a system, or finds it in the folder as it was compiled before. With `trace` it can write waveforms.
    ///
    /// # Errors
    /// If Verilator or a C++ compiler is missing or fails.
    pub fn build(design: &SystemDesign, folder: &Path, trace: bool) -> Result<SystemModel, ModelError> {
        let module = probe::module(design);
        let name = format!("{PROBE}.v");
        let files = design.files.iter().map(|file| (file.name.as_str(), file.text.as_str()));
        let (files, header) =
            (files.chain([(name.as_str(), module.as_str())]).collect(), probe::header(design));
        let sources = sources((PROBE, "Vsystem"), files, DRIVER, ("system.h", &header), trace);
        Ok(SystemModel {
            program: sources.build(folder)?,
            folder: folder.to_owned(),
            image: design.image.name.clone(),
            pins: design.plan.pins().len(),
        })
    }

    /// Starts a simulation with the contents of a memory image: the cores are loaded, and cycle 0 is to come. A model that can
    /// trace writes its waveform to the first argument; others are Verilog's plusargs.
    ///
    /// # Errors
    /// If the image cannot be written or the process cannot be started.
    pub fn start(&self, image: &str, arguments: &[&OsStr]) -> Result<SystemSimulation, ModelError> {
        static NUMBER: AtomicU64 = AtomicU64::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let folder = self.folder.join(format!("{}.{}.{number}.run", self.image, std::process::id()));
        let run = Folder(folder);
        fs::create_dir_all(&run.0).map_err(|source| file(&run.0, source))?;
        let path = run.0.join(&self.image);
        fs::write(&path, image).map_err(|source| file(&path, source))?;
        let process = Process::start(&self.program, arguments, Some(&run.0))?;
        Ok(SystemSimulation { process, pins: self.pins, _folder: run })
    }
}

fn file(path: &Path, source: std::io::Error) -> ModelError {
    ModelError::File { path: path.display().to_string(), source }
}

/// A folder that goes when this does.
#[derive(Debug)]
struct Folder(PathBuf);

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// What the host puts on a pin, by its number, in a cycle.
pub(super) type PinAction = (Cycle, usize, u32);

/// A running simulation of a system.
#[derive(Debug)]
pub struct SystemSimulation {
    process: Process,
    pins: usize,
    // Gone after the process.
    _folder: Folder,
}

impl SystemSimulation {
    /// Runs until so many cycles have passed. `actions` are sorted by cycle; none of a cycle that has passed. What has happened,
    /// and what stands on each of the host's pins in the cycle to come.
    ///
    /// # Errors
    /// If the process has ended.
    pub(super) fn run(
        &mut self,
        until: Cycle,
        actions: &[PinAction],
    ) -> Result<(Vec<SystemEvent>, Vec<u32>), ModelError> {
        let mut words = vec![1, until as u32, actions.len() as u32];
        words.extend(actions.iter().flat_map(|&(cycle, pin, value)| [cycle as u32, pin as u32, value]));
        self.process.send(&words)?;
        let count = self.process.receive(1)?[0] as usize;
        let events = self.process.receive(EVENT_WORDS * count)?;
        let pins = self.process.receive(self.pins)?;
        Ok((events.chunks_exact(EVENT_WORDS).filter_map(event).collect(), pins))
    }

    /// Writes a waveform of these cycles; the model must have been built for it.
    ///
    /// # Errors
    /// If the process has ended.
    pub fn trace(&mut self, first: Cycle, last: Cycle) -> Result<(), ModelError> {
        self.process.send(&[2, first as u32, last as u32])
    }

    /// Ends the simulation in order, so that its waveform is whole.
    pub fn finish(mut self) {
        self.process.finish();
    }
}

/// The driver's first kind that is a link's.
const LINK: u32 = 10;

fn event(words: &[u32]) -> Option<SystemEvent> {
    let (cycle, place) = (Cycle::from(words[1]), words[7] as usize);
    if words[0] < LINK {
        return Some(SystemEvent::Core { core: place, event: circuit_event(words)? });
    }
    let kind = match words[0] - LINK {
        0 => LinkEventKind::Value(words[5]),
        1 => LinkEventKind::Published,
        2 => LinkEventKind::Taken,
        3 => LinkEventKind::Skipped,
        4 => LinkEventKind::Pushed,
        5 => LinkEventKind::Popped,
        6 => LinkEventKind::Overflow,
        7 => LinkEventKind::Underflow,
        _ => return None,
    };
    Some(SystemEvent::Link(LinkEvent { cycle, link: place, kind }))
}

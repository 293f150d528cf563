// SPDX-License-Identifier: MIT OR Apache-2.0
//! A compiled circuit running as a process, and the protocol on its pipes.

use crate::event::{CircuitEvent, EVENT_WORDS};
use std::ffi::OsStr;
use std::fs;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use takt_isa::load::{LoadRecord, Space, load_records};
use takt_isa::timing::Cycle;
use takt_isa::{Program, Register};
use takt_rtl::verilator::VerilatorError;
use thiserror::Error;

/// Error that ends or prevents a simulation.
#[derive(Debug, Error)]
pub enum ModelError {
    /// Verilator or the C++ compiler failed.
    #[error(transparent)]
    Verilator(#[from] VerilatorError),
    /// A file cannot be written or read.
    #[error("{path}: {source}")]
    File {
        /// Path of the file.
        path: String,
        /// Error of the file system.
        source: std::io::Error,
    },
    /// The simulation ended early; with its standard error.
    #[error("the simulation ended early: {0}")]
    Ended(String),
}

pub(crate) fn file_error(path: &Path) -> impl FnOnce(std::io::Error) -> ModelError {
    let path = path.display().to_string();
    move |source| ModelError::File { path, source }
}

/// Process of a simulation, with its pipes.
#[derive(Debug)]
pub(crate) struct Process {
    process: Child,
    stdin: Option<ChildStdin>,
    stdout: Option<ChildStdout>,
}

impl Process {
    pub(crate) fn start(
        program: &Path,
        arguments: &[&OsStr],
        folder: Option<&Path>,
    ) -> Result<Process, ModelError> {
        let mut command = Command::new(program);
        if let Some(folder) = folder {
            command.current_dir(folder);
        }
        let mut process = command
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(file_error(program))?;
        let (stdin, stdout) = (process.stdin.take(), process.stdout.take());
        Ok(Process { process, stdin, stdout })
    }

    pub(crate) fn send(&mut self, words: &[u32]) -> Result<(), ModelError> {
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        let sent = self.stdin.as_mut().map(|stdin| stdin.write_all(&bytes).and_then(|()| stdin.flush()));
        if matches!(sent, Some(Ok(()))) { Ok(()) } else { Err(self.ended()) }
    }

    /// Receives `count` words from the driver.
    pub(crate) fn receive(&mut self, count: usize) -> Result<Vec<u32>, ModelError> {
        let mut bytes = vec![0; 4 * count];
        let read = self.stdout.as_mut().map(|stdout| stdout.read_exact(&mut bytes));
        if !matches!(read, Some(Ok(()))) {
            return Err(self.ended());
        }
        let word = |bytes: &[u8]| bytes.iter().rev().fold(0, |word, &byte| word << 8 | u32::from(byte));
        Ok(bytes.chunks_exact(4).map(word).collect())
    }

    fn ended(&mut self) -> ModelError {
        self.stdin = None;
        let mut text = String::new();
        if let Some(stderr) = self.process.stderr.as_mut() {
            let _ = stderr.read_to_string(&mut text);
        }
        ModelError::Ended(text)
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // The process ends when its pipes are closed.
        (self.stdin, self.stdout) = (None, None);
        let _ = self.process.wait();
    }
}

/// A temporary folder, removed on drop.
#[derive(Debug)]
pub(crate) struct Folder(pub(crate) PathBuf);

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Value of a pin, by its number, from a cycle on; a strobe's value holds for that cycle only.
pub(crate) type PinAction = (Cycle, usize, u32);

/// A running simulation. Dropping it completes its waveform.
#[derive(Debug)]
pub struct Simulation {
    process: Process,
    latched: u16,
    /// Number of a system's host pins; 0 for a core.
    pins: usize,
    /// Folder of a system's memory image, removed after the process ends.
    _folder: Option<Folder>,
}

impl Simulation {
    /// Starts a core's compiled circuit.
    pub(crate) fn of_core(
        program: &Path,
        arguments: &[&OsStr],
        latched: u16,
    ) -> Result<Simulation, ModelError> {
        Ok(Simulation { process: Process::start(program, arguments, None)?, latched, pins: 0, _folder: None })
    }

    /// Starts a system's compiled circuit in the folder of its memory image.
    pub(crate) fn of_system(
        program: &Path,
        arguments: &[&OsStr],
        pins: usize,
        folder: Folder,
    ) -> Result<Simulation, ModelError> {
        let process = Process::start(program, arguments, Some(&folder.0))?;
        Ok(Simulation { process, latched: 0, pins, _folder: Some(folder) })
    }

    /// Number of latched input ports of a core's circuit; 0 with direct ports.
    pub fn latched(&self) -> u16 {
        self.latched
    }

    /// Resets a core and loads a program and the initial values of input ports.
    ///
    /// # Errors
    /// If the process has ended.
    pub fn load(&mut self, program: &Program, inputs: &[(Register, u32)]) -> Result<(), ModelError> {
        let bank = &program.machine.inputs;
        let first = inputs.iter().filter_map(|&(register, bits)| {
            let address = bank.index(register)?.get();
            Some(LoadRecord { space: Space::Input, slot: 0, address, value: bits.into() })
        });
        let records: Vec<LoadRecord> = load_records(program).into_iter().chain(first).collect();
        let mut words = vec![3, records.len() as u32];
        for LoadRecord { space, slot, address, value } in records {
            words.extend([space as u32, slot.into(), address.into(), value as u32, (value >> 32) as u32]);
        }
        self.process.send(&words)
    }

    /// Runs until `until` cycles have passed. `actions` are sorted by cycle and lie in the future. Returns the events, and the value of
    /// each of the host's pins in cycle `until`.
    ///
    /// # Errors
    /// If the process has ended.
    pub(crate) fn run(
        &mut self,
        until: Cycle,
        actions: &[PinAction],
    ) -> Result<(Vec<CircuitEvent>, Vec<u32>), ModelError> {
        let mut words = vec![1, until as u32, actions.len() as u32];
        words.extend(actions.iter().flat_map(|&(cycle, pin, value)| [cycle as u32, pin as u32, value]));
        self.process.send(&words)?;
        let count = self.process.receive(1)?[0] as usize;
        let events = self.process.receive(EVENT_WORDS * count)?;
        let pins = self.process.receive(self.pins)?;
        Ok((events.chunks_exact(EVENT_WORDS).filter_map(CircuitEvent::read).collect(), pins))
    }

    /// Traces these cycles of the next run to the waveform; the model must have been built for it.
    ///
    /// # Errors
    /// If the process has ended.
    pub fn trace(&mut self, first: Cycle, last: Cycle) -> Result<(), ModelError> {
        self.process.send(&[2, first as u32, last as u32])
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! A plant whose FMU runs in a process of its own.

use crate::FmuError;
use crate::archive::Fmu;
use crate::description::Causality;
use crate::message::Message;
use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};
use takt_programs::plants::file::Kind;
use takt_programs::plants::{Interface, Plant, PlantFile};

/// Time in which an FMU must be loaded and initialised.
const START: Duration = Duration::from_secs(60);
/// Time for a process that has closed its line to end.
const END: Duration = Duration::from_secs(1);

/// An FMU as a plant.
#[derive(Debug)]
pub struct FmuPlant {
    process: Child,
    line: UnixStream,
    outputs: Vec<f64>,
    /// Time for a period's steps.
    limit: Duration,
    steps: u32,
    /// Removes its folder at the end, after the process.
    fmu: Fmu,
}

impl FmuPlant {
    /// Starts an FMU. `command` starts a process that calls [`serve`](crate::serve) with the folder that is added as its last argument.
    /// `start` has values of variables at the beginning, by name; a period, in s, is `steps` steps of the FMU, each of which may take `limit`
    /// seconds.
    ///
    /// # Errors
    /// If a variable does not exist, or the FMU does not start.
    pub fn new(
        fmu: Fmu,
        mut command: Command,
        start: &[(String, f64)],
        period: f64,
        steps: u32,
        limit: f64,
    ) -> Result<FmuPlant, FmuError> {
        let mut request = vec![period / f64::from(steps), f64::from(steps)];
        for (index, (name, value)) in start.iter().enumerate() {
            let position = position(&fmu, name).map_err(|text| FmuError::Start { index, text })?;
            request.extend([position as f64, *value]);
        }
        let failed = |name: &str, text: String| FmuError::Run { name: name.to_owned(), text };
        let mut started = || -> io::Result<(Child, UnixStream)> {
            let (line, other) = UnixStream::pair()?;
            let told = io::stderr().as_fd().try_clone_to_owned()?;
            command.arg(&fmu.folder).stdin(Stdio::from(OwnedFd::from(other))).stdout(Stdio::from(told));
            Ok((command.spawn()?, line))
        };
        let (process, line) = started()
            .map_err(|error| failed(&fmu.name, format!("its process cannot be started: {error}")))?;
        // The command keeps an end of the line open.
        drop(command);
        let limit = Duration::from_secs_f64(limit * f64::from(steps));
        let mut plant = FmuPlant { process, line, outputs: Vec::new(), limit, steps, fmu };
        plant.ask(request, START, "its start").map_err(|text| failed(&plant.fmu.name, text))?;
        Ok(plant)
    }

    /// Starts the FMU of a plant's file at a path, as [`FmuPlant::new`] does.
    ///
    /// # Errors
    /// If the plant is no FMU that can run here, or does not start; mistakes of the file at their places.
    pub fn of_file(
        file: &PlantFile,
        path: &Path,
        command: Command,
        period: f64,
    ) -> Result<FmuPlant, FmuError> {
        let name = || path.display().to_string();
        let (Kind::Fmu { start, limit, .. }, Some(fmu)) = (&file.kind, file.fmu(path)) else {
            return Err(FmuError::File { name: name(), text: "its plant is a model, and no FMU".to_owned() });
        };
        let values: Vec<(String, f64)> =
            start.iter().map(|(name, value, _)| (name.clone(), *value)).collect();
        let plant = FmuPlant::new(Fmu::open(&fmu)?, command, &values, period, file.steps, *limit);
        plant.map_err(|error| match error {
            FmuError::Start { index, text } => match start.get(index) {
                Some((_, _, place)) => FmuError::Plant(Box::new(file.mistake(*place, text))),
                None => FmuError::Start { index, text },
            },
            error => error,
        })
    }

    /// Signals of the plant; its outputs are also its states.
    pub fn interface(&self) -> Interface {
        self.fmu.interface()
    }

    /// Sends a request, and keeps the outputs of the answer.
    fn ask(&mut self, request: Vec<f64>, limit: Duration, what: &str) -> Result<(), String> {
        let asked = Message::Numbers(request).write(&mut self.line);
        let answer = asked.and_then(|()| {
            self.line.set_read_timeout(Some(limit))?;
            Message::read(&mut self.line)
        });
        match answer {
            Ok(Message::Numbers(outputs)) => {
                self.outputs = outputs;
                Ok(())
            }
            Ok(Message::Failed(text)) => Err(text),
            Err(error) if matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) => {
                let _ = self.process.kill();
                let seconds = limit.as_secs_f64();
                Err(format!(
                    "{what} took longer than {seconds} s, and its process was ended; `limit` in the plant's file allows more"
                ))
            }
            Err(error) => Err(match self.ended() {
                Some(status) => format!("its process broke down in {what}: {status}"),
                None => format!("its process does not answer {what}: {error}"),
            }),
        }
    }

    /// How the process ended, if it does shortly.
    fn ended(&mut self) -> Option<ExitStatus> {
        let begin = Instant::now();
        while begin.elapsed() < END {
            match self.process.try_wait() {
                Ok(None) => std::thread::sleep(Duration::from_millis(5)),
                status => return status.ok().flatten(),
            }
        }
        None
    }
}

impl Plant for FmuPlant {
    fn advance(&mut self, inputs: &[f64]) -> Result<(), String> {
        let what = if self.steps == 1 { "a step" } else { "the steps of a period" };
        self.ask(inputs.to_vec(), self.limit, what)
    }

    fn sensors(&self) -> Vec<f64> {
        self.outputs.clone()
    }

    fn states(&self) -> Vec<f64> {
        self.outputs.clone()
    }
}

impl Drop for FmuPlant {
    fn drop(&mut self) {
        // The end of the line lets the FMU terminate; one that does not is killed.
        let _ = self.line.shutdown(std::net::Shutdown::Both);
        if self.ended().is_none() {
            let _ = self.process.kill();
            let _ = self.process.wait();
        }
    }
}

/// Position of a variable that can be set before the initialisation.
fn position(fmu: &Fmu, name: &str) -> Result<usize, String> {
    let variables = &fmu.description.variables;
    let found = variables.iter().position(|variable| variable.name == name);
    let settable = |causality| matches!(causality, Causality::Start | Causality::Input);
    match found {
        Some(index) if settable(variables[index].causality) => Ok(index),
        Some(_) => Err(format!("`{name}` of {} cannot be set", fmu.name)),
        None => Err(format!("{} has no variable `{name}` that is a scalar number", fmu.name)),
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! The process of an FMU: loads it, and answers requests that come from standard input, a socket.

use crate::archive::{self, DESCRIPTION};
use crate::description::{Causality, Description, Variable};
use crate::library::LoadedFmu;
use crate::message::Message;
use std::io;
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::path::Path;

/// An FMU in motion.
struct Served<'a> {
    fmu: LoadedFmu,
    inputs: Vec<&'a Variable>,
    outputs: Vec<&'a Variable>,
    /// Size of a step in s, steps in a period, steps made.
    size: f64,
    steps: u64,
    made: u64,
}

impl<'a> Served<'a> {
    /// The first request: size of a step, steps in a period, and pairs of a variable's position and its value.
    fn new(description: &'a Description, folder: &Path, request: &[f64]) -> Result<Served<'a>, String> {
        let [size, steps, ref start @ ..] = *request else {
            return Err("a request without numbers".to_owned());
        };
        let library = archive::library(description).ok_or("FMUs of its version cannot run here")?;
        let fmu = LoadedFmu::new(description, &folder.join(library), folder)?;
        for pair in start.chunks_exact(2) {
            let variable = description.variables.get(pair[0] as usize).ok_or("a request for no variable")?;
            fmu.set(variable, pair[1])?;
        }
        fmu.enter_initialisation()?;
        fmu.exit_initialisation()?;
        let of = |causality| description.of(causality).map(|(_, variable)| variable).collect();
        let (inputs, outputs) = (of(Causality::Input), of(Causality::Output));
        Ok(Served { fmu, inputs, outputs, size, steps: steps as u64, made: 0 })
    }

    fn outputs(&self) -> Result<Vec<f64>, String> {
        self.outputs.iter().map(|variable| self.fmu.get(variable)).collect()
    }

    /// Any other request: values of the inputs, for a period.
    fn advance(&mut self, inputs: &[f64]) -> Result<(), String> {
        for (variable, value) in self.inputs.iter().zip(inputs) {
            self.fmu.set(variable, *value)?;
        }
        for _ in 0..self.steps {
            self.fmu.step(self.made as f64 * self.size, self.size)?;
            self.made += 1;
        }
        Ok(())
    }
}

/// Answers the requests of [`FmuPlant`](crate::FmuPlant) for an FMU that is unpacked in a folder, until the other side ends.
///
/// # Errors
/// If standard input is no socket.
pub fn serve(folder: &Path) -> io::Result<()> {
    // The FMU may write to standard output: a socket of our own keeps its words apart.
    let mut line = UnixStream::from(io::stdin().as_fd().try_clone_to_owned()?);
    let read = || -> Result<Description, String> {
        let text = std::fs::read_to_string(folder.join(DESCRIPTION)).map_err(|error| error.to_string())?;
        Description::read(&text)
    };
    let description = read();
    let mut served: Option<Served<'_>> = None;
    loop {
        let request = match Message::read(&mut line) {
            Ok(Message::Numbers(numbers)) => numbers,
            Ok(Message::Failed(_)) => return Ok(()),
            Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => return Ok(()),
            Err(error) => return Err(error),
        };
        let result = match (&mut served, &description) {
            (Some(served), _) => served.advance(&request).and_then(|()| served.outputs()),
            (None, Ok(description)) => Served::new(description, folder, &request).and_then(|new| {
                let outputs = new.outputs();
                served = Some(new);
                outputs
            }),
            (None, Err(error)) => Err(error.clone()),
        };
        result.map_or_else(Message::Failed, Message::Numbers).write(&mut line)?;
    }
}

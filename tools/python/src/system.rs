// SPDX-License-Identifier: MIT OR Apache-2.0
//! Systems of several cores, from their files.

use crate::program::{AssemblyError, Wishes, read_program};
use pyo3::prelude::*;
use std::path::Path;
use takt_system::{Description, ProgramError, ReadError, Request};

/// The system in a file, with its programs, which are looked for beside it.
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
            read_program(&file, request.machine, Wishes::default()).map_err(ProgramError::Invalid)
        });
    read.map_err(|error| match error {
        ReadError::Mistakes(mistakes) => AssemblyError::new_err((mistakes.render(false), mistakes.to_json())),
        ReadError::Program(error) => error,
    })
}

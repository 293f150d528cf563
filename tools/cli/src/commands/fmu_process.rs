// SPDX-License-Identifier: MIT OR Apache-2.0
//! The hidden command `takt fmu-process`: the process of an FMU that is a plant, which `takt run --plant` starts.

use anyhow::{Context, Result};
use clap::Args;
use std::path::PathBuf;

/// Answer requests for an FMU; `takt run --plant` calls this itself.
#[derive(Args)]
pub(crate) struct FmuProcess {
    /// Folder of the unpacked FMU.
    folder: PathBuf,
}

pub(crate) fn run(arguments: &FmuProcess) -> Result<()> {
    takt_fmu_plant::serve(&arguments.folder)
        .context("the process of an FMU is started by `takt run --plant` alone")
}

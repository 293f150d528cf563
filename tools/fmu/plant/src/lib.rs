// SPDX-License-Identifier: MIT OR Apache-2.0
//! Functional mock-up units (FMUs) of other tools as plants: co-simulation, FMI 2.0 and 3.0.
//!
//! - `description.rs`: what `modelDescription.xml` says; `archive.rs`: the file, unpacked into a folder;
//! - `process.rs`: a plant whose FMU runs in a process of its own, so that its crash or endless loop is a message and not the end of ours;
//! - `serve.rs`: that process; `library.rs`: the FMU's functions, the only module that calls foreign code;
//! - `message.rs`: messages between the two.

#![cfg(unix)]

mod archive;
mod description;
mod library;
mod message;
mod process;
mod serve;

pub use archive::Fmu;
pub use description::{Causality, Description, Kind, Variable, Version};
pub use process::FmuPlant;
pub use serve::serve;
use takt_diagnostics::diag::Diagnostics;

/// Reason why an FMU is no plant.
#[derive(Debug, thiserror::Error)]
pub enum FmuError {
    /// The file cannot be read or unpacked.
    #[error("{name}: {text}")]
    File {
        /// Path of the file.
        name: String,
        /// Reason, with the remedy.
        text: String,
    },
    /// A variable to be set does not exist, or cannot be set before the initialisation.
    #[error("{text}")]
    Start {
        /// Position among the values.
        index: usize,
        /// Reason.
        text: String,
    },
    /// A mistake in the plant's file, at its place.
    #[error("{}", .0.render(false))]
    Plant(Box<Diagnostics>),
    /// The FMU failed while it was started.
    #[error("{name}: {text}")]
    Run {
        /// Path of the file.
        name: String,
        /// Reason.
        text: String,
    },
}

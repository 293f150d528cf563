// SPDX-License-Identifier: MIT OR Apache-2.0
//! Programs and systems as functional mock-up units (FMUs): co-simulation, FMI 2.0 and 3.0.
//!
//! The crate is two things. As a library it writes an FMU: [`archive`] packs the description of the variables, the programs' images, and
//! shared libraries. A shared library is this crate again: `abi` exports the functions of both standards, which drive an [`Instance`].

mod abi;
pub mod archive;
pub mod circuit;
pub mod description;
mod instance;
mod machine;
mod model;
mod state;
mod variables;

pub use archive::{ArchiveError, Fmu, Library, Platform};
pub use instance::{Instance, Mistake};
pub use model::{Model, ModelError, Settings};
pub use state::SavedState;
pub use variables::{Causality, Variable};

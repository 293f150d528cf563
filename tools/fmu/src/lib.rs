// SPDX-License-Identifier: MIT OR Apache-2.0
//! Programs as functional mock-up units (FMUs): co-simulation, FMI 2.0 and 3.0.
//!
//! The crate is two things. As a library it writes an FMU: [`archive`] packs the description of the program's variables, its image, and a
//! shared library. The shared library is this crate again: `abi` exports the functions of both standards, which drive an [`Instance`].

mod abi;
pub mod archive;
pub mod description;
mod instance;
mod model;
mod state;
mod variables;

pub use archive::{ArchiveError, Fmu};
pub use instance::{Instance, Mistake};
pub use model::{Model, ModelError, Settings};
pub use state::SavedState;
pub use variables::{Causality, Variable};

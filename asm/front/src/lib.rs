// SPDX-License-Identifier: MIT OR Apache-2.0
//! Front ends: other tools' files in, source in the assembler's language out.
//!
//! A front end is a folder with its readers: [`robot`] (URDF, MJCF, tables of Denavit and Hartenberg), [`expressions`] (CasADi,
//! SymPy), [`fpcore`] (FPCore), [`policy`] (ONNX), [`mpc`] (control problems) and [`c`] (C99). Those whose result is equations make a [`graph::Function`]; programs
//! over arrays have a writer of their own. All write through [`sink`].

pub mod c;
mod error;
pub mod expressions;
mod files;
pub mod fpcore;
pub mod graph;
pub mod mpc;
pub mod policy;
pub mod robot;
pub mod sink;

pub use error::Error;
pub use files::{Files, no_files};
pub use takt_text::encoding::{DecodedText, decode};

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Outputs of an assembled program: images, listings, source again, and the bindings of its names.

pub mod disasm;
pub mod format;
pub mod image;
pub mod listing;
pub mod names;
pub(crate) mod origins;

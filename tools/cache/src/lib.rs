// SPDX-License-Identifier: MIT OR Apache-2.0
//! The user's cache folder: where results are stored, and which stored results can be trusted.
//!
//! Cached circuits are programs that run with the user's rights. Hence the folder must belong to the user and be writable by no one else,
//! and entries must be regular files of the user. Each entry has a checksum: a damaged entry is removed and computed again.

mod entry;
mod folder;
mod location;
mod native;

pub use entry::{copy, discard, keep, plain, prune, read, seal, unseal};
pub use folder::{CacheError, folder, folder_among};
pub use location::{CacheLocation, build};
pub use native::{is_whole, seal_program};

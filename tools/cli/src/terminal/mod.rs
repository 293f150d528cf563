// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command line and the terminal: options, numbers, files, messages, progress, pictures.

pub(crate) mod files;
pub(crate) mod history;
pub(crate) mod interrupt;
pub(crate) mod number;
pub(crate) mod options;
pub(crate) mod output;
pub(crate) mod page;
pub(crate) mod plot;
pub(crate) mod progress;
pub(crate) mod prompt;
pub(crate) mod suggest;

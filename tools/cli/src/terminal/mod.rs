// SPDX-License-Identifier: MIT OR Apache-2.0
//! Command line and terminal: options, numbers, files, messages, progress, plots.

pub(crate) mod files;
pub(crate) mod groups;
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

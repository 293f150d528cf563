// SPDX-License-Identifier: MIT OR Apache-2.0
//! Shared code of the project's automation: of `xtask`, which builds, tests and releases, and of `evidence`, which proves and measures.
#![allow(clippy::print_stdout, clippy::print_stderr)]

pub mod check_cache;
pub mod command;
pub mod documents;
pub mod fuzz;
pub mod progress;
pub mod test_program;
pub mod tracking;
pub mod venv;

/// Licence identifier in the first line of each source file.
pub const SPDX: &str = "SPDX-License-Identifier: MIT OR Apache-2.0";

/// Commands of `cargo xtask`; a test in `xtask` compares this list with the command-line parser.
pub const XTASK: [&str; 11] =
    ["test", "lint", "docs", "book", "web", "pages", "wheel", "extension", "release", "reach", "fuzz"];

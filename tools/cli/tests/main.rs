// SPDX-License-Identifier: MIT OR Apache-2.0
//! Integration tests in one binary, one module per subject.

mod batch;
mod board;
mod board_pins;
mod board_plant;
mod board_selftest;
mod board_system;
mod cache;
mod circuit;
mod commands;
mod common;
mod dap;
mod debug;
mod deny;
mod documents;
mod explore;
mod header;
mod linuxcnc;
mod live;
mod live_page;
mod lsp;
mod machine_file;
mod mistakes;
mod model;
mod page;
mod parameters;
mod plant;
mod robot;
mod sources;
mod system;
mod terminal;
mod traces;
mod untrusted_text;
mod workers;

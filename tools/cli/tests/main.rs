// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tests of the crate from outside, one program: a module for each subject.

mod batch;
mod board;
mod board_pins;
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
mod lsp;
mod machine_file;
mod mistakes;
mod model;
mod outside;
mod page;
mod plant;
mod robot;
mod sources;
mod system;
mod terminal;
mod traces;

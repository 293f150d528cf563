// SPDX-License-Identifier: MIT OR Apache-2.0
//! Language server, debug adapter, and grammars for editors.
//!
//! [`lsp`] is the language server; its knowledge of the language comes from `takt_asm` and the tables of `takt_isa`. [`dap`] is the debug
//! adapter. [`grammar`] and [`tree_sitter`] serve editors for colours and folds without the server. The crate does not print: a connection
//! is a pair of channels.

pub mod dap;
pub mod grammar;
pub mod lsp;
pub mod tree_sitter;
pub mod wire;

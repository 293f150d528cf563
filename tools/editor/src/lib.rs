// SPDX-License-Identifier: MIT OR Apache-2.0
//! The language server, the debug adapter, and the grammars for editors.
//!
//! [`lsp`] is the language server: everything it says of the language it asks of `takt_asm` and of the tables in `takt_isa`.
//! [`dap`] is the debug adapter. [`grammar`] and [`tree_sitter`] are what an editor colours and folds by without it. Nothing here prints: a connection is a pair of channels.

pub mod dap;
pub mod grammar;
pub mod lsp;
pub mod tree_sitter;
pub mod wire;

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Language server, debug adapter, and grammars for editors.
//!
//! [`lsp`] is the language server, which derives its knowledge of the language from `takt_asm` and the tables of `takt_isa`. [`dap`] is
//! the debug adapter. [`grammar`] and [`tree_sitter`] provide editors with colours and folds without the server. The crate performs no
//! I/O: a connection is a pair of channels.

pub mod dap;
pub mod grammar;
pub mod lsp;
pub mod tree_sitter;
pub mod wire;

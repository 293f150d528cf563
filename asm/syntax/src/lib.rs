// SPDX-License-Identifier: MIT OR Apache-2.0
//! The syntax of the assembler's language: text to tree, before any name has a meaning; and the expression
//! language.
//!
//! A crate of its own because its parsers take long to compile. Its public items reach other crates through `takt-asm`.

pub mod ast;
mod blocks;
mod explain;
pub mod expr;
mod expression;
pub mod foreign;
mod grammar;
mod grouping;
pub mod intern;
mod lex;
pub mod limits;
pub mod name;
pub mod parse;
pub mod tokens;

pub use expression::Expression;
pub use lex::hex_real;

use std::sync::Arc;
use takt_diagnostics::diag::{Diagnostics, Sink};
use takt_diagnostics::source::Sources;

/// Syntax errors of a text: its tokens, its lines, its blocks. Nothing is included, expanded or resolved.
pub fn read(name: &str, text: &str) -> Diagnostics {
    let (mut sources, mut sink) = (Sources::default(), Sink::default());
    match sources.add(name, text.into()) {
        Some(index) => {
            parse::parse(&sources.files()[index], &mut intern::Interner::new(), &mut sink);
        }
        None => sink.push(takt_diagnostics::diag::Diagnostic::placeless("limit", "the source is too long")),
    }
    sink.finish(Arc::new(sources))
}

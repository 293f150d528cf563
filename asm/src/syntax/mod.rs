//! Text to syntax tree, before any name has a meaning; and the expression language.

pub(crate) mod ast;
mod blocks;
pub mod expr;
mod expression;
mod grammar;
pub(crate) mod intern;
mod lex;
pub(crate) mod name;
pub(crate) mod parse;
pub mod tokens;

pub use expression::Expression;

use crate::report::diag::{Diagnostics, Sink};
use crate::report::source::Sources;
use std::sync::Arc;

/// What is wrong with a text before any name in it has a meaning: its tokens, its lines, its blocks. Nothing is included and
/// nothing expanded.
pub fn read(name: &str, text: &str) -> Diagnostics {
    let (mut sources, mut sink) = (Sources::default(), Sink::default());
    match sources.add(name, text.into()) {
        Some(index) => {
            parse::parse(&sources.files()[index], &mut intern::Interner::new(), &mut sink);
        }
        None => sink.push(crate::report::diag::Diagnostic::placeless("limit", "the source is too long")),
    }
    sink.finish(Arc::new(sources))
}

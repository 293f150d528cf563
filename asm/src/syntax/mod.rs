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

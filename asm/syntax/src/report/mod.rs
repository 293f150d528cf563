//! What the assembler says: places in sources, diagnostics, and the warnings by name.

pub mod diag;
pub mod levels;
mod nearest;
pub mod source;

pub use nearest::nearest;

//! Timing analysis of programs: plain data out, nothing printed. `docs/analysis.md` says how it is done and why it is safe.
//!
//! - [`bound`]: the best and the worst that each section of a program can take, from the program alone.

pub mod bound;
mod error;
mod graph;

pub use bound::{Bounds, SectionBounds, Span, bound};
pub use error::{BoundError, Refusal};

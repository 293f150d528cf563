//! Analysis of programs, their time and their accuracy: plain data out, nothing printed. `docs/analysis.md` says how it is done and why it is safe.
//!
//! - [`accuracy`]: the errors of a run's outputs against binary64, and where they come from.
//! - [`bound`]: the best and the worst that each section of a program can take, from the program alone.
//! - [`dependence`]: after how many periods an output follows an input.
//! - [`faster`]: what faster units would bring.
//! - [`follow`]: a run up to the period that is looked at.
//! - [`straight()`]: in which cycle each operation of a straight line issues, and what it waits for.
//! - [`trace`]: where the cycles of one period, or of a run, went: every issue and what it waited for, the chain of
//!   operations that sets the time, and what a faster unit would bring.
//! - [`picture`]: the same as JSON, and drawn, as a page for a browser.

pub mod accuracy;
pub mod bound;
pub mod dependence;
mod error;
pub mod faster;
pub mod follow;
mod graph;
pub mod picture;
mod straight;
mod text;
mod trace;

pub use bound::{Bounds, SectionBounds, bound, section_cycles};
pub use error::{BoundError, Refusal};
pub use straight::{StraightIssue, straight};
pub use trace::{Issued, Link, LinkKind, MAX_ISSUES, Stalls, Trace, TraceError, WhatIf, trace};

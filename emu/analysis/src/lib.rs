//! Analysis of programs, their time and their accuracy: plain data out, nothing printed. `docs/analysis.md` says how it is done and why it is safe.
//!
//! - [`accuracy`]: the errors of a run's outputs against binary64, and where they come from.
//! - [`bound`]: the best and the worst that each section of a program can take, from the program alone.
//! - [`dependence`]: after how many periods an output follows an input.
//! - [`what_if`]: the effect of faster units.
//! - [`period`]: a run to the period under examination.
//! - [`static_issue()`]: the cycle in which each bundle of straight-line code issues, and what it waits for.
//! - [`trace`]: where the cycles of one period, or of a run, went: every issue and what it waited for, the chain of
//!   operations that sets the time, and what a faster unit would bring.
//! - [`picture`]: the same as JSON, and drawn, as a page for a browser.

pub mod accuracy;
pub mod bound;
pub mod dependence;
mod error;
mod graph;
pub mod period;
pub mod picture;
mod static_issue;
mod text;
mod trace;
pub mod what_if;

pub use bound::{Bounds, SectionBounds, bound, section_cycles};
pub use error::{BoundError, Refusal};
pub use static_issue::{StaticIssue, static_issue};
pub use trace::{Issued, Link, LinkKind, MAX_ISSUES, Stalls, Trace, TraceError, WhatIf, trace};

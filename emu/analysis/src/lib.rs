// SPDX-License-Identifier: MIT OR Apache-2.0
//! Analyses of a program's timing and accuracy, with plain data as their results. `docs/analysis.md` describes the methods and argues
//! why they are sound.
//!
//! - [`accuracy`]: the errors of a run's outputs against binary64, and the operations that cause them.
//! - [`bound`]: best-case and worst-case execution time of each section of a program, by static analysis.
//! - [`dependence`]: data-flow analysis of the number of periods after which an output follows an input.
//! - [`what_if`]: the effect of faster units.
//! - [`limit()`]: the limit that saturates an output port.
//! - [`period`]: a run up to the period under examination.
//! - [`static_issue()`]: the cycle in which each bundle of straight-line code issues, and its stalls.
//! - [`trace`]: every issue of a period, its stalls, the critical path, and the effect of a faster unit.
//! - [`picture`]: a trace as JSON, and as a page for a browser.

pub mod accuracy;
pub mod bound;
mod certificate;
mod chain;
pub mod dependence;
mod error;
mod graph;
mod limit;
pub mod period;
pub mod picture;
mod static_issue;
mod text;
mod trace;
mod values;
pub mod what_if;

pub use bound::{Bounds, Publication, SectionBounds, bound, certify, section_cycles};
pub use chain::{EdgeSlots, Loop};
pub use error::{BoundError, Refusal};
pub use limit::limit;
pub use static_issue::{StaticIssue, static_issue};
pub use trace::{IssuedBundle, Link, LinkKind, MAX_ISSUES, Stalls, Trace, TraceError, WhatIf, trace};

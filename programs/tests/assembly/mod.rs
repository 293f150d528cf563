// SPDX-License-Identifier: MIT OR Apache-2.0
//! Shipped assembly programs, `hybrid/tracking.s` and its variants, judged by independent means: the binary64 model, the closed loop with
//! the plant, the other machines, the scheduler's own prediction.
//!
//! | module | question |
//! |---|---|
//! | [`agh`] | Is the joint reference accurate, and does the tool stay on the path, along "AGH"? |
//! | [`points`] | Are all twenty outputs right anywhere in the workspace? |
//! | [`integrator`] | Does the nonlinear integrator keep step through reversals, thresholds and saturation? |
//! | [`agreement`] | Do all machines, scheduled or not, compute the same bits? |
//! | [`cycles`] | Does a period take the predicted cycles, whatever the data? |
//! | [`operations`] | How many operations does a period take, compared with the paper's count? |
//! | [`friction`] | Do the friction parameters equal a fit to a run, and is Stribeck's term fed forward? |
//! | [`generation`] | Does `generation.s` give the trajectory's points, and lose no period between moves? |
//! | [`interpolation`] | Does `interpolation.s` give the cubics between knots, and brake where knots are missing? |
//! | [`mutations`] | Do these tests notice every single mistake? |
//!
//! `TAKT_FULL=1` runs the whole path, and more points, in a debug build too.

mod agh;
mod agreement;
mod cycles;
mod friction;
mod generation;
mod inputs;
mod integrator;
mod interpolation;
mod law;
mod measure;
mod mutations;
mod operations;
mod points;
mod processor;

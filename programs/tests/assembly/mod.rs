// SPDX-License-Identifier: MIT OR Apache-2.0
//! The shipped assembly programs, `hybrid/tracking.s` and its variants, judged by what was not written
//! into them: the binary64 model, the closed loop with the plant, the other machine, the scheduler's own prediction.
//!
//! | module | question |
//! |---|---|
//! | [`agh`] | Is the joint reference accurate, and does the tool stay on the path, along "AGH"? |
//! | [`points`] | Are all twenty outputs right anywhere in the workspace? |
//! | [`integrator`] | Does the nonlinear integrator keep step through reversals, thresholds and saturation? |
//! | [`agreement`] | Do both machines, scheduled or not, compute the same bits? |
//! | [`cycles`] | Does a period take the cycles that were predicted, whatever the data? |
//! | [`operations`] | How many operations is a period, beside the paper's count? |
//! | [`friction`] | Are the friction's parameters those that a run shows, and does Stribeck's term do what it says? |
//! | [`generation`] | Does `generation.s` give the trajectory's points, and lose no period between moves? |
//! | [`interpolation`] | Does `interpolation.s` give the cubics between knots, and brake where they are missing? |
//! | [`mutations`] | Would any of this notice a mistake? |
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

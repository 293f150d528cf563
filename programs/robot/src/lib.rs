// SPDX-License-Identifier: MIT OR Apache-2.0
//! The host of the three-processor robot controller, and the robot that it controls.
//!
//! ```text
//! text ─ language ─ level ─ host ─ packet ─▶ controller: three cores (takt-system) ─ plant
//! ```
//!
//! [`language`] reads commands and programs, [`level`] executes them, [`host`] is their end of the link, with packets as
//! [`packet`] defines them. [`controller`] is the other end: the system of three cores on the emulator, its loop closed by
//! [`plant`], a six-joint arm in binary64 whose [`dynamics`] are not the nominal ones. docs/robot-commands.md is the
//! language's contract. Nothing here prints, and nothing opens files.

pub mod controller;
pub mod dynamics;
pub mod geometry;
pub mod host;
pub mod language;
pub mod level;
pub mod limits;
pub mod packet;
pub mod plant;
pub mod standard;

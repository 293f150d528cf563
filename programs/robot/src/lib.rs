// SPDX-License-Identifier: MIT OR Apache-2.0
//! Host of the three-processor robot controller, and the robot that it controls.
//!
//! ```text
//! text ─ language ─ level ─ host ─ packet ─▶ controller: three cores (takt-system) ─ plant
//! ```
//!
//! [`language`] reads commands and programs, [`level`] executes them, [`host`] is their end of the link, with the packets of [`packet`].
//! [`controller`] is the other end: the system of three cores on the emulator, with [`plant`] in its loop, a six-joint arm in binary64
//! whose [`dynamics`] differ from the nominal ones. docs/robot-commands.md is the language's contract. The crate prints nothing and opens
//! no files.

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

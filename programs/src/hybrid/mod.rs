// SPDX-License-Identifier: MIT OR Apache-2.0
//! Five-axis hybrid robot: its parameters, its paths from G-code to the reference of every period, its tracking algorithm, and a plant to
//! close the loop with.
//!
//! Numbers in parentheses are equations of the founding paper (Przegląd Elektrotechniczny 98, 7/2022). The algorithm is generic over
//! [`Real`](crate::real::Real): in `f64` it is the golden model that judges the assembly program, in `f32` native binary32 code.

pub mod binding;
pub mod closed_loop;
pub mod controller;
pub mod dynamics;
pub mod friction;
pub mod gcode;
pub mod generation;
pub mod identify;
pub mod integrator;
pub mod kinematics;
pub mod params;
pub mod plant;
pub mod ports;
pub mod spread;
pub mod trajectory;
pub mod workspace;

pub use binding::{Binding, BindingError, UnwrittenOutput};
pub use closed_loop::{ClosedLoop, Inputs, LoopError, Record, TrackingController, TrackingError};
pub use controller::{Controller, Outputs};
pub use friction::Friction;
pub use identify::Identification;
pub use kinematics::{JointReference, Reference};
pub use plant::Plant;
pub use spread::{Robot, Spread};

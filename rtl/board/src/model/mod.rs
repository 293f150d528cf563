// SPDX-License-Identifier: MIT OR Apache-2.0
//! Behavioural models of the peripherals: pins and registers have, cycle by cycle, the values of the Verilog files of `rtl/board/verilog/`.
//!
//! `rtl/board/tests/peripherals.rs` compares the circuits with the models in every cycle.

mod biss_c;
mod clocked;
mod common;
mod filter;
mod inputs;
mod motor;
mod outputs;
mod sinc3;
mod spi;
mod ssi;

pub use biss_c::{BissC, BissFrame};
pub use clocked::Model;
pub use common::{Tick, UartReceive, UartSend};
pub use filter::Filter;
pub use inputs::{DigitalIn, Hall, Quadrature, Step};
pub use motor::{Bridges, Carrier, Pwm3, Trip};
pub use outputs::{DigitalOut, Pwm, SigmaDelta};
pub use sinc3::{Sinc3, Windows};
pub use spi::Spi;
pub use ssi::{Ssi, SsiFrame};

use crate::Kind;

/// Model of a peripheral with the parameters given in the order of the kind's table; a missing parameter has its default. For a kind on a
/// carrier, half the carrier's period in cycles follows.
pub fn of(kind: &Kind, parameters: &[u32]) -> Option<Box<dyn Model>> {
    let value = |i: usize| {
        parameters.get(i).copied().unwrap_or_else(|| kind.parameters.get(i).map_or(0, |p| p.default))
    };
    Some(match kind.name {
        "quadrature" => Box::new(Quadrature::new(value(0), value(1))),
        "step" => Box::new(Step::new(value(0))),
        "pwm" => Box::new(Pwm::new(value(0), value(1), value(2) != 0)),
        "pwm3" => Box::new(Pwm3::new(Bridges {
            half: parameters.get(kind.parameters.len()).copied()?,
            dead: value(0),
            minimum: value(1),
            update: value(2),
            signed: value(3) != 0,
            invert: [value(4) != 0, value(5) != 0],
            rests: [value(6), value(7)],
        })),
        "trip" => Box::new(Trip::new(value(0), value(1) != 0, value(2) != 0)),
        "sigma-delta" => Box::new(SigmaDelta::new(value(0) != 0)),
        "spi" => {
            Box::new(Spi::new(value(0), value(1), value(2) != 0, value(3) != 0, value(4) != 0, value(5)))
        }
        "ssi" => Box::new(Ssi::new(SsiFrame {
            half: value(0),
            bits: value(1),
            turn: value(2),
            gray: value(3) != 0,
            double: value(4) != 0,
            pause: value(5),
        })),
        "biss-c" => Box::new(BissC::new(BissFrame {
            half: value(0),
            bits: value(1),
            turn: value(2),
            wait: value(3),
            timeout: value(4),
        })),
        "sinc3" => Box::new(Sinc3::new(Windows {
            half: value(0),
            clock_in: value(1) != 0,
            osr: value(2) as usize,
            fast: value(3) as usize,
            limit: value(4),
        })),
        "hall" => Box::new(Hall::new(value(0))),
        "digital-in" => Box::new(DigitalIn::new(value(0), value(1) != 0)),
        "digital-out" => Box::new(DigitalOut::new(value(0) != 0)),
        _ => return None,
    })
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Behavioural models of the peripherals: the same pins and registers, cycle by cycle, as the Verilog files of `rtl/board/verilog/`.
//!
//! They are what an emulated board is made of, and what the circuits are compared with (`rtl/board/tests/peripherals.rs`).

mod clocked;
mod common;
mod filter;
mod inputs;
mod outputs;
mod spi;

pub use clocked::Model;
pub use common::{Tick, UartReceive, UartSend};
pub use filter::Filter;
pub use inputs::{DigitalIn, Quadrature, Step};
pub use outputs::{DigitalOut, Pwm, SigmaDelta};
pub use spi::Spi;

use crate::Kind;

/// The model of a peripheral with these parameters, in the order of its table; what is missing has its default.
pub fn of(kind: &Kind, parameters: &[u32]) -> Option<Box<dyn Model>> {
    let value = |i: usize| {
        parameters.get(i).copied().unwrap_or_else(|| kind.parameters.get(i).map_or(0, |p| p.default))
    };
    Some(match kind.name {
        "quadrature" => Box::new(Quadrature::new(value(0), value(1))),
        "step" => Box::new(Step::new(value(0))),
        "pwm" => Box::new(Pwm::new(value(0), value(1), value(2) != 0)),
        "sigma-delta" => Box::new(SigmaDelta::new(value(0) != 0)),
        "spi" => {
            Box::new(Spi::new(value(0), value(1), value(2) != 0, value(3) != 0, value(4) != 0, value(5)))
        }
        "digital-in" => Box::new(DigitalIn::new(value(0), value(1) != 0)),
        "digital-out" => Box::new(DigitalOut::new(value(0) != 0)),
        _ => return None,
    })
}

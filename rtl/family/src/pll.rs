// SPDX-License-Identifier: MIT OR Apache-2.0
//! Clock generation: a family's PLL.

use crate::File;
use thiserror::Error;

/// PLL of a family.
#[derive(Clone, Copy, Debug)]
pub struct Pll {
    /// Writes an instance in Verilog that makes the clock `clk` from `clk_in` and drives `locked`, given the frequencies of `clk_in` and
    /// of `clk` in MHz.
    pub instance: fn(f64, f64) -> Result<String, PllError>,
    /// A module in place of the cell in simulation: its output is its input, so that the pin's clock drives the core.
    pub stand_in: File,
}

/// Reason why a clock cannot be made.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum PllError {
    /// No dividers give the frequency.
    #[error("the PLL cannot make {wanted} MHz from {input}; the nearest are {below} and {above}")]
    Dividers {
        /// Frequency to be made, MHz.
        wanted: f64,
        /// Frequency on the pin, MHz.
        input: f64,
        /// Highest frequency below, MHz.
        below: f64,
        /// Lowest frequency above, MHz.
        above: f64,
    },
    /// Takt knows no PLL of the family.
    #[error(
        "no PLL of {family} is known to Takt: the clock is that of the board, `clock = {input}`, and not {wanted} MHz"
    )]
    NoPll {
        /// The family's text.
        family: &'static str,
        /// Frequency to be made, MHz.
        wanted: f64,
        /// Frequency on the pin, MHz.
        input: f64,
    },
}

/// The first of a PLL's settings that makes exactly the clock `wanted` from `input`, both in MHz; each of the settings comes with its
/// clock.
///
/// # Errors
/// The nearest clocks, if no setting makes this one.
pub(crate) fn exact<T>(
    input: f64,
    wanted: f64,
    settings: impl Iterator<Item = (f64, T)>,
) -> Result<T, PllError> {
    let (mut below, mut above) = (0.0_f64, f64::INFINITY);
    for (output, setting) in settings {
        if (output / wanted - 1.0).abs() < 1e-9 {
            return Ok(setting);
        }
        if output < wanted {
            below = below.max(output);
        } else {
            above = above.min(output);
        }
    }
    let places = |mhz: f64| (mhz * 1e4).round() / 1e4;
    Err(PllError::Dividers { wanted, input, below: places(below), above: places(above) })
}

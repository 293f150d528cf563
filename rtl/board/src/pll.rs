// SPDX-License-Identifier: MIT OR Apache-2.0
//! The clock: the dividers of ECP5's PLL.

use thiserror::Error;

/// The PLL's dividers: the output is `input / reference * feedback`, and the oscillator in it `output * outputs`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pll {
    /// CLKI_DIV.
    pub reference: u32,
    /// CLKFB_DIV.
    pub feedback: u32,
    /// CLKOP_DIV.
    pub outputs: u32,
}

/// The clock cannot be made.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("the PLL cannot make {wanted} MHz of {input}; near it are {below} and {above}")]
pub struct NoClock {
    wanted: f64,
    input: f64,
    below: f64,
    above: f64,
}

/// Limits of Lattice's data sheet FPGA-DS-02012, sysCLOCK PLL timing: phase detector and oscillator, in MHz.
const DETECTOR: (f64, f64) = (3.125, 400.0);
const OSCILLATOR: (f64, f64) = (400.0, 800.0);

impl Pll {
    /// The dividers for exactly this clock, both in MHz.
    ///
    /// # Errors
    /// If there are none: the nearest clocks.
    pub fn new(input: f64, wanted: f64) -> Result<Pll, NoClock> {
        let (mut below, mut above) = (0.0_f64, f64::INFINITY);
        for reference in 1..=128_u32 {
            let detector = input / f64::from(reference);
            if !(DETECTOR.0..=DETECTOR.1).contains(&detector) {
                continue;
            }
            for feedback in 1..=80_u32 {
                let output = detector * f64::from(feedback);
                // The oscillator in the middle of its range, where it can be.
                let outputs = (600.0 / output).round().clamp(1.0, 128.0);
                if !(OSCILLATOR.0..=OSCILLATOR.1).contains(&(output * outputs)) {
                    continue;
                }
                if (output / wanted - 1.0).abs() < 1e-9 {
                    return Ok(Pll { reference, feedback, outputs: outputs as u32 });
                }
                if output < wanted {
                    below = below.max(output);
                } else {
                    above = above.min(output);
                }
            }
        }
        let places = |mhz: f64| (mhz * 1e4).round() / 1e4;
        Err(NoClock { wanted, input, below: places(below), above: places(above) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dividers_are_those_of_ecppll() {
        // yowasp-ecppll -i 25 -o 100 and -o 125.
        assert_eq!(Pll::new(25.0, 100.0), Ok(Pll { reference: 1, feedback: 4, outputs: 6 }));
        assert_eq!(Pll::new(25.0, 125.0), Ok(Pll { reference: 1, feedback: 5, outputs: 5 }));
        assert_eq!(Pll::new(25.0, 62.5).map(|pll| (pll.reference, pll.feedback)), Ok((2, 5)));
        let error = Pll::new(25.0, 61.803).expect_err("none");
        assert!(
            error
                .to_string()
                .starts_with("the PLL cannot make 61.803 MHz of 25; near it are 60.7143 and 62.5"),
            "{error}"
        );
    }
}

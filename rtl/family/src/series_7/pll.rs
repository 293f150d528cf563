// SPDX-License-Identifier: MIT OR Apache-2.0
//! Clock generator MMCME2_BASE: dividers and instance.

use crate::PllError;
use crate::pll::exact;

/// Limits of the slowest grade, data sheets DS181 and DS187: phase detector and oscillator, in MHz.
const DETECTOR: (f64, f64) = (10.0, 450.0);
const OSCILLATOR: (f64, f64) = (600.0, 1200.0);

/// Dividers: the output is `input / reference * feedback / outputs`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Dividers {
    /// Parameter DIVCLK_DIVIDE.
    reference: u32,
    /// Parameter CLKFBOUT_MULT_F.
    feedback: u32,
    /// Parameter CLKOUT0_DIVIDE_F, in eighths.
    eighths: u32,
}

impl Dividers {
    /// Dividers that make exactly the clock `wanted` from `input`, both in MHz: of those, whole ones before eighths, and the fastest
    /// oscillator, which has the least jitter (UG949).
    ///
    /// # Errors
    /// The nearest possible clocks, if no dividers make this one.
    fn new(input: f64, wanted: f64) -> Result<Dividers, PllError> {
        let pairs = || {
            (1..=106_u32).flat_map(|reference| (2..=64_u32).rev().map(move |feedback| (reference, feedback)))
        };
        let settings = [8, 1].into_iter().flat_map(|step| pairs().map(move |pair| (step, pair)));
        let settings = settings.filter_map(|(step, (reference, feedback))| {
            let detector = input / f64::from(reference);
            let oscillator = detector * f64::from(feedback);
            let eighths = (oscillator / wanted * f64::from(8 / step)).round() * f64::from(step);
            let runs = (DETECTOR.0..=DETECTOR.1).contains(&detector)
                && (OSCILLATOR.0..=OSCILLATOR.1).contains(&oscillator)
                // Fractions begin at 2 (UG472).
                && (eighths == 8.0 || (16.0..=1024.0).contains(&eighths));
            runs.then_some((
                oscillator * 8.0 / eighths,
                Dividers { reference, feedback, eighths: eighths as u32 },
            ))
        });
        exact(input, wanted, settings)
    }
}

/// Instance of the clock generator with its buffer, for frequencies in MHz.
pub(super) fn instance(input: f64, wanted: f64) -> Result<String, PllError> {
    let Dividers { reference, feedback, eighths } = Dividers::new(input, wanted)?;
    Ok(format!(
        "    wire clk_made, clk_back;
    MMCME2_BASE #(
        .BANDWIDTH(\"OPTIMIZED\"), .CLKIN1_PERIOD({:.3}), .DIVCLK_DIVIDE({reference}), .CLKFBOUT_MULT_F({feedback}.000),
        .CLKOUT0_DIVIDE_F({:.3})
    ) pll (
        .CLKIN1(clk_in), .CLKFBIN(clk_back), .PWRDWN(1'b0), .RST(1'b0), .CLKFBOUT(clk_back), .CLKFBOUTB(), .CLKOUT0(clk_made),
        .CLKOUT0B(), .CLKOUT1(), .CLKOUT1B(), .CLKOUT2(), .CLKOUT2B(), .CLKOUT3(), .CLKOUT3B(), .CLKOUT4(), .CLKOUT5(), .CLKOUT6(),
        .LOCKED(locked)
    );
    BUFG buffer (.I(clk_made), .O(clk));
",
        1e3 / input,
        f64::from(eighths) / 8.0,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dividers_make_the_clock_within_the_limits() {
        // From 100 MHz, the fastest oscillator is 1200 MHz.
        assert_eq!(Dividers::new(100.0, 75.0), Ok(Dividers { reference: 1, feedback: 12, eighths: 128 }));
        assert_eq!(Dividers::new(125.0, 100.0), Ok(Dividers { reference: 1, feedback: 8, eighths: 80 }));
        for (input, wanted) in
            [(100.0, 62.5), (125.0, 50.0), (100.0, 80.0), (125.0, 90.0), (100.0, 96.0), (100.0, 106.25)]
        {
            let Ok(Dividers { reference, feedback, eighths }) = Dividers::new(input, wanted) else {
                panic!("{wanted} MHz from {input}")
            };
            let oscillator = input * f64::from(feedback) / f64::from(reference);
            assert!((OSCILLATOR.0..=OSCILLATOR.1).contains(&oscillator));
            assert!((oscillator * 8.0 / f64::from(eighths) / wanted - 1.0).abs() < 1e-12);
        }
        assert!(matches!(Dividers::new(100.0, 77.777), Err(PllError::Dividers { .. })));
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! PLL, as Quartus' module `altera_pll`, which finds the dividers itself.

use crate::PllError;
use crate::pll::exact;

/// Limits of every grade, data sheet CV-51002: phase detector and oscillator, in MHz.
const DETECTOR: (f64, f64) = (5.0, 325.0);
const OSCILLATOR: (f64, f64) = (600.0, 1300.0);
/// Most of each divider, handbook CV-5V2.
const MOST: u32 = 512;

/// Instance of the PLL, for frequencies in MHz. Quartus takes the nearest clock without an error if no whole dividers make the wanted one:
/// they must exist.
pub(super) fn instance(input: f64, wanted: f64) -> Result<String, PllError> {
    let pairs = (1..=MOST).flat_map(|reference| (1..=MOST).map(move |feedback| (reference, feedback)));
    let settings = pairs.filter_map(|(reference, feedback)| {
        let detector = input / f64::from(reference);
        let oscillator = detector * f64::from(feedback);
        let outputs = (oscillator / wanted).round().clamp(1.0, MOST.into());
        let runs = (DETECTOR.0..=DETECTOR.1).contains(&detector)
            && (OSCILLATOR.0..=OSCILLATOR.1).contains(&oscillator);
        runs.then_some((oscillator / outputs, ()))
    });
    exact(input, wanted, settings)?;
    Ok(format!(
        "    altera_pll #(
        .fractional_vco_multiplier(\"false\"), .reference_clock_frequency(\"{input:.6} MHz\"), .operation_mode(\"direct\"),
        .number_of_clocks(1), .output_clock_frequency0(\"{wanted:.6} MHz\"), .phase_shift0(\"0 ps\"), .duty_cycle0(50),
        .pll_type(\"General\"), .pll_subtype(\"General\")
    ) pll (
        .refclk(clk_in), .rst(1'b0), .fbclk(1'b0), .outclk(clk), .fboutclk(), .locked(locked)
    );
"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clocks_are_exact() {
        for mhz in [20.0, 62.5, 75.0, 90.0, 100.0, 106.25] {
            assert!(instance(50.0, mhz).is_ok(), "{mhz}");
        }
        assert!(matches!(instance(50.0, 77.7777), Err(PllError::Dividers { .. })));
    }
}

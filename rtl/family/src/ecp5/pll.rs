// SPDX-License-Identifier: MIT OR Apache-2.0
//! PLL cell EHXPLLL: dividers and instance.

use crate::PllError;
use crate::pll::exact;

/// Dividers of the PLL: its output is `input / reference * feedback`, and its oscillator runs at `output * outputs`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Dividers {
    /// Parameter CLKI_DIV.
    reference: u32,
    /// Parameter CLKFB_DIV.
    feedback: u32,
    /// Parameter CLKOP_DIV.
    outputs: u32,
}

/// Limits of Lattice's data sheet FPGA-DS-02012, sysCLOCK PLL timing: phase detector and oscillator, in MHz.
const DETECTOR: (f64, f64) = (3.125, 400.0);
const OSCILLATOR: (f64, f64) = (400.0, 800.0);

impl Dividers {
    /// Dividers that make exactly the clock `wanted` from `input`, both in MHz.
    ///
    /// # Errors
    /// The nearest possible clocks, if no dividers make this one.
    fn new(input: f64, wanted: f64) -> Result<Dividers, PllError> {
        let all = (1..=128_u32).flat_map(|reference| (1..=80_u32).map(move |feedback| (reference, feedback)));
        let settings = all.filter_map(|(reference, feedback)| {
            let detector = input / f64::from(reference);
            let output = detector * f64::from(feedback);
            // Place the oscillator in the middle of its range, if possible.
            let outputs = (600.0 / output).round().clamp(1.0, 128.0);
            let runs = (DETECTOR.0..=DETECTOR.1).contains(&detector)
                && (OSCILLATOR.0..=OSCILLATOR.1).contains(&(output * outputs));
            runs.then_some((output, Dividers { reference, feedback, outputs: outputs as u32 }))
        });
        exact(input, wanted, settings)
    }
}

/// Instance of the PLL, for frequencies in MHz.
pub(super) fn instance(input: f64, wanted: f64) -> Result<String, PllError> {
    let Dividers { reference, feedback, outputs } = Dividers::new(input, wanted)?;
    Ok(format!(
        "    EHXPLLL #(
        .PLLRST_ENA(\"DISABLED\"), .INTFB_WAKE(\"DISABLED\"), .STDBY_ENABLE(\"DISABLED\"), .DPHASE_SOURCE(\"DISABLED\"),
        .OUTDIVIDER_MUXA(\"DIVA\"), .OUTDIVIDER_MUXB(\"DIVB\"), .OUTDIVIDER_MUXC(\"DIVC\"), .OUTDIVIDER_MUXD(\"DIVD\"),
        .CLKI_DIV({reference}), .CLKOP_ENABLE(\"ENABLED\"), .CLKOP_DIV({outputs}), .CLKOP_CPHASE({}), .CLKOP_FPHASE(0),
        .FEEDBK_PATH(\"CLKOP\"), .CLKFB_DIV({feedback})
    ) pll (
        .RST(1'b0), .STDBY(1'b0), .CLKI(clk_in), .CLKOP(clk), .CLKFB(clk), .CLKINTFB(), .PHASESEL0(1'b0), .PHASESEL1(1'b0),
        .PHASEDIR(1'b1), .PHASESTEP(1'b1), .PHASELOADREG(1'b1), .PLLWAKESYNC(1'b0), .ENCLKOP(1'b0), .LOCK(locked)
    );
",
        outputs / 2
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dividers_equal_ecpplls() {
        // yowasp-ecppll -i 25 -o 100 and -o 125.
        assert_eq!(Dividers::new(25.0, 100.0), Ok(Dividers { reference: 1, feedback: 4, outputs: 6 }));
        assert_eq!(Dividers::new(25.0, 125.0), Ok(Dividers { reference: 1, feedback: 5, outputs: 5 }));
        assert_eq!(Dividers::new(25.0, 62.5).map(|pll| (pll.reference, pll.feedback)), Ok((2, 5)));
        let error = Dividers::new(25.0, 61.803).expect_err("none");
        assert!(
            error
                .to_string()
                .starts_with("the PLL cannot make 61.803 MHz from 25; the nearest are 60.7143 and 62.5"),
            "{error}"
        );
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! PLL cell SB_PLL40_PAD, whose input is the pin: dividers and instance.

use crate::PllError;
use crate::pll::exact;

/// Dividers of the PLL: its oscillator runs at `input * (feedback + 1)`, and its output is that divided by 2^`shift`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Dividers {
    /// Parameter DIVR; the phase detector gets the input divided by it plus 1.
    reference: u32,
    /// Parameter DIVF.
    feedback: u32,
    /// Parameter DIVQ.
    shift: u32,
}

/// Limits of Lattice's data sheet FPGA-DS-02008, sysCLOCK PLL timing: phase detector, oscillator and output, in MHz.
const DETECTOR: (f64, f64) = (10.0, 133.0);
const OSCILLATOR: (f64, f64) = (533.0, 1066.0);
const OUTPUT: (f64, f64) = (16.0, 275.0);

/// Upper limits of the phase detector's frequency in MHz for the values of FILTER_RANGE from 1 on, from icepll.
const FILTERS: [f64; 5] = [17.0, 26.0, 44.0, 66.0, 101.0];

impl Dividers {
    /// Dividers that make exactly the clock `wanted` from `input`, both in MHz.
    ///
    /// # Errors
    /// The nearest possible clocks, if no dividers make this one.
    fn new(input: f64, wanted: f64) -> Result<Dividers, PllError> {
        let within = |(least, greatest): (f64, f64), mhz: f64| (least..=greatest).contains(&mhz);
        let all = (0..=15_u32).flat_map(|reference| (0..=127_u32).map(move |feedback| (reference, feedback)));
        let all = all.flat_map(|(reference, feedback)| {
            (1..=6_u32).map(move |shift| Dividers { reference, feedback, shift })
        });
        let settings = all.filter_map(|dividers| {
            let detector = input / f64::from(dividers.reference + 1);
            let oscillator = detector * f64::from(dividers.feedback + 1);
            let output = oscillator / f64::from(1_u32 << dividers.shift);
            let runs = within(DETECTOR, detector) && within(OSCILLATOR, oscillator) && within(OUTPUT, output);
            runs.then_some((output, dividers))
        });
        exact(input, wanted, settings)
    }

    /// Parameter FILTER_RANGE.
    fn filter(self, input: f64) -> usize {
        let detector = input / f64::from(self.reference + 1);
        FILTERS.iter().take_while(|&&limit| detector >= limit).count() + 1
    }
}

/// Instance of the PLL, for frequencies in MHz.
pub(super) fn instance(input: f64, wanted: f64) -> Result<String, PllError> {
    let dividers = Dividers::new(input, wanted)?;
    let Dividers { reference, feedback, shift } = dividers;
    let filter = dividers.filter(input);
    Ok(format!(
        "    SB_PLL40_PAD #(
        .FEEDBACK_PATH(\"SIMPLE\"), .DIVR(4'd{reference}), .DIVF(7'd{feedback}), .DIVQ(3'd{shift}), .FILTER_RANGE(3'd{filter})
    ) pll (
        .PACKAGEPIN(clk_in), .PLLOUTGLOBAL(clk), .LOCK(locked), .RESETB(1'b1), .BYPASS(1'b0)
    );
"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dividers_equal_icepll() {
        // yowasp-icepll -i 12 -o 24, and -o 30.
        let dividers = Dividers::new(12.0, 24.0).expect("dividers");
        assert_eq!(dividers, Dividers { reference: 0, feedback: 63, shift: 5 });
        assert_eq!(dividers.filter(12.0), 1);
        assert_eq!(Dividers::new(12.0, 30.0), Ok(Dividers { reference: 0, feedback: 79, shift: 5 }));
        let error = Dividers::new(12.0, 25.0).expect_err("none").to_string();
        assert_eq!(error, "the PLL cannot make 25 MHz from 12; the nearest are 24.75 and 25.125");
    }
}

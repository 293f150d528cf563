// SPDX-License-Identifier: MIT OR Apache-2.0
//! PLL cells rPLL of GW1N and GW2A, and PLLA of GW5A: dividers and instances.

use crate::PllError;
use crate::pll::exact;

/// Dividers of rPLL: its output is `input / reference * feedback`, and its oscillator runs at `output * outputs`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Dividers {
    /// Parameter IDIV_SEL, plus 1.
    reference: u32,
    /// Parameter FBDIV_SEL, plus 1.
    feedback: u32,
    /// Parameter ODIV_SEL.
    outputs: u32,
}

/// Device with a cell rPLL.
struct Rpll {
    /// Parameter DEVICE.
    device: &'static str,
    /// Lowest and highest frequencies of phase detector, oscillator and output, in MHz.
    detector: (f64, f64),
    oscillator: (f64, f64),
    output: (f64, f64),
}

/// Limits of Gowin's data sheet DS102 for grade C8.
const GW2A: Rpll =
    Rpll { device: "GW2A-18", detector: (3.0, 500.0), oscillator: (500.0, 1250.0), output: (3.90625, 625.0) };

/// Limits of Gowin's data sheet DS117 for grade C6.
const GW1N: Rpll =
    Rpll { device: "GW1NR-9C", detector: (3.0, 400.0), oscillator: (400.0, 1200.0), output: (3.125, 600.0) };

/// Values of the divider of the oscillator.
const OUTPUTS: [u32; 11] = [2, 4, 8, 16, 32, 48, 64, 80, 96, 112, 128];

fn within((least, greatest): (f64, f64), mhz: f64) -> bool {
    (least..=greatest).contains(&mhz)
}

impl Dividers {
    /// Dividers that make exactly the clock `wanted` from `input`, both in MHz.
    ///
    /// # Errors
    /// The nearest possible clocks, if no dividers make this one.
    fn new(of: &Rpll, input: f64, wanted: f64) -> Result<Dividers, PllError> {
        let middle = f64::midpoint(of.oscillator.0, of.oscillator.1);
        let all = (1..=64_u32).flat_map(|reference| (1..=64_u32).map(move |feedback| (reference, feedback)));
        let settings = all.filter_map(|(reference, feedback)| {
            let detector = input / f64::from(reference);
            let output = detector * f64::from(feedback);
            // Place the oscillator near the middle of its range.
            let distance = |outputs: &u32| (f64::from(*outputs) * output - middle).abs();
            let possible =
                OUTPUTS.into_iter().filter(|&outputs| within(of.oscillator, f64::from(outputs) * output));
            let outputs = possible.min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
            (within(of.detector, detector) && within(of.output, output))
                .then_some((output, Dividers { reference, feedback, outputs }))
        });
        exact(input, wanted, settings)
    }
}

/// Instance of rPLL in GW2A, for frequencies in MHz.
pub(super) fn gw2a(input: f64, wanted: f64) -> Result<String, PllError> {
    rpll(&GW2A, input, wanted)
}

/// Instance of rPLL in GW1N, for frequencies in MHz.
pub(super) fn gw1n(input: f64, wanted: f64) -> Result<String, PllError> {
    rpll(&GW1N, input, wanted)
}

fn rpll(of: &Rpll, input: f64, wanted: f64) -> Result<String, PllError> {
    let Dividers { reference, feedback, outputs } = Dividers::new(of, input, wanted)?;
    let device = of.device;
    Ok(format!(
        "    rPLL #(
        .DEVICE(\"{device}\"), .FCLKIN(\"{input}\"), .IDIV_SEL({}), .FBDIV_SEL({}), .ODIV_SEL({outputs}),
        .DYN_IDIV_SEL(\"false\"), .DYN_FBDIV_SEL(\"false\"), .DYN_ODIV_SEL(\"false\"), .CLKFB_SEL(\"internal\")
    ) pll (
        .CLKIN(clk_in), .CLKOUT(clk), .LOCK(locked), .CLKOUTP(), .CLKOUTD(), .CLKOUTD3(), .CLKFB(1'b0), .RESET(1'b0),
        .RESET_P(1'b0), .FBDSEL(6'd0), .IDSEL(6'd0), .ODSEL(6'd0), .DUTYDA(4'd0), .PSDA(4'd0), .FDLY(4'd0)
    );
",
        reference - 1,
        feedback - 1
    ))
}

/// Dividers of PLLA: its oscillator runs at `input / reference * multiplier`, and its output is that divided by `outputs`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct AroraV {
    /// Parameter IDIV_SEL.
    reference: u32,
    /// Parameter MDIV_SEL; FBDIV_SEL is 1.
    multiplier: u32,
    /// Parameter ODIV0_SEL.
    outputs: u32,
}

/// Limits of Gowin's data sheet DS1103: phase detector and oscillator, in MHz.
const DETECTOR_V: (f64, f64) = (19.0, 800.0);
const OSCILLATOR_V: (f64, f64) = (800.0, 1600.0);

impl AroraV {
    /// Dividers that make exactly the clock `wanted` from `input`, both in MHz; of several, those whose oscillator is the nearest to the
    /// middle of its range.
    ///
    /// # Errors
    /// The nearest possible clocks, if no dividers make this one.
    fn new(input: f64, wanted: f64) -> Result<AroraV, PllError> {
        let all =
            (1..=64_u32).flat_map(|reference| (2..=128_u32).map(move |multiplier| (reference, multiplier)));
        let running = all.filter_map(|(reference, multiplier)| {
            let detector = input / f64::from(reference);
            let oscillator = detector * f64::from(multiplier);
            let runs = within(DETECTOR_V, detector) && within(OSCILLATOR_V, oscillator);
            runs.then_some((oscillator, reference, multiplier))
        });
        let mut running: Vec<_> = running.collect();
        running.sort_by(|(a, ..), (b, ..)| (a - 1200.0).abs().total_cmp(&(b - 1200.0).abs()));
        let settings = running.into_iter().flat_map(|(oscillator, reference, multiplier)| {
            (1..=128_u32).map(move |outputs| {
                (oscillator / f64::from(outputs), AroraV { reference, multiplier, outputs })
            })
        });
        exact(input, wanted, settings)
    }
}

/// Instance of PLLA, for frequencies in MHz. gowin_pack 0.32 cannot read its own defaults of the unused outputs' dividers.
pub(super) fn arora_v(input: f64, wanted: f64) -> Result<String, PllError> {
    let AroraV { reference, multiplier, outputs } = AroraV::new(input, wanted)?;
    Ok(format!(
        "    PLLA #(
        .FCLKIN(\"{input}\"), .IDIV_SEL({reference}), .FBDIV_SEL(1), .MDIV_SEL({multiplier}), .MDIV_FRAC_SEL(0),
        .ODIV0_SEL({outputs}), .ODIV0_FRAC_SEL(0), .CLKOUT0_EN(\"TRUE\"), .CLKFB_SEL(\"INTERNAL\"),
        .ODIV1_SEL(8), .ODIV2_SEL(8), .ODIV3_SEL(8), .ODIV4_SEL(8), .ODIV5_SEL(8), .ODIV6_SEL(8)
    ) pll (
        .CLKIN(clk_in), .CLKOUT0(clk), .LOCK(locked), .CLKOUT1(), .CLKOUT2(), .CLKOUT3(), .CLKOUT4(), .CLKOUT5(), .CLKOUT6(),
        .CLKFBOUT(), .MDRDO(), .CLKFB(1'b0), .RESET(1'b0), .PLLPWD(1'b0), .RESET_I(1'b0), .RESET_O(1'b0), .PSSEL(3'd0),
        .PSDIR(1'b0), .PSPULSE(1'b0), .SSCPOL(1'b0), .SSCON(1'b0), .SSCMDSEL(7'd0), .SSCMDSEL_FRAC(3'd0), .MDCLK(1'b0),
        .MDOPC(2'd0), .MDAINC(1'b0), .MDWDI(8'd0)
    );
"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dividers_equal_gowin_plls() {
        // gowin_pll -i 27 -o 108 -d "GW2A-18 C8/I7", with dividers of the oscillator that the range allows.
        assert_eq!(Dividers::new(&GW2A, 27.0, 108.0), Ok(Dividers { reference: 1, feedback: 4, outputs: 8 }));
        assert_eq!(Dividers::new(&GW2A, 27.0, 81.0), Ok(Dividers { reference: 1, feedback: 3, outputs: 8 }));
        assert_eq!(
            Dividers::new(&GW2A, 27.0, 60.0),
            Ok(Dividers { reference: 9, feedback: 20, outputs: 16 })
        );
        let error = Dividers::new(&GW2A, 27.0, 100.0).expect_err("none").to_string();
        // gowin_pll -i 27 -o 54 -d "GW1NR-9C C6/I5".
        assert_eq!(Dividers::new(&GW1N, 27.0, 54.0), Ok(Dividers { reference: 1, feedback: 2, outputs: 16 }));
        assert_eq!(error, "the PLL cannot make 100 MHz from 27; the nearest are 99 and 100.2857");
    }

    #[test]
    fn dividers_of_arora_v_are_within_the_limits() {
        assert_eq!(AroraV::new(50.0, 50.0), Ok(AroraV { reference: 1, multiplier: 24, outputs: 24 }));
        assert_eq!(AroraV::new(50.0, 80.0), Ok(AroraV { reference: 1, multiplier: 24, outputs: 15 }));
        assert!(AroraV::new(50.0, 61.803).is_err());
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Cologne Chip GateMate.

use crate::pll::exact;
use crate::{
    Cells, Constraints, Family, MeasurementDevice, Pack, Part, Pinout, Place, Pll, PllError, Pull, Sites,
    Synthesis, room,
};
use std::fmt::Write as _;
use takt_isa::memory::{BlockRam, Memories, Shape};

/// Cologne Chip GateMate A1: data sheet DS1001, primitives UG1001.
pub static FAMILY: Family = Family {
    name: "gatemate",
    text: "Cologne Chip GateMate",
    // A logic element (CPE) has two tables of four inputs and two flip-flops; nextpnr makes a multiplier of 121 logic elements.
    parts: &[Part { name: "CCGM1A1", tool: "CCGM1A1", room: room(40_960, 40_960, 169, 64) }],
    grades: (0, 0),
    modules: &[],
    memories: Memories {
        block: BlockRam {
            shapes: &[
                Shape { words: 512, bits: 40 },
                Shape { words: 1024, bits: 20 },
                Shape { words: 2048, bits: 10 },
                Shape { words: 4096, bits: 5 },
                Shape { words: 8192, bits: 2 },
                Shape { words: 16384, bits: 1 },
            ],
            is_initial: true,
        },
        logic: None,
    },
    lut: "LUT4",
    cells_per_flip_flop: None,
    multiplier: [18, 18],
    carry: None,
    initial_registers: true,
    oscillator: None,
    flash_clock: None,
    cells: Cells {
        luts: &[("CC_L2T4", 1), ("CC_L2T5", 2), ("CC_LUT", 1), ("CC_ADDF", 1), ("CC_MX", 2)],
        carries: &[],
        flip_flops: &[("CC_DFF", 1)],
        multipliers: &[("CC_MULT", 1)],
        block_rams: &[("CC_BRAM_20K", 1), ("CC_BRAM_40K", 2)],
    },
    pll: Some(Pll { instance, stand_in: ("CC_PLL.v", include_str!("CC_PLL.v")) }),
    synthesis: Some(Synthesis {
        commands: |top, netlist, _| format!("synth_gatemate -luttree -nomx8 -top {top} -json {netlist}"),
        files: &[],
    }),
    place: Some(Place {
        package: "yowasp-nextpnr-himbaechel-gatemate==0.11.1.0.post826",
        program: "yowasp-nextpnr-himbaechel-gatemate",
        device: |part, _, _| ["--device", part.tool].map(str::to_owned).to_vec(),
        pins: &["--vopt", "ccf=pins.ccf"],
        used: None,
        suffixes: &["_CC_", "$"],
        places_any_pin: false,
        timing: &[],
        margin: 1.0,
        measured: &MEASURED,
    }),
    pack: Some(Pack {
        placed: &["--vopt", "out=takt.txt"],
        from: "takt.txt",
        program: "yowasp-gmpack",
        arguments: |_| vec!["takt.txt", "takt.bit"],
        bitstream: "takt.bit",
    }),
    models: None,
    bank: None,
    board: Some(Pinout {
        packages: &["BGA324"],
        // The supply of a bank makes the level.
        standards: &["LVCMOS"],
        sites: Sites { form: "a bank, A or B, and a number from 0 to 8, as in \"IO_NB_A1\"", is_site },
        file: "pins.ccf",
        constraints,
    }),
    flow: None,
};

/// The CCGM1A1, with pins of the maker's evaluation board.
static MEASURED: MeasurementDevice = MeasurementDevice {
    part: "CCGM1A1",
    package: "BGA324",
    grade: 0,
    pins: (
        "pins.ccf",
        "NET \"clk\" Loc = \"IO_SB_A8\";
NET \"rst\" Loc = \"IO_EB_B0\";
NET \"serial_in\" Loc = \"IO_NB_A2\";
NET \"serial_out\" Loc = \"IO_NB_A1\";
",
    ),
    options: &[],
    units: &[],
    parts: [[0.0; 4]; 2],
};

/// Names of pins: `IO_NB_A1`, bank NB, row A, number 1.
fn is_site(site: &str) -> bool {
    let parts: Vec<&str> = site.split('_').collect();
    let ["IO", bank, pin] = parts[..] else { return false };
    let banks = ["NA", "NB", "EA", "EB", "SA", "SB", "WA", "WB", "WC"];
    banks.contains(&bank) && matches!(pin.as_bytes(), [b'A' | b'B', b'0'..=b'8'])
}

/// Constraints in Cologne Chip's format (CCF). The clock's frequency is an option of place and route.
fn constraints(of: &Constraints<'_>) -> String {
    let mut text = String::new();
    for pin in &of.pins {
        let pull = match pin.pull {
            Pull::Up => " | PULLUP=true",
            Pull::Down => " | PULLDOWN=true",
            Pull::None => "",
        };
        let _ = writeln!(text, "NET \"{}\" Loc = \"{}\"{pull};", pin.port, pin.site);
    }
    text
}

/// Limits of the PLL's oscillator in the mode for speed, data sheet DS1001, and of its output, in MHz.
const OSCILLATOR: (f64, f64) = (1250.0, 2500.0);
const OUTPUT: f64 = 416.75;

/// Instance of the PLL, for frequencies in MHz. nextpnr chooses the dividers, and takes a clock near the wanted one without a word if none
/// make it: the clock must be the input's, times half a ratio of whole numbers with which the oscillator runs within its limits.
fn instance(input: f64, wanted: f64) -> Result<String, PllError> {
    let all = (1..=1024_u32).flat_map(|feedback| (1..=128_u32).map(move |outputs| (feedback, outputs)));
    let settings = all.filter_map(|(feedback, outputs)| {
        let oscillator = 4.0 * input * f64::from(feedback);
        let output = oscillator / f64::from(8 * outputs);
        let runs = oscillator > OSCILLATOR.0 && oscillator <= OSCILLATOR.1 && output <= OUTPUT;
        runs.then_some((output, ()))
    });
    exact(input, wanted, settings)?;
    Ok(format!(
        "    CC_PLL #(
        .REF_CLK(\"{input}\"), .OUT_CLK(\"{wanted}\"), .PERF_MD(\"SPEED\"), .LOW_JITTER(1), .LOCK_REQ(1), .CI_FILTER_CONST(2), .CP_FILTER_CONST(4)
    ) pll (
        .CLK_REF(clk_in), .CLK0(clk), .USR_PLL_LOCKED(locked), .CLK_FEEDBACK(1'b0), .USR_CLK_REF(1'b0), .USR_LOCKED_STDY_RST(1'b0),
        .USR_PLL_LOCKED_STDY(), .CLK90(), .CLK180(), .CLK270(), .CLK_REF_OUT()
    );
"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clocks_are_exact() {
        for mhz in [20.0, 24.0, 25.0, 50.0, 62.5] {
            assert!(instance(10.0, mhz).is_ok(), "{mhz}");
        }
        assert!(matches!(instance(10.0, 33.333), Err(PllError::Dividers { .. })));
    }

    #[test]
    fn sites_are_named_by_bank() {
        assert!(is_site("IO_SB_A8") && is_site("IO_WC_B0"));
        assert!(!is_site("IO_SC_A8") && !is_site("IO_SB_A9") && !is_site("A8") && !is_site("IO_SB_A10"));
    }
}

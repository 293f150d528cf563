// SPDX-License-Identifier: MIT OR Apache-2.0
//! Gowin GW1N, the family for small designs, called LittleBee.

use super::{FILES, GW2A, PACK, PINOUT, PLACE, commands, device, packed, pll};
use crate::{Family, MeasurementDevice, Oscillator, Pack, Part, Pinout, Place, Pll, Synthesis, room};

/// Gowin GW1NR-9, a GW1N-9 with a memory beside it: data sheet DS117, clocks UG286.
pub static FAMILY: Family = Family {
    name: "gw1n",
    text: "Gowin GW1N",
    parts: &[Part { name: "GW1NR-9", tool: "GW1NR-LV9", room: room(8_640, 6_480, 20, 26) }],
    grades: (5, 6),
    oscillator: Some(Oscillator {
        cell: "OSC",
        mhz: (2.0, 125.0),
        runs: 250.0 / 26.0,
        instance: "OSC #(.FREQ_DIV(26), .DEVICE(\"GW1NR-9\")) oscillator (.OSCOUT(oscillation));",
    }),
    pll: Some(Pll { instance: pll::gw1n, stand_in: ("rPLL.v", include_str!("rPLL.v")) }),
    synthesis: Some(Synthesis {
        commands: |top, netlist, _| commands("gw1n", "", top, netlist),
        files: FILES,
    }),
    place: Some(Place {
        device: |part, package, grade| device(part, package, grade, &format!("family={DIE}")),
        measured: &MEASURED,
        ..PLACE
    }),
    pack: Some(Pack {
        arguments: |_| packed(DIE, &["--sspi_as_gpio", "--ready_as_gpio", "--done_as_gpio"]),
        ..PACK
    }),
    board: Some(Pinout { packages: &["QN88P", "LQ144P", "MG100P"], ..PINOUT }),
    ..GW2A
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
    parts: [[0.0; 4]; 2],
};

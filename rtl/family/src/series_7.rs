// SPDX-License-Identifier: MIT OR Apache-2.0
//! AMD (Xilinx) 7 series: resources are counted for an Artix XC7A35T, without place and route.

use crate::{Cells, Family, Oscillator, Part, Synthesis, room};
use takt_isa::memory::{KBIT_18, Memories, Shape};

/// AMD 7 series: overview DS180, memory UG473, logic UG474, multipliers UG479, configuration UG470.
pub static FAMILY: Family = Family {
    name: "xilinx",
    text: "AMD 7 series",
    parts: &[Part { name: "XC7A35T", tool: "", room: room(20_800, 41_600, 90, 100) }],
    grades: (1, 3),
    modules: &[],
    memories: Memories { block: KBIT_18, logic: Some(Shape { words: 32, bits: 6 }) },
    lut: "LUT6",
    multiplier: [25, 18],
    carry: None,
    initial_registers: true,
    // CFGMCLK of STARTUPE2: 65 MHz, within 50 %.
    oscillator: Some(Oscillator { cell: "STARTUPE2", mhz: (65.0, 65.0) }),
    cells: Cells {
        luts: &[
            ("LUT", 1),
            ("INV", 1),
            ("SRL", 1),
            ("RAM32M", 4),
            ("RAM64M", 4),
            ("RAM32X1D", 2),
            ("RAM64X1D", 2),
        ],
        carries: &[],
        flip_flops: &[("FD", 1)],
        multipliers: &[("DSP48E1", 1)],
        block_rams: &[("RAMB18E1", 1), ("RAMB36E1", 2)],
    },
    pll: None,
    synthesis: Some(Synthesis {
        commands: |top, netlist, _| {
            format!("synth_xilinx -family xc7 -flatten -noiopad -noclkbuf -top {top}; write_json {netlist}")
        },
        files: &[],
    }),
    place: None,
    pack: None,
    models: None,
    bank: None,
    board: None,
};

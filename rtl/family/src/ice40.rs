// SPDX-License-Identifier: MIT OR Apache-2.0
//! Lattice iCE40 UltraPlus: resources are counted, without place and route.

use crate::{Cells, Family, Oscillator, Part, Synthesis, room};
use takt_isa::memory::{BlockRam, Memories, Shape};

/// Lattice iCE40 UltraPlus: data sheet FPGA-DS-02008.
pub static FAMILY: Family = Family {
    name: "ice40",
    text: "Lattice iCE40 UltraPlus",
    parts: &[Part { name: "iCE40UP5K", tool: "", room: room(5_280, 5_280, 8, 30) }],
    grades: (0, 0),
    modules: &[],
    // The single-port RAM of 256 kbit, which no bitstream fills, is not used.
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
    multiplier: [16, 16],
    carry: None,
    initial_registers: true,
    oscillator: Some(Oscillator { cell: "SB_HFOSC", mhz: (6.0, 48.0) }),
    cells: Cells {
        luts: &[("SB_LUT4", 1)],
        carries: &[],
        flip_flops: &[("SB_DFF", 1)],
        multipliers: &[("SB_MAC16", 1)],
        block_rams: &[("SB_RAM40_4K", 1)],
    },
    pll: None,
    synthesis: Some(Synthesis {
        commands: |top, netlist, _| format!("synth_ice40 -device u -dsp -top {top}; write_json {netlist}"),
        files: &[],
    }),
    place: None,
    pack: None,
    models: None,
    bank: None,
    board: None,
};

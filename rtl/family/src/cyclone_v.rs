// SPDX-License-Identifier: MIT OR Apache-2.0
//! Intel Cyclone V: resources are counted, without place and route.

use crate::{Cells, Family, Oscillator, Part, Synthesis};
use takt_isa::memory::{BlockRam, Memories, Shape};

/// Intel Cyclone V: device overview CV-51001, memory and multipliers CV-5V2.
pub static FAMILY: Family = Family {
    name: "intel",
    text: "Intel Cyclone V",
    parts: &[Part { name: "Cyclone V", tool: "", room: None }],
    grades: (6, 8),
    modules: &[],
    memories: Memories {
        // M10K.
        block: BlockRam {
            shapes: &[
                Shape { words: 256, bits: 40 },
                Shape { words: 512, bits: 20 },
                Shape { words: 1024, bits: 10 },
                Shape { words: 2048, bits: 5 },
                Shape { words: 4096, bits: 2 },
                Shape { words: 8192, bits: 1 },
            ],
            is_initial: true,
        },
        logic: Some(Shape { words: 32, bits: 20 }),
    },
    lut: "ALUT",
    multiplier: [27, 27],
    carry: None,
    initial_registers: true,
    oscillator: Some(Oscillator { cell: "cyclonev_oscillator", mhz: (100.0, 100.0) }),
    cells: Cells {
        luts: &[("MISTRAL_ALUT", 1), ("MISTRAL_NOT", 1), ("MISTRAL_MLAB", 2)],
        carries: &[],
        flip_flops: &[("MISTRAL_FF", 1)],
        multipliers: &[("MISTRAL_MUL", 1)],
        block_rams: &[("MISTRAL_M10K", 1)],
    },
    pll: None,
    synthesis: Some(Synthesis {
        commands: |top, netlist, _| {
            format!("synth_intel_alm -family cyclonev -top {top}; write_json {netlist}")
        },
        files: &[],
    }),
    place: None,
    pack: None,
    models: None,
    bank: None,
    board: None,
};

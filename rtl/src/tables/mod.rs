// SPDX-License-Identifier: MIT OR Apache-2.0
//! The tables of the arithmetic units, as Verilog: one module per table, with a registered output, which synthesis places
//! into block RAM.
//!
//! The contents stand in the module itself rather than in a file for `$readmemh`, so that no tool depends on the folder it
//! runs in. `tests/tables.rs` keeps the files in `units/common` equal to what is computed here (`TAKT_BLESS=1` writes
//! them) and proves what the circuits rely on.

pub mod angle;
pub mod reciprocal;
pub mod sine;

use std::fmt::Write;

/// A read-only memory within a table's module.
struct Memory<'a> {
    /// Name of the output port.
    name: &'a str,
    /// Name of the address port; memories may share one.
    address: &'a str,
    /// Width of a word.
    bits: u32,
    /// The words.
    words: &'a [u64],
}

/// The text of the module `name`, whose memories are `memories`; `contract` is its header, without comment marks. Memories
/// are read in every cycle or, if `enable`, in those in which a port of that name is 1.
fn module(name: &str, contract: &str, enable: bool, memories: &[Memory<'_>]) -> String {
    let mut text = String::from("// SPDX-License-Identifier: MIT OR Apache-2.0\n");
    for line in contract.lines() {
        let _ = writeln!(text, "{}", format!("// {line}").trim_end());
    }
    text.push_str("//\n// Generated from rtl/src/tables; not to be edited.\n\n");
    let _ = writeln!(text, "module {name} (\n    input  wire clk,");
    if enable {
        text.push_str("    input  wire enable,\n");
    }
    for (i, memory) in memories.iter().enumerate() {
        if memories[..i].iter().all(|earlier| earlier.address != memory.address) {
            let _ =
                writeln!(text, "    input  wire [{}:0] {},", memory.words.len().ilog2() - 1, memory.address);
        }
    }
    let outputs: Vec<_> = memories
        .iter()
        .map(|memory| format!("    output reg  [{}:0] {}", memory.bits - 1, memory.name))
        .collect();
    let _ = writeln!(text, "{}\n);\n", outputs.join(",\n"));
    for memory in memories {
        let Memory { name, bits, words, .. } = memory;
        let _ = writeln!(text, "    reg [{}:0] {name}_words [0:{}];", bits - 1, words.len() - 1);
    }
    text.push_str(if enable {
        "\n    always @(posedge clk) if (enable) begin\n"
    } else {
        "\n    always @(posedge clk) begin\n"
    });
    for Memory { name, address, .. } in memories {
        let _ = writeln!(text, "        {name} <= {name}_words[{address}];");
    }
    text.push_str("    end\n");
    for Memory { name, bits, words, .. } in memories {
        let digits = bits.div_ceil(4) as usize;
        text.push_str("\n    initial begin\n");
        for (row, chunk) in words.chunks(4).enumerate() {
            text.push_str("       ");
            for (i, word) in chunk.iter().enumerate() {
                assert!(word >> bits == 0, "{name}: {word:#x} does not fit {bits} bits");
                let _ = write!(text, " {name}_words[{}] = {bits}'h{word:0digits$x};", 4 * row + i);
            }
            text.push('\n');
        }
        text.push_str("    end\n");
    }
    text.push_str("\nendmodule\n");
    text
}

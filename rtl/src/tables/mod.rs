// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tables of the arithmetic units, as Verilog: a module for each table, with a registered output, which synthesis places into block RAM.
//!
//! The module itself holds the contents, rather than a file for `$readmemh`, so that no tool depends on the folder in which it runs.
//! `tests/tables.rs` compares the files in `units/common` with the tables computed here (`TAKT_BLESS=1` writes them). The proofs of the
//! units also compare the words that yosys reads from those files.

pub mod angle;
pub mod reciprocal;
pub mod sine;

use std::fmt::Write;
use std::sync::OnceLock;

/// Read-only memory within a table's module.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Memory {
    /// Name of the output port.
    pub name: &'static str,
    /// Name of the address port; memories may share one.
    pub address: &'static str,
    /// Width of a word, in bits.
    pub bits: u32,
    /// Contents, in order of addresses.
    pub words: Vec<u64>,
}

/// A table: a module of memories that are read in every cycle.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Table {
    /// Name of the module and of its file.
    pub name: &'static str,
    /// Header of the file, without comment marks.
    contract: &'static str,
    /// Memories in the order of the output ports.
    pub memories: Vec<Memory>,
}

/// All tables of the units, after checking the bounds on their words that proofs in `rtl/formal` assume.
///
/// # Errors
/// A word beyond such a bound.
pub fn checked() -> Result<Vec<Table>, String> {
    reciprocal::Tables::new().check()?;
    angle::check()?;
    Ok(all())
}

fn all() -> Vec<Table> {
    vec![
        reciprocal::Tables::new().table(),
        sine::multiples(),
        sine::polynomials(),
        angle::arctangents(),
        angle::arccosines(),
    ]
}

/// Names of the tables' files in `units` and their texts, computed once: embedded, they would be a twentieth of the playground.
pub(crate) fn texts() -> &'static [(String, String)] {
    static TEXTS: OnceLock<Vec<(String, String)>> = OnceLock::new();
    TEXTS.get_or_init(|| {
        let file = |table: Table| (format!("common/{}.v", table.name), table.verilog());
        all().into_iter().map(file).collect()
    })
}

impl Table {
    /// Verilog text of the module.
    #[must_use]
    pub fn verilog(&self) -> String {
        let Table { name, contract, memories } = self;
        let mut text = String::from("// SPDX-License-Identifier: MIT OR Apache-2.0\n");
        for line in contract.lines() {
            let _ = writeln!(text, "{}", format!("// {line}").trim_end());
        }
        text.push_str("//\n// Generated from rtl/src/tables; not to be edited.\n\n");
        let _ = writeln!(text, "module {name} (\n    input  wire clk,");
        for (i, memory) in memories.iter().enumerate() {
            if memories[..i].iter().all(|earlier| earlier.address != memory.address) {
                let _ = writeln!(
                    text,
                    "    input  wire [{}:0] {},",
                    memory.words.len().ilog2() - 1,
                    memory.address
                );
            }
        }
        let outputs: Vec<_> = memories
            .iter()
            .map(|memory| format!("    output reg  [{}:0] {}", memory.bits - 1, memory.name))
            .collect();
        let _ = writeln!(text, "{}\n);\n", outputs.join(",\n"));
        for Memory { name, bits, words, .. } in memories {
            let _ = writeln!(text, "    reg [{}:0] {name}_words [0:{}];", bits - 1, words.len() - 1);
        }
        text.push_str("\n    always @(posedge clk) begin\n");
        for Memory { name, address, .. } in memories {
            let _ = writeln!(text, "        {name} <= {name}_words[{address}];");
        }
        text.push_str("    end\n");
        memories.iter().for_each(|memory| memory.initial(&mut text));
        text.push_str("\nendmodule\n");
        text
    }
}

impl Memory {
    /// Writes the block that initialises the memory.
    fn initial(&self, text: &mut String) {
        let Memory { name, bits, words, .. } = self;
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
}

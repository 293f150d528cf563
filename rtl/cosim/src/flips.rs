// SPDX-License-Identifier: MIT OR Apache-2.0
//! Bits of a core flipped, one at a time: what leaves it then, and whether the second core or the error correction tells.

use crate::simulation::{ModelError, Process};
use std::path::{Path, PathBuf};
use takt_isa::load::{LoadRecord, load_records};
use takt_isa::{Program, Type};
use takt_rtl::Design;
use takt_rtl::export::RESET_CYCLES;
use takt_rtl::verilator::Sources;

/// Main program around a core, or a pair: the counterpart of [`Flips`].
const DRIVER: &str = include_str!("flips.cpp");
/// Number that ends the flips.
const END: u32 = u32::MAX;

/// A core with mechanisms against faults, compiled for flips.
#[derive(Clone, Debug)]
pub struct FlipModel(PathBuf);

/// Inputs of a run and its length.
#[derive(Clone, Debug)]
pub struct Stimulus {
    /// Cycles from tick to tick.
    pub period: u32,
    /// Values of the program's input ports, in their order, for each period.
    pub rows: Vec<Vec<u32>>,
    /// Periods after a flip in which it may show.
    pub horizon: u32,
}

/// Register of the circuit: flip-flops or a memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FlipRegister {
    /// Hierarchical name below the top.
    pub name: String,
    /// Bits of a word.
    pub bits: u32,
    /// Words of a memory; 0 for flip-flops.
    pub words: u32,
}

/// Outcome of a flip; cycles count from the beginning of the run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Outcome {
    /// First cycle in which a value that the exchange reads, or a memory write of the first core, is not that of the run without a flip.
    pub harmful: Option<u32>,
    /// First cycle in which `differs` or `upset` is 1.
    pub told: Option<u32>,
    /// First cycle in which the first core stops with a fault or halts, misses its deadline, or has an output that is NaN.
    pub stops: Option<u32>,
    /// The flip left nothing behind.
    pub is_over: bool,
    /// A word was corrected.
    pub is_corrected: bool,
}

/// A program running on a core whose bits are flipped.
#[derive(Debug)]
pub struct Flips {
    process: Process,
    /// Registers, sorted by name.
    pub registers: Vec<FlipRegister>,
    /// First and last cycle for a flip.
    pub cycles: (u32, u32),
}

impl FlipRegister {
    /// Number of the register's bits.
    pub fn count(&self) -> u32 {
        self.bits * self.words.max(1)
    }
}

impl FlipModel {
    /// Compiles a design, or finds an earlier build in the folder.
    ///
    /// # Errors
    /// If Verilator or a C++ compiler is missing or fails.
    pub fn build(design: &Design, folder: &Path) -> Result<FlipModel, ModelError> {
        let mut kept = String::from("`verilator_config\n");
        for file in &design.files {
            let module = file.base().trim_end_matches(".v");
            for name in registers(&file.text) {
                kept += &format!("public_flat_rw -module \"{module}\" -var \"{name}\"\n");
            }
        }
        let mut header = format!("#define TOP \"{}\"\n#define RESET_CYCLES {RESET_CYCLES}\n", design.top);
        if design.safety.second_core.is_some() {
            header += "#define PAIR\n";
        }
        if design.safety.ecc {
            header += "#define ECC\n";
        }
        header += DRIVER;
        let files = design.files.iter().map(|file| (file.name.as_str(), file.text.as_str()));
        let mut sources = Sources {
            name: "flips",
            top: &design.top,
            prefix: "Vcircuit",
            files: files.collect(),
            driver: &header,
            headers: vec![("kept.vlt", &kept)],
            arguments: vec![format!("-GLATCHED={}", design.latched), "kept.vlt".to_owned()],
            defines: Vec::new(),
            optimise: "-O2",
            trace: false,
        };
        sources.arguments.push("-Wno-fatal".to_owned());
        Ok(FlipModel(sources.build(folder)?))
    }

    /// Runs a program without a flip, so that its bits can be flipped.
    ///
    /// # Errors
    /// If the process ends: the program must neither stop nor miss a deadline, and no mechanism may tell.
    pub fn start(&self, program: &Program, stimulus: &Stimulus) -> Result<Flips, ModelError> {
        let machine = program.machine;
        let records = load_records(program);
        let mut words = vec![records.len() as u32];
        for LoadRecord { space, slot, address, value } in records {
            words.extend([space as u32, slot.into(), address.into(), value as u32, (value >> 32) as u32]);
        }
        let inputs = program.inputs.iter().filter_map(|port| machine.input_number(port.register));
        let inputs: Vec<u32> = inputs.map(u32::from).collect();
        let outputs = program.outputs.iter().filter_map(|port| {
            Some((u32::from(machine.output_number(port.register)?), u32::from(port.ty == Type::F)))
        });
        let (outputs, floats): (Vec<u32>, Vec<u32>) = outputs.unzip();
        words.push(inputs.len() as u32);
        words.extend(inputs);
        words.push(outputs.len() as u32);
        words.extend(outputs);
        words.extend(floats);
        words.extend([stimulus.period, stimulus.rows.len() as u32]);
        words.extend(stimulus.rows.iter().flatten());
        words.push(stimulus.horizon);
        let mut process = Process::start(&self.0, &[], None)?;
        process.send(&words)?;
        let count = process.receive(1)?[0];
        let mut registers = Vec::new();
        for _ in 0..count {
            let [bits, words, letters] = process.receive(3)?[..] else { break };
            let name = process.receive(letters as usize)?;
            let name = name.into_iter().filter_map(char::from_u32).collect();
            registers.push(FlipRegister { name, bits, words });
        }
        let cycles = process.receive(2)?;
        Ok(Flips { process, registers, cycles: (cycles[0], cycles[1]) })
    }
}

impl Flips {
    /// Flips bits at once, at the beginning of a cycle: each is a bit of a register, by the register's number.
    ///
    /// # Errors
    /// If the process has ended.
    pub fn flip(&mut self, bits: &[(usize, u32)], cycle: u32) -> Result<Outcome, ModelError> {
        let mut words = vec![cycle, bits.len() as u32];
        words.extend(bits.iter().flat_map(|&(register, bit)| [register as u32, bit]));
        self.process.send(&words)?;
        let words = self.process.receive(5)?;
        let cycle = |word: u32| word.checked_sub(1);
        Ok(Outcome {
            harmful: cycle(words[0]),
            told: cycle(words[1]),
            stops: cycle(words[2]),
            is_over: words[3] != 0,
            is_corrected: words[4] != 0,
        })
    }
}

impl Drop for Flips {
    fn drop(&mut self) {
        let _ = self.process.send(&[END]);
    }
}

/// Names of a module's registers: what statements `name <= …`, `name[…] <= …` and `{name, …} <= …` set, and arrays.
fn registers(text: &str) -> Vec<String> {
    let code: String =
        text.lines().map(|line| line.split("//").next().unwrap_or(line)).collect::<Vec<_>>().join("\n");
    let mut names: Vec<String> = Vec::new();
    let mut put = |name: &str| {
        if !name.is_empty() && !names.iter().any(|known| known == name) {
            names.push(name.to_owned());
        }
    };
    let is_letter = |c: char| c.is_ascii_alphanumeric() || c == '_';
    // Arrays: `reg [31:0] words [0:15];`.
    for line in code.lines().map(str::trim).filter(|line| line.starts_with("reg ") && line.ends_with("];")) {
        let declared = line[4..].trim_start_matches(|c: char| c != ']').trim_start_matches([']', ' ']);
        put(declared.split(|c| !is_letter(c)).next().unwrap_or(""));
    }
    // The target stands before a `<=` outside of all brackets, at the beginning of a statement: other ones are comparisons.
    let (mut depth, mut begin, mut is_open) = (0_i32, 0, true);
    for (i, c) in code.char_indices() {
        match c {
            '(' | '[' | '{' => depth += 1,
            ')' | ']' | '}' => depth -= 1,
            ';' if depth == 0 => (begin, is_open) = (i + 1, true),
            '=' if depth == 0 && is_open => {
                is_open = false;
                if code[..i].ends_with('<') {
                    target(code[begin..i - 1].trim_end(), is_letter).iter().for_each(|name| put(name));
                }
            }
            _ if depth == 0 && code[..=i].ends_with("begin") => (begin, is_open) = (i + 1, true),
            _ => {}
        }
    }
    names
}

/// Names at the end of a text: `name`, `name[…]` or `{name, name[…]}`.
fn target(text: &str, is_letter: impl Fn(char) -> bool + Copy) -> Vec<&str> {
    let last = |text: &str| text.len() - text.trim_end_matches(is_letter).len();
    match text.chars().last() {
        Some('}') => {
            let inner = text.rfind('{').map_or("", |at| &text[at + 1..text.len() - 1]);
            // Bits of an index have no names before them: a name stands at the beginning of each part.
            inner.split(',').map(|part| part.trim().split(|c| !is_letter(c)).next().unwrap_or("")).collect()
        }
        Some(']') => match text.rfind('[') {
            // An index may have an index of its own.
            Some(at) if text[at..].matches(']').count() == 1 => target(text[..at].trim_end(), is_letter),
            Some(_) => {
                let head = text.split('[').next().unwrap_or("");
                vec![&head[head.len() - last(head)..]]
            }
            None => Vec::new(),
        },
        _ => vec![&text[text.len() - last(text)..]],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn registers_are_found_in_verilog() {
        let text = "module m #(parameter A = 1 <= 2) (input wire clk, output reg [1:0] q);
    reg [3:0] words [0:7];  // c <= d
    wire less = a <= b;
    localparam [3:0] LAST = (A <= 3) ? 1 : 2;
    always @(posedge clk) begin
        if (x <= y) z <= a <= b;
        else begin q[1] <= 1'b0; end
        {one, two[3:0]} <= 5'd0;
        case (k) 2'd0: words[at[2:0]] <= v; default: state <= 2'd1; endcase
        for (i = 0; i <= 3; i = i + 1) parity[8*i +: 8] <= 0;
    end
endmodule";
        assert_eq!(registers(text), ["words", "z", "q", "one", "two", "state", "parity"]);
    }
}

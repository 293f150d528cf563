// SPDX-License-Identifier: MIT OR Apache-2.0
//! Generator of the files beside the core in an exported folder: file lists, memory image, test bench.

use crate::export::{Design, DesignFile, INPUT_DELAY, RESET_CYCLES, family_files, synthesis_top};
use crate::template::fill;
use crate::{axi, wishbone};
use std::fmt::Write as _;
use takt_isa::load::{LoadRecord, load_records};
use takt_isa::{Machine, Program, Register};

/// Most records that the test bench reads from `inputs.hex`.
pub const STIMULI: usize = 1 << 16;

/// Cycles after which the test bench gives up waiting for the program's `wait`, unless `+cycles` says otherwise.
const LIMIT: u32 = 1_000_000;

/// Generates every file of an exported folder. The test bench runs `program.hex` and `inputs.hex`, which are empty without a program.
pub fn folder(
    design: &Design,
    program: Option<&Program>,
    periods: &[Vec<(Register, u32)>],
) -> Vec<DesignFile> {
    let machine = design.machine;
    let top = &design.top;
    let latched = design.latched;
    let put = |name: String, text: String| DesignFile { name, text };
    let mut files = design.files.clone();
    files.extend(family_files(top, &design.files));
    let list = |own: Option<&String>| {
        let core = design.files.iter().map(|file| &file.name);
        own.into_iter().chain(core).map(|name| format!("{name}\n")).collect::<String>()
    };
    let synthesis = format!("{}.v", synthesis_top(machine));
    let bench_name = format!("{top}_bench");
    let bench_file = format!("{bench_name}.v");
    files.push(put(format!("{top}.f"), list(None)));
    files.push(put(format!("{bench_name}.f"), list(Some(&bench_file))));
    files.push(put(synthesis, wishbone::on_few_pins(design)));
    files.push(put(format!("{}.v", wishbone::name(design)), wishbone::wrapper(design, latched)));
    files.push(put(format!("{}.v", axi::name(design)), axi::wrapper(design, latched)));
    files.push(put(bench_file, bench(design)));
    let nothing = || "// no program: `takt rtl --program FILE` writes one\n".to_owned();
    files.push(put("program.hex".to_owned(), program.map_or_else(nothing, image)));
    files.push(put("inputs.hex".to_owned(), stimuli(machine, periods)));
    files
}

/// Memory image for `$readmemh`: one record (space, slot, address, value) per line.
pub fn image(program: &Program) -> String {
    let mut text = String::from(
        "// space, slot, address, value: what the loader writes (docs/hardware.md in Takt's repository)\n",
    );
    for LoadRecord { space, slot, address, value } in load_records(program) {
        let _ = writeln!(text, "{:x}{slot:x}{address:04x}{value:012x}", space as u8);
    }
    text
}

/// Stimuli of the test bench for `$readmemh`: each period's inputs, by register, and its tick.
fn stimuli(machine: &Machine, periods: &[Vec<(Register, u32)>]) -> String {
    let mut text = String::from("// 1: input port, index, value; 2: tick\n");
    for inputs in periods {
        for &(register, bits) in inputs {
            // Skip registers that are not input ports.
            let Some(index) = machine.inputs.index(register) else { continue };
            let _ = writeln!(text, "1{:03x}{bits:08x}", index.get());
        }
        let _ = writeln!(text, "200000000000");
    }
    text
}

fn bench(design: &Design) -> String {
    let Design { machine, top, latched, .. } = design;
    let latched = *latched;
    let input_bits = machine.inputs.depth.trailing_zeros();
    let port_bits = machine.outputs_per_bank.trailing_zeros();
    let mut outputs = String::new();
    let mut ports = String::new();
    let mut shown = String::new();
    for slot in machine.slots {
        let b = slot.bank.name;
        let _ = writeln!(
            outputs,
            "    wire        output_{b}_write;\n    wire [{}:0]  output_{b}_index;\n    wire [31:0] output_{b}_value;",
            port_bits - 1
        );
        let _ = writeln!(
            ports,
            "        .output_{b}_write(output_{b}_write), .output_{b}_index(output_{b}_index), .output_{b}_value(output_{b}_value),"
        );
        let _ = writeln!(
            shown,
            "            if (output_{b}_write) {};",
            if latched > 0 {
                format!("written[output_{b}_index] = 1'b1")
            } else {
                format!("$display(\"%0d output %0d %h\", cycle, output_{b}_index, output_{b}_value)")
            }
        );
    }
    let count = machine.outputs_per_bank;
    // With latched ports, the test bench reads the ports written since the last period one by one, before it reports the `wait`.
    let published = if latched > 0 {
        fill(include_str!("templates/published.v.in"), &[("COUNT", &count)])
    } else {
        String::new()
    };
    let records =
        machine.code_depth as usize * machine.slots.len() + machine.data_depth as usize + Register::COUNT;
    fill(
        include_str!("templates/bench.v.in"),
        &[
            ("TOP", &top),
            ("LIMIT", &LIMIT),
            ("INDEX_HIGH", &(input_bits - 1)),
            ("PORT_HIGH", &(port_bits - 1)),
            ("WRITTEN_HIGH", &(count - 1)),
            ("OUTPUTS", &outputs),
            ("LATCHED", &latched),
            ("PORTS", &ports),
            ("LAST_RECORD", &(records - 1)),
            ("LAST_STIMULUS", &(STIMULI - 1)),
            ("SHOWN", &shown),
            ("PUBLISHED", &published),
            ("RESET", &RESET_CYCLES),
            ("RECORDS", &records),
            ("INDEX_TOP", &(48 + input_bits - 1)),
            ("STIMULUS_TOP", &(32 + input_bits - 1)),
            ("DELAY", &INPUT_DELAY),
            ("SAFETY_NETS", &design.safety.nets("")),
            ("SAFETY", &design.safety.connections("")),
        ],
    )
}

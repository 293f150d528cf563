// SPDX-License-Identifier: MIT OR Apache-2.0
//! Generator of the manual from the tables of the specification: text for the terminal, Markdown for `docs/isa.md`, plain
//! data for JSON.

use crate::memory::{BlockRam, KBIT_18};
use crate::shape::{Field, OPCODE, Shape, WORD_BITS};
use crate::spec::configuration::OPTIONS;
use crate::spec::instructions::{Function, ROWS, Row, Type};
use crate::spec::machines::{MACHINES, Machine, Slot};
use crate::spec::units::{UNITS, Unit};
use serde::Serialize;
use std::fmt::Write as _;

/// The whole manual as plain data.
#[derive(Debug, Serialize)]
pub struct Manual {
    /// Bits in a word.
    pub word_bits: u32,
    /// Entries of all instructions, in the order of the table.
    pub instructions: Vec<Entry>,
    /// Units of the table.
    pub units: &'static [Unit],
    /// Machines of the table, without fixtures.
    pub machines: &'static [&'static Machine],
}

/// Manual entry of an instruction.
#[derive(Debug, Serialize)]
pub struct Entry {
    /// Name in the source.
    pub mnemonic: &'static str,
    /// Operands as they are written.
    pub syntax: &'static str,
    /// Bits 47..41 of the word.
    pub opcode: u8,
    /// The function that the unit must offer.
    pub function: Function,
    /// Type of the result, if any, then of the sources.
    pub types: &'static [Type],
    /// Meaning in symbols, one line.
    pub summary: &'static str,
    /// Special cases, flags, error bound.
    pub text: &'static str,
    /// Forms in equations; the letters `a`, `b` and `c` are the sources.
    pub forms: &'static [&'static str],
    /// Bit fields: name, least significant bit, width.
    pub fields: Vec<(&'static str, u32, u32)>,
    /// Latency and interval, for each slot of each machine that hosts a unit for the instruction.
    pub timing: Vec<Timing>,
}

/// A slot in which an instruction issues on a machine, and its latency and interval in cycles.
#[derive(Debug, Serialize)]
pub struct Timing {
    /// Name of the machine.
    pub machine: &'static str,
    /// The slot; `any` for idle operations.
    pub slot: &'static str,
    /// The unit; empty for idle operations.
    pub unit: &'static str,
    /// Cycles to the earliest issue of a dependent operation; 0 where no register is written.
    pub latency: u32,
    /// Initiation interval: cycles between two issues to the unit.
    pub interval: u32,
}

/// The slots of a machine that execute an instruction, with latency and interval there.
pub fn timings(row: &Row, machine: &'static Machine) -> Vec<Timing> {
    if row.function == Function::Idle {
        return vec![Timing { machine: machine.name, slot: "any", unit: "", latency: 0, interval: 1 }];
    }
    let timing = |slot: &'static Slot| {
        let unit = slot.unit(row.function)?;
        let latency = if row.shape.has_dest() { unit.latency } else { 0 };
        Some(Timing {
            machine: machine.name,
            slot: slot.name,
            unit: unit.name,
            latency,
            interval: unit.interval,
        })
    };
    machine.slots.iter().filter_map(timing).collect()
}

/// Builds the manual from the tables.
pub fn manual() -> Manual {
    let entry = |row: &Row| Entry {
        mnemonic: row.mnemonic,
        syntax: row.shape.syntax(),
        opcode: row.opcode,
        function: row.function,
        types: row.types,
        summary: row.summary,
        text: row.text,
        forms: row.forms,
        fields: row
            .shape
            .fields()
            .iter()
            .map(|field| (field.name(), field.bits().low, field.bits().width))
            .collect(),
        timing: MACHINES.iter().flat_map(|machine| timings(row, machine)).collect(),
    };
    Manual {
        word_bits: WORD_BITS,
        instructions: ROWS.iter().map(entry).collect(),
        units: UNITS,
        machines: MACHINES,
    }
}

impl Entry {
    fn assembly(&self) -> String {
        format!("{} {}", self.mnemonic, self.syntax).trim_end().to_owned()
    }

    /// Latency and interval on a machine, as `slot 5/1` for each slot that hosts the unit; `-` if none does.
    pub fn cost(&self, machine: &str) -> String {
        let cost = |timing: &Timing| match timing.latency {
            0 => format!("{} -/{}", timing.slot, timing.interval),
            latency => format!("{} {latency}/{}", timing.slot, timing.interval),
        };
        let costs: Vec<String> =
            self.timing.iter().filter(|timing| timing.machine == machine).map(cost).collect();
        if costs.is_empty() { "-".to_owned() } else { costs.join(", ") }
    }
}

/// The entry of one instruction as a few lines of text.
pub fn entry_text(entry: &Entry) -> String {
    let mut out = format!("{}\n    {}\n", entry.assembly(), entry.summary);
    if !entry.text.is_empty() {
        let _ = writeln!(out, "    {}", entry.text);
    }
    if !entry.forms.is_empty() {
        let _ = writeln!(out, "    in equations: {}", entry.forms.join(", "));
    }
    let _ = write!(out, "    opcode 0x{:02x}", entry.opcode);
    for (name, low, width) in &entry.fields {
        let _ = write!(out, ", {name} [{}:{low}]", low + width - 1);
    }
    out.push('\n');
    for timing in &entry.timing {
        let unit = if timing.unit.is_empty() { String::new() } else { format!(", unit {}", timing.unit) };
        let latency = match timing.latency {
            0 => "writes no register".to_owned(),
            latency => format!("latency {latency}"),
        };
        let _ = writeln!(
            out,
            "    {}: slot {}{unit}, {latency}, interval {} (cycles)",
            timing.machine, timing.slot, timing.interval
        );
    }
    out
}

/// The memories of a machine, with the block RAMs that they take.
pub fn memories_text(machine: &Machine) -> String {
    memories_in(machine, machine.code_block_rams(&KBIT_18), machine.data_block_rams(&KBIT_18))
}

/// The memories of a machine, with the stated numbers of block RAMs of program and data memory.
pub fn memories_in(machine: &Machine, program: u64, data: u64) -> String {
    let Machine { code_depth, data_depth, .. } = machine;
    format!(
        "{code_depth} bundles of program memory ({program} block RAMs), {data_depth} words of data memory ({data} block RAMs)"
    )
}

/// The machines as text.
pub fn machines_text() -> String {
    let mut out = machines_as_text(MACHINES);
    out.push_str("Other depths of the memories, powers of two, follow a machine's name: `-m t3,code=4096,data=32768`, or in a source\n`.machine t3 code=4096 data=32768`:\n");
    for option in &OPTIONS {
        let _ = writeln!(out, "  {}  {}, 2 to {}", option.name, option.text, option.most);
    }
    out.push_str("`add 5/1`: a result 5 cycles after its operation has issued (latency), a new operation every cycle (interval).\n");
    out
}

/// The given machines as text.
pub fn machines_as_text(machines: &[&Machine]) -> String {
    let mut out = String::new();
    for machine in machines {
        let default = if *machine == MACHINES[0] { " (default)" } else { "" };
        let _ = writeln!(out, "{}{default}: {}", machine.name, machine.text);
        for slot in machine.slots {
            let (bank, last) = (slot.bank.name, slot.bank.depth - 1);
            let units: Vec<String> = slot
                .units
                .iter()
                .map(|unit| format!("{} {}/{}", unit.name, unit.latency, unit.interval))
                .collect();
            let _ =
                writeln!(out, "  slot {:<4} writes {bank}0..{bank}{last}; {}", slot.name, units.join(", "));
        }
        let _ = writeln!(
            out,
            "  inputs {0}0..{0}{1}; {2} outputs at the end of each bank; return stack {3}, loops nested {4} deep",
            machine.inputs.name,
            machine.inputs.depth - 2,
            machine.outputs_per_bank,
            machine.stack_depth,
            machine.loop_depth
        );
        let _ = writeln!(out, "  {}", memories_text(machine));
        let _ = writeln!(
            out,
            "  {} cycles without issue after a branch taken (refill), {} after one not taken (resolve)",
            machine.refill, machine.resolve
        );
    }
    out
}

/// The manual as Markdown, for `docs/isa.md`.
pub fn markdown() -> String {
    let manual = manual();
    let mut out = String::from(
        "# Takt's instruction set\n\n\
         <!-- Generated from the specification (`isa/src/spec/`) by `cargo xtask docs`; do not edit. -->\n\n",
    );
    let _ = writeln!(
        out,
        "A word has {WORD_BITS} bits; a bundle holds one word for each slot of the machine. Arithmetic is IEEE 754 binary32,\n\
         rounded to nearest even, subnormals included, with one canonical NaN (0x7fc00000). There are three sticky exception flags:\n\
         invalid, divide by zero and overflow. Underflow and inexact are deliberately left out.\n"
    );

    out.push_str("## Instructions\n\n| instruction | meaning | opcode | types |");
    for machine in manual.machines {
        let _ = write!(out, " {} |", machine.name);
    }
    out.push_str("\n|---|---|---|---|");
    out.push_str(&"---|".repeat(manual.machines.len()));
    out.push('\n');
    for entry in &manual.instructions {
        let types: Vec<&str> = entry.types.iter().map(|ty| type_name(*ty)).collect();
        let _ = write!(
            out,
            "| [`{}`](#{}) | {} | `0x{:02x}` | {} |",
            entry.assembly(),
            entry.mnemonic,
            entry.summary.replace('|', "\\|"),
            entry.opcode,
            types.join(" ")
        );
        for machine in manual.machines {
            let _ = write!(out, " {} |", entry.cost(machine.name));
        }
        out.push('\n');
    }
    out.push_str(
        "\nTypes: of the result, if any, then of the sources. Columns of machines: slot, latency/interval in cycles; an\n\
         operation that issues in cycle `c` delivers to operations that issue in cycle `c + latency` or later (docs/timing.md).\n\n",
    );

    out.push_str("## Words\n\n| operands | bits |\n|---|---|\n");
    for shape in Shape::ALL {
        let mut fields = vec![format!("opcode [{}:{}]", WORD_BITS - 1, OPCODE.low)];
        fields.extend(shape.fields().iter().map(|field| field_text(*field)));
        let syntax = if shape.syntax().is_empty() { "(none)" } else { shape.syntax() };
        let _ = writeln!(out, "| `{syntax}` | {} |", fields.join(", "));
    }
    out.push_str(
        "\nAll other bits are zero; a word in which they are not, or whose opcode is in no row, is illegal. `d` is an index into the bank of the slot\n\
         that holds the word; `a`, `b`, `c` are addresses in the register space.\n\n",
    );

    out.push_str("## Machines\n\n```text\n");
    out.push_str(&machines_text());
    out.push_str("```\n\n## Units\n\n| unit | executes | latency | interval | pipeline registers after the operands | RTL module | |\n|---|---|---|---|---|---|---|\n");
    for unit in manual.units {
        let functions: Vec<String> =
            unit.functions.iter().map(|function| format!("{function:?}").to_lowercase()).collect();
        let latency = if unit.latency == 0 { "-".to_owned() } else { unit.latency.to_string() };
        let _ = writeln!(
            out,
            "| {} | {} | {latency} | {} | {} | `{}` | {} |",
            unit.name,
            functions.join(", "),
            unit.interval,
            unit.cuts.join("; "),
            unit.rtl,
            unit.text
        );
    }

    out.push_str("\n## Entries\n");
    for entry in &manual.instructions {
        let _ = writeln!(out, "\n### {}\n\n```text\n{}```", entry.mnemonic, entry_text(entry));
    }
    out
}

/// A capacity: its name, and a function that formats the amount on a machine.
type Capacity = (&'static str, fn(&Machine) -> String);

/// The capacities of the machines as Markdown, for `docs/what-fits.md`. Memories are counted in blocks of a device; `devices` states the
/// blocks of each device.
pub fn capacities(block: &BlockRam, devices: &str) -> String {
    let mut out = String::from(
        "# What fits\n\n\
         <!-- Generated from the table of machines (`isa/src/spec/machines.rs`) by `cargo xtask docs`; do not edit. -->\n\n\
         The capacities of each machine. A program that needs more of one is refused, with the number that it needs; `takt asm FILE`\n\
         prints what a program takes, `--symbols -` where everything lies.\n\n|",
    );
    let machines = manual().machines;
    let rows: [Capacity; 8] = [
        ("operations a cycle (slots)", |machine| machine.slots.len().to_string()),
        ("bundles of program memory; up to 65,536 by `code=`", |machine| machine.code_depth.to_string()),
        ("words of data memory; up to 65,536 by `data=`", |machine| machine.data_depth.to_string()),
        ("registers, of which each slot writes its own bank", |machine| {
            let banks: Vec<String> = machine
                .slots
                .iter()
                .map(|slot| format!("{} in {}", slot.bank.depth, slot.bank.name))
                .collect();
            banks.join(", ")
        }),
        ("output ports, the last registers of each bank", |machine| machine.outputs_per_bank.to_string()),
        ("input ports", |machine| (machine.inputs.depth - 1).to_string()),
        ("subroutine calls inside one another", |machine| machine.stack_depth.to_string()),
        ("counted loops inside one another", |machine| machine.loop_depth.to_string()),
    ];
    for machine in machines {
        let _ = write!(out, " | {}", machine.name);
    }
    out.push_str(" |\n|---|");
    out.push_str(&"---|".repeat(machines.len()));
    out.push('\n');
    for (what, of) in rows {
        let _ = write!(out, "| {what}");
        for machine in machines {
            let _ = write!(out, " | {}", of(machine));
        }
        out.push_str(" |\n");
    }
    let kbit = block.bits() / 1024;
    let _ = write!(
        out,
        "\n## Larger memories\n\n\
         The first line of a program, `.machine t3 code=4096 data=32768`, or `-m t3,code=4096,data=32768` on the command line sets the\n\
         depths of its memories ([language.md](language.md#the-machine)). They take so many block RAMs of {kbit} kbit\n\
         ({devices}), beside those of registers and units ([synthesis.md](synthesis.md)):\n\n\
         | bundles or words | data |",
    );
    for machine in machines {
        let _ = write!(out, " code of {} |", machine.name);
    }
    out.push_str("\n|---|---|");
    out.push_str(&"---|".repeat(machines.len()));
    for depth in (10..=16).map(|bits| 1_u32 << bits) {
        let of = |machine: &Machine| Machine { code_depth: depth, data_depth: depth, ..*machine };
        let _ = write!(out, "\n| {depth} | {} |", of(machines[0]).data_block_rams(block));
        for machine in machines {
            let _ = write!(out, " {} |", of(machine).code_block_rams(block));
        }
    }
    out.push('\n');
    out.push_str(
        "\n## What shares what\n\n\
         - **Constants take registers**: each literal that an operation reads has one, in a bank that is free at that place; equal\n  \
         literals share it. A preset takes none beyond its register.\n\
         - **Output ports take registers** of the bank of the slot that computes them, from the end. A port is written by one slot.\n\
         - **Elements of arrays** that `.reg` declares are registers like others: each lies in the bank of the slot that writes it.\n\
         - **Values that no register is left for** are kept in data memory, if equations compute them; `takt asm` lists them, with the\n  \
         cycles that they cost.\n\
         - **Subroutines share the program memory**; a macro or a repetition takes its bundles at every use. A counted loop (`.for`) takes\n  \
         its bundles once, and those with which `.schedule on` begins and ends its overlapping iterations ([scheduling.md](scheduling.md)).\n\
         - **A system of several cores** gives each core all of this ([system.md](system.md)).\n\n\
         ## In numbers\n\n\
         Straight-line code of a few hundred operations fits every machine: the hybrid robot's controller has 290\n\
         operations, a six-axis arm's inverse dynamics 244 ([models.md](models.md)). Arrays belong in data memory and counted loops: a Kalman\n\
         filter of 12 states, model-predictive control and a neural network of 24,064 weights take little more than a cycle for each\n\
         multiply-add on t3 ([library.md](library.md)). A matrix of 12 by 12 takes 144 registers or data words. Memory beyond a machine's own\n\
         is an option: `.machine t3 data=32768`.\n",
    );
    out
}

fn field_text(field: Field) -> String {
    let bits = field.bits();
    format!("{} [{}:{}]", field.name(), bits.low + bits.width - 1, bits.low)
}

const fn type_name(ty: Type) -> &'static str {
    match ty {
        Type::F => "float",
        Type::I => "integer",
        Type::B => "bits",
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Wishbone slave around a core, as a peripheral: an example of integration that is simulated like the core.

use crate::export::{Design, RESET_CYCLES, synthesis_top};
use crate::template::fill;
use std::fmt::Write as _;
use takt_family::Resources;
use takt_isa::Machine;

/// Control or status register of the slave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Register {
    /// Address on the bus, in words.
    pub address: u16,
    /// Name, in lower case.
    pub name: &'static str,
    /// Access by the host: `r`, `w` or `rw`.
    pub access: &'static str,
    /// Purpose of the register, for documentation.
    pub text: &'static str,
    /// Bit fields from bit 0 on; empty if the register is a single value.
    pub fields: &'static [Field],
}

/// Bit field of a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// Field name; in `status`, the slave's signal of the same name.
    pub name: &'static str,
    /// Index of the lowest bit.
    pub low: u32,
    /// Width of the field, in bits.
    pub width: u32,
    /// Meaning of the field, for documentation.
    pub text: &'static str,
}

const fn field(name: &'static str, low: u32, width: u32, text: &'static str) -> Field {
    Field { name, low, width, text }
}

const CONTROL: Register = Register {
    address: 0,
    name: "control",
    access: "rw",
    text: "While run is 0 the core is in reset and can be loaded; 0 after `rst_i`. A reset, however short it is asked for, lasts as long as the core needs; with RESTORE, what was loaded is written again in it.",
    fields: &[field("run", 0, 1, "The program runs.")],
};
const STATUS: Register = Register {
    address: 1,
    name: "status",
    access: "r",
    text: "What the program does.",
    fields: &[
        field("waiting", 0, 1, "It waits for the tick: the outputs of the period stand."),
        field("deadline_missed", 1, 1, "A tick came before its `wait`, since reset."),
        field("halted", 2, 1, "It has halted."),
        field("fault", 3, 1, "It has stopped with a fault, which the other fields describe."),
        field(
            "fault_kind",
            4,
            3,
            "1 illegal word, 2 data address, 3 return stack full, 4 return stack empty, 5 loops too deep, 6 loop count, 7 loop nesting.",
        ),
        field("fault_slot", 7, 3, "The slot of the fault."),
        field(
            "flags",
            10,
            3,
            "The sticky flags: invalid, divide by zero, overflow, the last in the lowest bit.",
        ),
        field("differs", 13, 1, "With a second core: the cores have differed, since reset."),
        field(
            "upset",
            14,
            1,
            "With error correction: a word of a memory was wrong and could not be corrected, since reset.",
        ),
        field("corrected", 15, 1, "With error correction: a word of a memory was corrected, since reset."),
        field("fault_address", 16, 16, "The bundle of the fault."),
    ],
};
const PERIOD: Register = Register {
    address: 2,
    name: "period",
    access: "rw",
    text: "Clock cycles from tick to tick, once the program has first waited; 0: ticks come from register 3 only.",
    fields: &[],
};
const TICK: Register =
    Register { address: 3, name: "tick", access: "w", text: "Any write is a tick.", fields: &[] };
const LOAD_PLACE: Register = Register {
    address: 4,
    name: "load_place",
    access: "w",
    text: "Where the loader writes.",
    fields: &[
        field("address", 0, 16, "Bundle, data word or register."),
        field("space", 16, 2, "0 program memory, 1 data memory, 2 registers."),
        field("slot", 18, 3, "In program memory, the word of the bundle."),
    ],
};
const LOAD_HIGH: Register = Register {
    address: 5,
    name: "load_high",
    access: "w",
    text: "Bits 47:32 of the words loaded from now on.",
    fields: &[],
};
const LOAD_LOW: Register = Register {
    address: 6,
    name: "load_low",
    access: "w",
    text: "Bits 31:0 of a word: loads it at `load_place`, which then moves on by one address. Acknowledged when the core's reset has lasted long enough.",
    fields: &[],
};

/// Registers of the slave, by address. The wrapper, its test and the headers of programs are generated from this table.
pub const REGISTERS: &[Register] = &[CONTROL, STATUS, PERIOD, TICK, LOAD_PLACE, LOAD_HIGH, LOAD_LOW];

/// Word address of input port 0.
pub const INPUTS: u16 = 0x1000;
/// Word address of output port 0.
pub const OUTPUTS: u16 = 0x2000;

/// Module name of the slave.
pub fn name(design: &Design) -> String {
    format!("{}_wishbone", design.top)
}

/// Concatenation for the status register: the fields, with zeros between them.
fn status() -> String {
    let (mut parts, mut next) = (Vec::new(), 0);
    for field in STATUS.fields {
        if field.low > next {
            parts.push(format!("{}'d0", field.low - next));
        }
        parts.push(field.name.to_owned());
        next = field.low + field.width;
    }
    parts.reverse();
    format!("{{{}}}", parts.join(", "))
}

/// Open connections for the core's outputs that report each write of an output port: a slave that reads the ports does not need them.
pub fn open_streams(machine: &Machine) -> String {
    let streams = machine.slots.iter().map(|slot| {
        let b = slot.bank.name;
        format!(".output_{b}_write(), .output_{b}_index(), .output_{b}_value(),")
    });
    streams.collect::<Vec<_>>().join(" ")
}

/// Generates the slave. `latched` is the default of its parameter for latched ports
/// ([`Program::latched_inputs`](takt_isa::Program::latched_inputs)).
pub fn wrapper(design: &Design, latched: u16) -> String {
    let machine = design.machine;
    let name = name(design);
    let port_bits = machine.outputs_per_bank.trailing_zeros();
    let input_bits = machine.inputs.depth.trailing_zeros();
    let data_bits = machine.data_depth.trailing_zeros();
    let register_bits = takt_isa::Register::COUNT.trailing_zeros();
    let inputs_page = format!("{}'d{}", register_bits - input_bits, machine.inputs.base >> input_bits);
    // Words that RESTORE keeps: data, then registers.
    let half = data_bits.max(register_bits);
    let words = (1 << half) + (1 << register_bits);
    let streams = open_streams(machine);
    let mut table = String::new();
    for Register { address, name, access, text, fields } in REGISTERS {
        let _ = writeln!(table, "//   {address:04x} {access:<2} {name}: {text}");
        for Field { name, low, width, text } in *fields {
            let bits = if *width == 1 { low.to_string() } else { format!("{}:{low}", low + width - 1) };
            let _ = writeln!(table, "//             {bits} {name}: {text}");
        }
    }
    let [control, period, tick, place, high, low] =
        [CONTROL, PERIOD, TICK, LOAD_PLACE, LOAD_HIGH, LOAD_LOW].map(|register| register.address);
    fill(
        include_str!("templates/wishbone.v.in"),
        &[
            ("NAME", &name),
            ("TABLE", &table),
            ("INPUTS", &format!("{INPUTS:04x}")),
            ("OUTPUTS", &format!("{OUTPUTS:04x}")),
            ("WORDS", &words),
            ("LATCHED", &latched),
            ("RESET_CYCLES", &RESET_CYCLES),
            ("INPUT_HIGH", &(input_bits - 1)),
            ("PORT_HIGH", &(port_bits - 1)),
            ("CONTROL", &control),
            ("STATUS", &STATUS.address),
            ("PERIOD", &period),
            ("TICK", &tick),
            ("PLACE", &place),
            ("HIGH", &high),
            ("LOW", &low),
            ("INPUT_BITS", &input_bits),
            ("INPUT_PAGE_BITS", &(16 - input_bits)),
            ("INPUT_PAGE", &(INPUTS >> input_bits)),
            ("PORT_BITS", &port_bits),
            ("OUTPUT_PAGE_BITS", &(16 - port_bits)),
            ("OUTPUT_PAGE", &(OUTPUTS >> port_bits)),
            ("STATUS_WORD", &status()),
            ("HALF_HIGH", &(half - 1)),
            ("LAST_WORD", &(words - 1)),
            ("HALF_BITS", &half),
            ("HALF_COUNT", &(half + 1)),
            ("REGISTER_BITS", &register_bits),
            ("REGISTER_REST", &(16 - register_bits)),
            ("INPUTS_AT", &padded(half, register_bits, &format!("{inputs_page}, input_index"))),
            ("DATA_AT", &padded(half, data_bits, &format!("load_address[{}:0]", data_bits - 1))),
            ("REGISTER_AT", &padded(half, register_bits, &format!("load_address[{}:0]", register_bits - 1))),
            ("HALF_TOTAL", &(half + 2)),
            ("REGISTER_HIGH", &(register_bits - 1)),
            ("INPUTS_PAGE", &inputs_page),
            ("NONE", &(3 + half + 32)),
            ("REPLAY_AT", &padded(16, half, "replay_address")),
            ("TOP", &design.top),
            ("SAFETY_NETS", &design.safety.nets("")),
            ("SAFETY", &design.safety.connections("")),
            ("STREAMS", &streams),
        ],
    )
}

/// Resources of [`on_few_pins`] besides the slave: its registers, 3 LUT4 for each parity of eight bits, and 3 for the rest.
pub const PINS: Resources =
    Resources { luts: 15, carries: None, flip_flops: 145, multipliers: 0, block_rams: 0 };

/// Connects the slave to a few pins, for a place-and-route run without a board. Registers surround it, as in a system on the same device.
/// RESTORE is left out, since its memory belongs to the system.
pub fn on_few_pins(design: &Design) -> String {
    let (name, slave) = (synthesis_top(design.machine), name(design));
    fill(include_str!("templates/few_pins.v.in"), &[("NAME", &name), ("SLAVE", &slave)])
}

/// Zero extension in Verilog: `what`, of `bits` bits, extended to `wide` bits.
fn padded(wide: u32, bits: u32, what: &str) -> String {
    if wide == bits { format!("{{{what}}}") } else { format!("{{{}'d0, {what}}}", wide - bits) }
}

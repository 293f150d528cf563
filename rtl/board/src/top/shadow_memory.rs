// SPDX-License-Identifier: MIT OR Apache-2.0
//! Shadow memories: copies of each core's registers and data memory for the host, `takt_shadow_memory.v` beside the core.

use super::scope::recorded;
use crate::application::Application;
use crate::protocol::{core_bits, core_words};
use crate::wiring::Wiring;
use std::fmt::Write as _;
use takt_isa::{Bank, Machine};

/// The ports of a core that `takt_shadow_memory` watches: the name, the bits, and whether each slot has the bits.
const WATCHED: [(&str, u32, bool); 8] = [
    ("issued", 1, false),
    ("issued_address", 16, false),
    ("stored", 1, false),
    ("stored_address", 16, false),
    ("stored_value", 32, false),
    ("retire", 1, true),
    ("retire_register", 10, true),
    ("retire_value", 32, true),
];

/// Cycles from the last issue, besides the longest latency, until the copies have every result: results pass two registers on the way.
pub(super) const COPIED: u32 = 6;
/// Bits of an address at `takt_shadow_memory`: no core has more addresses of data words.
const ADDRESS: u32 = 14;

/// The number of a core's data words that have addresses, and therefore copies.
pub(super) fn copied_words(machine: &Machine, cores: usize) -> u32 {
    machine.data_depth.min(core_words(cores).into())
}

/// The shadow memory of a core.
pub(super) struct Shadow {
    core: usize,
    cores: usize,
    machine: &'static Machine,
    /// The address that the host asks for, without the number of the core.
    at: String,
    /// The board has copies.
    observe: bool,
    /// The scope watches this core.
    is_recorded: bool,
}

impl Shadow {
    /// The shadow memory of core `core`, as the wiring has it.
    pub(super) fn of(application: &Application<'_>, core: usize, wiring: &Wiring) -> Shadow {
        let cores = &application.description().cores;
        let bits = 14 - core_bits(cores.len());
        let at = match ADDRESS.saturating_sub(bits) {
            0 => format!("address[{}:0]", ADDRESS - 1),
            above => format!("{{{above}'d0, address[{}:0]}}", bits - 1),
        };
        let is_recorded = recorded(wiring, application) == Some(core);
        let machine = cores[core].program.machine;
        Shadow { core, cores: cores.len(), machine, at, observe: wiring.observe, is_recorded }
    }

    /// The Verilog of an instance, or of zeros in its place.
    pub(super) fn instance(&self) -> String {
        let Shadow { core, machine, at, observe, is_recorded, .. } = self;
        let mut text = format!(
            "    wire [15:0] last_issued{core};\n    wire [31:0] core_register{core}, core_data{core};\n"
        );
        let slots = machine.slots.len() as u32;
        if *observe || *is_recorded {
            for (name, bits, of_slot) in WATCHED {
                let bits = if of_slot { bits * slots } else { bits };
                let _ = writeln!(text, "    wire [{}:0] {name}{core};", bits - 1);
            }
        }
        if !observe {
            let _ = writeln!(
                text,
                "    assign {{settled[{core}], last_issued{core}, core_register{core}, core_data{core}}} = {{1'b1, 80'd0}};\n"
            );
            return text;
        }
        let of_slots = |of: &dyn Fn(&Bank) -> String| {
            let each: Vec<String> = machine.slots.iter().rev().map(|slot| of(&slot.bank)).collect();
            format!("{{{}}}", each.join(", "))
        };
        let latency = machine.slots.iter().flat_map(|slot| slot.units).map(|unit| unit.latency).max();
        let watched: Vec<String> =
            WATCHED.iter().map(|(name, ..)| format!(".{name}({name}{core})")).collect();
        let _ = writeln!(
            text,
            "    takt_shadow_memory #(.SLOTS({slots}), .BANKS({}), .INDICES({}), .DATA({}), .SETTLE({})) shadow{core} (
        .clk(clk), .load(loads[{core}]), .load_space(load_space), .load_address(load_address[9:0]), .load_value(load_value[31:0]),
        .still(core_rst | waiting[{core}] | halted[{core}] | fault[{core}]), .at({at}), .settled(settled[{core}]),
        .last(last_issued{core}), .register_value(core_register{core}), .data_value(core_data{core}),
        {}
    );
",
            of_slots(&|bank| format!("10'd{}", bank.base)),
            of_slots(&|bank| format!("4'd{}", bank.depth.trailing_zeros())),
            copied_words(machine, self.cores).trailing_zeros(),
            latency.unwrap_or(0) + COPIED,
            watched.join(", ")
        );
        text
    }

    /// The ports of the core that shadow memory and scope watch, with `prefix` before their names; the ports are left open if the board has
    /// neither.
    pub(super) fn pins(&self, prefix: &str) -> String {
        let is_watched = self.observe || self.is_recorded;
        let net = |name: &str| if is_watched { format!("{name}{}", self.core) } else { String::new() };
        WATCHED.iter().map(|(name, ..)| format!("        .{prefix}{name}({}),\n", net(name))).collect()
    }
}

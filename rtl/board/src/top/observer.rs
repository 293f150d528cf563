//! Copies of a core's registers and data memory for the host: `takt_observe.v` beside the core.

use std::fmt::Write as _;
use takt_isa::{Bank, Machine};

/// What a core shows to `takt_observe`: the name of the port, its bits, and whether each slot has so many.
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

/// Cycles from the last issue until everything is in the copies, besides the longest latency: results pass two registers on the way.
const COPIED: u32 = 6;

/// An instance of `takt_observe`, or what takes its place.
pub(super) struct Observer {
    /// What its nets' names end with: the core's number, or nothing.
    core: String,
    /// The expression that says that the core is being loaded.
    load: String,
    /// The expression that says that the core issues nothing.
    still: String,
    /// The net that says that everything is in the copies.
    settled: String,
    /// The address that the host reads; of a system's core without the core's number, which is above.
    at: &'static str,
}

impl Observer {
    /// That of a single program's core.
    pub(super) fn of_program() -> Observer {
        let [load, still, settled] =
            ["load", "core_rst | waiting | halted | fault", "settled"].map(str::to_owned);
        Observer { core: String::new(), load, still, settled, at: "address[11:0]" }
    }

    /// That of a system's core.
    pub(super) fn of_core(core: usize) -> Observer {
        let of = |net: &str| format!("{net}[{core}]");
        let still = format!("core_rst | {} | {} | {}", of("waiting"), of("halted"), of("fault"));
        Observer {
            core: core.to_string(),
            load: of("loads"),
            still,
            settled: of("settled"),
            at: "{2'd0, address[9:0]}",
        }
    }

    /// The copies of a core's registers and data; zeros if there are none.
    pub(super) fn instance(&self, machine: &Machine, observe: bool) -> String {
        let Observer { core, load, still, settled, at } = self;
        let mut text = String::new();
        if !observe {
            let _ = writeln!(
                text,
                "    assign {{{settled}, last_issued{core}, core_register{core}, core_data{core}}} = {{1'b1, 80'd0}};\n"
            );
            return text;
        }
        let slots = machine.slots.len() as u32;
        for (name, bits, of_slot) in WATCHED {
            let bits = if of_slot { bits * slots } else { bits };
            let _ = writeln!(text, "    wire [{}:0] {name}{core};", bits - 1);
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
            "    takt_observe #(.SLOTS({slots}), .BANKS({}), .INDICES({}), .DATA({}), .SETTLE({})) observe{core} (
        .clk(clk), .load({load}), .load_space(load_space), .load_address(load_address[9:0]), .load_value(load_value[31:0]),
        .still({still}), .at({at}), .settled({settled}), .last(last_issued{core}),
        .register_value(core_register{core}), .data_value(core_data{core}),
        {}
    );
",
            of_slots(&|bank| format!("10'd{}", bank.base)),
            of_slots(&|bank| format!("4'd{}", bank.depth.trailing_zeros())),
            machine.data_depth.trailing_zeros(),
            latency.unwrap_or(0) + COPIED,
            watched.join(", ")
        );
        text
    }

    /// The ports of a core that it looks at, with `prefix` before their names; left open if there are no copies.
    pub(super) fn pins(&self, prefix: &str, observe: bool) -> String {
        let net = |name: &str| if observe { format!("{name}{}", self.core) } else { String::new() };
        WATCHED.iter().map(|(name, ..)| format!("        .{prefix}{name}({}),\n", net(name))).collect()
    }
}

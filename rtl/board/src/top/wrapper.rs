// SPDX-License-Identifier: MIT OR Apache-2.0
//! The module around the cores: a single template for any number of cores, with the section that connects their ports.

use super::design::Design;
use super::image::Contents;
use super::peripherals::{PeripheralConnections, carriers, direction, own_pins, trip_net};
use super::scope::{self, ScopeSize};
use super::shadow_memory::Shadow;
use super::template::{Values, fill};
use super::{links, ports};
use crate::application::Application;
use crate::flash::{entries_room, half_bit};
use crate::protocol::{self, CORE, core_bits};
use crate::wiring::Wiring;
use std::fmt::Write as _;
use takt_isa::Machine;
use takt_rtl::Library;
use takt_system::{Link, MAX_CORES};

/// Port for the clock of a configuration flash.
const FLASH_CLOCK: &str = ",\n    output wire flash_clock";
/// Name of the module around cores and peripherals.
pub const AROUND: &str = "takt_peripherals";
/// Minimum cycles of reset after the last record: longer than anything is under way in a core or on a link.
const SETTLE: u64 = 128;

/// The module around the cores of a design.
pub(super) fn wrapper(
    wiring: &Wiring,
    application: &Application<'_>,
    design: &Design,
    (contents, scope): (&Contents, Option<ScopeSize>),
    library: &Library,
) -> String {
    let connected = PeripheralConnections::new(application, wiring);
    let mut all = host(wiring);
    all.extend(match &design.plan {
        None => ports::section(&connected, &design.top, wiring, library),
        Some(plan) => links::section(plan, &connected, wiring, &ports::to_integer(library)),
    });
    all.extend(connected.instances(wiring));
    all.extend(carriers(wiring));
    all.extend(pins(wiring));
    all.extend(flash(wiring, contents, design.number));
    all.extend(cores(wiring, application));
    all.extend(memories(application, contents));
    all.extend(scope::section(scope, wiring, application));
    all.push(("CIRCUIT", format!("{:08x}", design.number)));
    let text = fill(include_str!("board.v.in"), &all);
    // The sections have addresses of registers, too.
    protocol::REGISTERS.iter().fold(text, |text, register| {
        text.replace(&format!("@A_{}@", register.name.to_uppercase()), &register.address.to_string())
    })
}

/// The host's UART with its bridge to the registers; without a UART, nets at rest, from which synthesis removes the registers.
fn host(wiring: &Wiring) -> Values {
    let (bridge, pins, unused) = if wiring.uart {
        let pins = ",\n    input  wire uart_receive,\n    output wire uart_send";
        (include_str!("host.v.in"), pins, "")
    } else {
        (include_str!("alone.v.in"), "", ", bus_read, writable, grant, stream_due")
    };
    // Without a host, nobody changes period and lead.
    let tick_bits =
        if wiring.uart { 32 } else { u32::BITS - wiring.period.max(wiring.lead + 2).leading_zeros() };
    vec![
        ("TICK_BITS", tick_bits.to_string()),
        ("HOST", bridge.to_owned()),
        ("UART", pins.to_owned()),
        ("UNUSED", unused.to_owned()),
        ("DIVIDE", (wiring.clock * 1e6 / f64::from(wiring.baud)).round().to_string()),
    ]
}

/// The values for the flash: it has the bus before the host, from a reset until it has chosen what starts.
fn flash(wiring: &Wiring, contents: &Contents, circuit: u32) -> Values {
    let Some(flash) = &wiring.flash else {
        let mut nothing: Values = vec![("QUIET", "rst".to_owned())];
        nothing.extend(["ASKED", "FLASH_WRITABLE", "FLASH_VALUE", "FLASH"].map(|name| (name, String::new())));
        return nothing;
    };
    let [first, second] = flash.slots;
    let (block, room) = (protocol::FLASH >> 5, entries_room(contents.room));
    let start = if wiring.autostart { protocol::RUN | protocol::ENABLE } else { 0 };
    vec![
        ("QUIET", "rst | flash_plays".to_owned()),
        ("ASKED", "asked_".to_owned()),
        (
            "FLASH_WRITABLE",
            format!(
                "            16'd@A_FLASH@: writable <= ~flash_busy;\n            {}: writable <= ~flash_busy;\n",
                (0..protocol::WORDS as u16)
                    .map(|i| format!("16'd{}", protocol::FLASH + i))
                    .collect::<Vec<_>>()
                    .join(", ")
            ),
        ),
        ("FLASH_VALUE", format!("address[15:5] == 11'd{block} ? flash_value : ")),
        (
            "FLASH",
            format!(
                "    wire        flash_plays, flash_write, flash_busy, asked_bus_write;
    wire [15:0] flash_address, asked_address;
    wire [31:0] flash_word, flash_value, asked_bus_value;
    assign address   = flash_plays ? flash_address : asked_address;
    assign bus_write = flash_plays ? flash_write : asked_bus_write;
    assign bus_value = flash_plays ? flash_word : asked_bus_value;
    takt_flash #(
        .HALF({}), .CIRCUIT(32'h{circuit:08x}), .ROOM({room}), .FIRST(24'h{first:06x}), .SECOND(24'h{second:06x}),
        .CONTROL(16'd@A_CONTROL@), .DEFAULT({start})
    ) flash (
        .clk(clk), .rst(rst), .pin_select(flash_select), .pin_clock(flash_clock), .pin_out(flash_out), .pin_in(flash_in),
        .ready(~boot_reset), .plays(flash_plays), .play_write(flash_write), .play_address(flash_address), .play_value(flash_word),
        .write(asked_bus_write & asked_address[15:5] == 11'd{block}), .address(asked_address[4:0]), .value(asked_bus_value),
        .read(flash_value), .busy(flash_busy)
    );
",
                half_bit(wiring.clock)
            ),
        ),
    ]
}

/// The values for pins, parameters of the wiring, and addresses of the protocol.
fn pins(wiring: &Wiring) -> Values {
    let pins: String = own_pins(wiring)
        .iter()
        .map(|pin| format!(",\n    {} {}", direction(pin.direction), pin.name))
        .chain(wiring.flash.iter().filter(|flash| flash.is_configuration()).map(|_| FLASH_CLOCK.to_owned()))
        .collect();
    let mut signals = String::new();
    for (name, value) in
        [("drive", "drive"), ("fault", "|fault"), ("deadline", "|{@ALL_MISSES@}"), ("tick", "ticks")]
    {
        if wiring.signal(name).is_some() {
            let _ = writeln!(signals, "    assign signal_{name} = {value};");
        }
    }
    if wiring.signal("watchdog").is_some() {
        signals += "    takt_watchdog #(.CORES(@CORES@)) watchdog (.clk(clk), .rst(rst), .drive(drive), .done(puts), .pin(signal_watchdog));\n";
    }
    let stop = match wiring.signal("stop") {
        Some(_) => {
            "    takt_filter #(.HOLD(16), .BITS(8)) filter_stop (.clk(clk), .rst(rst), .pin(signal_stop), .level(stop));"
        }
        None => "    assign stop = 1'b0;",
    };
    vec![
        ("NAME", AROUND.to_owned()),
        ("PINS", pins),
        // With a flash, `takt_flash` starts the program.
        ("START", u8::from(wiring.autostart && wiring.flash.is_none()).to_string()),
        ("PERIOD", wiring.period.to_string()),
        ("LEAD", wiring.lead.to_string()),
        ("INPUTS_AT", (protocol::INPUTS >> 12).to_string()),
        ("OUTPUTS_AT", (protocol::OUTPUTS >> 12).to_string()),
        ("LINKS_AT", (protocol::DRIVEN >> 12).to_string()),
        ("IMAGE_AT", (protocol::IMAGE >> 14).to_string()),
        ("REGISTERS_AT", (protocol::CORE_REGISTERS >> 14).to_string()),
        ("DATA_AT", (protocol::CORE_DATA >> 14).to_string()),
        // Ticks on a carrier's places would leave them with another period.
        ("TIMES", if wiring.tick.is_some() { "" } else { " 16'd@A_PERIOD@, 16'd@A_LEAD@," }.to_owned()),
        (
            "TRIPS",
            trips(wiring).map_or_else(String::new, |trips| {
                format!("            16'd@A_TRIPS@: register_value <= {trips};\n")
            }),
        ),
        ("OBSERVED", u8::from(wiring.observe).to_string()),
        ("STOP", stop.to_owned()),
        ("SIGNALS", signals),
    ]
}

/// The trips as a vector, the wiring's first in bit 0; `None` without any.
pub(super) fn trips(wiring: &Wiring) -> Option<String> {
    let nets: Vec<String> = wiring.trips().rev().map(|trip| trip_net(&trip.name)).collect();
    (!nets.is_empty()).then(|| format!("{{{}}}", nets.join(", ")))
}

/// The values for the memories: the image's room, and the sizes of the largest core.
fn memories(application: &Application<'_>, contents: &Contents) -> Values {
    let description = application.description();
    let most = |of: fn(&Machine) -> u32| {
        description.cores.iter().map(|core| of(core.program.machine)).max().unwrap_or(1)
    };
    let transit = description.links.iter().map(Link::transit).max().unwrap_or(0);
    vec![
        ("RECORDS", contents.records.len().to_string()),
        ("ROOM", contents.room.to_string()),
        ("IMAGE_BITS", contents.bits().to_string()),
        ("IMAGE_LAST", (contents.bits() - 1).to_string()),
        ("SLOTS", most(|machine| machine.slots.len() as u32).to_string()),
        ("CODE", most(|machine| machine.code_depth.trailing_zeros()).to_string()),
        ("DATA", most(|machine| machine.data_depth.trailing_zeros()).to_string()),
        ("IN_BITS", most(|machine| machine.inputs.depth.trailing_zeros()).to_string()),
        ("SETTLE", (transit + 8).max(SETTLE).to_string()),
    ]
}

/// The values for the cores: each core's status, interlock and copies for the host, and the choice among the cores by an address.
fn cores(wiring: &Wiring, application: &Application<'_>) -> Values {
    let known = &application.description().cores;
    let (cores, bits) = (known.len(), core_bits(known.len()));
    let (mut parts, mut reads, mut picked) = (String::new(), String::new(), String::new());
    // With several cores, a register keeps the choice off the path.
    let (at, picks) = if cores == 1 { ("*", "=") } else { ("(posedge clk)", "<=") };
    let core_of = |net: &str| match bits {
        0 => "4'd0".to_owned(),
        _ => format!(
            "{net}[15] ? {{{}'d0, {net}[13 -: {bits}]}} : {net}[13:12] == 2'd3 ? 4'd0 : {net}[11:8]",
            4 - bits
        ),
    };
    for k in 0..cores {
        parts += &part(wiring, application, k);
        let fault = format!("{{13'd0, fault_kind[{} +: 3], fault_address[{} +: 16]}}", 3 * k, 16 * k);
        let own =
            ["status", "misses", "periods", "cycles", "most_cycles"].map(|name| (name, format!("{name}{k}")));
        let issued = ("issued", format!("{{16'd0, last_issued{k}}}"));
        for (register, value) in own.into_iter().chain([("fault", fault), issued]) {
            let at = protocol::address(register) + CORE * k as u16;
            let _ = writeln!(reads, "            16'd{at}: register_value <= {value};");
        }
        let _ = writeln!(
            picked,
            "            4'd{k}: {{seen_value, read_value, core_register, core_data}} {picks} {{seen_there{k}, read{k}, core_register{k}, core_data{k}}};"
        );
    }
    let all_misses = (0..cores).map(|core| format!("misses{core}")).collect::<Vec<_>>().join(", ");
    vec![
        (
            "TITLE",
            if application.is_program() {
                "the core".to_owned()
            } else {
                format!("a system of {cores} cores")
            },
        ),
        ("CORES", cores.to_string()),
        ("LAST_CORE", (cores - 1).to_string()),
        ("ID", format!("{:08x}", protocol::id(cores))),
        ("WHICH", core_of("address")),
        ("STREAMED", core_of("stream")),
        ("NO_CORES", format!("{:04x}", ((1_u32 << MAX_CORES) - (1 << cores)))),
        ("PICKED_AT", at.to_owned()),
        ("PICKED", picked),
        ("PICKS", picks.to_owned()),
        ("CORE_PARTS", parts),
        ("CORE_READS", reads),
        ("ALL_MISSES", all_misses),
    ]
}

/// A core's status, the copy of its input ports, its interlock and its shadow memory.
fn part(wiring: &Wiring, application: &Application<'_>, k: usize) -> String {
    let core = &application.description().cores[k];
    let last = core.program.machine.inputs.depth.trailing_zeros() - 1;
    let title = if application.is_program() { String::new() } else { format!("    // {}\n", core.name) };
    let tripped = trips(wiring).map_or_else(|| "1'b0".to_owned(), |trips| format!("|{trips}"));
    // The ports of the mechanisms, behind the core's other ones; 0 without them.
    let safety = wiring.safety.nets(&k.to_string());
    format!(
        "{title}    wire [31:0] misses{k}, periods{k}, cycles{k}, most_cycles{k}, read{k}, in_value{k};
    wire [8:0]  cause{k};
    {safety}
    wire [2:0]  flags{k};
    wire        in_write{k};
    wire [{last}:0] in_index{k};
    wire [31:0] status{k} = {{corrections{k}, 3'd0, cause{k}[8:7], {tripped}, cause{k}[5:0], drive, core_rst, flags{k}, fault_slot[{} +: 3], 1'b0, fault[{k}], halted[{k}], waiting[{k}]}};
    reg  [31:0] seen{k} [0:{}];
    reg  [31:0] seen_there{k};
    always @(posedge clk) begin
        if (in_write{k}) seen{k}[in_index{k}] <= in_value{k};
        seen_there{k} <= seen{k}[address[{last}:0]];
    end
    takt_interlock #(.DEADLINES({}), .HOST({})) interlock{k} (
        .clk(clk), .rst(core_rst), .enable(enable), .fault(fault[{k}]), .halted(halted[{k}]), .missed(late[{k}]), .done(puts[{k}]),
        .ticks(begins), .heard(heard), .stop(stop), .nan(nans[{k}]), .differs(differs{k}), .upset(upset{k}), .drive(drives[{k}]), .cause(cause{k}), .misses(misses{k})
    );
{}",
        3 * k,
        (2_u32 << last) - 1,
        wiring.deadlines,
        wiring.host,
        Shadow::of(application, k, wiring).instance()
    )
}

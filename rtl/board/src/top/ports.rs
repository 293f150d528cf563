// SPDX-License-Identifier: MIT OR Apache-2.0
//! The connections of a core without links: peripherals and host reach the ports of the core themselves.

use super::peripherals::{PeripheralConnections, net, scale};
use super::shadow_memory::Shadow;
use super::template::Values;
use crate::protocol;
use crate::wiring::Wiring;
use std::fmt::Write as _;
use takt_rtl::Library;
use takt_rtl::wishbone::open_streams;

/// The placeholders of the section, in which the core is the module `core`.
pub(super) fn section(
    connected: &PeripheralConnections<'_>,
    core: &str,
    wiring: &Wiring,
    library: &Library,
) -> Values {
    let machine = connected.application.description().cores[0].program.machine;
    let input_bits = machine.inputs.depth.trailing_zeros();
    let port_bits = machine.outputs_per_bank.trailing_zeros();
    let (mut inputs, mut writable) = (String::new(), String::new());
    for (n, (index, net)) in connected.driven.iter().enumerate() {
        let _ = writeln!(
            inputs,
            "            8'd{n}: {{in_index, in_value}} <= {{{input_bits}'d{index}, {net}}};"
        );
        // The host cannot write a port that a peripheral drives: the program reads the last value before the tick, which is the
        // peripheral's.
        let at = usize::from(protocol::INPUTS) + index;
        let _ = writeln!(writable, "            16'd{at}: writable <= 1'b0;");
    }
    let (mut outputs, mut settings, mut taken) = (String::new(), String::new(), String::new());
    let has_floats = connected.sinks[0].iter().any(|sink| sink.written.scale.is_some());
    for (n, sink) in connected.sinks[0].iter().enumerate() {
        let (float, exponent) = scale(sink.written);
        let _ = writeln!(outputs, "            8'd{n}: out_index <= {port_bits}'d{};", sink.number);
        let _ = writeln!(
            settings,
            "            8'd{n}: {{is_float, exponent}} = {{1'b{float}, 10'd{exponent}}};"
        );
        let _ = writeln!(taken, "            8'd{n}: {} <= result;", net(sink.peripheral, sink.register));
    }
    vec![
        ("CONNECTIONS", include_str!("ports.v.in").to_owned()),
        ("CORE", core.to_owned()),
        ("SAFETY", wiring.safety.connections("0")),
        ("WRITABLE", writable),
        (
            "PORT_WRITABLE",
            format!("address[15:12] == 4'd@INPUTS_AT@ & address[11:0] < 12'd{}", (1_u32 << input_bits) - 1),
        ),
        ("IN_COUNT", connected.driven.len().to_string()),
        ("IN_HIGH", (input_bits - 1).to_string()),
        ("INPUTS", inputs),
        ("OUT_COUNT", connected.sinks[0].len().to_string()),
        ("PORT_BITS", port_bits.to_string()),
        ("PORT_HIGH", (port_bits - 1).to_string()),
        ("OUTPUTS", outputs),
        (
            "TAKEN",
            if has_floats { include_str!("scaled.v.in") } else { include_str!("plain.v.in") }.to_owned(),
        ),
        ("SETTINGS", settings),
        ("SINKS", taken),
        ("FTOI", to_integer(library)),
        ("STREAMS", open_streams(machine)),
        ("WATCHED", Shadow::of(connected.application, 0, wiring).pins("")),
    ]
}

/// The converter's code for float to integer, from the converter's header.
pub(super) fn to_integer(library: &Library) -> String {
    let convert = library.text("convert.v").unwrap_or_default();
    u8::from(convert.lines().any(|line| line == "//@ op 1'b1 ftoi")).to_string()
}

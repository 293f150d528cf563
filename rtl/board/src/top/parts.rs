//! What the module around a program's core and the one around a system have in common: pins, peripherals, placeholders of their
//! templates.

use super::{AROUND, own_pins};
use crate::kind::Direction;
use crate::protocol;
use crate::wiring::{Peripheral, SIGNALS, Wiring, Write};
use std::fmt::Write as _;
use takt_rtl::Library;

/// Placeholders of a template, with what takes their place.
pub(super) type Values = Vec<(String, String)>;

/// The text with every `@NAME@` replaced by its value.
pub(super) fn fill(text: &str, values: &[(String, String)]) -> String {
    values.iter().fold(text.to_owned(), |text, (name, value)| text.replace(&format!("@{name}@"), value))
}

pub(super) fn direction(direction: Direction) -> &'static str {
    match direction {
        Direction::Input => "input  wire",
        Direction::Output => "output wire",
    }
}

/// Placeholders and their values.
pub(super) fn values<const N: usize>(values: [(&str, String); N]) -> Values {
    values.map(|(name, value)| (name.to_owned(), value)).into()
}

/// The placeholders that both templates have. `fault` and `deadline` are the expressions behind the signals of these names.
pub(super) fn common(wiring: &Wiring, [fault, deadline]: [&str; 2]) -> Values {
    let pins: String =
        own_pins(wiring).iter().map(|(name, way, _)| format!(",\n    {} {name}", direction(*way))).collect();
    let signal = |name: &str, value: &str| {
        let there = SIGNALS.iter().zip(&wiring.signals).any(|(s, pin)| s.name == name && pin.is_some());
        if there { format!("    assign signal_{name} = {value};\n") } else { String::new() }
    };
    let signals = signal("drive", "drive")
        + &signal("fault", fault)
        + &signal("deadline", deadline)
        + &signal("tick", "ticks");
    let stop = if wiring.signals[3].is_some() {
        "    takt_filter #(.HOLD(16), .BITS(8)) filter_stop (.clk(clk), .rst(rst), .pin(signal_stop), .level(stop));\n"
    } else {
        "    assign stop = 1'b0;\n"
    };
    let divide = (wiring.clock * 1e6 / f64::from(wiring.baud)).round();
    let registers = protocol::REGISTERS
        .iter()
        .map(|register| (format!("A_{}", register.name.to_uppercase()), register.address.to_string()));
    let own = values([
        ("NAME", AROUND.to_owned()),
        ("DIVIDE", divide.to_string()),
        ("PINS", pins),
        ("START", u8::from(wiring.autostart).to_string()),
        ("PERIOD", wiring.period.to_string()),
        ("LEAD", wiring.lead.to_string()),
        ("DEADLINES", wiring.deadlines.to_string()),
        ("HOST", wiring.host.to_string()),
        ("INPUTS_AT", (protocol::INPUTS >> 12).to_string()),
        ("OUTPUTS_AT", (protocol::OUTPUTS >> 12).to_string()),
        ("IMAGE_AT", (protocol::IMAGE >> 14).to_string()),
        ("REGISTERS_AT", (protocol::CORE_REGISTERS >> 14).to_string()),
        ("DATA_AT", (protocol::CORE_DATA >> 14).to_string()),
        ("OBSERVED", u8::from(wiring.observe).to_string()),
        ("STOP", stop.trim_end().to_owned()),
        ("SIGNALS", signals),
    ]);
    registers.chain(own).collect()
}

/// The converter's code for float to integer, from the converter's header.
pub(super) fn to_integer(library: &Library) -> String {
    let convert = library.text("convert.v").unwrap_or_default();
    u8::from(convert.lines().any(|line| line == "//@ op 1'b1 ftoi")).to_string()
}

/// Whether a register is written as a float, and the exponent of its scale, as `takt_scale` takes them.
pub(super) fn setting(write: &Write) -> String {
    let exponent = write.scale.unwrap_or(0).rem_euclid(1024);
    format!("{{1'b{}, 10'd{exponent}}}", u8::from(write.scale.is_some()))
}

/// The net of a register of a peripheral.
pub(super) fn net(peripheral: &Peripheral, register: &str) -> String {
    let reads = peripheral.kind.reads.iter().any(|own| own.name == register);
    format!("{}_{}_{register}", if reads { "r" } else { "w" }, peripheral.name)
}

/// A peripheral: `put` is what publishes its outputs; the registers of `connected` have nets.
pub(super) fn instance(peripheral: &Peripheral, put: &str, connected: &dyn Fn(&str) -> bool) -> String {
    let (name, kind) = (&peripheral.name, peripheral.kind);
    let parameters: Vec<String> = kind
        .parameters
        .iter()
        .zip(&peripheral.parameters)
        .map(|(parameter, value)| format!(".{}(32'd{value})", parameter.name.to_uppercase()))
        .collect();
    let list = if parameters.is_empty() { String::new() } else { format!("#({}) ", parameters.join(", ")) };
    let mut ports = vec![".clk(clk)".to_owned(), ".rst(rst)".to_owned()];
    if kind.strobes.enable {
        ports.push(".enable(drive)".to_owned());
    }
    if kind.strobes.start {
        ports.push(format!(".start({})", if peripheral.at_publish { put } else { "early | steps" }));
    }
    if !kind.reads.is_empty() {
        ports.push(".take(take)".to_owned());
    }
    if !kind.writes.is_empty() {
        ports.push(format!(".put({put})"));
    }
    for (pin, at) in kind.pins.iter().zip(&peripheral.pins) {
        ports.push(match (at, pin.direction) {
            (Some(_), _) => format!(".pin_{}({name}_{})", pin.name, pin.name),
            (None, Direction::Input) => format!(".pin_{}(1'b0)", pin.name),
            (None, Direction::Output) => format!(".pin_{}()", pin.name),
        });
    }
    for register in kind.reads {
        let net = if connected(register.name) { net(peripheral, register.name) } else { String::new() };
        ports.push(format!(".r_{}({net})", register.name));
    }
    for register in kind.writes {
        // Where nobody writes it, an SPI sends its preset, others stay at rest.
        let value = match connected(register.name) {
            true => net(peripheral, register.name),
            false => format!("32'd{}", peripheral.parameter(register.name)),
        };
        ports.push(format!(".w_{}({value})", register.name));
    }
    let mut text = String::new();
    let _ = writeln!(text, "    {} {list}u_{name} ({});", kind.module, ports.join(", "));
    text
}

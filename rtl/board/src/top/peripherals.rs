// SPDX-License-Identifier: MIT OR Apache-2.0
//! The peripherals of a wiring: their pins, their registers as nets, their instances.

use super::template::Values;
use crate::application::Application;
use crate::kind::Direction;
use crate::sinks::{Sink, sinks};
use crate::wiring::{Peripheral, SIGNALS, Wiring, Write};
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// The pins of peripherals and signals: name, direction, the board's pin.
pub(crate) fn own_pins(wiring: &Wiring) -> Vec<(String, Direction, String)> {
    let mut pins = Vec::new();
    for (signal, pin) in SIGNALS.iter().zip(&wiring.signals) {
        pins.extend(pin.clone().map(|pin| (format!("signal_{}", signal.name), signal.direction, pin)));
    }
    for peripheral in &wiring.peripherals {
        for (pin, at) in peripheral.kind.pins.iter().zip(&peripheral.pins) {
            let name = format!("{}_{}", peripheral.name, pin.name);
            pins.extend(at.clone().map(|at| (name, pin.direction, at)));
        }
    }
    pins
}

/// A port's direction in Verilog.
pub(super) fn direction(direction: Direction) -> &'static str {
    match direction {
        Direction::Input => "input  wire",
        Direction::Output => "output wire",
    }
}

/// The net of a register of a peripheral.
pub(super) fn net(peripheral: &Peripheral, register: &str) -> String {
    let reads = peripheral.kind.reads.iter().any(|own| own.name == register);
    format!("{}_{}_{register}", if reads { "r" } else { "w" }, peripheral.name)
}

/// Bit and exponent of a register's scale, as `takt_scale` takes them: 1 if it is written as a float.
pub(super) fn scale(write: &Write) -> (u8, i32) {
    (u8::from(write.scale.is_some()), write.scale.unwrap_or(0).rem_euclid(1024))
}

/// The connections between peripherals and cores, by [`Connection::number`](crate::application::Connection::number).
pub(super) struct Connected<'a> {
    pub(super) application: &'a Application<'a>,
    /// The nets of peripherals that drive inputs, by the inputs' numbers.
    pub(super) driven: BTreeMap<usize, String>,
    /// The sinks of each core.
    pub(super) sinks: Vec<Vec<Sink<'a>>>,
}

impl<'a> Connected<'a> {
    pub(super) fn new(application: &'a Application<'a>, wiring: &'a Wiring) -> Connected<'a> {
        let mut driven = BTreeMap::new();
        for peripheral in &wiring.peripherals {
            for (register, port) in peripheral.kind.reads.iter().zip(&peripheral.reads) {
                let Some(port) = port else { continue };
                if let Ok(found) = application.connect(Direction::Input, port) {
                    driven.insert(found.number, net(peripheral, register.name));
                }
            }
        }
        Connected { application, driven, sinks: sinks(application, wiring) }
    }

    /// Nets and instances of the peripherals.
    pub(super) fn instances(&self, wiring: &Wiring) -> Values {
        let (mut nets, mut instances) = (String::new(), String::new());
        for net in self.driven.values() {
            let _ = writeln!(nets, "    wire [31:0] {net};");
        }
        // The sequencer of a core without links writes registers one by one.
        let kind = if self.application.is_program() { "reg " } else { "wire" };
        for sink in self.sinks.iter().flatten() {
            let _ = writeln!(nets, "    {kind} [31:0] {};", net(sink.peripheral, sink.register));
        }
        for peripheral in &wiring.peripherals {
            instances += &self.instance(peripheral);
        }
        vec![("NETS", nets), ("PERIPHERALS", instances)]
    }

    /// A peripheral. Its outputs are published at the `wait` of the core that writes them, or of the first.
    fn instance(&self, peripheral: &Peripheral) -> String {
        let (name, kind) = (&peripheral.name, peripheral.kind);
        let is_own = |sink: &&Sink<'_>| sink.peripheral.name == *name;
        let core = self.sinks.iter().position(|sinks| sinks.iter().any(|sink| is_own(&sink))).unwrap_or(0);
        let put = format!("puts[{core}]");
        let parameters = kind.parameters.iter().zip(&peripheral.parameters);
        let parameters: Vec<String> = parameters
            .map(|(parameter, value)| format!(".{}(32'd{value})", parameter.name.to_uppercase()))
            .collect();
        let list =
            if parameters.is_empty() { String::new() } else { format!("#({}) ", parameters.join(", ")) };
        let mut ports = vec![".clk(clk)".to_owned(), ".rst(rst)".to_owned()];
        if kind.strobes.enable {
            ports.push(".enable(drive)".to_owned());
        }
        if kind.strobes.start {
            ports.push(format!(".start({})", if peripheral.at_publish { &put } else { "early | steps" }));
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
            let net = Some(net(peripheral, register.name));
            let net = net.filter(|net| self.driven.values().any(|driven| driven == net));
            ports.push(format!(".r_{}({})", register.name, net.unwrap_or_default()));
        }
        for register in kind.writes {
            let is_sink = |sink: &Sink<'_>| is_own(&sink) && sink.register == register.name;
            // An SPI whose register nobody writes sends its preset, others stay at rest.
            let value = match self.sinks.iter().flatten().any(is_sink) {
                true => net(peripheral, register.name),
                false => format!("32'd{}", peripheral.parameter(register.name)),
            };
            ports.push(format!(".w_{}({value})", register.name));
        }
        format!("    {} {list}u_{name} ({});\n", kind.module, ports.join(", "))
    }
}

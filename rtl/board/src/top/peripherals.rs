// SPDX-License-Identifier: MIT OR Apache-2.0
//! The peripherals of a wiring: their pins, their registers as nets, their instances.

use super::template::Values;
use crate::application::Application;
use crate::carrier::{Carrier, Instant};
use crate::flash::{MCLK, PINS};
use crate::kind::Direction;
use crate::latency::window_start;
use crate::sinks::{Sink, sinks};
use crate::wiring::{Peripheral, SIGNALS, Starts, Wiring, Write};
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// Pin of a peripheral or of a signal.
pub(crate) struct OwnPin {
    /// Port of the top.
    pub(crate) name: String,
    pub(crate) direction: Direction,
    /// Pin of the board.
    pub(crate) pin: String,
    /// See [`Pin::is_register`](crate::kind::Pin::is_register).
    pub(crate) is_register: bool,
    /// Level that switches off what is at the pin; `None` for pins that do not depend on `drive`.
    pub(crate) off: Option<bool>,
}

/// The pins of signals and peripherals.
pub(crate) fn own_pins(wiring: &Wiring) -> Vec<OwnPin> {
    let mut pins = Vec::new();
    for (signal, pin) in SIGNALS.iter().zip(&wiring.signals) {
        let (name, direction) = (format!("signal_{}", signal.name), signal.direction);
        let off = (signal.name == "drive").then_some(false);
        pins.extend(pin.clone().map(|pin| OwnPin { name, direction, pin, is_register: false, off }));
    }
    if let Some(flash) = &wiring.flash {
        for ((name, direction), pin) in PINS.into_iter().zip(&flash.pins).filter(|(_, pin)| *pin != MCLK) {
            let (name, is_register) = (format!("flash_{name}"), direction == Direction::Output);
            pins.push(OwnPin { name, direction, pin: pin.clone(), is_register, off: None });
        }
    }
    for peripheral in &wiring.peripherals {
        for (pin, at) in peripheral.kind.pins.iter().zip(&peripheral.pins) {
            let (name, direction) = (format!("{}_{}", peripheral.name, pin.name), pin.direction);
            let level = || pin.off.is_some_and(|parameter| peripheral.parameter(parameter) != 0);
            let off = (peripheral.kind.strobes.enable && direction == Direction::Output).then(level);
            // A pin that goes off without a clock has logic behind its register.
            let is_register = pin.is_register && !(wiring.clock_watch && off.is_some());
            pins.extend(at.clone().map(|pin| OwnPin { name, direction, pin, is_register, off }));
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

/// The net by which a direct trip takes switches off.
fn off_net(name: &str) -> String {
    format!("off_{name}")
}

/// The net of a trip.
pub(super) fn trip_net(name: &str) -> String {
    format!("trip_{name}")
}

/// The nets of a carrier: its place, and its half.
fn carrier_nets(carrier: &Carrier) -> [String; 2] {
    ["place", "back"].map(|net| format!("carrier_{}_{net}", carrier.name))
}

/// An expression that is 1 in the cycle of an instant.
fn at(wiring: &Wiring, instant: Instant) -> String {
    let carrier = &wiring.carriers[instant.carrier];
    let [place, back] = carrier_nets(carrier);
    let (at, behind) = (instant.at % carrier.half, instant.at >= carrier.half);
    format!("{place} == 16'd{at} & {}{back}", if behind { "" } else { "~" })
}

/// Carriers, and the signal that lets ticks begin; if no carrier gives the ticks, they may begin at any time.
pub(super) fn carriers(wiring: &Wiring) -> Values {
    let mut text = String::new();
    for carrier in &wiring.carriers {
        let [place, back] = carrier_nets(carrier);
        let _ = writeln!(
            text,
            "    wire [15:0] {place};\n    wire        {back};\n    takt_carrier #(.HALF({}), .START({})) carrier_{} (.clk(clk), .rst(rst), .place({place}), .back({back}));",
            carrier.half,
            carrier.start(),
            carrier.name
        );
    }
    let wanted = "ready & ~hold";
    let Some((instant, in_both)) = wiring.aligned() else {
        return vec![("CARRIERS", text), ("RUN", wanted.to_owned())];
    };
    let carrier = &wiring.carriers[instant.carrier];
    let place = match in_both {
        true => format!("{} == 16'd{}", carrier_nets(carrier)[0], instant.at % carrier.half),
        false => at(wiring, instant),
    };
    let _ = writeln!(
        text,
        "    wire        ticks_run;\n    takt_align align (.clk(clk), .rst(rst), .wanted({wanted}), .place({place}), .run(ticks_run));"
    );
    vec![("CARRIERS", text), ("RUN", "ticks_run".to_owned())]
}

/// Bit and exponent of a register's scale, as `takt_scale` takes them: the bit is 1 if the port is a float.
pub(super) fn scale(write: &Write) -> (u8, i32) {
    (u8::from(write.scale.is_some()), write.scale.unwrap_or(0).rem_euclid(1024))
}

/// The connections between peripherals and cores, by [`Connection::number`](crate::application::Connection::number).
pub(super) struct PeripheralConnections<'a> {
    pub(super) application: &'a Application<'a>,
    /// The nets of the peripherals that drive inputs, by the inputs' numbers.
    pub(super) driven: BTreeMap<usize, String>,
    /// The sinks of each core.
    pub(super) sinks: Vec<Vec<Sink<'a>>>,
}

impl<'a> PeripheralConnections<'a> {
    pub(super) fn new(application: &'a Application<'a>, wiring: &'a Wiring) -> PeripheralConnections<'a> {
        let mut driven = BTreeMap::new();
        for peripheral in &wiring.peripherals {
            for (register, port) in peripheral.kind.reads.iter().zip(&peripheral.reads) {
                let Some(port) = port else { continue };
                if let Ok(found) = application.connect(Direction::Input, port) {
                    driven.insert(found.number, net(peripheral, register.name));
                }
            }
        }
        PeripheralConnections { application, driven, sinks: sinks(application, wiring) }
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
        for trip in wiring.peripherals.iter().filter(|peripheral| peripheral.kind.strobes.trips) {
            let _ = writeln!(nets, "    wire {};", trip_net(&trip.name));
            if trip.is_direct() {
                let _ = writeln!(nets, "    wire {};", off_net(&trip.name));
            }
        }
        for peripheral in &wiring.peripherals {
            instances += &self.instance(wiring, peripheral);
        }
        vec![("NETS", nets), ("PERIPHERALS", instances)]
    }

    /// The instance of a peripheral, whose outputs are published at the `wait` of the core that writes them, or of core 0 if no core does.
    fn instance(&self, wiring: &Wiring, peripheral: &Peripheral) -> String {
        let (name, kind) = (&peripheral.name, peripheral.kind);
        let is_own = |sink: &&Sink<'_>| sink.peripheral.name == *name;
        let core = self.sinks.iter().position(|sinks| sinks.iter().any(|sink| is_own(&sink))).unwrap_or(0);
        let put = format!("puts[{core}]");
        let parameters = kind.parameters.iter().zip(&peripheral.parameters);
        let mut parameters: Vec<String> = parameters
            .map(|(parameter, value)| format!(".{}(32'd{value})", parameter.name.to_uppercase()))
            .collect();
        let carrier = peripheral.carrier.map(|carrier| &wiring.carriers[carrier]);
        parameters.extend(carrier.map(|carrier| format!(".HALF(32'd{})", carrier.half)));
        let list =
            if parameters.is_empty() { String::new() } else { format!("#({}) ", parameters.join(", ")) };
        let mut ports = vec![".clk(clk)".to_owned(), ".rst(rst)".to_owned()];
        let trips: Vec<String> = peripheral.trips.iter().map(|name| trip_net(name)).collect();
        if kind.strobes.enable {
            let trips = if kind.strobes.trip { &[] } else { &trips[..] };
            let trips: String = trips.iter().map(|trip| format!(" & ~{trip}")).collect();
            ports.push(format!(".enable(drive{trips})"));
        }
        if kind.strobes.trip {
            let any = |nets: &[String]| if nets.is_empty() { "1'b0".to_owned() } else { nets.join(" | ") };
            let direct =
                wiring.trips().filter(|trip| trip.is_direct() && peripheral.trips.contains(&trip.name));
            let direct: Vec<String> = direct.map(|trip| off_net(&trip.name)).collect();
            ports.push(format!(".trip({}), .off({})", any(&trips), any(&direct)));
        }
        if kind.strobes.trips {
            ports.push(format!(".clear(core_rst), .trip({})", trip_net(name)));
        }
        if kind.strobes.direct {
            let net = if peripheral.is_direct() { off_net(name) } else { String::new() };
            ports.push(format!(".off({net})"));
        }
        if kind.strobes.start {
            let start = match peripheral.starts {
                Starts::Lead => "early | steps".to_owned(),
                Starts::Publish => put.clone(),
                Starts::At(centre) if kind.strobes.window => {
                    at(wiring, window_start(wiring, peripheral, centre))
                }
                Starts::At(instant) => at(wiring, instant),
                Starts::Never => "1'b0".to_owned(),
            };
            ports.push(format!(".start({start})"));
        }
        if let Some(carrier) = carrier {
            let [place, back] = carrier_nets(carrier);
            ports.push(format!(".place({place}), .back({back})"));
        }
        if !kind.reads.is_empty() {
            let take = peripheral.latch.map_or_else(|| "take".to_owned(), |instant| at(wiring, instant));
            ports.push(format!(".take({take})"));
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
            // An SPI whose register nobody writes sends its preset; other peripherals stay at rest.
            let value = match self.sinks.iter().flatten().any(is_sink) {
                true => net(peripheral, register.name),
                false => format!("32'd{}", peripheral.parameter(register.name)),
            };
            ports.push(format!(".w_{}({value})", register.name));
        }
        format!("    {} {list}u_{name} ({});\n", kind.module, ports.join(", "))
    }
}

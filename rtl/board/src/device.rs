// SPDX-License-Identifier: MIT OR Apache-2.0
//! Devices at the pins of a simulated board: converters, modulators and encoders that a register's value feeds, and actuators, which
//! read output pins. Each has the facts of its peripheral from the wiring.
//!
//! A device gives its levels in the cycle in which an output pin has changed: lines have no length, and devices no delay.

use crate::kind::Kind;
use crate::latency::RECEIVED;
use crate::simulation::Edge;
use crate::wiring::{Peripheral, Wiring};
use std::collections::VecDeque;

/// Kinds of peripherals with a device, and the registers that a value can feed.
const FED: [(&str, &[&str]); 7] = [
    ("quadrature", &["count"]),
    ("spi", RECEIVED),
    ("sinc3", &["value"]),
    ("ssi", &["position"]),
    ("biss-c", &["position"]),
    ("hall", &["count", "sector"]),
    ("digital-in", &["level"]),
];

/// A device at pins of a peripheral. Pins have their names in the kind's table.
pub trait Device: std::fmt::Debug + Send {
    /// Output pins of the board whose edges the device needs, and input pins that it drives.
    fn pins(&self) -> DevicePins;

    /// Acts in a cycle, which does not come before the last call's: with the pins that it needs, and the value that its register shall
    /// read. It must be called after each edge, and at [`Device::next`]; further calls do no harm. True if it has given levels anew.
    fn act(&mut self, cycle: u64, needed: &[NeededPin], value: f64) -> bool;

    /// Levels of the pins that it drives.
    fn levels(&self) -> &[bool];

    /// Cycle in which it wants to act, although no pin changes.
    fn next(&self) -> Option<u64>;
}

/// An output pin of the board that a device needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NeededPin {
    /// Level in this cycle.
    pub level: bool,
    /// An edge that matters has led to this level since the cycle before.
    pub edge: bool,
}

/// Pins of a device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DevicePins {
    /// Output pins of the board, each with the edges that matter.
    pub needed: Vec<(&'static str, Edge)>,
    /// Input pins of the board.
    pub driven: Vec<&'static str>,
}

impl DevicePins {
    fn new(needed: &[(&'static str, Edge)], driven: &[&'static str]) -> DevicePins {
        DevicePins { needed: needed.to_vec(), driven: driven.to_vec() }
    }
}

/// Least and greatest value of a register that a device feeds; `None` for a position, which wraps.
pub fn range(peripheral: &Peripheral) -> Option<(f64, f64)> {
    let of = |name: &str| peripheral.parameter(name);
    match peripheral.kind.name {
        "spi" if of("signed") == 1 => {
            let half = f64::from(of("bits") - 1).exp2();
            Some((-half, half - 1.0))
        }
        "spi" => Some((0.0, f64::from(of("bits")).exp2() - 1.0)),
        "sinc3" => {
            let most = f64::from(of("osr")).powi(3);
            Some((-most, most))
        }
        "digital-in" => Some((0.0, 1.0)),
        _ => None,
    }
}

/// Device at a peripheral whose register a value feeds, with the value at the beginning.
///
/// # Errors
/// If the kind has no device, the register is not one that a value feeds, or the value cannot be that of the register; in words.
pub fn of(peripheral: &Peripheral, register: &str, value: f64) -> Result<Box<dyn Device>, String> {
    let Peripheral { name, kind, .. } = peripheral;
    let parameter = |name: &str| peripheral.parameter(name);
    let Some((_, registers)) = FED.iter().find(|(fed, _)| *fed == kind.name) else {
        let kinds = FED.map(|(kind, _)| kind).join(", ");
        return Err(format!(
            "`{name}` is of the kind `{}`, which has no device that a signal feeds; there are {kinds}",
            kind.name
        ));
    };
    if !registers.contains(&register) {
        let registers: Vec<String> = registers.iter().map(|register| format!("`{register}`")).collect();
        return Err(format!(
            "the register `{register}` of `{name}` ({}) comes with the frames or edges; a signal feeds {}",
            kind.name,
            registers.join(" or ")
        ));
    }
    if let Some((least, most)) = range(peripheral)
        && !(least..=most).contains(&value)
    {
        return Err(format!(
            "`{name}` would read {value} at the beginning, and its register `{register}` has {least} to {most}: another `scale`, or `offset`"
        ));
    }
    Ok(match kind.name {
        "quadrature" => {
            let (count, start) = (value.floor(), f64::from(parameter("start").cast_signed()));
            if count != start {
                return Err(format!(
                    "the encoder stands at {count} counts at the beginning, and `{name}` starts at {start}: `start = {count}` in the wiring"
                ));
            }
            Box::new(Tracks::new(value, ["a", "b"], quadrature))
        }
        "hall" => {
            if register == "count" && value.floor() != 0.0 {
                return Err(format!(
                    "the rotor stands at sector {} at the beginning, and `{name}` counts from 0: another `offset`",
                    value.floor()
                ));
            }
            Box::new(Tracks::new(value, ["a", "b", "c"], hall))
        }
        "digital-in" => Box::new(Switch { invert: parameter("invert") == 1, level: [false] }),
        "spi" => Box::new(Converter {
            bits: parameter("bits"),
            // Data changes at the edge at which it is not sampled; the clock then has this level.
            gives_at: (parameter("phase") == 1) != (parameter("polarity") == 1),
            is_early: parameter("phase") == 0,
            range: range(peripheral).unwrap_or_default(),
            left: VecDeque::new(),
            level: [true],
            pin: kind.reads.iter().find(|own| own.name == register).and_then(|own| own.pin).unwrap_or("in"),
        }),
        "sinc3" => Box::new(Modulator {
            full: f64::from(parameter("osr")).powi(3),
            own_half: (parameter("clock") == 1).then(|| u64::from(parameter("half"))),
            due: 0,
            sums: [0.0; 2],
            levels: [false; 2],
        }),
        "ssi" => Box::new(Ssi {
            bits: parameter("bits"),
            is_gray: parameter("gray") == 1,
            is_double: parameter("double") == 1,
            monoflop: u64::from(parameter("half")) + u64::from(parameter("pause") / 2),
            left: VecDeque::new(),
            level: [true],
            rests: None,
        }),
        _ => Box::new(BissC {
            bits: parameter("bits"),
            timeout: u64::from((parameter("timeout") / 4 * 3).max(parameter("half") + 2)),
            rises: None,
            left: VecDeque::new(),
            level: [true],
            rests: None,
        }),
    })
}

/// A position that follows a value count by count.
#[derive(Debug)]
struct Position {
    count: i64,
    wanted: i64,
    /// Cycle and value of the last call, and the value's change in a cycle.
    last: Option<(u64, f64)>,
    rate: f64,
    /// First cycle of the next count.
    ready: u64,
}

impl Position {
    /// Longest time between two counts of a position that catches up, in cycles.
    const PACE: f64 = 8.0;

    fn new(value: f64) -> Position {
        Position {
            count: value.floor() as i64,
            wanted: value.floor() as i64,
            last: None,
            rate: 0.0,
            ready: 0,
        }
    }

    /// Goes a count towards the value, as both tracks of an encoder never change at once.
    fn follow(&mut self, cycle: u64, value: f64) {
        if let Some((before, old)) = self.last
            && cycle > before
        {
            self.rate = (value - old) / (cycle - before) as f64;
        }
        self.last = Some((cycle, value));
        self.wanted = value.floor() as i64;
        let step = (self.wanted - self.count).signum();
        if step == 0 || cycle < self.ready {
            return;
        }
        self.count += step;
        // Twice as fast as the value at most: the peripheral's filter must see each count.
        self.ready = cycle + (0.5 / self.rate.abs()).floor().clamp(1.0, Position::PACE) as u64;
    }

    /// Cycle of the next count, if the value goes on as it did.
    fn next(&self) -> Option<u64> {
        let (cycle, value) = self.last?;
        if self.count != self.wanted {
            return Some(self.ready.max(cycle + 1));
        }
        let way = if self.rate > 0.0 { self.count as f64 + 1.0 - value } else { value - self.count as f64 };
        let cycles = (way / self.rate.abs()).ceil().max(1.0);
        (cycles < 1e12).then(|| cycle + cycles as u64)
    }
}

/// Encoder whose tracks show the count of a position.
#[derive(Debug)]
struct Tracks<const N: usize> {
    position: Position,
    pins: [&'static str; N],
    /// Levels of the tracks at a count.
    at: fn(i64) -> [bool; N],
    levels: [bool; N],
}

impl<const N: usize> Tracks<N> {
    fn new(value: f64, pins: [&'static str; N], at: fn(i64) -> [bool; N]) -> Tracks<N> {
        Tracks { position: Position::new(value), pins, at, levels: [false; N] }
    }
}

impl<const N: usize> Device for Tracks<N> {
    fn pins(&self) -> DevicePins {
        DevicePins::new(&[], &self.pins)
    }

    fn act(&mut self, cycle: u64, _: &[NeededPin], value: f64) -> bool {
        self.position.follow(cycle, value);
        self.levels = (self.at)(self.position.count);
        true
    }

    fn levels(&self) -> &[bool] {
        &self.levels
    }

    fn next(&self) -> Option<u64> {
        self.position.next()
    }
}

/// Tracks of an incremental encoder.
fn quadrature(count: i64) -> [bool; 2] {
    [(count + 1) >> 1 & 1 == 1, count >> 1 & 1 == 1]
}

/// Three Hall sensors: each is 1 over half a turn, a third of a turn after the one before.
fn hall(sector: i64) -> [bool; 3] {
    [1, 5, 3].map(|shift| (sector + shift).rem_euclid(6) < 3)
}

/// Switch: closed from 1 on.
#[derive(Debug)]
struct Switch {
    invert: bool,
    level: [bool; 1],
}

impl Device for Switch {
    fn pins(&self) -> DevicePins {
        DevicePins::new(&[], &["in"])
    }

    fn act(&mut self, _: u64, _: &[NeededPin], value: f64) -> bool {
        self.level = [(value >= 1.0) != self.invert];
        true
    }

    fn levels(&self) -> &[bool] {
        &self.level
    }

    fn next(&self) -> Option<u64> {
        None
    }
}

/// Lowest bits of a whole number, the highest first.
fn word(value: u64, bits: u32) -> VecDeque<bool> {
    (0..bits).rev().map(|at| value >> at & 1 == 1).collect()
}

/// Converter with an SPI slave: samples at the fall of its select pin; what is beyond its range is its end.
#[derive(Debug)]
struct Converter {
    bits: u32,
    gives_at: bool,
    /// The first bit comes with the fall of the select pin.
    is_early: bool,
    range: (f64, f64),
    left: VecDeque<bool>,
    level: [bool; 1],
    /// The line that it drives.
    pin: &'static str,
}

impl Device for Converter {
    fn pins(&self) -> DevicePins {
        let clock = if self.gives_at { Edge::Rise } else { Edge::Fall };
        DevicePins::new(&[("select", Edge::Fall), ("clock", clock)], &[self.pin])
    }

    fn act(&mut self, _: u64, needed: &[NeededPin], value: f64) -> bool {
        let &[select, clock] = needed else { return false };
        if select.edge {
            let raw = value.floor().clamp(self.range.0, self.range.1) as i64;
            self.left = word(raw.cast_unsigned(), self.bits);
        }
        let gives = !select.level && if select.edge { self.is_early } else { clock.edge };
        if gives {
            self.level = [self.left.pop_front().unwrap_or(false)];
        }
        gives
    }

    fn levels(&self) -> &[bool] {
        &self.level
    }

    fn next(&self) -> Option<u64> {
        None
    }
}

/// Delta-sigma modulator of second order.
#[derive(Debug)]
struct Modulator {
    /// Value at full scale.
    full: f64,
    /// Half a period of its own clock in cycles.
    own_half: Option<u64>,
    due: u64,
    sums: [f64; 2],
    /// Data, then the clock of its own.
    levels: [bool; 2],
}

impl Modulator {
    /// Samples, and gives a bit.
    fn sample(&mut self, value: f64) {
        // Beyond full scale the integrators run to their ends.
        const END: f64 = 4.0;
        let [first, second] = self.sums;
        let bit = if second >= 0.0 { 1.0 } else { -1.0 };
        let next = [first + 0.5 * (value / self.full - bit), second + 0.5 * (first - bit)];
        self.sums = next.map(|sum| sum.clamp(-END, END));
        self.levels[0] = bit > 0.0;
    }
}

impl Device for Modulator {
    fn pins(&self) -> DevicePins {
        match self.own_half {
            None => DevicePins::new(&[("clock", Edge::Rise)], &["data"]),
            Some(_) => DevicePins::new(&[], &["data", "clock_in"]),
        }
    }

    fn act(&mut self, cycle: u64, needed: &[NeededPin], value: f64) -> bool {
        let samples = match self.own_half {
            None => needed.first().is_some_and(|clock| clock.edge),
            Some(half) if cycle >= self.due => {
                self.due = cycle + half;
                self.levels[1] = !self.levels[1];
                self.levels[1]
            }
            Some(_) => false,
        };
        if samples {
            self.sample(value);
        }
        samples
    }

    fn levels(&self) -> &[bool] {
        if self.own_half.is_some() { &self.levels } else { &self.levels[..1] }
    }

    fn next(&self) -> Option<u64> {
        self.own_half.map(|_| self.due)
    }
}

/// Position of an absolute encoder, of which it has the lowest bits.
fn absolute(value: f64, bits: u32) -> u64 {
    (value.floor() as i64).rem_euclid(1 << bits).cast_unsigned()
}

/// Absolute encoder with SSI.
#[derive(Debug)]
struct Ssi {
    bits: u32,
    is_gray: bool,
    is_double: bool,
    /// Cycles after the clock's last edge in which the line goes to its rest.
    monoflop: u64,
    left: VecDeque<bool>,
    level: [bool; 1],
    /// Cycle in which the line goes to its rest.
    rests: Option<u64>,
}

impl Device for Ssi {
    fn pins(&self) -> DevicePins {
        DevicePins::new(&[("clock", Edge::Both)], &["data"])
    }

    fn act(&mut self, cycle: u64, needed: &[NeededPin], value: f64) -> bool {
        let &[clock] = needed else { return false };
        if !clock.edge {
            if self.rests.is_some_and(|at| cycle >= at) {
                (self.rests, self.level) = (None, [true]);
                self.left.clear();
                return true;
            }
            return false;
        }
        if self.rests.is_none() && !clock.level {
            let position = absolute(value, self.bits);
            let word = word(if self.is_gray { position ^ position >> 1 } else { position }, self.bits);
            self.left = word.clone();
            if self.is_double {
                self.left.push_back(false);
                self.left.extend(word);
            }
        }
        self.rests = Some(cycle + self.monoflop);
        if clock.level {
            self.level = [self.left.pop_front().unwrap_or(false)];
        }
        clock.level
    }

    fn levels(&self) -> &[bool] {
        &self.level
    }

    fn next(&self) -> Option<u64> {
        self.rests
    }
}

/// Absolute encoder with BiSS C, without error and warning.
#[derive(Debug)]
struct BissC {
    bits: u32,
    timeout: u64,
    /// Rises of the clock in this frame.
    rises: Option<u32>,
    left: VecDeque<bool>,
    level: [bool; 1],
    rests: Option<u64>,
}

impl BissC {
    /// Bits from the acknowledge on.
    fn frame(&self, position: u64) -> VecDeque<bool> {
        // Neither error nor warning, which are active low.
        let data = word(position << 2 | 3, self.bits + 2);
        let crc = data.iter().chain(&[false; 6]).fold(0_u64, |rest, bit| {
            let rest = rest << 1 | u64::from(*bit);
            if rest & 64 == 0 { rest } else { rest ^ 0x43 }
        });
        [false, true, false].into_iter().chain(data).chain(word(!crc, 6)).collect()
    }
}

impl Device for BissC {
    fn pins(&self) -> DevicePins {
        DevicePins::new(&[("ma", Edge::Both)], &["slo"])
    }

    fn act(&mut self, cycle: u64, needed: &[NeededPin], value: f64) -> bool {
        let &[clock] = needed else { return false };
        if !clock.edge {
            if self.rests.is_some_and(|at| cycle >= at) {
                (self.rests, self.rises, self.level) = (None, None, [true]);
                return true;
            }
            return false;
        }
        self.rests = Some(cycle + self.timeout);
        match self.rises {
            None if !clock.level => {
                self.rises = Some(0);
                self.left = self.frame(absolute(value, self.bits));
                false
            }
            Some(rises) if clock.level => {
                self.rises = Some(rises + 1);
                if rises > 0 {
                    self.level = [self.left.pop_front().unwrap_or(false)];
                }
                rises > 0
            }
            _ => false,
        }
    }

    fn levels(&self) -> &[bool] {
        &self.level
    }

    fn next(&self) -> Option<u64> {
        self.rests
    }
}

/// State of a half bridge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BridgeState {
    /// The upper switch is on.
    High,
    /// The lower switch is on.
    Low,
    /// Both are off.
    Off,
    /// Both are on: a short circuit.
    Short,
}

/// Meaning of the levels at a register's pins.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Shape {
    /// Half bridge with a period of so many cycles; the pins are those of the upper switch and, if there is one, of the lower one, and
    /// active low if the flags are true.
    Bridge([bool; 2], f64),
    /// Stream of pulses.
    Stream,
    /// One pin, on or off.
    Switch,
}

/// Output pins behind a register that the program writes.
#[derive(Clone, Debug, PartialEq)]
pub struct Actuator {
    /// Name of the peripheral.
    pub peripheral: String,
    /// Names of the pins in the circuit; of a half bridge the upper switch's, then the lower one's if it has a pin.
    pub pins: Vec<String>,
    shape: Shape,
    /// Value 0 of the register is a pulse of half the time.
    is_signed: bool,
    /// Value of the register for 1 at the program's port.
    unit: f64,
}

impl Actuator {
    /// Pins that the program moves through an output port; `None` if no peripheral has it.
    ///
    /// # Errors
    /// If the peripheral drives nothing by its pins' levels; in words.
    pub fn of(wiring: &Wiring, port: &str) -> Option<Result<Actuator, String>> {
        wiring.peripherals.iter().find_map(|peripheral| {
            let at = |write: &Option<crate::wiring::Write>| {
                write.as_ref().filter(|write| write.port == port).map(|write| write.scale)
            };
            let (register, scale) =
                peripheral.writes.iter().enumerate().find_map(|(i, write)| Some((i, at(write)?)))?;
            Some(Actuator::at(wiring, peripheral, register, scale.unwrap_or(0)))
        })
    }

    fn at(wiring: &Wiring, peripheral: &Peripheral, register: usize, scale: i32) -> Result<Actuator, String> {
        let Peripheral { name, kind, .. } = peripheral;
        let of = |name: &str| peripheral.parameter(name);
        let (names, shape): (&[&str], Shape) = match kind.name {
            "pwm" => (&["high", "low"], Shape::Bridge([false; 2], 2.0 * f64::from(of("half")))),
            "pwm3" if register >= 3 => {
                return Err(format!("the register `stop` of `{name}` is no duty; there are `a`, `b`, `c`"));
            }
            "pwm3" => {
                let invert = ["invert_high", "invert_low"].map(|name| of(name) == 1);
                let carrier = peripheral.carrier.and_then(|carrier| wiring.carriers.get(carrier));
                let cycles = carrier.map_or(1.0, |carrier| f64::from(carrier.period()));
                let names: &[&str] =
                    [&["high_a", "low_a"], &["high_b", "low_b"], &["high_c", "low_c"]][register];
                (names, Shape::Bridge(invert, cycles))
            }
            "sigma-delta" => (&["out"], Shape::Stream),
            "digital-out" => (&["out"], Shape::Switch),
            _ => {
                return Err(format!(
                    "`{name}` is of the kind `{}`, whose pins move no plant; there are pwm, pwm3, sigma-delta, digital-out",
                    kind.name
                ));
            }
        };
        let has = |pin: &&&str| {
            let at = kind.pins.iter().position(|own| own.name == **pin);
            at.is_some_and(|at| peripheral.pins[at].is_some())
        };
        Ok(Actuator {
            peripheral: name.clone(),
            pins: names.iter().filter(has).map(|pin| format!("{name}_{pin}")).collect(),
            shape,
            is_signed: of("signed") == 1,
            unit: f64::from(scale).exp2(),
        })
    }

    /// Factor and summand by which the port's value becomes the duty of a half bridge; `None` for other kinds.
    pub fn duty(&self) -> Option<(f64, f64)> {
        let Shape::Bridge(_, cycles) = self.shape else { return None };
        Some((self.unit / cycles, if self.is_signed { 0.5 } else { 0.0 }))
    }

    /// State of a half bridge, from the levels of the pins; without a pin of its own the lower switch is the upper one's opposite.
    pub fn state(&self, levels: &[bool]) -> BridgeState {
        let invert = if let Shape::Bridge(invert, _) = self.shape { invert } else { [false; 2] };
        let high = levels.first().is_some_and(|level| *level != invert[0]);
        let low = levels.get(1).map_or(!high, |level| *level != invert[1]);
        match (high, low) {
            (true, false) => BridgeState::High,
            (false, true) => BridgeState::Low,
            (false, false) => BridgeState::Off,
            (true, true) => BridgeState::Short,
        }
    }

    /// Mean level over some cycles, of which each pin was 1 in `high`; of a half bridge, of its leg, for which the time with both switches
    /// off counts half.
    pub fn mean(&self, high: &[u64], cycles: u64) -> f64 {
        let invert = if let Shape::Bridge(invert, _) = self.shape { invert } else { [false; 2] };
        let on = |pin: usize| {
            let high = *high.get(pin)?;
            Some(if invert[pin] { cycles.saturating_sub(high) } else { high } as f64)
        };
        let (cycles, up) = (cycles.max(1) as f64, on(0).unwrap_or_default());
        on(1).map_or(up, |down| 0.5 * (cycles + up - down)) / cycles
    }

    /// Value of the program's port for which the pins have this mean level.
    pub fn port(&self, mean: f64) -> f64 {
        let mean = if self.is_signed { mean - 0.5 } else { mean };
        let full = match self.shape {
            Shape::Bridge(_, cycles) => cycles,
            Shape::Stream => 65536.0,
            Shape::Switch => 1.0,
        };
        mean * full / self.unit
    }

    /// The peripheral is a half bridge.
    pub fn is_bridge(&self) -> bool {
        matches!(self.shape, Shape::Bridge(..))
    }
}

/// The peripheral, and the register's name, that an input port of the program reads.
pub fn reader<'w>(wiring: &'w Wiring, port: &str) -> Option<(&'w Peripheral, &'static str)> {
    wiring.peripherals.iter().find_map(|peripheral| {
        let Peripheral { kind, reads, .. } = peripheral;
        let Kind { reads: registers, .. } = kind;
        let at = reads.iter().position(|read| read.as_deref() == Some(port))?;
        Some((peripheral, registers[at].name))
    })
}

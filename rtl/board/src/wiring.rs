// SPDX-License-Identifier: MIT OR Apache-2.0
//! A wiring: which peripherals at which pins of a board, and which ports of the program are their registers.
//!
//! The form of the file: docs/board.md.

use crate::application::Application;
use crate::boards::Board;
use crate::document::{At, Document, Mistake, Table};
use crate::kind::{Direction, KINDS, Kind};
use std::collections::BTreeMap;
use std::ops::Range;
use takt_isa::Type;

/// Peripherals of a wiring.
pub const PERIPHERALS: usize = 64;
/// A period where no file says how long it is, in µs: the founding paper's.
const PERIOD: f64 = 100.0;
/// Bits per second of the UART where no file says them.
const BAUD: u32 = 115_200;
/// Cycles between a tick of a core in a system and the next base tick: the pulse and the next one's beginning.
const ROOM: u64 = 8;
/// Cycles of a period, at most.
pub const MOST_PERIOD: u32 = 1 << 30;

/// A wiring.
#[derive(Clone, Debug, PartialEq)]
pub struct Wiring {
    /// The core's clock in MHz.
    pub clock: f64,
    /// Cycles from tick to tick.
    pub period: u32,
    /// Cycles by which conversions start before the tick.
    pub lead: u32,
    /// Bits per second of the UART.
    pub baud: u32,
    /// True if the program runs, and drives, from power-up on.
    pub autostart: bool,
    /// Deadlines that may be missed one after the other until the outputs are safe.
    pub deadlines: u32,
    /// Periods without a request of the host until the outputs are safe; 0: any number.
    pub host: u32,
    /// True if the host can read registers and data memory of the cores, for which there are then shadow memories.
    pub observe: bool,
    /// Pins with a meaning of their own, by [`SIGNALS`]' order.
    pub signals: [Option<String>; SIGNALS.len()],
    /// The peripherals, in the order of the file.
    pub peripherals: Vec<Peripheral>,
}

/// A pin with a meaning of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Signal {
    /// Its name in wiring files.
    pub name: &'static str,
    /// Its direction, seen from the circuit.
    pub direction: Direction,
    /// Its meaning.
    pub text: &'static str,
}

/// Pins with a meaning of their own.
pub const SIGNALS: [Signal; 5] = [
    Signal { name: "drive", direction: Direction::Output, text: "1: the outputs drive" },
    Signal { name: "fault", direction: Direction::Output, text: "1: the program has stopped with a fault" },
    Signal {
        name: "deadline",
        direction: Direction::Output,
        text: "1: a deadline was missed since the start",
    },
    Signal {
        name: "stop",
        direction: Direction::Input,
        text: "1, or open: the outputs are safe, until the next start",
    },
    Signal { name: "tick", direction: Direction::Output, text: "high for a cycle at each tick" },
];

/// A peripheral of a wiring.
#[derive(Clone, Debug, PartialEq)]
pub struct Peripheral {
    /// Its name.
    pub name: String,
    /// Its kind.
    pub kind: &'static Kind,
    /// Its parameters, in the order of the kind's table.
    pub parameters: Vec<u32>,
    /// The board's names of its pins, in the order of the kind's table; none if it is not connected.
    pub pins: Vec<Option<String>>,
    /// Of an SPI: whether it starts when outputs are published, not ahead of the tick.
    pub at_publish: bool,
    /// The program's input ports: for each of the kind's registers that it reads.
    pub reads: Vec<Option<String>>,
    /// The program's output ports: for each of the kind's registers that it writes.
    pub writes: Vec<Option<Write>>,
    ports: Vec<(String, Direction, Range<usize>)>,
}

impl Peripheral {
    /// The parameter of this name; 0 if its kind has none.
    pub fn parameter(&self, name: &str) -> u32 {
        let at = self.kind.parameters.iter().position(|parameter| parameter.name == name);
        at.and_then(|at| self.parameters.get(at)).copied().unwrap_or(0)
    }
}

/// The keys of a wiring. Of a system there is one error, instead of one for each of its keys.
fn keys<'a>(document: &'a Document<'a>) -> Option<Table<'a>> {
    let top = document.top()?;
    if let Some(place) = top.place_of("core") {
        let text =
            "this is a system of several cores, and a wiring is wanted, which says what is at a board's pins";
        document.mistake(&place, text);
        return None;
    }
    Some(top)
}

/// A register that the program writes.
#[derive(Clone, Debug, PartialEq)]
pub struct Write {
    /// The program's output port.
    pub port: String,
    /// For a float port: the power of two by which it is multiplied before it is rounded.
    pub scale: Option<i32>,
}

impl Wiring {
    /// No peripherals: the host has all ports. The program, or system, waits for it.
    pub fn none<'a>(board: &Board, application: impl Into<Application<'a>>) -> Wiring {
        let application = application.into();
        let period = match application.is_program() {
            true => (PERIOD * board.clock.1) as u32,
            false => application.description().tick.min(MOST_PERIOD.into()) as u32,
        };
        Wiring {
            clock: board.clock.1,
            period,
            lead: 0,
            baud: BAUD,
            autostart: false,
            deadlines: 1,
            host: 0,
            observe: true,
            signals: [const { None }; SIGNALS.len()],
            peripherals: Vec::new(),
        }
    }

    /// The signal at a pin of the board: `motor.high`, `drive`.
    pub fn at(&self, pin: &str) -> Option<String> {
        let signals = SIGNALS.iter().zip(&self.signals);
        let signal =
            signals.filter(|(_, at)| at.as_deref() == Some(pin)).map(|(signal, _)| signal.name.to_owned());
        let pins = self.peripherals.iter().flat_map(|peripheral| {
            let pins = peripheral.kind.pins.iter().zip(&peripheral.pins);
            pins.map(move |(own, at)| (at.as_deref(), || format!("{}.{}", peripheral.name, own.name)))
        });
        signal.chain(pins.filter(|(at, _)| *at == Some(pin)).map(|(_, name)| name())).next()
    }

    /// The board that a wiring is for, if its text says so.
    ///
    /// # Errors
    /// If the text is no wiring at all, or what it says of the board is no name.
    pub fn board(file: &str, text: &str) -> Result<Option<String>, Vec<Mistake>> {
        let document = Document::new(file, text);
        let board = keys(&document).map(|top| top.string("board").map(|board| board.value));
        document.finish(board)
    }

    /// Reads a wiring for a board, from the text of a file.
    ///
    /// # Errors
    /// Everything that is wrong with it, in the order of the file.
    pub fn read(file: &str, text: &str, board: &Board) -> Result<Wiring, Vec<Mistake>> {
        let document = Document::new(file, text);
        let wiring = keys(&document).and_then(|top| Reader::new(&document, board).wiring(&top));
        document.finish(wiring)
    }

    /// Checks that a program, or a system, has the ports that the wiring names, with types that fit. `text` is the text of the wiring's
    /// file.
    ///
    /// # Errors
    /// Every port that it does not have, or that does not fit; of a system, what else a board cannot do.
    pub fn check<'a>(
        &self,
        file: &str,
        text: &str,
        application: impl Into<Application<'a>>,
    ) -> Result<(), Vec<Mistake>> {
        let (document, application) = (Document::new(file, text), application.into());
        let mut driven: BTreeMap<usize, &str> = BTreeMap::new();
        for peripheral in &self.peripherals {
            for (port, direction, place) in &peripheral.ports {
                let found = match application.connect(*direction, port) {
                    Ok(found) => found,
                    Err(text) => {
                        document.mistake(place, text);
                        continue;
                    }
                };
                if *direction == Direction::Input
                    && let Some(other) = driven.insert(found.number, &peripheral.name)
                {
                    let text = format!("input port `{port}` is driven twice: `{other}` drives it, too");
                    document.mistake(place, text);
                }
                self.check_type(&document, peripheral, (port.as_str(), found.ty), *direction, place);
            }
        }
        let place = document.top().and_then(|top| top.place_of("period")).unwrap_or(0..0);
        for text in self.unfit(&application) {
            document.mistake(&place, text);
        }
        document.finish(Some(()))
    }

    /// The properties of a system that do not fit this wiring's period, or any board, in words.
    pub fn unfit(&self, application: &Application<'_>) -> Vec<String> {
        let description = application.description();
        let mut unfit: Vec<String> = application.endpoints().too_many().into_iter().collect();
        // A program's tick is the wiring's period.
        if application.is_program() {
            return unfit;
        }
        let (tick, period) = (description.tick, u64::from(self.period));
        if tick != period {
            unfit.push(format!(
                "the system's `tick` is {tick} cycles, which at {} MHz are {} µs; `period` is {period} cycles",
                self.clock,
                tick as f64 / self.clock
            ));
        }
        for core in &description.cores {
            let most = core.period(tick).saturating_sub(description.lead() + ROOM);
            if core.offset > most {
                unfit.push(format!(
                    "core `{}` has the offset {}; on a board its tick must be given before its next base tick: an offset of {most} cycles at most",
                    core.name, core.offset
                ));
            }
        }
        unfit
    }

    fn check_type(
        &self,
        document: &Document<'_>,
        peripheral: &Peripheral,
        (port, ty): (&str, Type),
        direction: Direction,
        place: &Range<usize>,
    ) {
        let name = port.rsplit('.').next().unwrap_or(port);
        if direction == Direction::Input {
            if ty == Type::F {
                let text = format!(
                    "input port `{port}` is a float; a register is an integer: declare it `{name}:int`"
                );
                document.mistake(place, text);
            }
            return;
        }
        let writes = peripheral.writes.iter().flatten();
        let Some(write) = writes.into_iter().find(|write| write.port == port) else { return };
        match (ty, write.scale) {
            (Type::F, None) => document.mistake(
                place,
                format!(
                    "output port `{port}` is a float: `scale` says how many steps of the register 1.0 is, as in \
                     `scale = {{ {} = 16 }}`",
                    peripheral.kind.writes[0].name
                ),
            ),
            (Type::I, Some(_)) => document.mistake(
                place,
                format!("output port `{port}` is an integer, which is not scaled: leave out `scale`"),
            ),
            _ => {}
        }
    }
}

/// The reader of a wiring.
struct Reader<'a> {
    document: &'a Document<'a>,
    board: &'a Board,
    /// Pins that are used: by what, and in which line.
    used: BTreeMap<String, (String, usize)>,
}

impl<'a> Reader<'a> {
    fn new(document: &'a Document<'a>, board: &'a Board) -> Reader<'a> {
        Reader { document, board, used: BTreeMap::new() }
    }

    fn wiring(mut self, top: &Table<'a>) -> Option<Wiring> {
        let mistake = |place: &Range<usize>, text: String| self.document.mistake(place, text);
        if let Some(wanted) = top.string("board").filter(|wanted| wanted.value != self.board.name) {
            let text =
                format!("this wiring is for the board `{}`, not for `{}`", wanted.value, self.board.name);
            mistake(&wanted.place, text);
        }
        let clock = top.number("clock", 4.0, 400.0).map_or(self.board.clock.1, |at| at.value);
        let cycles = |at: At<f64>, least: u32| {
            let cycles = (at.value * clock).round();
            let range = f64::from(least)..=f64::from(MOST_PERIOD);
            if range.contains(&cycles) {
                return Some(cycles as u32);
            }
            mistake(
                &at.place,
                format!(
                    "{} µs are {cycles} cycles of {clock} MHz; there may be {least} to {MOST_PERIOD}",
                    at.value
                ),
            );
            None
        };
        let most = f64::from(MOST_PERIOD);
        let period = top.need("period", top.number("period", 0.0, most)).and_then(|at| cycles(at, 64));
        let lead = match top.number("lead", 0.0, most) {
            Some(at) => {
                let place = at.place.clone();
                let lead = cycles(at, 0);
                if let (Some(lead), Some(period)) = (lead, period)
                    && lead >= period
                {
                    mistake(&place, "`lead` is to be shorter than the period".to_owned());
                }
                lead
            }
            None => Some(0),
        };
        let baud = top.integer("baud", 9600, 12_000_000);
        if let Some(baud) = &baud {
            let divide = clock * 1e6 / f64::from(baud.value);
            let error = (divide.round() / divide - 1.0).abs();
            if !(4.0..=65535.0).contains(&divide.round()) || error > 0.02 {
                mistake(
                    &baud.place,
                    format!(
                        "{} baud are {divide:.2} cycles of {clock} MHz; that must be 4 to 65535, within 2 % of a whole number",
                        baud.value
                    ),
                );
            }
        }
        let autostart = top.boolean("autostart").is_some_and(|at| at.value);
        let deadlines = top.integer("deadlines", 1, 65535).map_or(1, |at| at.value);
        let host = top.integer("host", 0, 65535).map_or(0, |at| at.value);
        let observe = top.boolean("observe").is_none_or(|at| at.value);
        let mut signals = [const { None }; SIGNALS.len()];
        if let Some(table) = top.table("signals") {
            for (signal, pin) in SIGNALS.iter().zip(&mut signals) {
                *pin = table.string(signal.name).and_then(|at| self.pin(at, signal.name));
            }
            table.no_others(&[]);
        }
        let mut peripherals = Vec::new();
        for (name, table) in top.table("peripheral").iter().flat_map(Table::tables) {
            if peripherals.len() == PERIPHERALS {
                self.document.mistake(&name.place, format!("there are more than {PERIPHERALS} peripherals"));
                break;
            }
            peripherals.extend(self.peripheral(name, &table));
        }
        top.no_others(&[]);
        Some(Wiring {
            clock,
            period: period?,
            lead: lead?,
            baud: baud.map_or(BAUD, |at| at.value),
            autostart,
            deadlines,
            host,
            observe,
            signals,
            peripherals,
        })
    }

    /// A pin of the board, which is used from now on.
    fn pin(&mut self, pin: At<String>, by: &str) -> Option<String> {
        if self.board.site(&pin.value).is_none() {
            let names: Vec<&str> = self.board.pins.iter().map(|(name, _)| name.as_str()).collect();
            let some = names.iter().take(6).copied().collect::<Vec<_>>().join(", ");
            let text = format!(
                "`{}` is no pin of {}; it has {some} … ({} in all: `takt board pins {}`)",
                pin.value,
                self.board.name,
                names.len(),
                self.board.name
            );
            self.document.mistake(&pin.place, text);
            return None;
        }
        let line = self.document.line(&pin.place);
        if let Some((other, at)) = self.used.get(&pin.value) {
            let text = format!("pin `{}` is used twice: line {at} has it for `{other}`", pin.value);
            self.document.mistake(&pin.place, text);
            return None;
        }
        self.used.insert(pin.value.clone(), (by.to_owned(), line));
        Some(pin.value)
    }

    fn peripheral(&mut self, name: At<String>, table: &Table<'a>) -> Option<Peripheral> {
        let document = self.document;
        let letters = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        if !name.value.starts_with(|c: char| c.is_ascii_lowercase())
            || !name.value.chars().all(letters)
            || name.value.len() > 32
        {
            let text = format!(
                "`{}` is no name of a peripheral: 32 small letters, digits and _ at most, a letter first",
                name.value
            );
            document.mistake(&name.place, text);
        }
        let given = table.need("kind", table.string("kind"))?;
        let Some(kind) = Kind::from_name(&given.value) else {
            let kinds: Vec<&str> = KINDS.iter().map(|kind| kind.name).collect();
            let text = format!("`{}` is no kind of peripheral; there are {}", given.value, kinds.join(", "));
            document.mistake(&given.place, text);
            return None;
        };
        let parameters = kind.parameters.iter().map(|parameter| {
            table
                .signed(parameter.name, parameter.least, parameter.most)
                .map_or(parameter.default, |at| at.value as u32)
        });
        let parameters = parameters.collect();
        let at_publish = kind.strobes.start
            && table.string("starts").is_some_and(|at| {
                if !["lead", "publish"].contains(&at.value.as_str()) {
                    let text = format!("`starts` is to be \"lead\" or \"publish\", not \"{}\"", at.value);
                    document.mistake(&at.place, text);
                }
                at.value == "publish"
            });
        let mut pins = vec![None; kind.pins.len()];
        if let Some(list) = table.need("pins", table.table("pins")) {
            for (i, pin) in kind.pins.iter().enumerate() {
                let given = list.string(pin.name);
                let given = if pin.optional { given } else { list.need(pin.name, given) };
                pins[i] = given.and_then(|at| self.pin(at, &name.value));
            }
            list.no_others(&[]);
        }
        let mut ports = Vec::new();
        let scales = table.table("scale").map(|table| table.numbers()).unwrap_or_default();
        let (mut reads, mut writes) = (vec![None; kind.reads.len()], vec![None; kind.writes.len()]);
        if let Some(list) = table.table("ports") {
            for (read, register) in reads.iter_mut().zip(kind.reads) {
                if let Some(at) = list.string(register.name) {
                    ports.push((at.value.clone(), Direction::Input, at.place));
                    *read = Some(at.value);
                }
            }
            for (write, register) in writes.iter_mut().zip(kind.writes) {
                let scale = scales.iter().find(|(key, _)| key.value == register.name);
                let scale = scale.and_then(|(_, at)| self.scale(register.scaled, register.name, at));
                if let Some(at) = list.string(register.name) {
                    ports.push((at.value.clone(), Direction::Output, at.place));
                    *write = Some(Write { port: at.value, scale });
                }
            }
            list.no_others(&[]);
        }
        for (key, _) in &scales {
            if !kind.writes.iter().any(|register| register.name == key.value) {
                let text = format!("`{}` is no register of a {} that a program writes", key.value, kind.name);
                document.mistake(&key.place, text);
            }
        }
        table.no_others(&[]);
        Some(Peripheral { name: name.value, kind, parameters, pins, at_publish, reads, writes, ports })
    }

    /// The exponent of a scale, a power of two.
    fn scale(&self, scaled: bool, register: &str, at: &At<f64>) -> Option<i32> {
        let exponent = at.value.log2().round();
        if !scaled {
            self.document.mistake(&at.place, format!("`{register}` is not scaled"));
            None
        } else if at.value > 0.0 && exponent.abs() <= 60.0 && exponent.exp2() == at.value {
            Some(exponent as i32)
        } else {
            let text = format!(
                "a scale is a power of two from 2^-60 to 2^60, as 0.5, 1 or 16, not {}: multiply by the rest in the program",
                at.value
            );
            self.document.mistake(&at.place, text);
            None
        }
    }
}

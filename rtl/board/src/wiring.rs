// SPDX-License-Identifier: MIT OR Apache-2.0
//! A wiring: the peripherals at the pins of a board, and the ports of the program that drive or take their registers.
//!
//! The page docs/board.md describes the form of the file.

mod times;

use crate::application::Application;
use crate::boards::Board;
use crate::carrier::{self, Carrier, CarrierTick, Carriers, Instant};
use crate::document::{Document, Located, Mistake, Table};
use crate::flash::{self, Flash};
use crate::kind::{DIRECT, Direction, KINDS, Kind};
use crate::scope::{LEAST_DEPTH, MOST_CHANNELS, MOST_DEPTH, MOST_WORDS};
use crate::top::image;
use std::collections::BTreeMap;
use std::ops::Range;
use takt_family::FAMILIES;
use takt_isa::Type;
use takt_rtl::Safety;
use times::Times;

/// Number of ports that an application lacks from which on the wiring is taken for another application's.
const FOREIGN: usize = 3;

/// Most peripherals of a wiring.
pub const PERIPHERALS: usize = 64;
/// The period in µs of a program without a wiring: the founding paper's.
const PERIOD: f64 = 100.0;
/// Default baud rate of the UART.
const BAUD: u32 = 115_200;
/// Cycles between a tick of a core in a system and the next base tick: the tick's pulse, and the beginning of the next.
const ROOM: u64 = 8;
/// Cycles by which a second core is later, unless the wiring states them, and at most: values that differ must not reach a pin first.
const DELAY: u32 = 2;
const MOST_DELAY: u32 = 4;
/// Most cycles of a period.
pub const MOST_PERIOD: u32 = 1 << 30;

/// A wiring, as read from its file.
#[derive(Clone, Debug, PartialEq)]
pub struct Wiring {
    /// The core's clock in MHz.
    pub clock: f64,
    /// Cycles from tick to tick.
    pub period: u32,
    /// Cycles by which conversions start before the tick.
    pub lead: u32,
    /// A host reads and writes registers over a UART. Without one, the program starts by itself, and an image that nobody changes has just
    /// the room for it.
    pub uart: bool,
    /// Bits per second of the UART.
    pub baud: u32,
    /// The program runs, and drives, from power-up on.
    pub autostart: bool,
    /// Number of consecutive missed deadlines that make the outputs safe.
    pub deadlines: u32,
    /// Number of periods without a request of the host that makes the outputs safe; 0 for no limit.
    pub host: u32,
    /// The device's own oscillator watches the clock; pins go off when it stops.
    pub clock_watch: bool,
    /// Mechanisms of every core against faults of the circuit.
    pub safety: Safety,
    /// The host can read registers and data memory of the cores, which then have shadow memories.
    pub observe: bool,
    /// Pins of the board for the signals of [`SIGNALS`], in the order of that table.
    pub signals: [Option<String>; SIGNALS.len()],
    /// The carriers, in the order of the file.
    pub carriers: Vec<Carrier>,
    /// The ticks that a carrier gives; `None` if they come every `period` cycles of no carrier.
    pub tick: Option<CarrierTick>,
    /// The flash with images that a reset starts, if the board has one.
    pub flash: Option<Flash>,
    /// The scope, if the board has one.
    pub scope: Option<ScopeRequest>,
    /// The peripherals, in the order of the file.
    pub peripherals: Vec<Peripheral>,
}

/// A scope as the wiring asks for it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ScopeRequest {
    /// Channels, a power of two up to 8; `None`: by the device.
    pub channels: Option<u32>,
    /// Samples, a power of two; `None`: by the block RAM that is left.
    pub depth: Option<u32>,
    /// The core of a system that is recorded; `None` for a program.
    pub core: Option<String>,
    place: Range<usize>,
}

/// The start of conversions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Starts {
    /// [`Wiring::lead`] cycles before each tick.
    #[default]
    Lead,
    /// With the outputs.
    Publish,
    /// At a place of a carrier; of a filter, the centre of the window that is kept.
    At(Instant),
    /// Never: a filter keeps each window.
    Never,
}

/// A pin of the circuit that belongs to no peripheral.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Signal {
    /// The signal's name in wiring files.
    pub name: &'static str,
    /// The signal's direction, seen from the circuit.
    pub direction: Direction,
    /// The signal's meaning, in words.
    pub text: &'static str,
}

/// The signals that a wiring can connect to pins.
pub const SIGNALS: [Signal; 6] = [
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
    Signal {
        name: "watchdog",
        direction: Direction::Output,
        text: "changes with each period whose outputs drive, for a watchdog beside the FPGA",
    },
];

/// A peripheral of a wiring.
#[derive(Clone, Debug, PartialEq)]
pub struct Peripheral {
    /// The name of the peripheral.
    pub name: String,
    /// The kind of the peripheral.
    pub kind: &'static Kind,
    /// The peripheral's parameters, in the order of the kind's table.
    pub parameters: Vec<u32>,
    /// The board's names of the pins, in the order of the kind's table; `None` for a pin that is not connected.
    pub pins: Vec<Option<String>>,
    /// The start of frames, or the centre of windows.
    pub starts: Starts,
    /// The place of a carrier at which the registers that the program reads are captured; `None` for the tick.
    pub latch: Option<Instant>,
    /// The index of the carrier, of a kind on one.
    pub carrier: Option<usize>,
    /// The names of the peripherals whose trips make this one safe.
    pub trips: Vec<String>,
    /// The input port of the program that each register of the kind's `reads` drives.
    pub reads: Vec<Option<String>>,
    /// The output port of the program that each register of the kind's `writes` takes.
    pub writes: Vec<Option<Write>>,
    ports: Vec<(String, Direction, Range<usize>)>,
}

impl Peripheral {
    /// The parameter with this name; 0 if the kind has no such parameter.
    pub fn parameter(&self, name: &str) -> u32 {
        let at = self.kind.parameters.iter().position(|parameter| parameter.name == name);
        at.and_then(|at| self.parameters.get(at)).copied().unwrap_or(0)
    }

    /// A trip of this peripheral's takes half bridges off without a clock.
    pub(crate) fn is_direct(&self) -> bool {
        self.parameter(DIRECT) != 0
    }
}

/// The keys of a wiring. A system in its place is a single error, instead of an error for each of its keys.
fn keys<'a>(document: &'a Document<'a>) -> Option<Table<'a>> {
    let top = document.top()?;
    if let Some(place) = top.place_of("core") {
        let text =
            "expected a wiring, which assigns peripherals to a board's pins; found a system of several cores";
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
    /// The power of two by which the value of a float port is multiplied before it is rounded; `None` for an integer.
    pub scale: Option<i32>,
}

impl Wiring {
    /// A wiring without peripherals: the host has all ports, and the program, or system, waits for the host.
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
            uart: true,
            baud: BAUD,
            autostart: false,
            deadlines: 1,
            host: 0,
            clock_watch: false,
            safety: Safety::default(),
            observe: true,
            signals: [const { None }; SIGNALS.len()],
            carriers: Vec::new(),
            tick: None,
            flash: None,
            scope: None,
            peripherals: Vec::new(),
        }
    }

    /// The peripherals that trip others, in the order of the file: as the bits of the board's register `trips`.
    pub fn trips(&self) -> impl DoubleEndedIterator<Item = &Peripheral> {
        self.peripherals.iter().filter(|peripheral| peripheral.kind.strobes.trips)
    }

    /// The pin of a signal of [`SIGNALS`]; `None` if it has none.
    pub fn signal(&self, name: &str) -> Option<&str> {
        let at = SIGNALS.iter().position(|signal| signal.name == name)?;
        self.signals[at].as_deref()
    }

    /// The name of the peripheral's pin, or signal, at a pin of the board: `motor.high`, `drive`.
    pub fn at(&self, pin: &str) -> Option<String> {
        let signals = SIGNALS.iter().zip(&self.signals);
        let signal =
            signals.filter(|(_, at)| at.as_deref() == Some(pin)).map(|(signal, _)| signal.name.to_owned());
        let pins = self.peripherals.iter().flat_map(|peripheral| {
            let pins = peripheral.kind.pins.iter().zip(&peripheral.pins);
            pins.map(move |(own, at)| (at.as_deref(), || format!("{}.{}", peripheral.name, own.name)))
        });
        let flash = self.flash.iter().flat_map(|flash| flash::PINS.iter().zip(&flash.pins));
        let flash = flash.filter(|(_, at)| *at == pin).map(|((name, _), _)| format!("flash.{name}"));
        signal.chain(flash).chain(pins.filter(|(at, _)| *at == Some(pin)).map(|(_, name)| name())).next()
    }

    /// The peripheral that drives the input port which the host would set at this address, with the register, in words.
    pub fn driver(&self, application: &Application<'_>, address: u16) -> Option<String> {
        self.peripherals.iter().find_map(|peripheral| {
            let registers = peripheral.kind.reads.iter().zip(&peripheral.reads);
            let is_it = |port: &str| application.find(port).is_ok_and(|place| place.set == Some(address));
            let (register, _) = registers.into_iter().find(|(_, port)| port.as_deref().is_some_and(is_it))?;
            let Peripheral { name, kind, .. } = peripheral;
            Some(format!("the register `{}` of the peripheral `{name}` ({})", register.name, kind.name))
        })
    }

    /// The board that a wiring is for, if the wiring's text names a board.
    ///
    /// # Errors
    /// If the text is not a wiring, or the name of the board is not a string.
    pub fn board(file: &str, text: &str) -> Result<Option<String>, Vec<Mistake>> {
        let document = Document::new(file, text);
        let board = keys(&document).map(|top| top.string("board").map(|board| board.value));
        document.finish(board)
    }

    /// Reads a wiring for a board from the text of a file.
    ///
    /// # Errors
    /// Lists every mistake of the text, in the order of the file.
    pub fn read(file: &str, text: &str, board: &Board) -> Result<Wiring, Vec<Mistake>> {
        let document = Document::new(file, text);
        let wiring = keys(&document).and_then(|top| Reader::new(&document, board).wiring(&top));
        document.finish(wiring)
    }

    /// Checks that a program, or a system, has the ports that the wiring names, with types that fit. `text` is the text of the wiring's
    /// file.
    ///
    /// # Errors
    /// All ports that the application does not have, or that do not fit; for a system, also everything else that a board does not
    /// support.
    pub fn check<'a>(
        &self,
        file: &str,
        text: &str,
        application: impl Into<Application<'a>>,
    ) -> Result<(), Vec<Mistake>> {
        let (document, application) = (Document::new(file, text), application.into());
        let mut driven: BTreeMap<usize, &str> = BTreeMap::new();
        let (mut all, mut missing) = (0, 0);
        for peripheral in &self.peripherals {
            for (port, direction, place) in &peripheral.ports {
                all += 1;
                let found = match application.connect(*direction, port) {
                    Ok(found) => found,
                    Err(text) => {
                        missing += 1;
                        document.mistake(place, text);
                        continue;
                    }
                };
                if *direction == Direction::Input
                    && let Some(other) = driven.insert(found.number, &peripheral.name)
                {
                    let text = format!("input port `{port}` is driven twice: `{other}` drives it too");
                    document.mistake(place, text);
                }
                self.check_type(&document, peripheral, (port.as_str(), found.ty), *direction, place);
            }
        }
        // The file's first line, so that this comes before the ports.
        if missing >= FOREIGN && 2 * missing > all {
            let what = if application.is_program() { "program" } else { "system" };
            let text = format!(
                "this wiring belongs to another {what}: of its {all} ports {missing} are not those of this {what}"
            );
            document.mistake(&(0..0), text);
        }
        if let Some(flash) = &self.flash
            && let Ok(contents) = image(application.clone())
            && let Some(text) = flash.overlap(contents.room)
        {
            document.mistake(&flash.place, text);
        }
        if let Some(scope) = &self.scope {
            let cores = &application.description().cores;
            let names = || cores.iter().map(|core| core.name.as_str()).collect::<Vec<_>>().join(", ");
            let text = match &scope.core {
                Some(_) if application.is_program() => {
                    Some("`core` is for a system of several cores; this is a single program".to_owned())
                }
                Some(core) if application.description().core_named(core).is_none() => {
                    Some(format!("the system has no core `{core}`; there are {}", names()))
                }
                None if !application.is_program() => Some(format!(
                    "a scope records one core of a system: `core = \"NAME\"`, one of {}",
                    names()
                )),
                _ => None,
            };
            text.into_iter().for_each(|text| document.mistake(&scope.place, text));
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
        // The tick of a program is the wiring's period.
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

/// The table `[second_core]`: cycles by which second cores are later.
fn second_core(table: &Table<'_>) -> u32 {
    let delay = table.integer("delay", 1, MOST_DELAY).map_or(DELAY, |at| at.value);
    table.reject_unknown_keys(&[]);
    delay
}

/// The reader of a wiring.
struct Reader<'a> {
    document: &'a Document<'a>,
    board: &'a Board,
    /// Pins that are in use: the name of the user, and the line.
    used: BTreeMap<String, (String, usize)>,
    /// Carriers of the file.
    carriers: Carriers,
    /// Names in `trips`, with their places.
    trips: Vec<Located<String>>,
    /// The clock in MHz.
    clock: f64,
}

/// Message about an invalid name of a peripheral or a carrier; `None` for a valid one.
pub(crate) fn unnamed(name: &str, what: &str) -> Option<String> {
    let letters = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    let is_name =
        name.starts_with(|c: char| c.is_ascii_lowercase()) && name.chars().all(letters) && name.len() <= 32;
    (!is_name).then(|| {
        format!("`{name}` is not a name for {what}: at most 32 small letters, digits and _, a letter first")
    })
}

impl<'a> Reader<'a> {
    fn new(document: &'a Document<'a>, board: &'a Board) -> Reader<'a> {
        Reader {
            document,
            board,
            used: BTreeMap::new(),
            carriers: Carriers::default(),
            trips: Vec::new(),
            clock: board.clock.1,
        }
    }

    fn wiring(mut self, top: &Table<'a>) -> Option<Wiring> {
        let mistake = |place: &Range<usize>, text: String| self.document.mistake(place, text);
        if let Some(wanted) = top.string("board").filter(|wanted| wanted.value != self.board.name) {
            let text =
                format!("this wiring is for the board `{}`, not for `{}`", wanted.value, self.board.name);
            mistake(&wanted.place, text);
        }
        let clock = top.number("clock", 4.0, 400.0).map_or(self.board.clock.1, |at| at.value);
        (self.carriers, self.clock) = (carrier::read(self.document, top, clock), clock);
        let cycles = |at: Located<f64>, least: u32| {
            let cycles = (at.value * clock).round();
            let range = f64::from(least)..=f64::from(MOST_PERIOD);
            if range.contains(&cycles) {
                return Some(cycles as u32);
            }
            mistake(
                &at.place,
                format!(
                    "{} µs are {cycles} cycles of {clock} MHz; expected {least} to {MOST_PERIOD}",
                    at.value
                ),
            );
            None
        };
        let most = f64::from(MOST_PERIOD);
        let given = top.number("period", 0.0, most);
        let period = match (&self.carriers.tick, given) {
            (Some((_, period)), None) => Some(*period),
            (Some((tick, period)), Some(at)) => {
                let name = &self.carriers.all[tick.carrier].name;
                mistake(
                    &at.place,
                    format!("the carrier `{name}` gives a tick every {period} cycles: leave out `period`"),
                );
                None
            }
            (None, given) => top.need("period", given).and_then(|at| cycles(at, 64)),
        };
        let lead = match top.number("lead", 0.0, most) {
            Some(at) => {
                let place = at.place.clone();
                let lead = cycles(at, 0);
                if let (Some(lead), Some(period)) = (lead, period)
                    && lead >= period
                {
                    mistake(&place, "`lead` must be shorter than the period".to_owned());
                }
                lead
            }
            None => Some(0),
        };
        let baud = self.baud(top, clock);
        let autostart = top.boolean("autostart").is_some_and(|at| at.value);
        let deadlines = top.integer("deadlines", 1, 65535).map_or(1, |at| at.value);
        let host = top.integer("host", 0, 65535).map_or(0, |at| at.value);
        let uart = top.boolean("uart").is_none_or(|at| at.value);
        if !uart {
            self.check_alone(top);
        }
        let observe = top.boolean("observe").map_or(uart, |at| at.value);
        let clock_watch = self.clock_watch(top);
        let mut signals = [const { None }; SIGNALS.len()];
        if let Some(table) = top.table("signals") {
            for (signal, pin) in SIGNALS.iter().zip(&mut signals) {
                *pin = table.string(signal.name).and_then(|at| self.pin(at, signal.name));
            }
            table.reject_unknown_keys(&[]);
        }
        let second_core = top.table("second_core").map(|table| second_core(&table));
        let ecc = top.boolean("ecc").is_some_and(|at| at.value);
        let flash = top.table("flash").and_then(|table| self.flash(&table));
        let scope = top.table("scope").map(|table| self.scope(&table));
        let mut peripherals = Vec::new();
        for (name, table) in top.table("peripheral").iter().flat_map(Table::tables) {
            if peripherals.len() == PERIPHERALS {
                self.document.mistake(&name.place, format!("there are more than {PERIPHERALS} peripherals"));
                break;
            }
            peripherals.extend(self.peripheral(name, &table));
        }
        self.check_trips(&peripherals);
        top.reject_unknown_keys(&[]);
        Some(Wiring {
            clock,
            period: period?,
            lead: lead?,
            uart,
            baud: baud.map_or(BAUD, |at| at.value),
            autostart,
            deadlines,
            host,
            clock_watch,
            safety: Safety { ecc, second_core },
            observe,
            signals,
            tick: self.carriers.tick.map(|(tick, _)| tick),
            carriers: self.carriers.all,
            flash,
            scope,
            peripherals,
        })
    }

    /// Checks that a board without a UART starts by itself, and that nothing of the wiring is for a host.
    fn check_alone(&self, top: &Table<'a>) {
        let starts = top.boolean("autostart");
        if !starts.as_ref().is_some_and(|at| at.value) {
            let place = starts.map(|at| at.place).or_else(|| top.place_of("uart")).unwrap_or(0..0);
            self.document.mistake(
                &place,
                "without a UART nobody starts the program: `uart = false` needs `autostart = true`",
            );
        }
        let is_on = top.boolean("observe").is_some_and(|at| at.value);
        for key in ["baud", "host", "flash", "scope"].into_iter().chain(is_on.then_some("observe")) {
            if let Some(place) = top.place_of(key) {
                let text = format!(
                    "`{key}` is for a host, which `uart = false` leaves out: leave out one of the two"
                );
                self.document.mistake(&place, text);
            }
        }
    }

    /// The key `clock_watch`, for a device with an oscillator.
    fn clock_watch(&self, top: &Table<'a>) -> bool {
        let Some(at) = top.boolean("clock_watch").filter(|at| at.value) else { return false };
        let family = self.board.family;
        if family.oscillator.is_none() {
            let text = format!(
                "`clock_watch` needs an oscillator within the device, which {} does not have: the signal `watchdog` is for a \
                 watchdog beside the FPGA",
                family.text
            );
            self.document.mistake(&at.place, text);
        }
        true
    }

    /// The table `[flash]`: pins, and the addresses of the two images.
    fn flash(&mut self, table: &Table<'a>) -> Option<Flash> {
        let mut pins = [const { None }; flash::PINS.len()];
        if let Some(list) = table.need("pins", table.table("pins")) {
            for ((name, _), pin) in flash::PINS.into_iter().zip(&mut pins) {
                let at = list.need(name, list.string(name));
                *pin =
                    at.and_then(|at| if name == "clock" { self.flash_clock(at) } else { self.pin(at, name) });
            }
            list.reject_unknown_keys(&[]);
        }
        let address = |key| {
            let at = table.need(key, table.integer(key, 0, flash::REACH - 1))?;
            if at.value % flash::SECTOR != 0 {
                let text = format!(
                    "an image begins at a multiple of {} bytes (0x{:x})",
                    flash::SECTOR,
                    flash::SECTOR
                );
                self.document.mistake(&at.place, text);
            }
            Some(at.value)
        };
        let (first, second) = (address("first"), address("second"));
        table.reject_unknown_keys(&[]);
        let [select, clock, out, input] = pins;
        Some(Flash {
            pins: [select?, clock?, out?, input?],
            slots: [first?, second?],
            place: table.place.clone(),
        })
    }

    /// The clock of a flash: a pin, or [`flash::MCLK`].
    fn flash_clock(&mut self, at: Located<String>) -> Option<String> {
        if at.value != flash::MCLK {
            return self.pin(at, "clock");
        }
        let family = self.board.family;
        if family.flash_clock.is_none() {
            let known: Vec<&str> = FAMILIES
                .iter()
                .filter(|family| family.flash_clock.is_some())
                .map(|family| family.text)
                .collect();
            let text = format!(
                "`{}` is the clock of the flash that a {} is configured from; on {} it is a pin, or none",
                at.value,
                known.join(", "),
                family.text
            );
            self.document.mistake(&at.place, text);
        }
        Some(at.value)
    }

    /// The table `[scope]`: channels and samples are powers of two.
    fn scope(&self, table: &Table<'a>) -> ScopeRequest {
        let power = |key, least, most| {
            let at = table.integer(key, least, most)?;
            if !at.value.is_power_of_two() {
                let text = format!(
                    "`{key}` must be a power of two from {least} to {most}: {} is not, {} is",
                    at.value,
                    at.value.next_power_of_two().min(most)
                );
                self.document.mistake(&at.place, text);
            }
            Some(at.value)
        };
        let channels = power("channels", 1, MOST_CHANNELS);
        let depth = power("depth", LEAST_DEPTH, MOST_DEPTH);
        let core = table.string("core").map(|at| at.value);
        table.reject_unknown_keys(&[]);
        if let (Some(channels), Some(depth)) = (channels, depth)
            && channels * depth > MOST_WORDS
        {
            let text = format!(
                "{channels} channels of {depth} samples are {} words; a host has addresses for {MOST_WORDS}",
                channels * depth
            );
            self.document.mistake(&table.place, text);
        }
        ScopeRequest { channels, depth, core, place: table.place.clone() }
    }

    /// Reads the baud rate, which a divider of the clock must approximate.
    fn baud(&self, top: &Table<'a>, clock: f64) -> Option<Located<u32>> {
        let baud = top.integer("baud", 9600, 12_000_000);
        if let Some(baud) = &baud {
            let divide = clock * 1e6 / f64::from(baud.value);
            let error = (divide.round() / divide - 1.0).abs();
            if !(4.0..=65535.0).contains(&divide.round()) || error > 0.02 {
                self.document.mistake(
                    &baud.place,
                    format!(
                        "{} baud are {divide:.2} cycles of {clock} MHz; that must be 4 to 65535, within 2 % of a whole number",
                        baud.value
                    ),
                );
            }
        }
        baud
    }

    /// Marks a pin of the board as used; returns its name.
    fn pin(&mut self, pin: Located<String>, by: &str) -> Option<String> {
        if self.board.site(&pin.value).is_none() {
            let names: Vec<&str> = self.board.pins.iter().map(|(name, _)| name.as_str()).collect();
            let some = names.iter().take(6).copied().collect::<Vec<_>>().join(", ");
            let text = format!(
                "`{}` is not a pin of {}; it has {some} … ({} in all: `takt board pins {}`)",
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

    fn peripheral(&mut self, name: Located<String>, table: &Table<'a>) -> Option<Peripheral> {
        let document = self.document;
        if let Some(text) = unnamed(&name.value, "a peripheral") {
            document.mistake(&name.place, text);
        }
        let given = table.need("kind", table.string("kind"))?;
        let Some(kind) = Kind::from_name(&given.value) else {
            let kinds: Vec<&str> = KINDS.iter().map(|kind| kind.name).collect();
            let text =
                format!("`{}` is not a kind of peripheral; there are {}", given.value, kinds.join(", "));
            document.mistake(&given.place, text);
            return None;
        };
        let parameters = kind.parameters.iter().map(|parameter| self.parameter(table, parameter)).collect();
        let Times { starts, latch, carrier } = self.times(kind, table);
        let trips = if kind.strobes.enable { table.strings("trips").unwrap_or_default() } else { Vec::new() };
        self.trips.extend(trips.iter().cloned());
        let trips = trips.into_iter().map(|at| at.value).collect();
        let mut pins = vec![None; kind.pins.len()];
        if let Some(list) = table.need("pins", table.table("pins")) {
            for (i, pin) in kind.pins.iter().enumerate() {
                let given = list.string(pin.name);
                let given = if pin.optional { given } else { list.need(pin.name, given) };
                pins[i] = given.and_then(|at| self.pin(at, &name.value));
            }
            list.reject_unknown_keys(&[]);
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
            list.reject_unknown_keys(&[]);
        }
        for (key, _) in &scales {
            if !kind.writes.iter().any(|register| register.name == key.value) {
                let text =
                    format!("`{}` is not a register of a {} that a program writes", key.value, kind.name);
                document.mistake(&key.place, text);
            }
        }
        table.reject_unknown_keys(&[]);
        Some(Peripheral {
            name: name.value,
            kind,
            parameters,
            pins,
            starts,
            latch,
            carrier,
            trips,
            reads,
            writes,
            ports,
        })
    }

    /// The exponent of a scale, which is a power of two.
    fn scale(&self, scaled: bool, register: &str, at: &Located<f64>) -> Option<i32> {
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

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Pins of a simulated board under their user-visible names, driven by commands from a script or standard input, or by a plant at two
//! pipes.

use super::text;
use crate::run::ports;
use crate::terminal::files::{self, Out};
use crate::terminal::number;
use crate::terminal::options::suggest;
use crate::terminal::output;
use crate::terminal::progress::{self, DelayedProgress};
use anyhow::{Context, Result, anyhow, bail};
use std::collections::VecDeque;
use std::io::{BufRead, BufReader, IsTerminal, Read, Write};
use std::path::Path;
use std::sync::mpsc::{Receiver, TryRecvError, sync_channel};
use takt_board::kind::Direction;
use takt_board::simulation::{EncoderMotion, Simulation};
use takt_board::terminal::Terminal;
use takt_board::top::RESET;
use takt_board::wiring::SIGNALS;
use takt_board::{Board, Wiring};
use takt_debug::inputs::Table;
use takt_isa::program::Port;
use takt_isa::{Register, Type};

/// Maximum length of a command line in bytes.
const LINE: u64 = 4096;
/// Number of lines read from standard input in advance.
const AHEAD: usize = 64;

/// A pin: user-visible name, and name in the circuit.
#[derive(Clone)]
struct Pin {
    name: String,
    /// Name of the peripheral, if the pin is its only input.
    short: Option<String>,
    circuit: String,
}

/// An encoder, which can be set by its count as well as by its pins.
struct Encoder {
    name: String,
    start: i32,
}

/// Pins of a simulated board.
pub(crate) struct Pins {
    inputs: Vec<Pin>,
    outputs: Vec<Pin>,
    encoders: Vec<Encoder>,
}

impl Pins {
    /// Pins of a wiring on a board; pins in `taken` are driven elsewhere.
    pub(crate) fn new(board: &Board, wiring: &Wiring, taken: &[&str]) -> Pins {
        let (mut inputs, mut outputs, mut encoders) = (Vec::new(), Vec::new(), Vec::new());
        for (signal, _) in SIGNALS.iter().zip(&wiring.signals).filter(|(_, pin)| pin.is_some()) {
            let circuit = format!("signal_{}", signal.name);
            let pin = Pin { name: signal.name.to_owned(), short: None, circuit };
            if signal.direction == Direction::Input { inputs.push(pin) } else { outputs.push(pin) }
        }
        if board.reset.is_some() {
            inputs.push(Pin { name: "button".to_owned(), short: None, circuit: "button".to_owned() });
        }
        for peripheral in &wiring.peripherals {
            let of = |direction: Direction| {
                let pins = peripheral.kind.pins.iter().zip(&peripheral.pins);
                let pins = pins.filter(|(pin, at)| pin.direction == direction && at.is_some());
                pins.map(|(pin, _)| pin.name).collect::<Vec<_>>()
            };
            let pin = |pin: &str, short: bool| Pin {
                name: format!("{}.{pin}", peripheral.name),
                short: short.then(|| peripheral.name.clone()),
                circuit: format!("{}_{pin}", peripheral.name),
            };
            outputs.extend(of(Direction::Output).into_iter().map(|name| pin(name, false)));
            if taken.contains(&peripheral.name.as_str()) {
                continue;
            }
            let own = of(Direction::Input);
            inputs.extend(own.iter().map(|name| pin(name, own.len() == 1)));
            if peripheral.kind.name == "quadrature" {
                let start = peripheral.parameter("start").cast_signed();
                encoders.push(Encoder { name: peripheral.name.clone(), start });
            }
        }
        Pins { inputs, outputs, encoders }
    }

    /// Name in the circuit of an input pin.
    ///
    /// # Errors
    /// If there is no such input pin; in words, with the nearest name.
    pub(super) fn circuit(&self, name: &str) -> Result<&str, String> {
        self.input(name).map(|pin| pin.circuit.as_str())
    }

    /// Parses wires such as `pulse.high=pulses.in` into outputs and inputs of the circuit. The inputs are not driven otherwise.
    ///
    /// # Errors
    /// If a wire is malformed, or does not lead from an output pin to an input pin that nothing else drives.
    pub(super) fn wires<'a>(
        &mut self,
        texts: impl IntoIterator<Item = &'a str>,
    ) -> Result<Vec<(String, String)>, String> {
        let mut wires: Vec<(String, String)> = Vec::new();
        for text in texts {
            let (from, to) = text.split_once('=').ok_or_else(|| {
                format!("`{text}` is not `output=input`, two pins, as in `pulse.high=pulses.in`")
            })?;
            let Some(output) = self.outputs.iter().find(|pin| pin.name == from) else {
                let names: Vec<&str> = self.outputs.iter().map(|pin| &*pin.name).collect();
                let near = suggest(from, names.iter().copied());
                return Err(format!("{text}: no output pin `{from}`{near}; there are {}", names.join(", ")));
            };
            let input = self.circuit(to).map_err(|reason| format!("{text}: {reason}"))?;
            if wires.iter().any(|(_, known)| known == input) {
                return Err(format!("{text}: another wire leads to `{to}`"));
            }
            wires.push((output.circuit.clone(), input.to_owned()));
        }
        let inputs: Vec<String> = wires.iter().map(|(_, input)| input.clone()).collect();
        self.leave_out(&inputs);
        Ok(wires)
    }

    /// Name for users of an output pin in the circuit.
    pub(super) fn shown<'p>(&'p self, circuit: &'p str) -> &'p str {
        self.output_name(circuit).unwrap_or(circuit)
    }

    /// Leaves out input pins of the circuit that are driven elsewhere.
    pub(super) fn leave_out(&mut self, circuit: &[String]) {
        self.inputs.retain(|pin| !circuit.contains(&pin.circuit));
    }

    /// Name of an input pin for a user, from its name in the circuit.
    pub(crate) fn input_name(&self, circuit: &str) -> Option<&str> {
        self.inputs.iter().find(|pin| pin.circuit == circuit).map(|pin| pin.name.as_str())
    }

    /// Name of an output pin for a user, from its name in the circuit.
    pub(crate) fn output_name(&self, circuit: &str) -> Option<&str> {
        self.outputs.iter().find(|pin| pin.circuit == circuit).map(|pin| pin.name.as_str())
    }

    /// Encoders: name of each, names of its two pins in the circuit, and its initial count.
    pub(crate) fn encoders(&self) -> impl Iterator<Item = (&str, [String; 2], i32)> {
        self.encoders.iter().map(|encoder| {
            (encoder.name.as_str(), ["a", "b"].map(|pin| format!("{}_{pin}", encoder.name)), encoder.start)
        })
    }

    /// Finds an input pin by name. If a signal and a peripheral share the name, the signal's pin is chosen.
    fn input(&self, name: &str) -> Result<&Pin, String> {
        let of = |name: &str, short: bool| {
            self.inputs
                .iter()
                .find(|pin| if short { pin.short.as_deref() } else { Some(&*pin.name) } == Some(name))
        };
        of(name, false).or_else(|| of(name, true)).ok_or_else(|| {
            if self.outputs.iter().any(|pin| pin.name == name) {
                return format!("`{name}` is an output pin, which the board drives");
            }
            if self.inputs.is_empty() {
                return format!("no input pin `{name}`: this wiring has none");
            }
            let names: Vec<&str> = self.inputs.iter().map(|pin| &*pin.name).collect();
            let shorts = self.inputs.iter().filter_map(|pin| pin.short.as_deref());
            let near = suggest(name, names.iter().copied().chain(shorts));
            format!("no input pin `{name}`{near}; there are {}", names.join(", "))
        })
    }

    /// Short names of inputs as columns of a table, with their pins.
    fn shorts(&self) -> (Vec<(String, Type)>, Vec<&Pin>) {
        let is_other = |short: &str| self.inputs.iter().any(|pin| pin.name == short);
        let shorts = self.inputs.iter().filter_map(|pin| Some((pin.short.as_ref()?, pin)));
        shorts
            .filter(|(short, _)| !is_other(short))
            .map(|(short, pin)| ((short.clone(), Type::B), pin))
            .unzip()
    }

    /// Parses assignments such as `limit=1` into pins of the circuit with their levels.
    ///
    /// # Errors
    /// If an assignment is malformed or names no input pin.
    pub(super) fn levels<'a>(
        &self,
        texts: impl IntoIterator<Item = &'a str>,
    ) -> Result<Vec<(String, bool)>, String> {
        let level = |text: &'a str| {
            let (name, level) = text.split_once('=').ok_or_else(|| format!("`{text}` is not `pin=level`"))?;
            let level = match level {
                "0" => false,
                "1" => true,
                _ => return Err(format!("`{text}`: a pin's level is 0 or 1")),
            };
            Ok((self.input(name)?.circuit.clone(), level))
        };
        texts.into_iter().map(level).collect()
    }
}

/// A command of a pin script.
enum Command {
    Set(Vec<(String, bool)>),
    /// Number of cycles to wait.
    Wait(u64),
    Show,
    Quit,
}

impl Command {
    /// Parses a command line; `None` for a blank line or a comment.
    fn parse(line: &str, pins: &Pins, clock: f64) -> Result<Option<Command>, String> {
        let line = line.split('#').next().unwrap_or_default().trim();
        let (word, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let alone = |command: Command| match rest {
            "" => Ok(Some(command)),
            _ => Err(format!("`{word}` takes no arguments, found `{}`", rest.trim())),
        };
        match word {
            "" => Ok(None),
            "set" if rest.trim().is_empty() => Err("`set` needs `pin=level`, as in `set limit=1`".to_owned()),
            "set" => pins.levels(rest.split_whitespace()).map(|levels| Some(Command::Set(levels))),
            "wait" => {
                let time =
                    number::time(rest).map_err(|reason| format!("`wait {}`: {reason}", rest.trim()))?;
                Ok(Some(Command::Wait(time.cycles(clock))))
            }
            "show" => alone(Command::Show),
            "quit" => alone(Command::Quit),
            _ => Err(format!(
                "no command `{word}`; there are `set pin=level …`, `wait 5ms`, `show` and `quit`"
            )),
        }
    }
}

/// Source of pin commands: a file or standard input.
enum Source {
    File(VecDeque<Command>),
    /// Lines of standard input as they arrive, with the number of the last line.
    Live {
        lines: Receiver<std::io::Result<String>>,
        number: usize,
        terminal: bool,
    },
}

/// A script in execution.
pub(super) struct Script<'a> {
    pins: &'a Pins,
    clock: f64,
    source: Source,
    /// Cycle at which the current `wait` ends.
    until: u64,
    /// Messages on standard error are coloured.
    color: bool,
}

impl<'a> Script<'a> {
    /// Opens a script; a file is parsed completely in advance.
    pub(super) fn open(path: &Path, pins: &'a Pins, wiring: &Wiring, color: bool) -> Result<Script<'a>> {
        let clock = wiring.clock;
        let source = if files::is_dash(path) {
            Source::Live { lines: listen(), number: 0, terminal: std::io::stdin().is_terminal() }
        } else {
            let (name, text) = text(path)?;
            let mut commands = VecDeque::new();
            for (line, number) in text.lines().zip(1..) {
                let command = Command::parse(line, pins, clock);
                commands.extend(command.map_err(|reason| anyhow!("{name}:{number}: {reason}"))?);
            }
            Source::File(commands)
        };
        Ok(Script { pins, clock, source, until: 0, color })
    }

    /// Executes all due commands; returns whether the simulation ends.
    pub(super) fn act(&mut self, sim: &mut Simulation, out: &mut Out) -> Result<bool> {
        while sim.cycles >= self.until {
            let Some(command) = self.next()? else { return Ok(false) };
            match command {
                Command::Set(levels) => levels.iter().for_each(|(pin, level)| sim.set(pin, *level)),
                Command::Wait(cycles) => {
                    // In a file, a wait starts at the end of the previous wait, so that the lengths of runs do not accumulate; an
                    // interactive wait starts now.
                    let from = if matches!(self.source, Source::File(_)) { self.until } else { sim.cycles };
                    self.until = from.saturating_add(cycles);
                }
                Command::Show => self.show(sim, out)?,
                Command::Quit => return Ok(true),
            }
        }
        Ok(false)
    }

    /// Limits the length of the next run to the next command.
    pub(super) fn at_most(&self, now: u64, cycles: u32) -> u32 {
        match self.until.saturating_sub(now) {
            0 => cycles,
            left => u32::try_from(left).unwrap_or(u32::MAX).min(cycles),
        }
    }

    fn next(&mut self) -> Result<Option<Command>> {
        let Source::Live { lines, number, terminal } = &mut self.source else {
            let Source::File(commands) = &mut self.source else { return Ok(None) };
            return Ok(commands.pop_front());
        };
        loop {
            let line = match lines.try_recv() {
                Ok(line) => line.context("cannot read standard input")?,
                Err(TryRecvError::Empty | TryRecvError::Disconnected) => return Ok(None),
            };
            *number += 1;
            match Command::parse(&line, self.pins, self.clock) {
                Ok(None) => {}
                Ok(command) => return Ok(command),
                Err(reason) if *terminal => output::error(&reason, self.color),
                Err(reason) => bail!("standard input:{number}: {reason}"),
            }
        }
    }

    fn show(&self, sim: &Simulation, out: &mut Out) -> Result<()> {
        writeln!(out, "{:.3} ms", sim.cycles as f64 / self.clock / 1e3)?;
        for pin in &self.pins.inputs {
            let level = sim.inputs().find(|(name, _)| *name == pin.circuit).is_some_and(|(_, level)| level);
            writeln!(out, "  {} = {}", pin.name, u8::from(level))?;
        }
        for pin in &self.pins.outputs {
            let level = sim.output(&pin.circuit).is_some_and(|(level, _)| level);
            writeln!(out, "  {} = {} (output)", pin.name, u8::from(level))?;
        }
        Ok(out.flush()?)
    }
}

/// Starts a thread that reads lines of standard input.
fn listen() -> Receiver<std::io::Result<String>> {
    let (sender, lines) = sync_channel(AHEAD);
    std::thread::spawn(move || {
        let mut stdin = BufReader::new(std::io::stdin());
        loop {
            let mut line = String::new();
            let read = match (&mut stdin).take(LINE).read_line(&mut line) {
                Ok(0) => return,
                Ok(count) if count as u64 == LINE && !line.ends_with('\n') => {
                    Err(std::io::Error::other(format!("a line is longer than {LINE} bytes")))
                }
                Ok(_) => Ok(line),
                Err(error) => Err(error),
            };
            let failed = read.is_err();
            if sender.send(read).is_err() || failed {
                return;
            }
        }
    });
    lines
}

/// A user's plant at the pins: exchanges one row of inputs and one row of outputs per period.
pub(super) struct Plant<'a> {
    pub(super) pins: &'a Pins,
    pub(super) wiring: &'a Wiring,
    pub(super) inputs: &'a Path,
    pub(super) outputs: Option<&'a Path>,
}

/// Pins that a column of the table drives.
enum Column<'a> {
    Pin(&'a Pin),
    /// Encoder: indices of its two pins among the simulation's inputs, and the previous count.
    Encoder([usize; 2], i32),
}

impl Plant<'_> {
    /// Runs until the rows end or the cycle limit is reached; returns the simulation.
    pub(super) fn run(
        &self,
        simulation: impl FnOnce() -> Result<Simulation>,
        cycles: Option<u64>,
        out: &mut Out,
    ) -> Result<Simulation> {
        let names = self.pins.inputs.iter().map(|pin| (pin.name.clone(), Type::B));
        let counts = self.pins.encoders.iter().map(|encoder| (encoder.name.clone(), Type::I));
        let (shorts, short_pins) = self.pins.shorts();
        let ports = names.chain(counts).chain(shorts).enumerate();
        let ports = ports.filter_map(|(i, (name, ty))| Some(Port { name, register: Register::new(i)?, ty }));
        let ports: Vec<Port> = ports.collect();
        let open = || {
            let name = files::input_name(self.inputs);
            Table::of_some(name, files::open(self.inputs)?, &ports).map_err(|error| anyhow!(error))
        };
        let titles = self.pins.outputs.iter().map(|pin| pin.name.clone());
        let (mut table, mut outputs) = ports::open_both(Some(self.inputs), open, self.outputs, titles)?;
        let live = files::is_live(self.inputs);

        let mut sim = simulation()?;
        let mut columns: Vec<Column<'_>> = self.pins.inputs.iter().map(Column::Pin).collect();
        for encoder in &self.pins.encoders {
            let pins = ["a", "b"].map(|pin| sim.input(&format!("{}_{pin}", encoder.name)));
            let [Some(a), Some(b)] = pins else { bail!("`{}` has no pins", encoder.name) };
            // The encoder starts at its initial count, at rest.
            sim.turns.push(EncoderMotion { pins: [a, b], from: encoder.start, by: 0 });
            columns.push(Column::Encoder([a, b], encoder.start));
        }
        columns.extend(short_pins.into_iter().map(Column::Pin));
        let mut terminal = Terminal::new()?;
        let port = format!("{} {}", terminal.path().display(), self.wiring.baud);
        if self.outputs.is_some_and(files::is_dash) {
            output::message(&port);
        } else {
            writeln!(out, "{port}")?;
            out.flush()?;
        }
        // During reset, pins are undefined.
        sim.run(RESET, &[])?;
        let period = self.wiring.period;
        let bar = DelayedProgress::new(progress::rows(Some(self.inputs)), "periods");
        while cycles.is_none_or(|most| sim.cycles < most)
            && let Some(row) = table.next().map_err(|error| anyhow!(error))?.cloned()
        {
            for (register, bits) in row {
                match &mut columns[register.index()] {
                    Column::Pin(pin) => {
                        if bits > 1 {
                            bail!(
                                "{}: column {}: a pin's level is 0 or 1, not {bits}",
                                table.place(),
                                pin.name
                            );
                        }
                        sim.set(&pin.circuit, bits != 0);
                    }
                    Column::Encoder(pins, last) => {
                        let count = bits.cast_signed();
                        sim.turns.push(EncoderMotion {
                            pins: *pins,
                            from: *last,
                            by: count.wrapping_sub(*last),
                        });
                        *last = count;
                    }
                }
            }
            sim.run(period, &terminal.receive()?)?;
            bar.add(1);
            let received = sim.take_received();
            if !received.is_empty() {
                terminal.send(&received)?;
            }
            if let Some(outputs) = &mut outputs {
                let part = |pin: &Pin| {
                    let high = sim.output(&pin.circuit).map_or(0, |(_, high)| high);
                    (f64::from(high) / f64::from(period)).to_string()
                };
                ports::write_row(outputs, self.pins.outputs.iter().map(part))?;
                if live {
                    outputs.flush()?;
                }
            }
        }
        outputs.map_or(Ok(()), Out::finish)?;
        Ok(sim)
    }
}

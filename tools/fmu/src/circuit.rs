// SPDX-License-Identifier: MIT OR Apache-2.0
//! A board's circuit behind an instance: the simulation that Verilator made of the board's top level, as a child process, and the host at
//! its UART, which starts the program and stays in touch.

use crate::machine::Reason;
use crate::variables::{Causality, Source, Variable};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use takt_isa::Type;

/// Encoder, which is set by its count.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Encoder {
    /// Name of the variable.
    pub name: String,
    /// Indices of its two pins among the circuit's inputs.
    pub pins: [usize; 2],
    /// Count at power-up.
    pub start: i32,
}

/// Input pin of the circuit.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InputPin {
    /// Name of the variable; `None` for a pin of an encoder, which turns by its count.
    pub name: Option<String>,
    /// Level at power-up.
    pub level: bool,
}

/// Host's requests, as bytes at the UART.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Requests {
    /// Starts the program and enables its outputs; empty if the program starts by itself.
    pub start: Vec<u8>,
    /// Requests that change nothing, sent in turn so that the host is not silent; empty if the board allows silence.
    pub ask: Vec<Vec<u8>>,
    /// Periods from a request that changes nothing to the next, one at least.
    pub every: u32,
}

/// Board in simulation: its pins, files, and host.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Circuit {
    /// Name of the board.
    pub board: String,
    /// Cycles after power-up in which the circuit resets itself.
    pub reset: u32,
    /// Input pins, in the simulation's order.
    pub inputs: Vec<InputPin>,
    /// Encoders.
    pub encoders: Vec<Encoder>,
    /// Output pins by name, in the simulation's order.
    pub outputs: Vec<String>,
    /// Cores by name; the name of a single program's core is empty.
    pub cores: Vec<String>,
    /// Causes for which a core's outputs become safe, from the lowest bit on.
    pub causes: Vec<String>,
    /// Trips of the wiring by name, from the lowest bit on.
    pub trips: Vec<String>,
    /// Host's requests.
    pub requests: Requests,
    /// Files that the simulation reads, in `resources/circuit`.
    pub files: Vec<String>,
}

impl Circuit {
    /// Reason why the circuit has no meaning.
    pub(crate) fn mistake(&self) -> Option<&'static str> {
        let pin = |pin: &usize| *pin >= self.inputs.len();
        match () {
            () if self.encoders.iter().flat_map(|encoder| &encoder.pins).any(pin) => {
                Some("an encoder is at a pin that the circuit does not have")
            }
            () if self.requests.every == 0 => Some("the host's requests must be a period apart at least"),
            () => None,
        }
    }

    /// Variables, in the order of their value references: levels, counts, and for each output the part of the step.
    pub(crate) fn variables(&self) -> Vec<Variable> {
        let levels = self.inputs.iter().enumerate().filter_map(|(pin, input)| {
            let name = input.name.clone()?;
            let mut level = Variable::new(name, Type::B, Causality::Input, Source::Level(pin));
            (level.start, level.description) = (input.level.into(), "Level of the pin");
            Some(level)
        });
        let counts = self.encoders.iter().enumerate().map(|(encoder, of)| {
            let mut count = Variable::new(of.name.clone(), Type::I, Causality::Input, Source::Count(encoder));
            (count.start, count.description) =
                (of.start.cast_unsigned(), "Count to which the encoder turns in the step's first period");
            count
        });
        let parts = self.outputs.iter().enumerate().map(|(pin, name)| {
            let mut part = Variable::new(name.clone(), Type::F, Causality::Output, Source::Part(pin));
            part.description = "Part of the last period in which the pin was 1";
            part
        });
        levels.chain(counts).chain(parts).collect()
    }
}

/// Board with its state.
pub(crate) struct Board {
    circuit: Circuit,
    /// Cycles of a period.
    period: u32,
    /// Folder with the simulation and its files; empty for a model that was not read from a folder.
    folder: PathBuf,
    simulation: Option<process::Simulation>,
    levels: Vec<bool>,
    /// Count of each encoder as set, and as it stands.
    counts: Vec<[i32; 2]>,
    /// Part of the last period in which each output was 1.
    parts: Vec<f32>,
    /// Number of requests that change nothing, periods since the last one, and whether it is answered.
    asked: usize,
    since: u32,
    is_answered: bool,
}

/// Cycles after which the host looks for the answer to its start.
const SLICE: u32 = 256;
/// Most cycles that the answer takes: a UART of 115200 baud at 200 MHz needs 300 000 for 16 bytes each way.
const PATIENCE: u64 = 5_000_000;
/// First byte of an answer, and its number of bytes without words (docs/protocol.md).
const ANSWER: (u8, usize) = (0x5a, 6);
/// Words of a moment in which outputs became safe.
const MOMENT: usize = 10;

impl Board {
    pub(crate) fn new(circuit: &Circuit, period: u32, folder: &Path) -> Board {
        let mut board = Board {
            circuit: circuit.clone(),
            period,
            folder: folder.to_owned(),
            simulation: None,
            levels: Vec::new(),
            counts: Vec::new(),
            parts: Vec::new(),
            asked: 0,
            since: 0,
            is_answered: true,
        };
        board.reset();
        board
    }

    /// Ends the simulation; the next start begins another.
    pub(crate) fn reset(&mut self) {
        self.simulation = None;
        self.levels = self.circuit.inputs.iter().map(|input| input.level).collect();
        self.counts = self.circuit.encoders.iter().map(|encoder| [encoder.start; 2]).collect();
        self.parts = vec![0.0; self.circuit.outputs.len()];
        (self.asked, self.since, self.is_answered) = (0, 0, true);
    }

    pub(crate) fn set_level(&mut self, pin: usize, level: bool) {
        self.levels[pin] = level;
    }

    pub(crate) fn set_count(&mut self, encoder: usize, count: i32) {
        self.counts[encoder][0] = count;
    }

    pub(crate) fn part(&self, pin: usize) -> f32 {
        self.parts[pin]
    }

    /// Starts the simulation, waits for the end of the reset, and lets the host start the program. Encoders stand.
    pub(crate) fn start(&mut self) -> Result<(), Reason> {
        self.simulation = Some(process::Simulation::start(&self.folder, self.circuit.outputs.len())?);
        for encoder in 0..self.counts.len() {
            self.stand(encoder);
        }
        self.run_cycles(self.circuit.reset, &[])?;
        if self.circuit.requests.start.is_empty() {
            return Ok(());
        }
        let (mut bytes, mut answer, mut cycles) = (self.circuit.requests.start.clone(), Vec::new(), 0);
        while answer.len() < ANSWER.1 {
            if cycles >= PATIENCE {
                return Err("the board does not answer its host".to_owned());
            }
            answer.extend(self.run_cycles(SLICE, &bytes)?.received);
            bytes.clear();
            cycles += u64::from(SLICE);
        }
        match answer[..] {
            [first, _, 0, 0, ..] if first == ANSWER.0 => Ok(()),
            _ => Err(format!("the board does not start its program: it answers {answer:02x?}")),
        }
    }

    /// The pins of an encoder are at the count where it stands.
    fn stand(&mut self, encoder: usize) {
        let [a, b] = self.circuit.encoders[encoder].pins;
        let count = self.counts[encoder][1].cast_unsigned();
        self.levels[a] = count.wrapping_add(1) >> 1 & 1 == 1;
        self.levels[b] = count >> 1 & 1 == 1;
    }

    /// Runs a period: `number` of those before it. Adds warnings.
    pub(crate) fn run(&mut self, number: u64, warnings: &mut Vec<String>) -> Result<(), Reason> {
        self.since = self.since.saturating_add(1);
        let mut bytes = Vec::new();
        let Requests { ask, every, .. } = &self.circuit.requests;
        if self.is_answered && self.since >= *every && !ask.is_empty() {
            bytes.clone_from(&ask[self.asked % ask.len()]);
            (self.asked, self.since, self.is_answered) = (self.asked + 1, 0, false);
        }
        let mut turns = Vec::new();
        for (encoder, [to, from]) in self.circuit.encoders.iter().zip(&mut self.counts) {
            turns.push((encoder.pins, *from, to.wrapping_sub(*from)));
            *from = *to;
        }
        let simulation = self.simulation.as_mut().ok_or("the simulation has ended")?;
        let answer = simulation.run(self.period, &self.levels, &turns, &bytes)?;
        for encoder in 0..self.counts.len() {
            self.stand(encoder);
        }
        self.is_answered |= !answer.received.is_empty();
        let period = self.period as f32;
        self.parts = answer.high.iter().map(|&cycles| cycles as f32 / period).collect();
        for moment in answer.moments.chunks_exact(MOMENT) {
            warnings.push(format!("period {number}: {}", self.moment(moment)));
        }
        Ok(())
    }

    /// A moment in words.
    fn moment(&self, words: &[u32]) -> String {
        let names = |all: &[String], bits: u32| -> String {
            let named = all.iter().enumerate().filter(|(bit, _)| bits >> *bit & 1 == 1);
            named.map(|(_, name)| name.as_str()).collect::<Vec<_>>().join(", ")
        };
        let (cycle, core, cause, trips) = (words[0], words[1] as usize, words[2], words[MOMENT - 1]);
        if trips != 0 {
            return format!("cycle {cycle}: a trip is held: {}", names(&self.circuit.trips, trips));
        }
        let core = self.circuit.cores.get(core).filter(|name| !name.is_empty());
        let core = core.map_or(String::new(), |name| format!("core {name}: "));
        format!("cycle {cycle}: the outputs become safe: {core}{}", names(&self.circuit.causes, cause))
    }

    fn run_cycles(&mut self, cycles: u32, bytes: &[u8]) -> Result<Answer, Reason> {
        let simulation = self.simulation.as_mut().ok_or("the simulation has ended")?;
        simulation.run(cycles, &self.levels, &[], bytes)
    }
}

/// Answer of the simulation to a command.
struct Answer {
    /// Bytes from the board.
    received: Vec<u8>,
    /// Cycles in which each output was 1.
    high: Vec<u32>,
    /// Moments in which outputs became safe or trips rose, [`MOMENT`] words each.
    moments: Vec<u32>,
}

/// Motion of an encoder in a run: its pins, count, and difference.
type Turn = ([usize; 2], i32, i32);

#[cfg(unix)]
mod process {
    use super::{Answer, MOMENT, Reason, Turn};
    use crate::model::{CIRCUIT_FOLDER, SIMULATION};
    use std::io::{Read, Write};
    use std::os::fd::OwnedFd;
    use std::os::unix::fs::PermissionsExt;
    use std::os::unix::net::UnixStream;
    use std::path::Path;
    use std::process::{Child, Command, Stdio};

    /// Child process that simulates the circuit; it ends with this.
    pub(super) struct Simulation {
        process: Child,
        /// Standard input and output of the process. A socket, since a write to a pipe whose reader has died ends a master that does not
        /// ignore the signal.
        line: UnixStream,
        outputs: usize,
    }

    impl Simulation {
        /// Starts the simulation of an unpacked FMU.
        pub(super) fn start(folder: &Path, outputs: usize) -> Result<Simulation, Reason> {
            let program = folder.join(SIMULATION);
            let failed = |what: &str, error: std::io::Error| format!("{what} {}: {error}", program.display());
            let permissions = std::fs::metadata(&program).map_err(|error| failed("cannot read", error))?;
            // Not every master unpacks files with their permissions.
            let mut permissions = permissions.permissions();
            if permissions.mode() & 0o111 == 0 {
                permissions.set_mode(0o755);
                std::fs::set_permissions(&program, permissions)
                    .map_err(|error| failed("cannot make executable", error))?;
            }
            let start = |error| failed("cannot start", error);
            let (line, theirs) = UnixStream::pair().map_err(start)?;
            let out = theirs.try_clone().map_err(start)?;
            let process = Command::new(&program)
                .current_dir(folder.join(CIRCUIT_FOLDER))
                .stdin(Stdio::from(OwnedFd::from(theirs)))
                .stdout(Stdio::from(OwnedFd::from(out)))
                .spawn()
                .map_err(start)?;
            Ok(Simulation { process, line, outputs })
        }

        /// Runs some cycles with these levels and turns, and sends bytes to the board. `rtl/board/src/driver.cpp` describes the words.
        pub(super) fn run(
            &mut self,
            cycles: u32,
            levels: &[bool],
            turns: &[Turn],
            bytes: &[u8],
        ) -> Result<Answer, Reason> {
            let mut words = vec![cycles, 0];
            words.extend(levels.iter().map(|&level| u32::from(level)));
            words.push(turns.len() as u32);
            for &([a, b], from, by) in turns {
                words.extend([a as u32, b as u32, from.cast_unsigned(), by.cast_unsigned()]);
            }
            words.push(bytes.len() as u32);
            words.extend(bytes.iter().map(|&byte| u32::from(byte)));
            let words: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
            self.exchange(&words).map_err(|error| {
                let status = self.process.try_wait().ok().flatten();
                let status = status.map_or(String::new(), |status| format!(" ({status})"));
                format!("the simulation has ended{status}: {error}")
            })
        }

        fn exchange(&mut self, words: &[u8]) -> std::io::Result<Answer> {
            self.line.write_all(words)?;
            let received = self.counted(1)?;
            let high = self.words(self.outputs)?;
            // The levels at the end.
            self.words(self.outputs)?;
            let moments = self.counted(MOMENT)?;
            Ok(Answer { received: received.into_iter().map(|word| word as u8).collect(), high, moments })
        }

        /// A count, and that many entries of `words` words.
        fn counted(&mut self, words: usize) -> std::io::Result<Vec<u32>> {
            let count = self.words(1)?[0] as usize;
            self.words(words * count)
        }

        fn words(&mut self, count: usize) -> std::io::Result<Vec<u32>> {
            let mut bytes = vec![0; 4 * count];
            self.line.read_exact(&mut bytes)?;
            Ok(bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
        }
    }

    impl Drop for Simulation {
        fn drop(&mut self) {
            let _ = self.process.kill();
            let _ = self.process.wait();
        }
    }
}

#[cfg(not(unix))]
mod process {
    use super::{Answer, Reason, Turn};
    use std::path::Path;

    /// No simulation: circuits run on Linux.
    pub(super) enum Simulation {}

    impl Simulation {
        pub(super) fn start(_: &Path, _: usize) -> Result<Simulation, Reason> {
            Err("the circuit of a board runs on Linux only".to_owned())
        }

        pub(super) fn run(&mut self, _: u32, _: &[bool], _: &[Turn], _: &[u8]) -> Result<Answer, Reason> {
            match *self {}
        }
    }
}

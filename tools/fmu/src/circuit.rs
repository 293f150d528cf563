// SPDX-License-Identifier: MIT OR Apache-2.0
//! A board's circuit behind an instance: the simulation that Verilator made of the board's top level, as a child process, and the host at
//! its UART, which starts the program and stays in touch.

use crate::machine::Reason;
use crate::variables::{Causality, Declaration, Source, Variable};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use takt_isa::program::Range;
use takt_isa::{Register, Type};

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

/// Type of a port that the host sets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum PortType {
    /// binary32.
    Float,
    /// Integer of 32 bits with a sign.
    Integer,
    /// 32 bits.
    Bits,
}

/// Input port of the program that no peripheral drives, and so the host sets.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HostPort {
    /// Name of the variable.
    pub name: String,
    /// Name of the port in the source.
    pub port: String,
    /// Type of the port.
    pub ty: PortType,
    /// Address at the UART (docs/protocol.md).
    pub address: u16,
    /// Least and largest value that the source states, as bits.
    pub range: Option<[u32; 2]>,
}

/// Host's requests, as bytes at the UART.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Requests {
    /// Starts the program without ticks, so that its ports can be set; empty if the program starts by itself.
    pub hold: Vec<u8>,
    /// Lets the program run and enables its outputs; empty if the program starts by itself.
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
    /// Ports that the host sets, in ascending order of their addresses.
    pub ports: Vec<HostPort>,
    /// Host's requests.
    pub requests: Requests,
    /// Files that the simulation reads, in `resources/circuit`.
    pub files: Vec<String>,
}

impl Circuit {
    /// Reason why the circuit has no meaning.
    pub(crate) fn mistake(&self) -> Option<&'static str> {
        let pin = |pin: &usize| *pin >= self.inputs.len();
        let unsorted = |pair: &[HostPort]| pair[0].address >= pair[1].address;
        match () {
            () if self.encoders.iter().flat_map(|encoder| &encoder.pins).any(pin) => {
                Some("an encoder is at a pin that the circuit does not have")
            }
            () if self.ports.windows(2).any(unsorted) => {
                Some("the ports are not in the order of their addresses")
            }
            () if self.requests.every == 0 => Some("the host's requests must be a period apart at least"),
            () => None,
        }
    }

    /// Variables, in the order of their value references: levels, counts, the host's ports, and for each output the part of the step.
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
        let ports = self.ports.iter().enumerate().map(|(number, of)| {
            let ty = match of.ty {
                PortType::Float => Type::F,
                PortType::Integer => Type::I,
                PortType::Bits => Type::B,
            };
            let mut port = Variable::new(of.name.clone(), ty, Causality::Input, Source::HostPort(number));
            // The register plays no part in a variable's range.
            let range = of.range.zip(Register::new(0));
            let range = range.map(|([low, high], register)| Range { register, ty, low, high });
            port.bound(range.as_ref(), 0);
            port.declaration = Some(Declaration { core: 0, directive: ".input", name: of.port.clone() });
            port.description = "Port that the host sets";
            port
        });
        let parts = self.outputs.iter().enumerate().map(|(pin, name)| {
            let mut part = Variable::new(name.clone(), Type::F, Causality::Output, Source::Part(pin));
            part.description = "Part of the last period in which the pin was 1";
            part
        });
        levels.chain(counts).chain(ports).chain(parts).collect()
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
    /// Bits of each of the host's ports as set, and as the board has them or will have when it answers.
    ports: Vec<[u32; 2]>,
    /// Number of requests so far, and periods since the last one.
    requests: u8,
    since: u32,
    /// Bytes of answers, and their number when all requests are answered.
    answers: Vec<u8>,
    awaited: usize,
}

/// Cycles after which the host looks for the answer to its start.
const SLICE: u32 = 256;
/// Most cycles that the answer takes: a UART of 115200 baud at 200 MHz needs 300 000 for 16 bytes each way.
const PATIENCE: u32 = 5_000_000;
/// First byte of a request, and of an answer, whose bytes without words are so many (docs/protocol.md).
const REQUEST: u8 = 0xa5;
const ANSWER: u8 = 0x5a;
const ANSWER_BYTES: usize = 6;
/// Most words of a request.
const REQUEST_WORDS: usize = 16;
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
            ports: Vec::new(),
            requests: 0,
            since: 0,
            answers: Vec::new(),
            awaited: 0,
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
        // The variables state the start, which is not always 0.
        self.ports = vec![[0; 2]; self.circuit.ports.len()];
        (self.requests, self.since, self.awaited) = (0, 0, 0);
        self.answers.clear();
    }

    pub(crate) fn set_level(&mut self, pin: usize, level: bool) {
        self.levels[pin] = level;
    }

    pub(crate) fn set_count(&mut self, encoder: usize, count: i32) {
        self.counts[encoder][0] = count;
    }

    pub(crate) fn set_port(&mut self, port: usize, bits: u32) {
        self.ports[port][0] = bits;
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
        let Requests { hold, start, .. } = self.circuit.requests.clone();
        let settings = self.settings();
        if !settings.is_empty() {
            self.request(hold)?;
        }
        for setting in settings {
            self.request(setting)?;
        }
        self.request(start)
    }

    /// Sends a request, unless it is empty, and waits for its answer.
    fn request(&mut self, mut bytes: Vec<u8>) -> Result<(), Reason> {
        if bytes.is_empty() {
            return Ok(());
        }
        self.awaited = ANSWER_BYTES;
        for _ in 0..PATIENCE / SLICE {
            let received = self.run_cycles(SLICE, &bytes)?.received;
            bytes.clear();
            if self.hears(&received)? {
                return Ok(());
            }
        }
        Err("the board does not answer its host".to_owned())
    }

    /// Takes bytes from the board; returns whether all requests are answered.
    fn hears(&mut self, received: &[u8]) -> Result<bool, Reason> {
        self.answers.extend(received);
        if self.answers.len() < self.awaited {
            return Ok(self.awaited == 0);
        }
        let mut rest = self.answers.as_slice();
        while let [first, _, status, words, ..] = *rest {
            if first != ANSWER || status != 0 {
                return Err(format!("the board refuses a request of its host: it answers {rest:02x?}"));
            }
            rest = rest.get(ANSWER_BYTES + 4 * usize::from(words)..).unwrap_or_default();
        }
        self.answers.clear();
        self.awaited = 0;
        Ok(true)
    }

    /// Requests that set the ports whose values have changed. Ports with consecutive addresses change together.
    fn settings(&mut self) -> Vec<Vec<u8>> {
        let mut requests = Vec::new();
        let together = self.circuit.ports.chunk_by(|a, b| a.address + 1 == b.address);
        let mut from = 0;
        for ports in together.flat_map(|run| run.chunks(REQUEST_WORDS)) {
            let values = &mut self.ports[from..from + ports.len()];
            from += ports.len();
            if values.iter().any(|[set, sent]| set != sent) {
                values.iter_mut().for_each(|[set, sent]| *sent = *set);
                self.requests = self.requests.wrapping_add(1);
                requests.push(setting(self.requests, ports[0].address, values));
            }
        }
        requests
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
        let bytes = if self.awaited == 0 { self.next_requests() } else { Vec::new() };
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
        self.hears(&answer.received)?;
        let period = self.period as f32;
        self.parts = answer.high.iter().map(|&cycles| cycles as f32 / period).collect();
        for moment in answer.moments.chunks_exact(MOMENT) {
            warnings.push(format!("period {number}: {}", self.moment(moment)));
        }
        Ok(())
    }

    /// Bytes of the requests that are due: changed ports, or else, now and then, a request that changes nothing.
    fn next_requests(&mut self) -> Vec<u8> {
        let settings = self.settings();
        let Requests { ask, every, .. } = &self.circuit.requests;
        if !settings.is_empty() {
            (self.since, self.awaited) = (0, ANSWER_BYTES * settings.len());
            return settings.concat();
        }
        if self.since < *every || ask.is_empty() {
            return Vec::new();
        }
        // The answer has a word.
        (self.since, self.awaited) = (0, ANSWER_BYTES + 4);
        self.requests = self.requests.wrapping_add(1);
        ask[usize::from(self.requests) % ask.len()].clone()
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

/// Request that sets ports with consecutive addresses to values, whose first bits are those to set.
fn setting(number: u8, address: u16, values: &[[u32; 2]]) -> Vec<u8> {
    let [low, high] = address.to_le_bytes();
    let mut bytes = vec![REQUEST, number, 2, values.len() as u8, low, high];
    bytes.extend(values.iter().flat_map(|[set, _]| set.to_le_bytes()));
    let sum = checksum(&bytes[1..]);
    bytes.extend(sum.to_le_bytes());
    bytes
}

/// CRC-16/CCITT-FALSE, as the board computes it (docs/protocol.md).
fn checksum(bytes: &[u8]) -> u16 {
    let shifted = |sum: u16| if sum & 0x8000 == 0 { sum << 1 } else { sum << 1 ^ 0x1021 };
    bytes.iter().fold(0xffff, |sum, &byte| (0..8).fold(sum ^ u16::from(byte) << 8, |sum, _| shifted(sum)))
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
            // No pin is watched: the run does not end before its time.
            words.push(0);
            let words: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
            self.exchange(&words).map_err(|error| {
                let status = self.process.try_wait().ok().flatten();
                let status = status.map_or(String::new(), |status| format!(" ({status})"));
                format!("the simulation has ended{status}: {error}")
            })
        }

        fn exchange(&mut self, words: &[u8]) -> std::io::Result<Answer> {
            self.line.write_all(words)?;
            // The cycles that were run, and whether the last is that of the tick.
            self.words(2)?;
            let received = self.counted(1)?;
            let high = self.words(self.outputs)?;
            // The levels at the end, and the registers that the program reads.
            self.words(self.outputs)?;
            self.counted(1)?;
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

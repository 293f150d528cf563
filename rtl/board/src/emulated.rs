// SPDX-License-Identifier: MIT OR Apache-2.0
//! Emulated board: cores and links run on the emulator, registers behave as in docs/protocol.md. This is many times faster than the circuit
//! in Verilator. Behaviour is exact at base ticks. Between two base ticks no time passes for the line and the peripherals: requests are
//! answered at once, and a core's write to an output acts from the tick on.

mod scope;

use self::scope::EmulatedScope;
use crate::application::Application;
use crate::endpoints::{Endpoints, Fifo};
use crate::host::Status;
use crate::interlock::{Figures, command};
use crate::kind::Direction;
use crate::protocol::{
    self, CORE, DONE, DRIVEN, ENABLE, FIFO_WORDS, FIFOS, HOLD, IMAGE, READ_ONLY, RESTART, RUN, Request, SEEN,
    address,
};
use crate::sinks::sinks;
use crate::top::{TopError, circuit_number};
use crate::wiring::Wiring;
use std::collections::BTreeMap;
use takt_isa::Type;
use takt_isa::timing::Cycle;
use takt_system::{Description, System};
use thiserror::Error;

/// Causes that stop the drive, as bits of the register `status`.
const CAUSES: u32 = 12;
const FAULT: u32 = 1 << CAUSES;
const HALT: u32 = 1 << (CAUSES + 1);
const DEADLINE: u32 = 1 << (CAUSES + 2);
const SILENT: u32 = 1 << (CAUSES + 3);
const STOP: u32 = 1 << (CAUSES + 4);
const NAN: u32 = 1 << (CAUSES + 5);

/// Registers that only store values: the emulated period is the system's tick, whatever `period` says.
const KEPT: [&str; 4] = ["period", "lead", "stream", "page"];

/// Reason why a board cannot be emulated.
#[derive(Debug, Error)]
pub enum EmulatedError {
    /// A single program, which has no system to emulate.
    #[error(
        "a board with a single program can only be simulated as a circuit: --emulated is for systems of several cores"
    )]
    Program,
    /// No circuit exists that could be emulated.
    #[error(transparent)]
    Top(#[from] TopError),
    /// A core's memories cannot hold its program.
    #[error("{0}")]
    Load(String),
}

/// Register of a peripheral that takes a core's output.
#[derive(Clone, Debug)]
struct Output {
    peripheral: String,
    /// The host's endpoint.
    number: usize,
    /// Link and field of the host's endpoint.
    place: (usize, usize),
    ty: Type,
    /// Exponent of the power of two by which a float is multiplied.
    scale: i32,
}

impl Output {
    /// The register's value; `None` for a NaN.
    fn value(&self, bits: u32) -> Option<i32> {
        if self.ty != Type::F {
            return Some(bits.cast_signed());
        }
        let scaled = (f64::from(f32::from_bits(bits)) * f64::from(self.scale).exp2()).round_ties_even();
        // Rust's cast saturates, like the circuit.
        (!scaled.is_nan()).then_some(scaled as i32)
    }
}

/// Emulated board with its host interface.
pub struct EmulatedBoard {
    description: Description,
    endpoints: Endpoints,
    /// Captured values of the host's inputs that peripherals drive.
    captured: BTreeMap<usize, u32>,
    /// Values of the host's inputs that the computer sets.
    set: BTreeMap<usize, u32>,
    /// Fields of the next entry of each FIFO.
    next: BTreeMap<u16, u32>,
    outputs: Vec<Output>,
    values: Vec<i32>,
    /// Missed deadlines in a row, and periods without a request, that make outputs safe.
    limits: [u32; 2],
    circuit: u32,
    period: u32,
    lead: u32,
    control: u32,
    causes: u32,
    /// Names of the outputs that were NaN when NaN became a cause.
    nan: Vec<String>,
    /// Receives the reason when outputs become safe.
    pub tell: Option<fn(&str)>,
    /// The first period has ended.
    begun: bool,
    stop: bool,
    system: Option<System>,
    /// Cycle in which the host's values for the next base tick are written; `None` before ticks begin.
    tick: Option<Cycle>,
    steps: u32,
    ticks: u32,
    missed: u32,
    in_row: u32,
    silent: u32,
    stream: u32,
    page: u32,
    scope: Option<EmulatedScope>,
    frames: u8,
    bytes: Vec<u8>,
    errors: u32,
    /// Number of the last write request, and the status of its answer.
    last: Option<(u8, u8)>,
}

impl std::fmt::Debug for EmulatedBoard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Emulated")
            .field("status", &self.state())
            .field("ticks", &self.ticks)
            .finish_non_exhaustive()
    }
}

impl EmulatedBoard {
    /// A board at power-up.
    ///
    /// # Errors
    /// If the application is a program, or there is no circuit of it.
    pub fn new<'a>(
        wiring: &Wiring,
        application: impl Into<Application<'a>>,
    ) -> Result<EmulatedBoard, EmulatedError> {
        let application = application.into();
        if application.is_program() {
            return Err(EmulatedError::Program);
        }
        let circuit = circuit_number(application.description())?;
        let description = application.description().clone();
        let endpoints = application.endpoints().clone();
        System::new(&description).map_err(|error| EmulatedError::Load(error.to_string()))?;
        let reads = wiring.peripherals.iter().flat_map(|peripheral| peripheral.reads.iter().flatten());
        let captured =
            reads.filter_map(|port| Some((application.connect(Direction::Input, port).ok()?.number, 0)));
        let captured = captured.collect();
        let outputs = sinks(&application, wiring).into_iter().flatten().map(|sink| {
            let end = &endpoints.outputs[sink.number];
            Output {
                peripheral: sink.peripheral.name.clone(),
                number: sink.number,
                place: (end.link, end.field),
                ty: end.ty,
                scale: sink.written.scale.unwrap_or(0),
            }
        });
        let outputs: Vec<Output> = outputs.collect();
        let scope = EmulatedScope::of(wiring, &application);
        let mut board = EmulatedBoard {
            captured,
            set: BTreeMap::new(),
            next: BTreeMap::new(),
            values: vec![0; outputs.len()],
            outputs,
            limits: [wiring.deadlines, wiring.host],
            circuit,
            period: wiring.period,
            lead: wiring.lead,
            control: 0,
            causes: 0,
            nan: Vec::new(),
            tell: None,
            begun: false,
            stop: false,
            system: None,
            tick: None,
            steps: 0,
            ticks: 0,
            missed: 0,
            in_row: 0,
            silent: 0,
            stream: 0,
            page: 0,
            scope,
            frames: 0,
            bytes: Vec::new(),
            errors: 0,
            last: None,
            description,
            endpoints,
        };
        if wiring.autostart {
            board.write_control(RUN | ENABLE);
        }
        Ok(board)
    }

    /// Number of the host's input that a peripheral drives.
    pub fn input(&self, port: &str) -> Option<usize> {
        let found = Application::from(&self.description).connect(Direction::Input, port).ok()?.number;
        self.captured.contains_key(&found).then_some(found)
    }

    /// Sets the word that a peripheral captures at the next tick.
    pub fn capture(&mut self, input: usize, word: u32) {
        self.captured.insert(input, word);
    }

    /// Sets the level of the pin `stop`.
    pub fn set_stop(&mut self, level: bool) {
        self.stop = level;
    }

    /// The outputs drive.
    pub fn drives(&self) -> bool {
        self.control & (RUN | ENABLE) == RUN | ENABLE && self.begun && self.causes == 0
    }

    /// Value in a peripheral's first register that takes an output; 0 while outputs are safe.
    pub fn output(&self, peripheral: &str) -> Option<i32> {
        let at = self.outputs.iter().position(|output| output.peripheral == peripheral)?;
        Some(if self.drives() { self.values[at] } else { 0 })
    }

    /// Base ticks since the start.
    pub fn ticks(&self) -> u32 {
        self.ticks
    }

    /// Takes bytes from the line, and answers the requests among them.
    pub fn receive(&mut self, bytes: &[u8]) -> Vec<u8> {
        let drove = self.drives();
        self.bytes.extend(bytes);
        let mut answers = Vec::new();
        while let Some(request) = protocol::take_request(&mut self.bytes, &mut self.errors) {
            self.silent = 0;
            answers.extend(self.answer(&request));
        }
        self.report_safe_outputs(drove);
        answers
    }

    /// Shows the scope that outputs that drove have become safe, and reports the reason.
    fn report_safe_outputs(&mut self, drove: bool) {
        if !drove || self.drives() {
            return;
        }
        self.scope.iter_mut().for_each(EmulatedScope::became_safe);
        let Some(tell) = self.tell else { return };
        let figures = Figures {
            misses: self.missed,
            period: u32::try_from(self.description.tick).unwrap_or(u32::MAX),
            nan: self.nan.clone(),
            ..Figures::default()
        };
        let mut reasons: Vec<String> =
            Status(self.causes).causes().map(|cause| figures.reason(cause)).collect();
        if reasons.is_empty() {
            reasons.push(command(self.control & RUN != 0, self.control & ENABLE != 0).to_owned());
        }
        tell(&format!("tick {}: the outputs become safe: {}", self.ticks, reasons.join("; ")));
    }

    /// Handles a silent line: drops an incomplete frame.
    pub fn pause(&mut self) {
        self.errors += u32::from(!self.bytes.is_empty());
        self.bytes.clear();
    }

    /// Simulates from a base tick to the next. Returns the bytes that the board sends on its own.
    pub fn pass(&mut self) -> Vec<u8> {
        let drove = self.drives();
        let sent = self.run_period();
        self.report_safe_outputs(drove);
        if let Some(scope) = &mut self.scope {
            scope.decide(self.system.as_ref());
        }
        sent
    }

    fn run_period(&mut self) -> Vec<u8> {
        if self.stop {
            self.causes |= STOP;
        }
        let held = self.control & HOLD != 0;
        if self.control & RUN == 0
            || self.causes & (FAULT | HALT) != 0
            || held && self.steps == 0 && self.tick.is_some()
        {
            return Vec::new();
        }
        // Steps count ticks; before every core waits for its first tick, no tick is due.
        self.steps -= u32::from(held && self.tick.is_some());
        if self.run().is_err() {
            self.causes |= FAULT;
            return Vec::new();
        }
        self.ended()
    }

    /// Runs the system to just before its next base tick.
    fn run(&mut self) -> Result<(), Box<dyn std::error::Error>> {
        let Some(system) = &mut self.system else { return Ok(()) };
        let (lead, base) = (self.description.lead(), self.description.tick);
        let Some(tick) = self.tick else {
            let limit = system.now() + base;
            self.tick = system.run_to_start(limit)?.map(|start| start - lead);
            return Ok(());
        };
        system.run_until(tick)?;
        for (number, word) in self.set.iter().chain(&self.captured) {
            system.set_input(&self.endpoints.inputs[*number].name, *word)?;
        }
        for (number, link) in self.description.links.iter().enumerate() {
            if link.from == takt_system::End::Host && link.is_snapshot() {
                system.publish(number)?;
            }
        }
        self.tick = Some(tick + base);
        match &mut self.scope {
            Some(scope) => scope.run(system, tick + base)?,
            None => system.run_until(tick + base)?,
        }
        self.ticks += 1;
        Ok(())
    }

    /// Handles the end of a period: outputs, causes that make them safe, and a frame of the stream.
    fn ended(&mut self) -> Vec<u8> {
        let Some(system) = &self.system else { return Vec::new() };
        if self.ticks == 0 {
            return Vec::new();
        }
        let skipped: u64 = (0..self.description.cores.len()).map(|core| system.periods(core).skipped).sum();
        self.in_row = if skipped as u32 == self.missed { 0 } else { self.in_row + 1 };
        self.missed = skipped as u32;
        self.silent += 1;
        let [deadlines, host] = self.limits;
        let reasons = [
            (HALT, system.halted()),
            (DEADLINE, self.in_row >= deadlines),
            (SILENT, host > 0 && self.silent >= host),
        ];
        self.causes |= reasons.iter().filter(|(_, holds)| *holds).fold(0, |all, (bit, _)| all | bit);
        let mut nan = Vec::new();
        for (output, value) in self.outputs.iter().zip(&mut self.values) {
            let (link, field) = output.place;
            match output.value(system.field_bits(link, field).unwrap_or(0)) {
                Some(found) => *value = found,
                None => nan.push(format!("`{}`", self.endpoints.outputs[output.number].name)),
            }
        }
        if !nan.is_empty() {
            self.causes |= NAN;
            self.nan = nan;
        }
        self.begun = true;
        let (first, words, every) = (self.stream as u16, self.stream >> 16 & 15, self.stream >> 20);
        if every == 0 || !self.ticks.is_multiple_of(every) {
            return Vec::new();
        }
        let mut frame = vec![self.ticks];
        frame.extend((0..words as u16).map(|i| self.read(first.wrapping_add(i))));
        self.frames = self.frames.wrapping_add(1);
        protocol::streamed(self.frames, &frame)
    }

    fn answer(&mut self, request: &Request) -> Vec<u8> {
        let at = |i: usize| request.address.wrapping_add(i as u16);
        let Some(words) = &request.words else {
            let words: Vec<u32> = (0..request.count).map(|i| self.read(at(i))).collect();
            self.last = None;
            return protocol::answer(request.number, DONE, &words);
        };
        let status = match self.last {
            // A repeated request is not carried out twice.
            Some((number, status)) if number == request.number => status,
            _ if (0..words.len()).all(|i| self.is_writable(at(i))) => {
                words.iter().enumerate().for_each(|(i, word)| self.write(at(i), *word));
                DONE
            }
            _ => READ_ONLY,
        };
        self.last = Some((request.number, status));
        protocol::answer(request.number, status, &[])
    }

    /// FIFO at an address, and the part of it: 0 is its status.
    fn fifo(&self, at: u16) -> Option<(&Fifo, u16)> {
        let fifo = self.endpoints.fifos.get(usize::from(at.checked_sub(FIFOS)? / FIFO_WORDS))?;
        Some((fifo, at - fifo.address))
    }

    /// Register that only stores its value, by address.
    fn register(&mut self, at: u16) -> Option<&mut u32> {
        let registers = [&mut self.period, &mut self.lead, &mut self.stream, &mut self.page];
        KEPT.iter().zip(registers).find(|(name, _)| address(name) == at).map(|(_, register)| register)
    }

    fn is_writable(&self, at: u16) -> bool {
        if at == address("control") || KEPT.iter().any(|name| address(name) == at) {
            return true;
        }
        if at == address("step") {
            return self.control & HOLD != 0;
        }
        if let Some((scope, at)) = self.scope.as_ref().zip(scope::offset(at)) {
            return scope.is_writable(at);
        }
        if (DRIVEN..SEEN).contains(&at) {
            let number = usize::from(at - DRIVEN);
            return number < self.endpoints.inputs.len() && !self.captured.contains_key(&number);
        }
        let fifo = self.fifo(at);
        fifo.is_some_and(|(fifo, _)| {
            at == fifo.act() || !fifo.to_host && (1..fifo.act() - fifo.address).contains(&(at - fifo.address))
        })
    }

    fn write_control(&mut self, word: u32) {
        let starts = word & RUN != 0 && (self.control & RUN == 0 || word & RESTART != 0);
        self.control = word & (RUN | HOLD | ENABLE);
        if starts || word & RUN == 0 {
            self.scope.iter_mut().for_each(EmulatedScope::reset);
            (self.causes, self.begun, self.tick, self.steps) = (0, false, None, 0);
            self.silent = 0;
            self.set.clear();
            self.values.fill(0);
            // `EmulatedBoard::new` has checked that the program fits.
            self.system = starts.then(|| System::new(&self.description).ok()).flatten();
        }
        if starts {
            (self.ticks, self.missed, self.in_row) = (0, 0, 0);
        }
    }

    fn write(&mut self, at: u16, word: u32) {
        if at == address("control") {
            return self.write_control(word);
        }
        if at == address("step") {
            self.steps += 1;
        } else if let Some((scope, at)) = self.scope.as_mut().zip(scope::offset(at)) {
            scope.write(at, word);
        } else if let Some(register) = self.register(at) {
            *register = word;
        } else if (DRIVEN..SEEN).contains(&at) {
            self.set.insert(usize::from(at - DRIVEN), word);
        } else if let Some((fifo, part)) = self.fifo(at) {
            let (fifo, is_act) = (fifo.clone(), at == fifo.act());
            if !is_act {
                self.next.insert(at, word);
                return;
            }
            debug_assert!(part > 0, "the status is not writable");
            self.act(&fifo);
        }
    }

    /// Pushes an entry into a FIFO, or pops one.
    fn act(&mut self, fifo: &Fifo) {
        let Some(system) = &mut self.system else { return };
        if fifo.to_host {
            let _ = system.pop(fifo.link);
            return;
        }
        for (i, (field, _)) in fifo.fields.iter().enumerate() {
            let word = self.next.get(&fifo.field(i)).copied().unwrap_or(0);
            let _ = system.set_input(&format!("{}.{field}", fifo.name), word);
        }
        let _ = system.push(fifo.link);
    }

    /// Word of a core's register `status`.
    fn status(&self, core: usize) -> u32 {
        let Some(system) = &self.system else { return 1 << 10 | self.causes };
        let fault = system.fault().is_some_and(|fault| fault.core == core);
        let waits = self.tick.is_some() && !fault;
        u32::from(waits)
            | u32::from(system.halted()) << 1
            | u32::from(fault) << 2
            | u32::from(self.drives()) << 11
            | self.causes
    }

    /// Status of the first core.
    pub fn state(&self) -> Status {
        Status(self.status(0))
    }

    fn read(&self, at: u16) -> u32 {
        let registers = CORE * self.description.cores.len() as u16;
        if let Some((scope, at)) = self.scope.as_ref().zip(scope::offset(at)) {
            return scope.read(at);
        }
        match at {
            _ if at < registers => self.read_register(usize::from(at / CORE), at % CORE),
            DRIVEN..SEEN => {
                let number = usize::from(at - DRIVEN);
                self.captured.get(&number).or_else(|| self.set.get(&number)).copied().unwrap_or(0)
            }
            SEEN..FIFOS => {
                let end = self.endpoints.outputs.get(usize::from(at - SEEN));
                let bits = end.zip(self.system.as_ref());
                bits.and_then(|(end, system)| system.field_bits(end.link, end.field)).unwrap_or(0)
            }
            _ if at >= IMAGE => {
                let scope = self.scope.as_ref();
                scope.and_then(|scope| scope.word(self.page, at - IMAGE)).unwrap_or(0)
            }
            _ => self.read_fifo(at),
        }
    }

    fn read_register(&self, core: usize, at: u16) -> u32 {
        let Some(register) = protocol::REGISTERS.iter().find(|register| register.address == at) else {
            return 0;
        };
        let system = self.system.as_ref();
        let periods = system.map(|system| system.periods(core));
        let cycles = |most: bool| {
            let longest = periods.as_ref().filter(|_| most).map(|periods| periods.longest);
            let last = system.and_then(|system| system.last_period(core)).map(|report| report.cycles);
            longest.or(last).unwrap_or(0) as u32
        };
        match (register.name, core) {
            ("status", _) => self.status(core),
            ("misses", _) => periods.map_or(0, |periods| periods.skipped as u32),
            ("periods", _) => periods.map_or(0, |periods| periods.count as u32),
            ("cycles", _) => cycles(false),
            ("most_cycles", _) => cycles(true),
            ("id", 0) => protocol::id(self.description.cores.len()),
            ("control", 0) => self.control,
            ("period", 0) => self.period,
            ("lead", 0) => self.lead,
            ("stream", 0) => self.stream,
            ("page", 0) => self.page,
            ("errors", 0) => self.errors,
            ("circuit", 0) => self.circuit,
            _ => 0,
        }
    }

    fn read_fifo(&self, at: u16) -> u32 {
        let (Some((fifo, part)), Some(system)) = (self.fifo(at), &self.system) else { return 0 };
        if part == 0 {
            use takt_system::Status::{Count, Empty, Full, Overflow, Underflow};
            let bit = |status| system.fifo_status(fifo.link, status).unwrap_or(0);
            return bit(Empty) | bit(Full) << 1 | bit(Overflow) << 2 | bit(Underflow) << 3 | bit(Count) << 16;
        }
        match fifo.to_host {
            true => system.field_bits(fifo.link, usize::from(part - 1)).unwrap_or(0),
            false => self.next.get(&at).copied().unwrap_or(0),
        }
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Host's side of the protocol: requests with retries, over any line.

use crate::application::Application;
use crate::endpoints::Fifo;
use crate::protocol::{self, CORE, Frame, Line, LinkError, PAGE, Receiver, WORDS, address};
use crate::top;
use std::collections::VecDeque;
use std::time::Duration;
use takt_isa::fp::Flags;
use takt_system::MAX_CORES;

/// Counting registers: of a program's periods since its start, and of the line's frames since power-up.
pub const COUNTERS: [&str; 6] = ["periods", "misses", "cycles", "most_cycles", "errors", "lost"];

/// Attempts at a request.
const ATTEMPTS: u32 = 8;

/// Bytes searched for an answer before a request is repeated: many times the longest answer.
const BYTES: usize = 4096;

/// Factor for the last attempt's patience if the request waits for the program: the board refuses it after 2²² cycles, which take a
/// simulated board long.
const GRANT: u32 = 60;

/// Records written before they are read back.
const PART: usize = 64;

/// Time limit of a request with all its attempts.
const LIMIT: Duration = Duration::from_secs(90);

/// Limit on the polls for the program's `wait`, with a pause of the line between two.
const ASKED: u32 = 30;

/// Connection to a board that answers.
#[derive(Debug)]
pub struct Host<L> {
    /// Line to the board.
    pub line: L,
    receiver: Receiver,
    number: u8,
    stream: VecDeque<Frame>,
    /// Number of requests that were repeated.
    pub retries: u64,
    /// Cores of the board's system; 1 for a single program.
    pub cores: usize,
    /// Records for which the board's image has room.
    room: usize,
}

/// Limit on consecutive reads of a stream without a frame.
const STILL: u32 = 50;

/// Words for ports with consecutive numbers, after the address of the first port.
pub type Ports = (u16, Vec<u32>);

/// Result of feeding rows.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FeedResult {
    /// First period that used each row.
    pub used: Vec<u32>,
    /// Periods that repeated the last row, or for which that is unknown.
    pub late: u32,
}

/// Status of a FIFO: its first word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FifoStatus(pub u32);

impl FifoStatus {
    /// Number of entries in the FIFO.
    pub fn count(self) -> u32 {
        self.0 >> 16
    }

    /// The queue has no entry.
    pub fn empty(self) -> bool {
        self.0 & 1 != 0
    }

    /// The queue has no room.
    pub fn full(self) -> bool {
        self.0 & 2 != 0
    }

    /// Sticky: an entry was refused because the queue was full.
    pub fn overflow(self) -> bool {
        self.0 & 4 != 0
    }

    /// Sticky: a pop was refused because the queue was empty.
    pub fn underflow(self) -> bool {
        self.0 & 8 != 0
    }
}

/// Cause of peripherals that are safe while others may drive.
pub(crate) const TRIP: &str = "trip";

/// Status of a core: the register `status`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Status(pub u32);

impl Status {
    /// The program waits for its tick.
    pub fn waiting(self) -> bool {
        self.0 & 1 != 0
    }

    /// The program has halted.
    pub fn halted(self) -> bool {
        self.0 & 2 != 0
    }

    /// The program has stopped with a fault.
    pub fn fault(self) -> bool {
        self.0 & 4 != 0
    }

    /// Slot of the operation that faulted.
    pub fn fault_slot(self) -> usize {
        (self.0 >> 4 & 7) as usize
    }

    /// Sticky exception flags of the core.
    pub fn flags(self) -> Flags {
        // The register has them in the same order, from overflow on.
        Flags::from_bits((self.0 >> 7 & 7) as u8 * Flags::OVERFLOW.bits())
    }

    /// The core is in reset.
    pub fn in_reset(self) -> bool {
        self.0 >> 10 & 1 != 0
    }

    /// The core's outputs drive.
    pub fn drives(self) -> bool {
        self.0 >> 11 & 1 != 0
    }

    /// Activity of the core, as text; `control` is the value of that register.
    pub fn activity(self, control: u32) -> &'static str {
        match self {
            _ if self.fault() => "stopped with a fault",
            _ if self.halted() => "halted",
            _ if self.in_reset() => "stopped",
            _ if control & protocol::HOLD != 0 => "held",
            _ => "runs",
        }
    }

    /// Corrected words of memories since the core was started, at most 255; 0 without error correction.
    pub fn corrections(self) -> u32 {
        self.0 >> 24
    }

    /// Causes that stopped the drive, and `trip`, which stops the peripherals that the wiring names.
    pub fn causes(self) -> impl Iterator<Item = &'static str> {
        let names = [
            "fault",
            "halt",
            "missed deadline",
            "host silent",
            "stop",
            "NaN output",
            TRIP,
            "cores differ",
            "memory error",
        ];
        names.into_iter().enumerate().filter(move |(i, _)| self.0 >> (12 + i) & 1 != 0).map(|(_, name)| name)
    }
}

/// Kind of a fault, as text, from the value of the register `fault`.
pub fn fault_kind(register: u32) -> &'static str {
    match register >> 16 & 7 {
        1 => "illegal word",
        2 => "data address",
        3 => "return stack full",
        4 => "return stack empty",
        5 => "loops too deep",
        6 => "loop count",
        7 => "loop nesting",
        _ => "of an unknown kind",
    }
}

impl<L: Line> Host<L> {
    /// Connects to a board. `number` is the number of the first request and should differ from run to run.
    ///
    /// # Errors
    /// If there is no answer, or the answer is not from a Takt board.
    pub fn connect(line: L, number: u8) -> Result<Host<L>, LinkError> {
        let receiver = Receiver::default();
        let mut host =
            Host { line, receiver, number, stream: VecDeque::new(), retries: 0, cores: 1, room: 0 };
        let id = host.register("id")?;
        host.cores = (id & 0xff) as usize;
        match (id >> 16, id >> 8 & 0xff) {
            (protocol::MAGIC, protocol::VERSION) if (1..=MAX_CORES).contains(&host.cores) => {}
            (protocol::MAGIC, protocol::VERSION) => return Err(LinkError::Cores(host.cores)),
            (protocol::MAGIC, version) => return Err(LinkError::Version(version)),
            _ => return Err(LinkError::Stranger(id)),
        }
        host.room = host.register("room")? as usize;
        Ok(host)
    }

    /// Checks that the board's circuit was built for this program or system: then it can be loaded, and its names have the right addresses.
    ///
    /// # Errors
    /// If the circuit differs, or the board does not answer.
    pub fn fits<'a>(&mut self, application: impl Into<Application<'a>>) -> Result<(), LinkError> {
        let application = application.into();
        let (there, wanted) = (self.cores, application.description().cores.len());
        if there != wanted {
            return Err(LinkError::OtherCores { there, wanted });
        }
        let circuit =
            top::circuit_number(application).map_err(|error| LinkError::NoCircuit(error.to_string()))?;
        if self.register("circuit")? == circuit { Ok(()) } else { Err(LinkError::OtherCircuit) }
    }

    /// Repeats a request until it is answered with `wanted` words, within the limits of attempts and time.
    fn request(
        &mut self,
        bytes: &[u8],
        number: u8,
        address: u16,
        wanted: usize,
    ) -> Result<Vec<u32>, LinkError> {
        let until = self.line.time() + LIMIT;
        let mut error = LinkError::Silence(ATTEMPTS);
        for attempt in 1..=ATTEMPTS {
            self.retries += u64::from(attempt > 1);
            self.line.send(bytes)?;
            let long = attempt == ATTEMPTS && protocol::waits(address);
            let patience = self.line.patience() * if long { GRANT } else { 1 };
            let Some(frame) = self.listen(number, patience, until)? else { continue };
            match frame.status {
                protocol::DONE if frame.words.len() == wanted => return Ok(frame.words),
                protocol::DONE => {
                    error = LinkError::Words { wanted, came: frame.words.len(), attempts: ATTEMPTS };
                }
                protocol::BUSY => return Err(LinkError::Busy),
                protocol::READ_ONLY => {
                    let words = usize::from(bytes.get(3).copied().unwrap_or(0));
                    return Err(LinkError::ReadOnly { address, words });
                }
                status => return Err(LinkError::Status(status)),
            }
        }
        Err(error)
    }

    /// Listens for an answer until the line has been silent `patience` times. Answers may come in pieces; noise and a stream may never end.
    fn listen(&mut self, number: u8, patience: u32, until: Duration) -> Result<Option<Frame>, LinkError> {
        let (mut silent, mut bytes) = (0, 0);
        while silent < patience && bytes < BYTES && self.line.time() < until {
            let received = self.line.receive()?;
            silent = if received.is_empty() { silent + 1 } else { 0 };
            bytes += received.len();
            self.receiver.put(&received);
            while let Some(frame) = self.receiver.frame() {
                match frame {
                    Frame { stream: true, .. } => self.stream.push_back(frame),
                    Frame { number: of, .. } if of == number => return Ok(Some(frame)),
                    // An answer to a request that was given up.
                    _ => {}
                }
            }
        }
        self.receiver.give_up();
        Ok(None)
    }

    /// Reads `count` words from `address` on.
    ///
    /// # Errors
    /// If the board does not answer, or refuses.
    pub fn read(&mut self, address: u16, count: usize) -> Result<Vec<u32>, LinkError> {
        let mut words = Vec::with_capacity(count);
        while words.len() < count {
            let some = (count - words.len()).min(WORDS);
            self.number = self.number.wrapping_add(1);
            let at = address.wrapping_add(words.len() as u16);
            let bytes = protocol::read(self.number, at, some as u8);
            words.extend(self.request(&bytes, self.number, at, some)?);
        }
        Ok(words)
    }

    /// Writes words; up to 16 go together, between two periods.
    ///
    /// # Errors
    /// If the board does not answer, or refuses.
    pub fn write(&mut self, address: u16, words: &[u32]) -> Result<(), LinkError> {
        for (i, some) in words.chunks(WORDS).enumerate() {
            self.number = self.number.wrapping_add(1);
            let at = address.wrapping_add((WORDS * i) as u16);
            let bytes = protocol::write(self.number, at, some);
            self.request(&bytes, self.number, at, 0)?;
        }
        Ok(())
    }

    /// Reads words at any addresses, runs of consecutive ones together.
    ///
    /// # Errors
    /// If the board does not answer.
    pub fn read_each(&mut self, addresses: &[u16]) -> Result<Vec<u32>, LinkError> {
        let mut words = Vec::with_capacity(addresses.len());
        for together in addresses.chunk_by(|a, b| Some(*b) == a.checked_add(1)) {
            words.extend(self.read(together[0], together.len())?);
        }
        Ok(words)
    }

    /// Sets ports, in ascending order of addresses. Ports with consecutive addresses change together, between two periods.
    ///
    /// # Errors
    /// If the board does not answer, or refuses.
    pub fn set_ports(&mut self, settings: &[(u16, u32)]) -> Result<(), LinkError> {
        for together in settings.chunk_by(|a, b| a.0 + 1 == b.0) {
            let values: Vec<u32> = together.iter().map(|(_, bits)| *bits).collect();
            self.write(together[0].0, &values)?;
        }
        Ok(())
    }

    /// Reads a register, by name.
    ///
    /// # Errors
    /// If the board does not answer.
    pub fn register(&mut self, name: &str) -> Result<u32, LinkError> {
        self.register_of(0, name)
    }

    /// Reads a register of a core: `status`, `fault`, `misses`, `periods`, `cycles`, `most_cycles`, `issued`. A single program's core is 0.
    ///
    /// # Errors
    /// If the board does not answer.
    pub fn register_of(&mut self, core: usize, name: &str) -> Result<u32, LinkError> {
        let at = address(name) + CORE * core as u16;
        Ok(self.read(at, 1)?.first().copied().unwrap_or(0))
    }

    /// Reads registers of a core, by name, in one request if their addresses lie within 16.
    ///
    /// # Errors
    /// If the board does not answer.
    pub fn registers_of(&mut self, core: usize, names: &[&str]) -> Result<Vec<u32>, LinkError> {
        let addresses = || names.iter().map(|name| address(name));
        let (first, last) = (addresses().min().unwrap_or(0), addresses().max().unwrap_or(0));
        let words = self.read(first + CORE * core as u16, usize::from(last - first) + 1)?;
        Ok(addresses().map(|at| words[usize::from(at - first)]).collect())
    }

    /// Writes a register, by name.
    ///
    /// # Errors
    /// If the board does not answer.
    pub fn set(&mut self, name: &str, value: u32) -> Result<(), LinkError> {
        self.write(address(name), &[value])
    }

    /// Reads the status of core 0.
    ///
    /// # Errors
    /// If the board does not answer.
    pub fn status(&mut self) -> Result<Status, LinkError> {
        self.status_of(0)
    }

    /// Reads the status of a core.
    ///
    /// # Errors
    /// If the board does not answer.
    pub fn status_of(&mut self, core: usize) -> Result<Status, LinkError> {
        Ok(Status(self.register_of(core, "status")?))
    }

    /// Waits until the program, or every core of a system, is between two periods or has stopped. Polls the status, unlike a read of the
    /// program's values, so that a program that never waits is detected early.
    ///
    /// # Errors
    /// [`LinkError::Busy`] if that does not happen soon, or the board does not answer.
    pub fn settle(&mut self) -> Result<(), LinkError> {
        if self.register("control")? & protocol::RUN == 0 {
            return Ok(());
        }
        for _ in 0..ASKED {
            let mut waits = true;
            for core in 0..self.cores {
                let status = self.status_of(core)?;
                if status.fault() {
                    return Ok(());
                }
                waits &= !status.in_reset() && (status.waiting() || status.halted());
            }
            if waits {
                return Ok(());
            }
            self.hear()?;
        }
        Err(LinkError::Busy)
    }

    /// Reads the status of a FIFO.
    ///
    /// # Errors
    /// If the board does not answer.
    pub fn fifo(&mut self, fifo: &Fifo) -> Result<FifoStatus, LinkError> {
        Ok(FifoStatus(self.read(fifo.address, 1)?.first().copied().unwrap_or(0)))
    }

    fn needs_running(&mut self) -> Result<(), LinkError> {
        if self.register("control")? & protocol::RUN == 0 { Err(LinkError::Stopped) } else { Ok(()) }
    }

    /// Pushes an entry into a FIFO from the host; false if it is full. A repeated request does not push twice.
    ///
    /// # Errors
    /// If the system is stopped, or the board does not answer.
    pub fn push(&mut self, fifo: &Fifo, entry: &[u32]) -> Result<bool, LinkError> {
        self.needs_running()?;
        if self.fifo(fifo)?.full() {
            return Ok(false);
        }
        // The last word pushes the entry.
        let words: Vec<u32> = entry.iter().copied().chain([1]).collect();
        self.write(fifo.field(0), &words)?;
        Ok(true)
    }

    /// Pops the head of a FIFO to the host; `None` if it is empty. The head is read before it is removed, so that a lost answer loses no
    /// entry.
    ///
    /// # Errors
    /// If the system is stopped, or the board does not answer.
    pub fn pop(&mut self, fifo: &Fifo) -> Result<Option<Vec<u32>>, LinkError> {
        self.needs_running()?;
        let mut words = self.read(fifo.address, 1 + fifo.fields.len())?;
        let entry = words.split_off(1);
        if FifoStatus(words[0]).empty() {
            return Ok(None);
        }
        self.write(fifo.act(), &[1])?;
        Ok(Some(entry))
    }

    /// Stops the program, loads another, and reads it back. Does not start it.
    ///
    /// # Errors
    /// If the image is too big or comes back different, or the board does not answer: then the program stays stopped.
    pub fn load(&mut self, records: &[[u32; 3]]) -> Result<(), LinkError> {
        self.load_with(records, |_| ())
    }

    /// Loads a program like [`Host::load`]; `loaded` gets the number of records that each step has written and compared.
    ///
    /// # Errors
    /// See [`Host::load`].
    pub fn load_with(
        &mut self,
        records: &[[u32; 3]],
        mut loaded: impl FnMut(usize),
    ) -> Result<(), LinkError> {
        if records.len() > self.room {
            return Err(LinkError::TooBig(records.len(), self.room));
        }
        self.set("control", 0)?;
        self.set("records", 0)?;
        for (page, some) in records.chunks(PAGE).enumerate() {
            self.set("page", page as u32)?;
            // Each record has four words of address space, the last of them unused.
            for (part, some) in some.chunks(PART).enumerate() {
                let words: Vec<u32> =
                    some.iter().flat_map(|[low, high, place]| [*low, *high, *place, 0]).collect();
                let at = protocol::IMAGE + (4 * PART * part) as u16;
                self.write(at, &words)?;
                let back = self.read(at, words.len())?;
                if let Some(at) = words.iter().zip(&back).position(|(a, b)| a != b) {
                    return Err(LinkError::Image(PAGE * page + PART * part + at / 4));
                }
                loaded(some.len());
            }
        }
        self.set("records", records.len() as u32)
    }

    /// Index of the first record that differs in the board's image. The register `records` holds the number of records on the board.
    ///
    /// # Errors
    /// If the board does not answer.
    pub fn first_difference(&mut self, records: &[[u32; 3]]) -> Result<Option<usize>, LinkError> {
        for (page, some) in records.chunks(PAGE).enumerate() {
            self.set("page", page as u32)?;
            // Each record has four words of address space, the last of them unused.
            let words = self.read(protocol::IMAGE, 4 * some.len())?;
            let differs =
                some.iter().zip(words.chunks(4)).position(|(record, words)| record[..] != words[..3]);
            if let Some(at) = differs {
                return Ok(Some(PAGE * page + at));
            }
        }
        Ok(None)
    }

    /// Sets input ports once per period, a row each: row by row, the values for the period after the period that has just ended. The stream
    /// reports the ends of periods.
    ///
    /// # Errors
    /// If the board does not answer, or no period ends.
    pub fn feed(&mut self, rows: impl IntoIterator<Item = Vec<Ports>>) -> Result<FeedResult, LinkError> {
        let mut fed = FeedResult::default();
        // A frame in every period. A stream has at least one word, which every frame carries besides the register.
        self.set("stream", 1 << 20 | 1 << 16 | u32::from(address("periods")))?;
        self.stream.clear();
        let mut period = self.period()?;
        for row in rows {
            for (address, words) in row {
                self.write(address, &words)?;
            }
            // Periods that ended before the answer did not use the row.
            if let Some(ended) =
                self.stream.drain(..).filter_map(|frame| frame.words.first().copied()).next_back()
            {
                fed.late += ended.wrapping_sub(period);
                period = ended;
            }
            fed.used.push(period.wrapping_add(1));
            let ended = self.period()?;
            fed.late += ended.wrapping_sub(period).saturating_sub(1);
            period = ended;
        }
        self.set("stream", 0)?;
        self.stream.clear();
        Ok(fed)
    }

    /// Next period that ends, from the stream.
    fn period(&mut self) -> Result<u32, LinkError> {
        for _ in 0..STILL {
            if let Some(frame) = self.streamed()?
                && let Some(period) = frame.words.first()
            {
                return Ok(*period);
            }
        }
        Err(LinkError::Still)
    }

    /// Next frame of the stream: received already, or within a short wait.
    ///
    /// # Errors
    /// If the line is gone.
    pub fn streamed(&mut self) -> Result<Option<Frame>, LinkError> {
        if self.stream.is_empty() {
            self.hear()?;
        }
        Ok(self.stream.pop_front())
    }

    /// Receives frames of the stream, waiting a short time at most.
    fn hear(&mut self) -> Result<(), LinkError> {
        let received = self.line.receive()?;
        self.receiver.put(&received);
        while let Some(frame) = self.receiver.frame() {
            if frame.stream {
                self.stream.push_back(frame);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;

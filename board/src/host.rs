//! The host's side of the protocol: requests with retries, over any line.

use crate::application::{Application, CORE};
use crate::ends::Fifo;
use crate::protocol::{self, Frame, Line, LinkError, PAGE, Receiver, WORDS, address};
use crate::top::{self, RECORDS};
use std::collections::VecDeque;
use takt_isa::fp::Flags;

/// The registers that count: of a program's periods since its start, and of the line's frames since power-up.
pub const COUNTERS: [&str; 6] = ["periods", "misses", "cycles", "most_cycles", "errors", "lost"];

/// Times that a request is made.
const ATTEMPTS: u32 = 8;

/// Bytes among which an answer is looked for until the request is made again: many times the longest answer.
const BYTES: usize = 4096;

/// A board that answers.
#[derive(Debug)]
pub struct Host<L> {
    /// The line to it.
    pub line: L,
    receiver: Receiver,
    number: u8,
    stream: VecDeque<Frame>,
    /// Requests that had to be made again.
    pub retries: u64,
    /// Cores of the system that the board carries; 0: it carries a single program.
    pub cores: usize,
    /// Records that its image has room for.
    room: usize,
}

/// Times in a row that a stream may bring nothing until it is given up.
const STILL: u32 = 50;

/// Words for ports with consecutive numbers, the address of the first one ahead.
pub type Ports = (u16, Vec<u32>);

/// What became of rows that were fed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Fed {
    /// The first period that had each row.
    pub used: Vec<u32>,
    /// Periods that had the row of the period before once more, or of which nobody knows.
    pub late: u32,
}

/// What the first word of a FIFO says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FifoStatus(pub u32);

impl FifoStatus {
    /// Entries in it.
    pub fn count(self) -> u32 {
        self.0 >> 16
    }

    /// There is none.
    pub fn empty(self) -> bool {
        self.0 & 1 != 0
    }

    /// There is no room.
    pub fn full(self) -> bool {
        self.0 & 2 != 0
    }

    /// An entry was refused because it was full.
    pub fn overflow(self) -> bool {
        self.0 & 4 != 0
    }

    /// One was asked for while it was empty.
    pub fn underflow(self) -> bool {
        self.0 & 8 != 0
    }
}

/// What the register `status` says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Status(pub u32);

impl Status {
    /// The program waits for its tick.
    pub fn waiting(self) -> bool {
        self.0 & 1 != 0
    }

    /// It has halted.
    pub fn halted(self) -> bool {
        self.0 & 2 != 0
    }

    /// It has stopped with a fault.
    pub fn fault(self) -> bool {
        self.0 & 4 != 0
    }

    /// The slot of the operation that faulted.
    pub fn fault_slot(self) -> usize {
        (self.0 >> 4 & 7) as usize
    }

    /// The sticky exception flags.
    pub fn flags(self) -> Flags {
        // In the same order, from overflow on.
        Flags::from_bits((self.0 >> 7 & 7) as u8 * Flags::OVERFLOW.bits())
    }

    /// It is in reset.
    pub fn in_reset(self) -> bool {
        self.0 >> 10 & 1 != 0
    }

    /// Its outputs drive.
    pub fn drives(self) -> bool {
        self.0 >> 11 & 1 != 0
    }

    /// What the program does, in words; `control` is the value of that register.
    pub fn activity(self, control: u32) -> &'static str {
        match self {
            _ if self.fault() => "stopped with a fault",
            _ if self.halted() => "halted",
            _ if self.in_reset() => "stopped",
            _ if control & protocol::HOLD != 0 => "held",
            _ => "runs",
        }
    }

    /// What stopped the drive.
    pub fn causes(self) -> impl Iterator<Item = &'static str> {
        let names = ["fault", "halt", "missed deadline", "host silent", "stop", "NaN output"];
        names.into_iter().enumerate().filter(move |(i, _)| self.0 >> (12 + i) & 1 != 0).map(|(_, name)| name)
    }
}

/// The kind of a fault, in words, from the value of the register `fault`.
pub fn fault_kind(register: u32) -> &'static str {
    match register >> 16 & 7 {
        1 => "illegal word",
        2 => "data address",
        3 => "return stack full",
        4 => "return stack empty",
        _ => "of an unknown kind",
    }
}

impl<L: Line> Host<L> {
    /// Asks who is there. `number` is that of the first request: any, but not the same each time.
    ///
    /// # Errors
    /// If nobody answers, or a stranger does.
    pub fn connect(line: L, number: u8) -> Result<Host<L>, LinkError> {
        let receiver = Receiver::default();
        let mut host =
            Host { line, receiver, number, stream: VecDeque::new(), retries: 0, cores: 0, room: RECORDS };
        match host.register("id")? {
            protocol::ID => {}
            protocol::SYSTEM_ID => {
                let system = host.register("system")?;
                (host.cores, host.room) = ((system & 0xffff) as usize, (system >> 16) as usize);
            }
            other => return Err(LinkError::Stranger(other)),
        }
        Ok(host)
    }

    /// Whether the board's circuit is one for this program, or system: then it can be loaded, and its names have the right addresses.
    ///
    /// # Errors
    /// If it is not, or the board does not answer.
    pub fn fits<'a>(&mut self, application: impl Into<Application<'a>>) -> Result<(), LinkError> {
        match application.into() {
            Application::Program(_) if self.cores > 0 => Err(LinkError::IsSystem(self.cores)),
            Application::Program(_) => Ok(()),
            Application::System(_) if self.cores == 0 => Err(LinkError::IsProgram),
            Application::System(description) => {
                let wanted = top::circuit_number(description).map_err(Box::new)?;
                if self.register("circuit")? == wanted { Ok(()) } else { Err(LinkError::OtherCircuit) }
            }
        }
    }

    fn request(&mut self, bytes: &[u8], number: u8) -> Result<Frame, LinkError> {
        for attempt in 0..ATTEMPTS {
            self.retries += u64::from(attempt > 0);
            self.line.send(bytes)?;
            // A line brings an answer in as many pieces as it likes; what counts is how long it is silent. Noise and a stream
            // can come without end.
            let (mut silent, mut bytes) = (0, 0);
            while silent < self.line.patience() && bytes < BYTES {
                let received = self.line.receive()?;
                silent = if received.is_empty() { silent + 1 } else { 0 };
                bytes += received.len();
                self.receiver.put(&received);
                while let Some(frame) = self.receiver.frame() {
                    match frame {
                        Frame { stream: true, .. } => self.stream.push_back(frame),
                        Frame { status: 2, number: of, .. } if of == number => return Err(LinkError::Busy),
                        Frame { number: of, .. } if of == number => return Ok(frame),
                        // An answer to a request that was given up.
                        _ => {}
                    }
                }
            }
            self.receiver.give_up();
        }
        Err(LinkError::Silence(ATTEMPTS))
    }

    /// Reads words.
    ///
    /// # Errors
    /// If the board does not answer, or refuses.
    pub fn read(&mut self, address: u16, count: usize) -> Result<Vec<u32>, LinkError> {
        let mut words = Vec::with_capacity(count);
        while words.len() < count {
            let some = (count - words.len()).min(WORDS);
            self.number = self.number.wrapping_add(1);
            let bytes = protocol::read(self.number, address.wrapping_add(words.len() as u16), some as u8);
            let frame = self.request(&bytes, self.number)?;
            if frame.words.len() == some {
                words.extend(frame.words);
            }
        }
        Ok(words)
    }

    /// Writes words; 16 at most go together, between two periods.
    ///
    /// # Errors
    /// If the board does not answer, or refuses.
    pub fn write(&mut self, address: u16, words: &[u32]) -> Result<(), LinkError> {
        for (i, some) in words.chunks(WORDS).enumerate() {
            self.number = self.number.wrapping_add(1);
            let bytes = protocol::write(self.number, address.wrapping_add((WORDS * i) as u16), some);
            self.request(&bytes, self.number)?;
        }
        Ok(())
    }

    /// Sets ports, which must be in ascending order of their addresses. Ports with consecutive addresses change together, between two
    /// periods.
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

    /// A register's value, by its name.
    ///
    /// # Errors
    /// If the board does not answer.
    pub fn register(&mut self, name: &str) -> Result<u32, LinkError> {
        self.register_of(0, name)
    }

    /// A register of a core: `status`, `fault`, `misses`, `periods`, `cycles`, `most_cycles`. A single program's is core 0.
    ///
    /// # Errors
    /// If the board does not answer.
    pub fn register_of(&mut self, core: usize, name: &str) -> Result<u32, LinkError> {
        let at = address(name) + CORE * core as u16;
        Ok(self.read(at, 1)?.first().copied().unwrap_or(0))
    }

    /// Sets a register, by its name.
    ///
    /// # Errors
    /// If the board does not answer.
    pub fn set(&mut self, name: &str, value: u32) -> Result<(), LinkError> {
        self.write(address(name), &[value])
    }

    /// What the program does, or core 0 of a system.
    ///
    /// # Errors
    /// If the board does not answer.
    pub fn status(&mut self) -> Result<Status, LinkError> {
        self.status_of(0)
    }

    /// What a core does.
    ///
    /// # Errors
    /// If the board does not answer.
    pub fn status_of(&mut self, core: usize) -> Result<Status, LinkError> {
        Ok(Status(self.register_of(core, "status")?))
    }

    /// What a FIFO tells about itself.
    ///
    /// # Errors
    /// If the board does not answer.
    pub fn fifo(&mut self, fifo: &Fifo) -> Result<FifoStatus, LinkError> {
        Ok(FifoStatus(self.read(fifo.address, 1)?.first().copied().unwrap_or(0)))
    }

    fn needs_running(&mut self) -> Result<(), LinkError> {
        if self.register("control")? & protocol::RUN == 0 { Err(LinkError::Stopped) } else { Ok(()) }
    }

    /// Puts an entry into a FIFO from the host; false if it is full. A request that is repeated does not push twice.
    ///
    /// # Errors
    /// If the system is stopped, or the board does not answer.
    pub fn push(&mut self, fifo: &Fifo, entry: &[u32]) -> Result<bool, LinkError> {
        self.needs_running()?;
        if self.fifo(fifo)?.full() {
            return Ok(false);
        }
        // The entry goes in with the last word.
        let words: Vec<u32> = entry.iter().copied().chain([1]).collect();
        self.write(fifo.field(0), &words)?;
        Ok(true)
    }

    /// Takes the head of a FIFO to the host; none if it is empty. It is read first, and then taken out: nothing is lost with an answer.
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

    /// Stops the program, and loads another one, which is read back. It does not start.
    ///
    /// # Errors
    /// If the image is too big or comes back different, or the board does not answer: it is then stopped.
    pub fn load(&mut self, records: &[[u32; 3]]) -> Result<(), LinkError> {
        if records.len() > self.room {
            return Err(LinkError::TooBig(records.len(), self.room));
        }
        self.set("control", 0)?;
        self.set("records", 0)?;
        for (page, some) in records.chunks(PAGE).enumerate() {
            if self.cores > 0 {
                self.set("page", page as u32)?;
            }
            // Four words of address for each record, of which the last is not there.
            let words: Vec<u32> =
                some.iter().flat_map(|[low, high, place]| [*low, *high, *place, 0]).collect();
            self.write(protocol::IMAGE, &words)?;
            let back = self.read(protocol::IMAGE, words.len())?;
            if let Some(at) = words.iter().zip(&back).position(|(a, b)| a != b) {
                return Err(LinkError::Image(PAGE * page + at / 4));
            }
        }
        self.set("records", records.len() as u32)
    }

    /// Sets input ports once for each period, a row each: what they have in the period after the one that has just ended. The stream
    /// says when one has.
    ///
    /// # Errors
    /// If the board does not answer, or no period ends.
    pub fn feed(&mut self, rows: impl IntoIterator<Item = Vec<Ports>>) -> Result<Fed, LinkError> {
        let mut fed = Fed::default();
        // Every period; a stream has a word at least, and that of the register is with every frame.
        self.set("stream", 1 << 20 | 1 << 16 | u32::from(address("periods")))?;
        self.stream.clear();
        let mut period = self.period()?;
        for row in rows {
            for (address, words) in row {
                self.write(address, &words)?;
            }
            // Periods that ended before the answer did not have it.
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

    /// The next period that ends, as the stream says.
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

    /// The next frame of the stream: what stands in the line, or after waiting a little.
    ///
    /// # Errors
    /// If the line is gone.
    pub fn streamed(&mut self) -> Result<Option<Frame>, LinkError> {
        if self.stream.is_empty() {
            let received = self.line.receive()?;
            self.receiver.put(&received);
            while let Some(frame) = self.receiver.frame() {
                if frame.stream {
                    self.stream.push_back(frame);
                }
            }
        }
        Ok(self.stream.pop_front())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::ID;

    /// A board that brings a byte at a time, or noise for ever.
    #[derive(Debug)]
    struct Slow {
        bytes: VecDeque<u8>,
        noise: bool,
        sent: u32,
    }

    impl Line for Slow {
        fn send(&mut self, request: &[u8]) -> std::io::Result<()> {
            self.sent += 1;
            if !self.noise {
                self.bytes = protocol::answer(request[1], &[ID]).into();
            }
            Ok(())
        }

        fn receive(&mut self) -> std::io::Result<Vec<u8>> {
            Ok(if self.noise { vec![0x11; 16] } else { self.bytes.pop_front().into_iter().collect() })
        }

        fn patience(&self) -> u32 {
            2
        }
    }

    #[test]
    fn flags_of_a_status() {
        let all = [(7, Flags::OVERFLOW), (8, Flags::DIVIDE_BY_ZERO), (9, Flags::INVALID)];
        assert!(all.iter().all(|(bit, flag)| Status(1 << bit | 5).flags() == *flag));
        assert_eq!((Status(6 << 4 | 4).flags(), Status(6 << 4 | 4).fault_slot()), (Flags::NONE, 6));
    }

    #[test]
    fn an_answer_may_come_in_any_number_of_pieces() {
        let host = Host::connect(Slow { bytes: VecDeque::new(), noise: false, sent: 0 }, 1).unwrap();
        assert_eq!((host.retries, host.line.sent), (0, 1));
    }

    #[test]
    fn noise_without_end_is_no_answer() {
        let error = Host::connect(Slow { bytes: VecDeque::new(), noise: true, sent: 0 }, 1).unwrap_err();
        assert!(matches!(error, LinkError::Silence(ATTEMPTS)), "{error}");
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! The protocol on the UART between host and board: frames, and the map of the registers behind them. docs/protocol.md describes it.

use std::time::Duration;
use takt_isa::Type;
use takt_isa::load::LoadRecord;
use takt_system::MAX_CORES;
use thiserror::Error;

/// Magic number in bits 31:16 of the register `id`: "TK".
pub const MAGIC: u32 = 0x544b;
/// The version of this protocol, bits 15:8 of `id`. Bits 7:0 are the number of cores.
pub const VERSION: u32 = 2;
/// Address of input port 0.
pub const INPUTS: u16 = 0x1000;
/// Address of output port 0.
pub const OUTPUTS: u16 = 0x2000;
/// Number of addresses that each core has for its board registers, its input ports and its output ports. The addresses of core *n* are
/// *n* times this number higher than those of core 0.
pub const CORE: u16 = 0x100;
/// Address of the first value of a link that the host drives.
pub const DRIVEN: u16 = 0x3000;
/// Address of the first value of a link that the host sees.
pub const SEEN: u16 = 0x3400;
/// Address of the first FIFO with an endpoint at the host.
pub const FIFOS: u16 = 0x3800;
/// Addresses that a FIFO has: its status, its fields, and the address whose writes push or pop.
pub const FIFO_WORDS: u16 = 0x20;
/// Address of the first part of the image's first record.
pub const IMAGE: u16 = 0x4000;
/// Address of register 0 of core 0.
pub const CORE_REGISTERS: u16 = 0x8000;
/// Address of data word 0 of core 0.
pub const CORE_DATA: u16 = 0xc000;
/// Records in a page of the image: a single page has addresses at a time.
pub const PAGE: usize = 0x1000;
/// Most pages of an image.
pub const PAGES: usize = 8;
/// Most words of a request.
pub const WORDS: usize = 16;

/// Bits of a core's number in an address from [`CORE_REGISTERS`] on.
pub const fn core_bits(cores: usize) -> u32 {
    cores.next_power_of_two().trailing_zeros()
}

/// Addresses that each core has for its registers, and for its data words: as many as [`core_bits`] leaves.
pub const fn core_words(cores: usize) -> u16 {
    0x4000 >> core_bits(cores)
}

/// The register `id` of a board with `cores` cores.
pub const fn id(cores: usize) -> u32 {
    MAGIC << 16 | VERSION << 8 | cores as u32
}

/// The addresses of a value, as the host finds it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// The address at which the host reads the value.
    pub read: u16,
    /// The address at which the host sets the value; `None` if the host cannot set it.
    pub set: Option<u16>,
    /// The type of the value.
    pub ty: Type,
}

/// Bit of the register `control`: the program runs. While the bit is 0, the core is in reset.
pub const RUN: u32 = 1;
/// Bit of the register `control`: the only ticks are the ticks of the register `step`.
pub const HOLD: u32 = 1 << 1;
/// Bit of the register `control`: the outputs may drive.
pub const ENABLE: u32 = 1 << 2;
/// Bit of the register `control`: writing it starts the program again.
pub const RESTART: u32 = 1 << 8;

/// First byte of a request.
pub const REQUEST: u8 = 0xa5;
/// First byte of an answer.
pub const ANSWER: u8 = 0x5a;
/// First byte of a frame that the board sends by itself.
pub const STREAM: u8 = 0x3c;

/// Status of an answer: the request is done.
pub const DONE: u8 = 0;
/// Status of an answer: the host cannot write an address of the request now, and nothing was written.
pub const READ_ONLY: u8 = 1;
/// Status of an answer: the program did not wait.
pub const BUSY: u8 = 2;

/// A request to this address waits until the program is between two periods.
pub const fn waits(address: u16) -> bool {
    matches!(address >> 12, 1..=3 | 8..)
}

/// A register of the board that the host reads or writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Register {
    /// The address of the register.
    pub address: u16,
    /// The name of the register.
    pub name: &'static str,
    /// The access that the host has: `r`, `w` or `rw`.
    pub access: &'static str,
    /// The register's contents, in words.
    pub text: &'static str,
}

const fn register(address: u16, name: &'static str, access: &'static str, text: &'static str) -> Register {
    Register { address, name, access, text }
}

/// The board's registers. Generator, host and docs/protocol.md take the registers from this table.
pub const REGISTERS: [Register; 34] = [
    register(
        0,
        "id",
        "r",
        "31:16 0x544b (`TK`), 15:8 the version of this protocol, 2; 7:0 the number of cores",
    ),
    register(
        1,
        "control",
        "rw",
        "bit 0 run: while it is 0 the core is in reset; 1 hold: no ticks but by `step`; 2 enable: outputs may drive. Writing bit 8 \
         starts the program again",
    ),
    register(
        2,
        "status",
        "r",
        "bit 0 waiting, 1 halted, 2 fault, 6:4 slot of the fault, sticky flags: 7 overflow, 8 divide by zero, 9 invalid; 10 in reset, \
         11 drive, 17:12 what stopped the drive: fault, halt, deadline, host, stop, a NaN output; 18 a trip is held, \
         19 a second core (docs/safety.md) has done something else, which stopped the drive, too, 20 a memory error, which did; \
         31:24 corrected words since the start, at most 255, both with error correction (docs/safety.md)",
    ),
    register(3, "fault", "r", "15:0 bundle, 18:16 kind, as of the Wishbone slave (docs/hardware.md)"),
    register(4, "period", "rw", "cycles from tick to tick"),
    register(5, "lead", "rw", "cycles by which conversions start before the tick"),
    register(6, "step", "w", "while hold is 1: a tick"),
    register(7, "misses", "r", "missed deadlines since the start"),
    register(8, "errors", "r", "frames that were dropped, since power-up"),
    register(9, "periods", "r", "periods since the start"),
    register(10, "cycles", "r", "of the last period, from its tick to its outputs on the peripherals"),
    register(11, "most_cycles", "r", "the same, the most since the start"),
    register(12, "records", "rw", "records of the image; written while run is 0"),
    register(
        13,
        "stream",
        "rw",
        "15:0 first address, 19:16 words (1 to 15), 31:20 N: sent every N periods; 0: no stream",
    ),
    register(14, "lost", "r", "frames of the stream that were not sent, since power-up"),
    register(15, "room", "r", "records that the image has room for"),
    register(16, "circuit", "r", "a number for cores, links and ports, without the programs"),
    register(
        17,
        "page",
        "rw",
        "the 4096 records of the image that have addresses: 0 for the first; from 8 on, the 16,384 words of the scope's ring in their place",
    ),
    register(18, "observed", "r", "1: registers and data memory can be read; 0: the wiring leaves that out"),
    register(19, "issued", "r", "15:0 the bundle that issued last, if `observed` is 1"),
    register(20, "trips", "r", "the trips that are held, the wiring's first in bit 0"),
    register(
        48,
        "flash",
        "rw",
        "bit 0 busy; 3:2 the image that was started, the first in bit 2; 5:4 images that were valid at the reset; 7:6 images that read \
         otherwise when they were played. Written: 7:0 bytes of the buffer that are sent, 15:8 bytes that are received then",
    ),
    register(
        49,
        "flash_at",
        "r",
        "places of the two images in pages of 256 bytes: 15:0 the first, 31:16 the second",
    ),
    register(50, "flash_room", "r", "entries that an image may have; 0: no flash"),
    register(
        64,
        "scope",
        "r",
        "15:0 samples of the scope's ring, 19:16 channels, 27:24 the core that it records, 28 channels can be restricted to a bundle; 0: no \
         scope",
    ),
    register(
        65,
        "scope_state",
        "rw",
        "1:0 0 at rest, 1 armed, 2 triggered, 3 done; 2 the last sample is that of a stop; 9:4 the trigger: fault or halt, missed deadline, \
         trip, outputs become safe, host, comparison; 27:16 periods until the next sample. Written: bit 0 arms, 1 triggers, 2 ends",
    ),
    register(66, "scope_every", "rw", "11:0 N: a sample every N periods"),
    register(
        67,
        "scope_length",
        "rw",
        "15:0 samples before the trigger's for which a comparison waits, 31:16 samples after it",
    ),
    register(
        68,
        "scope_trigger",
        "rw",
        "2:0 comparison: 0 none, 1 at or above the level, 2 below, 3 rises to it, 4 falls below it, 5 equals it, 6 the value changes; 6:4 \
         channel, 9:8 type: 0 binary32, 1 integer, 2 bits; 19:16 events, as in `scope_state`: fault or halt, missed deadline, trip, outputs \
         become safe",
    ),
    register(69, "scope_level", "rw", "the level, as a key: below"),
    register(
        70,
        "scope_at",
        "r",
        "15:0 place in the ring after the last sample, 31:16 place of the trigger's sample",
    ),
    register(71, "scope_samples", "r", "samples since the scope was armed, ffff at most"),
    register(72, "scope_period", "r", "the period in which it was triggered"),
    register(73, "scope_last", "r", "the period of the last sample"),
];

/// Address of the flash's buffer, of [`WORDS`] words; the registers `flash` to `flash_room` lie behind it.
pub const FLASH: u16 = 32;
/// Address of the scope's first register; it has 64 addresses.
pub const SCOPE: u16 = 64;
/// The page from which on the ring of the scope is at [`IMAGE`], with this number of words each.
pub(crate) const SCOPE_PAGE: u32 = 8;
/// Words of the ring in a page.
pub(crate) const PAGE_WORDS: usize = 0x4000;

/// Address of the register that names a channel's register; at the next two are its value, and the last samples in which it has one.
pub(crate) const fn channel(number: usize) -> u16 {
    SCOPE + 32 + 4 * number as u16
}

/// The registers as rows of the table in docs/protocol.md.
pub fn markdown() -> String {
    let row = |r: &Register| format!("| {} | {} | {} | {} |\n", r.address, r.name, r.access, r.text);
    REGISTERS.iter().map(row).collect()
}

/// The address of a register.
pub(crate) fn address(name: &str) -> u16 {
    REGISTERS.iter().find(|register| register.name == name).map_or(0, |register| register.address)
}

/// CRC-16/CCITT-FALSE: polynomial 0x1021, initially 0xffff, highest bit first.
pub fn checksum(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0xffff, |sum, &byte| {
        (0..8).fold(
            sum ^ u16::from(byte) << 8,
            |sum, _| {
                if sum & 0x8000 == 0 { sum << 1 } else { sum << 1 ^ 0x1021 }
            },
        )
    })
}

/// The record of a core's image as its three words: low, high, place.
pub fn record_words(core: usize, record: &LoadRecord) -> [u32; 3] {
    let place = (core as u32) << 21
        | u32::from(record.slot) << 18
        | (record.space as u32) << 16
        | u32::from(record.address);
    [record.value as u32, (record.value >> 32) as u32, place]
}

/// A frame from the board.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// The frame belongs to the stream; otherwise it is an answer.
    pub stream: bool,
    /// The number of the answered request; in the stream, a number that goes up by 1 with each frame sent.
    pub number: u8,
    /// The status: [`DONE`], [`READ_ONLY`] or [`BUSY`].
    pub status: u8,
    /// The words that the request has read, or that the stream carries.
    pub words: Vec<u32>,
}

/// A request that reads words.
pub fn read(number: u8, address: u16, count: u8) -> Vec<u8> {
    request(number, 1, count, address, &[])
}

/// A request that writes words.
pub fn write(number: u8, address: u16, words: &[u32]) -> Vec<u8> {
    request(number, 2, words.len() as u8, address, words)
}

/// The bytes begin with a whole request.
pub fn has_request(bytes: &[u8]) -> bool {
    let [_, _, command, count, ..] = bytes else { return false };
    let words = if *command == 2 { usize::from(*count) } else { 0 };
    bytes.len() >= 8 + 4 * words
}

/// A request as a board understands it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Request {
    pub(crate) number: u8,
    /// The address of the first word.
    pub(crate) address: u16,
    /// The number of words to read, or to write.
    pub(crate) count: usize,
    /// The words to write; `None` if the request reads.
    pub(crate) words: Option<Vec<u32>>,
}

/// Takes the first whole request out of `bytes`. Bytes that begin no request are dropped, and `errors` counts broken requests.
pub(crate) fn take_request(bytes: &mut Vec<u8>, errors: &mut u32) -> Option<Request> {
    loop {
        let begins = bytes.iter().position(|&byte| byte == REQUEST).unwrap_or(bytes.len());
        bytes.drain(..begins);
        let &[_, number, command, count, low, high, ..] = bytes.as_slice() else { return None };
        let words = if command == 2 { usize::from(count) } else { 0 };
        let end = 6 + 4 * words;
        let possible = matches!(command, 1 | 2) && (1..=WORDS).contains(&usize::from(count));
        if possible && bytes.len() < end + 2 {
            return None;
        }
        if possible && checksum(&bytes[1..end]).to_le_bytes() == bytes[end..end + 2] {
            let word = |bytes: &[u8]| u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
            let words = (command == 2).then(|| bytes[6..end].chunks_exact(4).map(word).collect());
            let address = u16::from_le_bytes([low, high]);
            bytes.drain(..end + 2);
            return Some(Request { number, address, count: count.into(), words });
        }
        *errors += 1;
        bytes.remove(0);
    }
}

fn request(number: u8, command: u8, count: u8, address: u16, words: &[u32]) -> Vec<u8> {
    let [low, high] = address.to_le_bytes();
    let mut bytes = vec![REQUEST, number, command, count, low, high];
    bytes.extend(words.iter().flat_map(|word| word.to_le_bytes()));
    let sum = checksum(&bytes[1..]);
    bytes.extend(sum.to_le_bytes());
    bytes
}

/// The bytes of a board's answer: a status, and the words that were read.
pub(crate) fn answer(number: u8, status: u8, words: &[u32]) -> Vec<u8> {
    from_board(ANSWER, number, status, words)
}

/// The bytes of a frame of the stream.
pub(crate) fn streamed(number: u8, words: &[u32]) -> Vec<u8> {
    from_board(STREAM, number, DONE, words)
}

/// The bytes begin with a whole request that writes.
pub fn has_write(bytes: &[u8]) -> bool {
    has_request(bytes) && bytes[2] == 2
}

fn from_board(first: u8, number: u8, status: u8, words: &[u32]) -> Vec<u8> {
    let mut bytes = vec![first, number, status, words.len() as u8];
    bytes.extend(words.iter().flat_map(|word| word.to_le_bytes()));
    let sum = checksum(&bytes[1..]);
    bytes.extend(sum.to_le_bytes());
    bytes
}

/// The parser of frames among the bytes of a line, between noise.
#[derive(Clone, Debug, Default)]
pub struct Receiver {
    bytes: Vec<u8>,
    /// Bytes that belonged to no frame.
    pub dropped: u64,
}

impl Receiver {
    /// Appends the bytes that have come.
    pub fn put(&mut self, bytes: &[u8]) {
        self.bytes.extend(bytes);
    }

    /// The next whole frame. Bytes that cannot begin a frame are dropped.
    pub fn frame(&mut self) -> Option<Frame> {
        loop {
            let drop = match self.bytes.as_slice() {
                [] => return None,
                [ANSWER | STREAM, rest @ ..] => match rest {
                    [_, _, count, ..] if usize::from(*count) > WORDS => 1,
                    [number, status, count, ..] => {
                        let end = 4 + 4 * usize::from(*count);
                        if self.bytes.len() < end + 2 {
                            return None;
                        }
                        let sum = u16::from_le_bytes([self.bytes[end], self.bytes[end + 1]]);
                        if checksum(&self.bytes[1..end]) == sum {
                            let word =
                                |bytes: &[u8]| u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
                            let frame = Frame {
                                stream: self.bytes[0] == STREAM,
                                number: *number,
                                status: *status,
                                words: self.bytes[4..end].chunks_exact(4).map(word).collect(),
                            };
                            self.bytes.drain(..end + 2);
                            return Some(frame);
                        }
                        1
                    }
                    _ => return None,
                },
                _ => 1,
            };
            self.bytes.drain(..drop);
            self.dropped += drop as u64;
        }
    }

    /// Drops the first byte: a frame that was incomplete before a pause will never be complete.
    pub fn give_up(&mut self) {
        if !self.bytes.is_empty() {
            self.bytes.remove(0);
            self.dropped += 1;
        }
    }
}

/// A line to a board.
pub trait Line {
    /// Sends bytes over the line.
    ///
    /// # Errors
    /// If the line is gone.
    fn send(&mut self, bytes: &[u8]) -> std::io::Result<()>;

    /// Receives the bytes that have come, after waiting a little for them; receiving no byte is not an error.
    ///
    /// # Errors
    /// If the line is gone.
    fn receive(&mut self) -> std::io::Result<Vec<u8>>;

    /// Number of consecutive reads without a byte after which the host repeats a request.
    fn patience(&self) -> u32;

    /// Time on the line since an arbitrary start. It limits how long the host listens to an endless stream of bytes.
    fn time(&self) -> Duration;
}

/// Reason why the board did not do what the host asked for.
#[derive(Debug, Error)]
pub enum LinkError {
    /// The line is gone.
    #[error("the connection is lost: {0}")]
    Line(#[from] std::io::Error),
    /// The board did not answer, however often it was asked.
    #[error(
        "no answer in {0} attempts: is this the right port, with the right baud rate, and the board's bitstream loaded?"
    )]
    Silence(u32),
    /// All answers had the wrong number of words.
    #[error(
        "the board answers with {came} words where {wanted} were asked for, in {attempts} attempts: its circuit is not one of `takt board build`, or of another version"
    )]
    Words {
        /// Words that the host wanted to read; 0 for a write.
        wanted: usize,
        /// Words of the last answer.
        came: usize,
        /// The number of attempts.
        attempts: u32,
    },
    /// An address of a write cannot be written.
    #[error(
        "the board refuses to write {words} words from address {address:#06x} on: an address of them is read only, a peripheral drives it, or it can be written only while the program is stopped, or held (docs/protocol.md)"
    )]
    ReadOnly {
        /// The address of the first word.
        address: u16,
        /// Words that the host wanted to write.
        words: usize,
    },
    /// The answer has a status that the protocol does not have.
    #[error("the board answers with status {0}, which docs/protocol.md does not have")]
    Status(u8),
    /// The board has no core, or more cores than a system can have.
    #[error("the board says that it carries {0} cores; there can be 1 to {MAX_CORES}")]
    Cores(usize),
    /// The board speaks another version of the protocol.
    #[error(
        "the board speaks version {0} of the protocol, this is version {VERSION}: `takt board build` of this `takt` makes a circuit for it"
    )]
    Version(u32),
    /// The program does not wait.
    #[error(
        "the program does not wait for its tick, so its values cannot be read or set between periods; `takt live PORT stop` stops it"
    )]
    Busy,
    /// A command to the flash does not end.
    #[error("the board's last command to its flash does not end")]
    Flash,
    /// No period ends any more.
    #[error(
        "no period has ended for a while: the program has stopped, or is held; `takt live PORT status` says which"
    )]
    Still,
    /// The device at the other end is not a Takt board.
    #[error("the device that answers is not a board of Takt: its register `id` is {0:#010x}")]
    Stranger(u32),
    /// A record of the image came back different from the record that was written.
    #[error(
        "record {0} of the program reads back different from the written value: the board stays stopped; try again"
    )]
    Image(usize),
    /// The board has another number of cores.
    #[error(
        "number of cores: {there} on the board, {wanted} in the program or system; `takt board build` makes a circuit for it"
    )]
    OtherCores {
        /// The number of cores on the board.
        there: usize,
        /// The number of cores of the program, or system.
        wanted: usize,
    },
    /// The board has the circuit of other machines, links or ports.
    #[error(
        "the board's circuit is that of another program or system: machines, ticks, links or ports differ; `takt board build` makes one for this"
    )]
    OtherCircuit,
    /// The host has no circuit to compare the board's circuit with.
    #[error("{0}")]
    NoCircuit(String),
    /// The system is stopped: its FIFOs would lose the entries.
    #[error("the system is stopped, and its FIFOs are empty; `takt live PORT start` starts it")]
    Stopped,
    /// The image is too big for the board.
    #[error("the program takes {0} records; the board has room for {1}")]
    TooBig(usize, usize),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checksum_is_the_standards() {
        // The check value of CRC-16/CCITT-FALSE in the catalogue of CRCs (reveng.sourceforge.io).
        assert_eq!(checksum(b"123456789"), 0x29b1);
    }

    #[test]
    fn frames_are_found_between_noise() {
        let mut line = vec![1, ANSWER, 200];
        line.extend(answer(7, 0, &[0x5a5a_5a5a, 2]));
        let mut broken = answer(8, 0, &[3]);
        broken[5] ^= 4;
        line.extend(broken);
        line.extend(answer(9, 0, &[]));
        let mut receiver = Receiver::default();
        let mut found = Vec::new();
        for byte in line {
            receiver.put(&[byte]);
            assert!(receiver.frame().is_none(), "what noise seems to begin waits for its end");
        }
        // After a pause, the receiver treats the bytes as noise.
        receiver.give_up();
        while let Some(frame) = receiver.frame() {
            found.push((frame.number, frame.words));
        }
        assert_eq!(found, [(7, vec![0x5a5a_5a5a, 2]), (9, vec![])]);
        assert!(receiver.dropped > 0);
    }
}

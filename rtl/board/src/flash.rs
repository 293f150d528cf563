// SPDX-License-Identifier: MIT OR Apache-2.0
//! Images in a board's SPI flash: their form, and the update, which leaves a valid image at any moment at which the power goes.
//!
//! `takt_flash.v` is the board's side; docs/protocol.md describes the form.

use crate::host::Host;
use crate::kind::Direction;
use crate::protocol::{self, Line, LinkError, PAGE, WORDS, address};
use std::fmt::{self, Display, Formatter};
use std::ops::Range;
use thiserror::Error;

/// The pins of a flash by their names in a wiring, with their directions, seen from the circuit.
pub const PINS: [(&str, Direction); 4] = [
    ("select", Direction::Output),
    ("clock", Direction::Output),
    ("out", Direction::Output),
    ("in", Direction::Input),
];

/// The pin `clock` of a flash that the device is configured from, where that clock is no ordinary pin.
pub const MCLK: &str = "mclk";

/// Bytes that the flash erases together.
pub const SECTOR: u32 = 4096;
/// Addresses of a flash that commands with three bytes of address reach.
pub const REACH: u32 = 1 << 24;
/// First word of an image.
const MAGIC: u32 = u32::from_be_bytes(*b"TKF1");
/// Bytes of an image before its entries, of an entry, and of the checksum.
const HEAD: usize = 16;
const ENTRY: usize = 8;
const SUM: usize = 4;
/// Bytes that one command programs: they lie in one page of the flash.
const PART: usize = 32;
/// Bytes that one command reads.
const READ: usize = 64;
/// Limit on the polls for the end of a command, and of an erasure: seconds on the fastest line.
const POLLS: u32 = 20_000;
/// Highest frequency of the flash's clock in MHz, which every flash takes for all commands that are used.
const MOST_CLOCK: f64 = 20.0;

/// A flash beside the device, as a wiring has it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Flash {
    /// The board's names of the pins, in the order of [`PINS`].
    pub pins: [String; 4],
    /// Addresses of the two images.
    pub slots: [u32; 2],
    pub(crate) place: Range<usize>,
}

impl Flash {
    /// The clock comes from the device's configuration, not from an ordinary pin.
    pub fn is_configuration(&self) -> bool {
        self.pins[1] == MCLK
    }

    /// Message about images that overlap or end beyond the flash, with this room for records; `None` if they fit.
    pub(crate) fn overlap(&self, records: usize) -> Option<String> {
        let ([first, second], bytes) = (self.slots, slot_bytes(records));
        if first.abs_diff(second) < bytes {
            Some(format!(
                "the two images overlap: each takes {bytes} bytes (0x{bytes:x}), and they begin {} apart",
                first.abs_diff(second)
            ))
        } else {
            let end = u64::from(first.max(second)) + u64::from(bytes);
            (end > REACH.into())
                .then(|| format!("an image takes {bytes} bytes (0x{bytes:x}), and ends beyond 16 MB"))
        }
    }
}

/// Number of entries for which an image with this room for records has room.
pub fn entries_room(records: usize) -> usize {
    3 * records + protocol::PAGES + 2
}

/// Bytes of a slot for images with this room for records, in whole sectors.
pub fn slot_bytes(records: usize) -> u32 {
    ((HEAD + ENTRY * entries_room(records) + SUM) as u32).next_multiple_of(SECTOR)
}

/// Cycles of half a bit on the flash's pins, at a clock in MHz.
pub(crate) fn half_bit(clock: f64) -> u32 {
    // From two on, so that a bit is sampled after it was sent.
    (clock / MOST_CLOCK / 2.0).ceil().max(2.0) as u32
}

/// The writes on the board's bus by which a program comes into its image.
pub fn entries(records: &[[u32; 3]]) -> Vec<(u16, u32)> {
    let mut entries = Vec::with_capacity(entries_room(records.len()));
    for (page, some) in records.chunks(PAGE).enumerate() {
        entries.push((address("page"), page as u32));
        for (i, record) in some.iter().enumerate() {
            let at = protocol::IMAGE + 4 * i as u16;
            entries.extend(record.iter().enumerate().map(|(part, word)| (at + part as u16, *word)));
        }
    }
    entries.extend([(address("page"), 0), (address("records"), records.len() as u32)]);
    entries
}

/// CRC-32/MPEG-2: that of Ethernet with the bits of each byte and of the result in the other order, and the result not inverted.
fn checksum(bytes: &[u8]) -> u32 {
    let turned: Vec<u8> = bytes.iter().map(|byte| byte.reverse_bits()).collect();
    (!crc32fast::hash(&turned)).reverse_bits()
}

/// The bytes of an image for a circuit; the image with the later number is played.
pub fn image(circuit: u32, number: u32, entries: &[(u16, u32)]) -> Vec<u8> {
    let mut words = vec![MAGIC, circuit, number, entries.len() as u32];
    words.extend(entries.iter().flat_map(|(at, value)| [u32::from(*at), *value]));
    let mut bytes: Vec<u8> = words.iter().flat_map(|word| word.to_be_bytes()).collect();
    bytes.extend(checksum(&bytes).to_be_bytes());
    bytes
}

/// The length in bytes of an image with this beginning, and its number; `None` if the image is none for the circuit.
fn head(bytes: &[u8; HEAD], circuit: u32, room: u32) -> Option<(usize, u32)> {
    let word = |i: usize| u32::from_be_bytes([0, 1, 2, 3].map(|k| bytes[4 * i + k]));
    let is_one = word(0) == MAGIC && word(1) == circuit && word(3) <= room;
    is_one.then(|| (HEAD + ENTRY * word(3) as usize + SUM, word(2)))
}

/// One of the two images.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Slot {
    /// The image at the first address.
    First,
    /// The image at the second address.
    Second,
}

impl Slot {
    /// Both, in the order of their addresses.
    pub const ALL: [Slot; 2] = [Slot::First, Slot::Second];

    fn other(self) -> Slot {
        if self == Slot::First { Slot::Second } else { Slot::First }
    }
}

impl Display for Slot {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(if *self == Slot::First { "first" } else { "second" })
    }
}

/// The image that `takt_flash.v` plays, of the numbers of those that are valid.
pub fn newest(numbers: [Option<u32>; 2]) -> Option<Slot> {
    match numbers {
        [None, None] => None,
        [Some(_), None] => Some(Slot::First),
        [Some(first), Some(second)] if second.wrapping_sub(first) >> 31 == 1 => Some(Slot::First),
        _ => Some(Slot::Second),
    }
}

/// The board's flash, as its registers describe it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Addresses of the two images.
    pub slots: [u32; 2],
    /// Entries that an image may have.
    pub room: u32,
    /// The circuit that images are for.
    pub circuit: u32,
}

/// Reason why an image was not stored. The image before is still valid.
#[derive(Debug, Error)]
pub enum FlashError<E> {
    /// The line failed.
    #[error(transparent)]
    Line(#[from] E),
    /// Nothing is at the flash's pins.
    #[error("no flash answers at the pins of the wiring's `[flash]`: its identification reads as {0:06x}")]
    Absent(u32),
    /// The image is longer than its slot.
    #[error("the program's image has {0} entries, and the board has room for {1}")]
    TooBig(usize, u32),
    /// The flash stays busy.
    #[error("the flash is still busy after {POLLS} polls")]
    Busy,
    /// The flash does not keep what is written.
    #[error(
        "the flash reads as {found:02x} at {at:06x}, where {wanted:02x} was written: it may be protected against writing; the image \
         before is as it was"
    )]
    Kept {
        /// The address.
        at: u32,
        /// The byte that was written.
        wanted: u8,
        /// The byte that is there.
        found: u8,
    },
}

/// Commands to a flash: bytes that are sent, then bytes that come back.
pub trait Commands {
    /// Reason why a command did not reach the flash.
    type Error;

    /// Sends at most 64 bytes, at least one, and receives at most 64.
    ///
    /// # Errors
    /// If the command did not reach the flash.
    fn command(&mut self, send: &[u8], receive: usize) -> Result<Vec<u8>, Self::Error>;
}

/// A command with an address.
fn at(command: u8, address: u32) -> Vec<u8> {
    let [_, bytes @ ..] = address.to_be_bytes();
    [&[command][..], &bytes].concat()
}

fn read<C: Commands>(flash: &mut C, from: u32, count: usize) -> Result<Vec<u8>, FlashError<C::Error>> {
    let mut bytes = Vec::with_capacity(count);
    while bytes.len() < count {
        let some = (count - bytes.len()).min(READ);
        bytes.extend(flash.command(&at(0x03, from + bytes.len() as u32), some)?);
    }
    Ok(bytes)
}

/// A command that changes the flash, to its end.
fn change<C: Commands>(flash: &mut C, command: &[u8]) -> Result<(), FlashError<C::Error>> {
    flash.command(&[0x06], 0)?;
    flash.command(command, 0)?;
    for _ in 0..POLLS {
        if flash.command(&[0x05], 1)?.first().is_some_and(|status| status & 1 == 0) {
            return Ok(());
        }
    }
    Err(FlashError::Busy)
}

/// Programs bytes and compares what the flash has kept.
fn program<C: Commands>(
    flash: &mut C,
    from: u32,
    bytes: &[u8],
    mut done: impl FnMut(usize),
) -> Result<(), FlashError<C::Error>> {
    let mut begin = 0;
    while begin < bytes.len() {
        let address = from + begin as u32;
        // Up to a boundary of parts, so that none crosses a page.
        let some = &bytes[begin..(begin + PART - address as usize % PART).min(bytes.len())];
        change(flash, &[at(0x02, address), some.to_vec()].concat())?;
        let back = read(flash, address, some.len())?;
        if let Some(i) = some.iter().zip(&back).position(|(a, b)| a != b) {
            return Err(FlashError::Kept { at: address + i as u32, wanted: some[i], found: back[i] });
        }
        begin += some.len();
        done(some.len());
    }
    Ok(())
}

/// The numbers of the images that are valid.
///
/// # Errors
/// If no flash answers, or the line fails.
pub fn numbers<C: Commands>(flash: &mut C, place: &Place) -> Result<[Option<u32>; 2], FlashError<C::Error>> {
    let id = flash.command(&[0x9f], 3)?;
    if id.iter().all(|byte| *byte == 0xff) || id.iter().all(|byte| *byte == 0) {
        return Err(FlashError::Absent(id.iter().fold(0, |id, byte| id << 8 | u32::from(*byte))));
    }
    let mut numbers = [None; 2];
    for (number, slot) in numbers.iter_mut().zip(place.slots) {
        let bytes = read(flash, slot, HEAD)?;
        let Some((length, its)) =
            bytes.first_chunk().and_then(|bytes| head(bytes, place.circuit, place.room))
        else {
            continue;
        };
        let whole = read(flash, slot, length)?;
        // With the checksum at its end, an image has the checksum 0.
        *number = (checksum(&whole) == 0).then_some(its);
    }
    Ok(numbers)
}

/// Stores an image where the newest valid one is not; `done` gets the bytes that each step has written and compared. Returns the slot
/// and the image's number. The word by which an image is one is written last.
///
/// # Errors
/// If the image is too long, no flash answers or keeps it, or the line fails; the newest image is then as it was.
pub fn store<C: Commands>(
    flash: &mut C,
    place: &Place,
    entries: &[(u16, u32)],
    mut done: impl FnMut(usize),
) -> Result<(Slot, u32), FlashError<C::Error>> {
    if entries.len() > place.room as usize {
        return Err(FlashError::TooBig(entries.len(), place.room));
    }
    let numbers = numbers(flash, place)?;
    let before = newest(numbers);
    let slot = before.map_or(Slot::First, Slot::other);
    let number = before.and_then(|slot| numbers[slot as usize]).map_or(1, |number| number.wrapping_add(1));
    let (bytes, from) = (image(place.circuit, number, entries), place.slots[slot as usize]);
    for sector in (0..bytes.len() as u32).step_by(SECTOR as usize) {
        change(flash, &at(0x20, from + sector))?;
    }
    program(flash, from + 4, &bytes[4..], &mut done)?;
    program(flash, from, &bytes[..4], &mut done)?;
    Ok((slot, number))
}

/// Makes both images invalid: the next power-up begins with the bitstream's program.
///
/// # Errors
/// If no flash answers or keeps it, or the line fails.
pub fn forget<C: Commands>(flash: &mut C, place: &Place) -> Result<(), FlashError<C::Error>> {
    numbers(flash, place)?;
    // Bits of a flash can be cleared without an erasure.
    place.slots.iter().try_for_each(|slot| program(flash, *slot, &[0; 4], |_| ()))
}

/// Result of the choice at the last reset: the register `flash`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Started(u32);

impl Started {
    /// The image that was started; `None` for the bitstream's program.
    pub fn running(self) -> Option<Slot> {
        Slot::ALL.into_iter().find(|slot| self.0 >> (2 + *slot as u32) & 1 == 1)
    }

    /// An image was valid, and read otherwise when it was played.
    pub fn failed(self, slot: Slot) -> bool {
        self.0 >> (6 + slot as u32) & 1 == 1
    }
}

impl<L: Line> Host<L> {
    /// The board's flash; `None` for a board without one.
    ///
    /// # Errors
    /// If the board does not answer.
    pub fn flash(&mut self) -> Result<Option<Place>, LinkError> {
        let words = self.read(address("flash_at"), 2)?;
        // In pages of 256 bytes.
        let slots = [words[0] << 8 & 0xff_ff00, words[0] >> 8 & 0xff_ff00];
        let circuit = self.register("circuit")?;
        Ok((words[1] != 0).then_some(Place { slots, room: words[1], circuit }))
    }

    /// Result of the choice among the images at the last reset.
    ///
    /// # Errors
    /// If the board does not answer.
    pub fn started(&mut self) -> Result<Started, LinkError> {
        Ok(Started(self.register("flash")?))
    }
}

impl<L: Line> Commands for Host<L> {
    type Error = LinkError;

    fn command(&mut self, send: &[u8], receive: usize) -> Result<Vec<u8>, LinkError> {
        // The bytes are the last ones of the buffer, and the word that sends them lies behind it.
        let mut words = vec![0_u32; send.len().div_ceil(4)];
        let begin = 4 * words.len() - send.len();
        for (i, byte) in send.iter().enumerate() {
            words[(begin + i) / 4] |= u32::from(*byte) << (8 * ((begin + i) % 4));
        }
        let go = (receive as u32) << 8 | send.len() as u32;
        let to = address("flash") - words.len() as u16;
        words.push(go);
        self.write(to, &words)?;
        let ends = (0..POLLS)
            .map(|_| self.register("flash"))
            .find(|state| !matches!(state, Ok(state) if state & 1 != 0));
        ends.unwrap_or(Err(LinkError::Flash))?;
        let words = self.read(protocol::FLASH, receive.div_ceil(4))?;
        Ok(words.iter().flat_map(|word| word.to_le_bytes()).take(receive).collect())
    }
}

const _: () = assert!(READ == 4 * WORDS && PART + 4 < READ, "takt_flash has 16 words");

// SPDX-License-Identifier: MIT OR Apache-2.0
//! The stream that a board sends by itself every few periods: the words of a frame, and the names of the words.

use crate::application::Application;
use crate::protocol::{CORE, CORE_REGISTERS, Frame};
use takt_isa::Type;

/// Most words of a frame of the stream, besides the number of the period.
pub const STREAMED: u16 = 15;

/// Ports, registers or data words that a single frame carries.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stream {
    first: u16,
    words: u32,
    /// The place among the words, and the type, of each name's value.
    values: Vec<(usize, Type)>,
}

impl Stream {
    /// Stream of the values with these names ([`Application::find`]).
    ///
    /// # Errors
    /// A message, if a name does not exist, or the names do not fit into a frame.
    pub fn of(application: &Application<'_>, names: &[String]) -> Result<Stream, String> {
        let found = names.iter().map(|name| application.find(name)).collect::<Result<Vec<_>, _>>()?;
        let addresses = || found.iter().map(|place| place.read);
        let (first, last) = (addresses().min().unwrap_or(0), addresses().max().unwrap_or(0));
        let block = |address: u16| match address < CORE_REGISTERS {
            true => address / CORE,
            false => address / application.core_words(),
        };
        if found.is_empty() || block(first) != block(last) || last - first >= STREAMED {
            return Err(format!(
                "a stream can have up to {STREAMED} consecutive numbers: inputs, outputs, registers or data words of one core"
            ));
        }
        let values = found.iter().map(|place| (usize::from(place.read - first), place.ty)).collect();
        Ok(Stream { first, words: u32::from(last - first) + 1, values })
    }

    /// The value of the register `stream` for a frame every `every` periods, at most every 4095.
    pub fn register(&self, every: u32) -> u32 {
        every << 20 | self.words << 16 | u32::from(self.first)
    }

    /// The period of a frame, and the bits and type of each name's value; `None` if the frame belongs to another stream.
    pub fn values<'f>(&'f self, frame: &'f Frame) -> Option<(u32, impl Iterator<Item = (u32, Type)> + 'f)> {
        let (period, words) = frame.words.split_first()?;
        let values = self.values.iter().map(|(at, ty)| (words[*at], *ty));
        (words.len() == self.words as usize).then_some((*period, values))
    }
}

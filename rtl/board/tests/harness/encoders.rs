// SPDX-License-Identifier: MIT OR Apache-2.0
//! Encoders behind the pins of a model, for stimuli: frames that are right most of the time.

use rand_pcg::Pcg64;
use rand_pcg::rand_core::{Rng as _, SeedableRng as _};
use takt_board::model::Model;

/// An encoder, a cycle at a time.
pub(crate) trait Encoder {
    /// The level of the data pin in the next cycle; `clock` is the level of the clock pin in this one.
    fn clock(&mut self, clock: bool, random: &mut Pcg64) -> bool;

    /// The encoder holds this position at its next sample, in place of a random one.
    fn holds(&mut self, position: u64);

    /// A frame has begun, and not ended.
    fn is_busy(&self) -> bool;
}

/// Bits of a position, the highest first, or random ones.
fn word(position: Option<u64>, bits: u32, random: &mut Pcg64) -> Vec<bool> {
    let mut bit =
        |at: u32| position.map_or_else(|| random.next_u32() & 1, |position| (position >> at & 1) as u32) == 1;
    (0..bits).rev().map(&mut bit).collect()
}

/// An encoder at the pins of a model, with disturbed bits.
pub(crate) struct BehindPins {
    model: Box<dyn Model>,
    encoder: Box<dyn Encoder>,
    random: Pcg64,
    level: bool,
}

impl BehindPins {
    pub(crate) fn new(model: Box<dyn Model>, encoder: Box<dyn Encoder>, seed: u64) -> BehindPins {
        BehindPins { model, encoder, random: Pcg64::seed_from_u64(seed), level: true }
    }

    /// The level of the data pin in a cycle; `inputs` are the other inputs of the cycle, with any level of this pin.
    pub(crate) fn level(&mut self, inputs: &[u32], is_reset: bool) -> u32 {
        let level = self.level != self.random.next_u32().is_multiple_of(300);
        let clock = self.model.outputs()[0] == 1;
        self.level = self.encoder.clock(clock, &mut self.random);
        // The data pin is the last input of all kinds with an encoder.
        let mut all: Vec<u32> = [is_reset.into()].into_iter().chain(inputs.iter().copied()).collect();
        if let Some(data) = all.last_mut() {
            *data = level.into();
        }
        self.model.clock(&all);
        level.into()
    }
}

/// An SSI encoder with random positions.
pub(crate) struct SsiEncoder {
    bits: u32,
    half: u32,
    pause: u32,
    double: bool,
    position: Option<u64>,
    was: bool,
    /// Bits that are left to send, and the level.
    left: Vec<bool>,
    level: bool,
    /// Cycles since the clock's last edge.
    quiet: u32,
}

impl SsiEncoder {
    pub(crate) fn new(bits: u32, half: u32, pause: u32, double: bool) -> SsiEncoder {
        SsiEncoder {
            bits,
            half,
            pause,
            double,
            position: None,
            was: true,
            left: Vec::new(),
            level: true,
            quiet: 0,
        }
    }
}

impl Encoder for SsiEncoder {
    fn clock(&mut self, clock: bool, random: &mut Pcg64) -> bool {
        let is_edge = clock != self.was;
        self.was = clock;
        self.quiet = if is_edge { 0 } else { self.quiet + 1 };
        match clock {
            false if is_edge && self.left.is_empty() => {
                let word = word(self.position, self.bits, random);
                self.left.clone_from(&word);
                if self.double {
                    self.left.push(false);
                    self.left.extend(word);
                }
            }
            true if is_edge && !self.left.is_empty() => self.level = self.left.remove(0),
            // The monoflop lets the line go to its rest.
            true if self.quiet > self.half + self.pause.min(5) => {
                self.left.clear();
                self.level = true;
            }
            _ => {}
        }
        self.level
    }

    fn holds(&mut self, position: u64) {
        self.position = Some(position);
    }

    fn is_busy(&self) -> bool {
        !self.left.is_empty()
    }
}

/// A BiSS C encoder with random positions, behind a line that is some cycles long, another number in each frame.
pub(crate) struct BissEncoder {
    bits: u32,
    half: u32,
    timeout: u32,
    position: Option<u64>,
    was: bool,
    /// Rises of the clock in this frame; `None` at rest.
    rises: Option<u32>,
    left: Vec<bool>,
    level: bool,
    quiet: u32,
    /// Levels on their way.
    line: std::collections::VecDeque<bool>,
}

impl BissEncoder {
    pub(crate) fn new(bits: u32, half: u32, timeout: u32) -> BissEncoder {
        BissEncoder {
            bits,
            half,
            timeout,
            position: None,
            was: true,
            rises: None,
            left: Vec::new(),
            level: true,
            quiet: 0,
            line: std::collections::VecDeque::new(),
        }
    }

    /// The bits from the acknowledge on: it lasts one bit, or a few more for a random position.
    fn frame(&self, random: &mut Pcg64) -> Vec<bool> {
        let mut data = word(self.position, self.bits, random);
        data.extend(word(self.position.map(|_| 3), 2, random));
        let rest = data.iter().chain(&[false; 6]).fold(0_u32, |rest, bit| {
            let rest = rest << 1 | u32::from(*bit);
            if rest & 64 == 0 { rest } else { rest ^ 0x43 }
        });
        data.extend((0..6).rev().map(|at| rest >> at & 1 == 0));
        let busy =
            if self.position.is_some() { 1 } else { 1 + random.next_u32() % 4 * (random.next_u32() % 2) };
        let mut frame = vec![false; busy as usize];
        frame.extend([true, false]);
        frame.extend(data);
        frame
    }
}

impl Encoder for BissEncoder {
    fn clock(&mut self, clock: bool, random: &mut Pcg64) -> bool {
        let is_edge = clock != self.was;
        self.was = clock;
        self.quiet = if is_edge { 0 } else { self.quiet + 1 };
        match self.rises {
            None if is_edge && !clock => {
                self.rises = Some(0);
                self.left = self.frame(random);
                let most = if random.next_u32().is_multiple_of(8) { 40 * self.half } else { 5 * self.half };
                let cycles = if self.position.is_some() { self.half } else { random.next_u32() % most };
                self.line = vec![true; cycles as usize].into();
            }
            Some(rises) if is_edge && clock => {
                self.rises = Some(rises + 1);
                if rises > 0 {
                    self.level = !self.left.is_empty() && self.left.remove(0);
                }
            }
            // The line rests behind the timeout.
            Some(_) if self.quiet + 5 > self.timeout.max(self.half + 6) => {
                (self.rises, self.level) = (None, true)
            }
            _ => {}
        }
        self.line.push_back(self.level);
        self.line.pop_front().unwrap_or(self.level)
    }

    fn holds(&mut self, position: u64) {
        self.position = Some(position);
    }

    fn is_busy(&self) -> bool {
        self.rises.is_some()
    }
}

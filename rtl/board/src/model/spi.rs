// SPDX-License-Identifier: MIT OR Apache-2.0
//! Model of the circuit `takt_spi`.

use super::clocked::{Model, high, word};

/// Data lines into the master.
const LINES: usize = 8;

/// Model of the SPI master.
#[derive(Clone, Debug)]
pub struct Spi {
    half: u32,
    bits: u32,
    polarity: bool,
    second_edge: bool,
    signed: bool,
    preset: u32,
    send: u32,
    /// Cycles since the frame began.
    at: Option<u32>,
    /// Bits of the lines; those of the first are also the bits to send.
    shift: [u32; LINES],
    synchroniser: [[bool; LINES]; 2],
    clock: bool,
    select: bool,
    out: bool,
    /// Frames, lost starts.
    now: [u32; 2],
    received: [u32; LINES],
    /// The registers, in their order.
    taken: [u32; 2 + LINES],
}

impl Spi {
    /// SPI master at rest. `half` is half a bit in cycles, `bits` the length of a frame; `polarity` and `second_edge` are the mode bits
    /// of SPI; with `signed`, the received number is signed; `preset` is the first number sent.
    pub fn new(half: u32, bits: u32, polarity: bool, second_edge: bool, signed: bool, preset: u32) -> Spi {
        Spi {
            half,
            bits,
            polarity,
            second_edge,
            signed,
            preset,
            send: preset,
            at: None,
            shift: [0; LINES],
            synchroniser: [[false; LINES]; 2],
            clock: polarity,
            select: true,
            out: false,
            now: [0; 2],
            received: [0; LINES],
            taken: [0; 2 + LINES],
        }
    }

    /// Ends half `half` of a frame. The halves 0 to 2·bits - 1 end with an edge of the clock.
    fn edge(&mut self, half: u32) {
        if half == 2 * self.bits {
            (self.at, self.select, self.out) = (None, true, false);
            let spare = 32 - self.bits;
            let signed = self.signed;
            self.received = self.shift.map(|bits| {
                let top = bits << spare;
                if signed { ((top as i32) >> spare) as u32 } else { top >> spare }
            });
            self.now[0] = self.now[0].wrapping_add(1);
            return;
        }
        let first = half.is_multiple_of(2);
        self.clock = first != self.polarity;
        let before = self.shift[0];
        if first != self.second_edge {
            for (bits, pin) in self.shift.iter_mut().zip(self.synchroniser[1]) {
                *bits = *bits << 1 | u32::from(pin);
            }
        } else if half < 2 * self.bits - 1 {
            // The other edge moves to the next bit; the last bit has no next bit.
            self.out = before >> 31 == 1;
        }
    }
}

impl Model for Spi {
    fn outputs(&self) -> Vec<u32> {
        let pins = [self.clock, self.select, self.out].map(u32::from);
        pins.into_iter().chain(self.taken).collect()
    }

    fn clock(&mut self, inputs: &[u32]) {
        let [rst, start, take, put] = [0, 1, 2, 3].map(|i| high(inputs, i));
        let pins: [bool; LINES] = std::array::from_fn(|line| high(inputs, 4 + line));
        if take {
            self.taken[0] = self.received[0];
            self.taken[1..3].copy_from_slice(&self.now);
            self.taken[3..].copy_from_slice(&self.received[1..]);
        }
        match self.at {
            None if start => {
                let first = self.send << (32 - self.bits);
                (self.at, self.shift[0], self.out, self.select) = (Some(0), first, first >> 31 == 1, false);
            }
            None => {}
            Some(at) => {
                if start {
                    self.now[1] = self.now[1].wrapping_add(1);
                }
                self.at = Some(at + 1);
                if (at + 1).is_multiple_of(self.half) {
                    self.edge(at / self.half);
                }
            }
        }
        if put {
            self.send = word(inputs, 4 + LINES);
        }
        let synchroniser = [pins, self.synchroniser[0]];
        if rst {
            *self = Spi::new(self.half, self.bits, self.polarity, self.second_edge, self.signed, self.preset);
        }
        self.synchroniser = synchroniser;
    }
}

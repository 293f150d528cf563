// SPDX-License-Identifier: MIT OR Apache-2.0
//! Model of the circuit `takt_spi`.

use super::clocked::{Model, high, word};

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
    shift: u32,
    synchroniser: [bool; 2],
    clock: bool,
    select: bool,
    out: bool,
    now: [u32; 3],
    taken: [u32; 3],
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
            shift: 0,
            synchroniser: [false; 2],
            clock: polarity,
            select: true,
            out: false,
            now: [0; 3],
            taken: [0; 3],
        }
    }

    /// Ends half `half` of a frame. The halves 0 to 2·bits - 1 end with an edge of the clock.
    fn edge(&mut self, half: u32) {
        if half == 2 * self.bits {
            (self.at, self.select, self.out) = (None, true, false);
            let spare = 32 - self.bits;
            let top = self.shift << spare;
            self.now[0] = if self.signed { ((top as i32) >> spare) as u32 } else { top >> spare };
            self.now[1] = self.now[1].wrapping_add(1);
            return;
        }
        let first = half.is_multiple_of(2);
        self.clock = first != self.polarity;
        let before = self.shift;
        if first != self.second_edge {
            self.shift = self.shift << 1 | u32::from(self.synchroniser[1]);
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
        let [rst, start, take, put, pin] = [0, 1, 2, 3, 4].map(|i| high(inputs, i));
        if take {
            self.taken = self.now;
        }
        match self.at {
            None if start => {
                let first = self.send << (32 - self.bits);
                (self.at, self.shift, self.out, self.select) = (Some(0), first, first >> 31 == 1, false);
            }
            None => {}
            Some(at) => {
                if start {
                    self.now[2] = self.now[2].wrapping_add(1);
                }
                self.at = Some(at + 1);
                if (at + 1).is_multiple_of(self.half) {
                    self.edge(at / self.half);
                }
            }
        }
        if put {
            self.send = word(inputs, 5);
        }
        let synchroniser = [pin, self.synchroniser[0]];
        if rst {
            *self = Spi::new(self.half, self.bits, self.polarity, self.second_edge, self.signed, self.preset);
        }
        self.synchroniser = synchroniser;
    }
}

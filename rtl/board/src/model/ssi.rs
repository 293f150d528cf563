// SPDX-License-Identifier: MIT OR Apache-2.0
//! Model of the circuit `takt_ssi`.

use super::clocked::{Model, high};

/// Parameters of an [`Ssi`], like the circuit's.
#[derive(Clone, Copy, Debug)]
pub struct SsiFrame {
    /// Half a bit in cycles.
    pub half: u32,
    /// Bits of the value.
    pub bits: u32,
    /// Bits of the position within a turn.
    pub turn: u32,
    /// The bits are Gray code.
    pub gray: bool,
    /// The encoder sends the bits twice.
    pub double: bool,
    /// Cycles of rest after a frame.
    pub pause: u32,
}

/// Time of the master, in cycles since the last change of its activity.
#[derive(Clone, Copy, Debug)]
enum Activity {
    Ready,
    Frame(u32),
    Pause(u32),
}

/// Model of the SSI master.
#[derive(Clone, Debug)]
pub struct Ssi {
    of: SsiFrame,
    activity: Activity,
    /// Data was low before the frame.
    is_low: bool,
    received: Vec<bool>,
    synchroniser: [bool; 2],
    now: [u32; 5],
    taken: [u32; 5],
}

/// Splits a value into its lowest `turn` bits and the bits above.
pub(super) fn split(value: u64, turn: u32) -> [u32; 2] {
    [(value % (1_u64 << turn)) as u32, (value >> turn) as u32]
}

/// The number whose bits these are, the highest first.
pub(super) fn number(bits: &[bool]) -> u64 {
    bits.iter().fold(0, |number, bit| number << 1 | u64::from(*bit))
}

impl Ssi {
    /// Master after a reset, in its first pause.
    pub fn new(of: SsiFrame) -> Ssi {
        Ssi {
            of,
            activity: Activity::Pause(0),
            is_low: false,
            received: Vec::new(),
            synchroniser: [false; 2],
            now: [0; 5],
            taken: [0; 5],
        }
    }

    /// Bits of a frame on the line.
    fn line_bits(&self) -> u32 {
        if self.of.double { 2 * self.of.bits + 1 } else { self.of.bits }
    }

    /// Value of a whole frame; `None` if the frame is not valid.
    fn value(&self) -> Option<u64> {
        let (first, rest) = self.received.split_at(self.of.bits as usize);
        let is_repeated = match rest.split_first() {
            None => true,
            Some((between, second)) => !between && first == second,
        };
        let coded = number(first);
        let value = match self.of.gray {
            true => (0..36).fold(0, |value, by| value ^ coded >> by),
            false => coded,
        };
        (is_repeated && !self.is_low).then_some(value)
    }
}

impl Model for Ssi {
    fn outputs(&self) -> Vec<u32> {
        let is_low = matches!(self.activity, Activity::Frame(at) if (at / self.of.half).is_multiple_of(2));
        [u32::from(!is_low)].into_iter().chain(self.taken).collect()
    }

    fn clock(&mut self, inputs: &[u32]) {
        let [rst, start, take, pin] = [0, 1, 2, 3].map(|i| high(inputs, i));
        if take {
            self.taken = self.now;
        }
        if start && !matches!(self.activity, Activity::Ready) {
            self.now[3] = self.now[3].wrapping_add(1);
        }
        self.activity = match self.activity {
            Activity::Ready if start => {
                self.is_low = !self.synchroniser[1];
                self.received.clear();
                Activity::Frame(0)
            }
            Activity::Ready => Activity::Ready,
            Activity::Pause(at) if at + 1 == self.of.pause => Activity::Ready,
            Activity::Pause(at) => Activity::Pause(at + 1),
            Activity::Frame(at) => {
                if (at + 1).is_multiple_of(2 * self.of.half) {
                    self.received.push(self.synchroniser[1]);
                }
                if self.received.len() as u32 == self.line_bits() {
                    match self.value() {
                        Some(value) => {
                            let [position, turns] = split(value, self.of.turn);
                            self.now[..2].copy_from_slice(&[position, turns]);
                            self.now[2] = self.now[2].wrapping_add(1);
                        }
                        None => self.now[4] = self.now[4].wrapping_add(1),
                    }
                    Activity::Pause(0)
                } else {
                    Activity::Frame(at + 1)
                }
            }
        };
        let synchroniser = [pin, self.synchroniser[0]];
        if rst {
            *self = Ssi::new(self.of);
        }
        self.synchroniser = synchroniser;
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Model of the circuit `takt_biss_c`.

use super::clocked::{Model, high};
use super::ssi::{number, split};

/// Parameters of a [`BissC`], like the circuit's.
#[derive(Clone, Copy, Debug)]
pub struct BissFrame {
    /// Half a bit in cycles.
    pub half: u32,
    /// Bits of the position.
    pub bits: u32,
    /// Bits of the position within a turn.
    pub turn: u32,
    /// Bits from the clock's second rise to the start bit, at most.
    pub wait: u32,
    /// Cycles of rest after a frame.
    pub timeout: u32,
}

/// A frame under way.
#[derive(Clone, Debug, Default)]
struct Frame {
    /// Cycles since the clock's first fall.
    at: u32,
    /// Cycle of the frame in which the acknowledge was seen.
    answered: Option<u32>,
    /// The bits behind the acknowledge, from the start bit on.
    bits: Vec<bool>,
}

/// Model of the BiSS C master.
#[derive(Clone, Debug)]
pub struct BissC {
    of: BissFrame,
    frame: Option<Frame>,
    /// Cycles for which the clock stays low behind a frame.
    low: u32,
    /// Cycles for which the clock has been high behind a frame; stops at the timeout.
    quiet: u32,
    synchroniser: [bool; 2],
    now: [u32; 9],
    taken: [u32; 9],
}

/// Remainder of the bits and their inverted CRC, by division on paper; 0 if the CRC is right.
fn remainder(data: &[bool], crc: &[bool]) -> u64 {
    let divisor = 0x43;
    let mut rest = 0;
    for bit in data.iter().copied().chain(crc.iter().map(|bit| !bit)) {
        rest = rest << 1 | u64::from(bit);
        if rest >> 6 == 1 {
            rest ^= divisor;
        }
    }
    rest
}

impl BissC {
    /// Master after a reset, in its first timeout.
    pub fn new(of: BissFrame) -> BissC {
        BissC { of, frame: None, low: 0, quiet: 0, synchroniser: [false; 2], now: [0; 9], taken: [0; 9] }
    }

    fn count(&mut self, register: usize) {
        self.now[register] = self.now[register].wrapping_add(1);
    }

    /// A cycle of a frame; `None` for a frame that has ended.
    fn step(&mut self, mut frame: Frame) -> Option<Frame> {
        let BissFrame { half, bits, turn, wait, .. } = self.of;
        let (level, second_rise) = (self.synchroniser[1], 3 * half);
        let at = frame.at;
        frame.at += 1;
        let is_over = |frame: &Frame| frame.bits.is_empty() && at == second_rise + 2 * half * wait;
        let Some(answered) = frame.answered else {
            if is_over(&frame) || (!level && at < second_rise + 2) {
                self.count(7);
                return None;
            }
            frame.answered = (!level).then_some(at);
            return Some(frame);
        };
        let is_middle = (at - answered) % (2 * half) == half;
        if is_middle && (level || !frame.bits.is_empty()) {
            frame.bits.push(level);
        }
        if is_over(&frame) {
            self.count(7);
            return None;
        }
        if (frame.bits.len() as u32) < bits + 10 {
            return Some(frame);
        }
        let (data, crc) = frame.bits[2..].split_at(bits as usize + 2);
        if remainder(data, crc) != 0 {
            self.count(6);
            return None;
        }
        let (value, states) = data.split_at(bits as usize);
        let [position, turns] = split(number(value), turn);
        self.now[..4].copy_from_slice(&[position, turns, (!states[0]).into(), (!states[1]).into()]);
        self.count(4);
        self.now[8] = answered - second_rise - 2;
        None
    }
}

impl Model for BissC {
    fn outputs(&self) -> Vec<u32> {
        let is_low = match &self.frame {
            Some(frame) => (frame.at / self.of.half).is_multiple_of(2),
            None => self.low > 0,
        };
        [u32::from(!is_low)].into_iter().chain(self.taken).collect()
    }

    fn clock(&mut self, inputs: &[u32]) {
        let [rst, start, take, pin] = [0, 1, 2, 3].map(|i| high(inputs, i));
        if take {
            self.taken = self.now;
        }
        let is_ready = self.frame.is_none() && self.quiet == self.of.timeout;
        if start && !is_ready {
            self.count(5);
        }
        match self.frame.take() {
            Some(frame) => {
                let half = self.of.half;
                let next = frame.at + 1;
                self.frame = self.step(frame);
                // The half that would follow is gone through if it is low.
                let is_low = self.frame.is_none() && (next / half).is_multiple_of(2);
                (self.low, self.quiet) = (if is_low { half - next % half } else { 0 }, 0);
            }
            None if self.low > 0 => self.low -= 1,
            None if start && is_ready && self.synchroniser[1] => self.frame = Some(Frame::default()),
            None => {
                if start && is_ready {
                    self.count(7);
                }
                self.quiet = (self.quiet + 1).min(self.of.timeout);
            }
        }
        let synchroniser = [pin, self.synchroniser[0]];
        if rst {
            *self = BissC::new(self.of);
        }
        self.synchroniser = synchroniser;
    }
}

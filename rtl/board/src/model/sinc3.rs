// SPDX-License-Identifier: MIT OR Apache-2.0
//! Model of the circuit `takt_sinc3`: the weighted sum of each window, from the bits themselves.

use super::clocked::{Model, high, word};
use super::motor::Trip;
use std::collections::VecDeque;

/// Parameters of a [`Sinc3`], like the circuit's.
#[derive(Clone, Copy, Debug)]
pub struct Windows {
    /// Half a period of the modulator's clock in cycles.
    pub half: u32,
    /// The modulator has a clock of its own.
    pub clock_in: bool,
    /// Oversampling ratio of the value.
    pub osr: usize,
    /// Oversampling ratio of the sum for overcurrent.
    pub fast: usize,
    /// Least magnitude of this sum that trips; 0 for none.
    pub limit: u32,
}

/// Result of the bits so far, before it is in a register.
#[derive(Clone, Copy, Debug)]
enum Sum {
    Value(i32),
    Over(bool),
}

/// Cycles from a rise of the clock to the last cycle in which the register has the old sum.
const SUMS: u32 = 5;

/// Model of the filter.
#[derive(Clone, Debug)]
pub struct Sinc3 {
    of: Windows,
    place: u32,
    clock: bool,
    /// Pins of the clock and the data, the last cycle's first.
    pins: [[bool; 2]; 3],
    /// The last bits, as far as a window reaches, the latest first.
    bits: VecDeque<i32>,
    /// Bits since the last end of a window, and since the last end of a fast one.
    since: [usize; 2],
    /// A start without a bit after it, and any start.
    started: [bool; 2],
    /// Ends of windows that another one may follow at its distance; true for the beginning of a window to be kept.
    ends: VecDeque<bool>,
    fast_ends: u32,
    /// Sums with the cycles after which they are in their register.
    pending: Vec<(u32, Sum)>,
    over: bool,
    trip: Trip,
    now: [u32; 2],
    taken: [u32; 2],
}

/// Sum of the latest bits with the weights of three moving averages over `osr` bits.
fn window(bits: &VecDeque<i32>, osr: usize) -> i32 {
    let mut weights = vec![1];
    for _ in 0..3 {
        let len = weights.len();
        let at = |i: usize| (0..osr).filter_map(|back| weights.get(i.checked_sub(back)?)).sum();
        weights = (0..len + osr - 1).map(at).collect();
    }
    weights.iter().zip(bits).map(|(weight, bit)| weight * bit).sum()
}

impl Sinc3 {
    /// Filter after a reset.
    pub fn new(of: Windows) -> Sinc3 {
        Sinc3 {
            of,
            place: 0,
            clock: false,
            pins: [[false; 2]; 3],
            bits: VecDeque::new(),
            since: [0; 2],
            started: [false; 2],
            ends: VecDeque::new(),
            fast_ends: 0,
            pending: Vec::new(),
            over: false,
            trip: Trip::new(0, false, false),
            now: [0; 2],
            taken: [0; 2],
        }
    }

    /// Takes a bit, and ends the windows that end with this bit.
    fn bit(&mut self, one: bool) {
        let Windows { osr, fast, limit, .. } = self.of;
        self.bits.push_front(if one { 1 } else { -1 });
        self.bits.truncate(3 * osr.max(fast));
        self.since = self.since.map(|bits| bits + 1);
        let [is_first, has_started] = self.started;
        let is_regular = self.since[0] == osr;
        if is_regular || is_first {
            if !is_regular {
                self.ends.clear();
            }
            if self.ends.len() == 3 && self.ends.pop_front() == Some(true) {
                self.pending.push((SUMS, Sum::Value(window(&self.bits, osr))));
            }
            self.ends.push_back(is_first || !has_started);
            self.since[0] = 0;
        }
        if self.since[1] == fast {
            self.since[1] = 0;
            self.fast_ends += 1;
            let is_over = limit > 0 && self.fast_ends > 3 && window(&self.bits, fast).unsigned_abs() >= limit;
            self.pending.push((SUMS, Sum::Over(is_over)));
        }
        self.started[0] = false;
    }
}

impl Model for Sinc3 {
    fn outputs(&self) -> Vec<u32> {
        let trip = self.trip.outputs();
        [self.clock.into(), trip[0]].into_iter().chain(self.taken).chain(trip[2..].iter().copied()).collect()
    }

    fn clock(&mut self, inputs: &[u32]) {
        let [rst, clear, start, take, put, data, clock_in] = [0, 1, 2, 3, 4, 5, 6].map(|i| high(inputs, i));
        let over = self.over;
        self.trip.clock(&[rst.into(), clear.into(), take.into(), put.into(), over.into(), word(inputs, 7)]);
        if take {
            self.taken = self.now;
        }
        for (left, sum) in &mut self.pending {
            *left -= 1;
            match sum {
                Sum::Value(value) if *left == 0 => {
                    self.now = [value.cast_unsigned(), self.now[1].wrapping_add(1)];
                }
                Sum::Over(is_over) if *left == 0 => self.over = *is_over,
                _ => {}
            }
        }
        self.pending.retain(|(left, _)| *left > 0);
        let [_, one_before, two_before] = self.pins;
        match self.of.clock_in {
            true if one_before[0] && !two_before[0] => self.bit(two_before[1]),
            false if self.place == 0 => self.bit(one_before[1]),
            _ => {}
        }
        if start {
            self.started = [true; 2];
        }
        self.place = if start { 0 } else { (self.place + 1) % (2 * self.of.half) };
        self.clock = self.place < self.of.half;
        let pins = [[clock_in, data], self.pins[0], self.pins[1]];
        if rst {
            let trip = self.trip.clone();
            *self = Sinc3 { trip, ..Sinc3::new(self.of) };
        }
        self.pins = pins;
    }
}

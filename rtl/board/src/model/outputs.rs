// SPDX-License-Identifier: MIT OR Apache-2.0
//! Models of outputs: pulses and levels.

use super::clocked::{Model, high, word};

/// The sum of a signed number of 32 bits and an offset, clamped to 0 to `most`.
pub(super) fn clamped(value: u32, offset: u32, most: u32) -> u32 {
    // The conversion cannot wrap: 64 bits hold every sum, and 32 bits hold every value between 0 and `most`.
    (i64::from(value as i32) + i64::from(offset)).clamp(0, i64::from(most)) as u32
}

/// Model of the circuit `takt_pwm`.
#[derive(Clone, Debug)]
pub struct Pwm {
    half: u32,
    dead: u32,
    zero: u32,
    next: u32,
    on: u32,
    place: u32,
    back: bool,
    stood: [u32; 2],
    pins: [bool; 2],
}

impl Pwm {
    /// A modulator with half a period, and the dead time, in cycles.
    pub fn new(half: u32, dead: u32, signed: bool) -> Pwm {
        let zero = if signed { half } else { 0 };
        Pwm { half, dead, zero, next: zero, on: zero, place: 0, back: false, stood: [0; 2], pins: [false; 2] }
    }
}

impl Model for Pwm {
    fn outputs(&self) -> Vec<u32> {
        self.pins.map(u32::from).to_vec()
    }

    fn clock(&mut self, inputs: &[u32]) {
        let (rst, enable) = (high(inputs, 0), high(inputs, 1));
        if rst || !enable {
            *self = Pwm::new(self.half, self.dead, self.zero > 0);
            return;
        }
        // The part before the middle has the odd cycle.
        let part = if self.back { self.on / 2 } else { self.on.div_ceil(2) };
        let pulse = self.half - self.place <= part;
        self.pins = [pulse, !pulse].map(|on| on && self.stood[usize::from(!pulse)] == self.dead);
        self.stood = [pulse, !pulse]
            .map(|on| if on { (self.stood[usize::from(!pulse)] + 1).min(self.dead) } else { 0 });
        let ends = self.back && self.place == 0;
        if ends {
            self.on = self.next;
        }
        match self.back {
            true if self.place == 0 => self.back = false,
            true => self.place -= 1,
            false if self.place == self.half - 1 => self.back = true,
            false => self.place += 1,
        }
        if high(inputs, 2) {
            self.next = clamped(word(inputs, 3), self.zero, 2 * self.half);
        }
    }
}

/// Model of the circuit `takt_sigma_delta`.
#[derive(Clone, Debug)]
pub struct SigmaDelta {
    zero: u32,
    value: u32,
    sum: u32,
    pin: bool,
}

impl SigmaDelta {
    /// A modulator at rest.
    pub fn new(signed: bool) -> SigmaDelta {
        let zero = if signed { 1 << 15 } else { 0 };
        SigmaDelta { zero, value: zero, sum: 0, pin: false }
    }
}

impl Model for SigmaDelta {
    fn outputs(&self) -> Vec<u32> {
        vec![self.pin.into()]
    }

    fn clock(&mut self, inputs: &[u32]) {
        if high(inputs, 0) || !high(inputs, 1) {
            *self = SigmaDelta { value: self.zero, sum: 0, pin: false, ..*self };
            return;
        }
        let next = self.sum + self.value;
        (self.pin, self.sum) = (next >= 1 << 16, next % (1 << 16));
        if high(inputs, 2) {
            self.value = clamped(word(inputs, 3), self.zero, 1 << 16);
        }
    }
}

/// Model of the circuit `takt_digital_out`.
#[derive(Clone, Debug)]
pub struct DigitalOut {
    safe: bool,
    pin: bool,
}

impl DigitalOut {
    /// An output whose pin has the level `safe` while it is not enabled.
    pub fn new(safe: bool) -> DigitalOut {
        DigitalOut { safe, pin: safe }
    }
}

impl Model for DigitalOut {
    fn outputs(&self) -> Vec<u32> {
        vec![self.pin.into()]
    }

    fn clock(&mut self, inputs: &[u32]) {
        if high(inputs, 0) || !high(inputs, 1) {
            self.pin = self.safe;
        } else if high(inputs, 2) {
            self.pin = word(inputs, 3) != 0;
        }
    }
}

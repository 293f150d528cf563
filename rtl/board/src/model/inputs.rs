// SPDX-License-Identifier: MIT OR Apache-2.0
//! Models of inputs: encoders, steps, switches.

use super::clocked::{Model, high};
use super::filter::Filter;

/// Cycles since the last edge, at most, as at standstill.
const STANDSTILL: u32 = i32::MAX as u32;

/// Model of the circuit `takt_quadrature`.
#[derive(Clone, Debug)]
pub struct Quadrature {
    pins: [Filter; 3],
    was: [bool; 3],
    start: u32,
    now: [u32; 5],
    taken: [u32; 5],
}

impl Quadrature {
    /// Counter with filters that pass levels of `filter` cycles, and with the count `start` after a reset.
    pub fn new(filter: u32, start: u32) -> Quadrature {
        let pins = [(); 3].map(|()| Filter::new(filter));
        let now = [start, 0, 0, 0, STANDSTILL];
        Quadrature { pins, was: [false; 3], start, now, taken: now }
    }
}

impl Model for Quadrature {
    fn outputs(&self) -> Vec<u32> {
        self.taken.to_vec()
    }

    fn clock(&mut self, inputs: &[u32]) {
        let rst = high(inputs, 0);
        let [a, b, index] = [0, 1, 2].map(|i| self.pins[i].level());
        let [was_a, was_b, was_index] = self.was;
        if high(inputs, 1) {
            self.taken = self.now;
        }
        let [count, at_index, indices, errors, since] = &mut self.now;
        if index && !was_index {
            *at_index = *count;
            *indices = indices.wrapping_add(1);
        }
        match (a != was_a, b != was_b) {
            (true, true) => *errors = errors.wrapping_add(1),
            // Upwards, (a, b) goes through 00, 10, 11, 01.
            (true, false) => *count = count.wrapping_add(if a != b { 1 } else { u32::MAX }),
            (false, true) => *count = count.wrapping_add(if a == b { 1 } else { u32::MAX }),
            (false, false) => {}
        }
        *since = if (a, b) == (was_a, was_b) { (*since + 1).min(STANDSTILL) } else { 1 };
        self.was = [a, b, index];
        if rst {
            self.now = [self.start, 0, 0, 0, STANDSTILL];
            self.taken = self.now;
        }
        for (i, pin) in self.pins.iter_mut().enumerate() {
            pin.clock(rst, high(inputs, 2 + i));
        }
    }
}

/// Model of the circuit `takt_step`.
#[derive(Clone, Debug)]
pub struct Step {
    step: Filter,
    direction: Filter,
    was: bool,
    count: u32,
    taken: u32,
}

impl Step {
    /// Counter with filters that pass levels of `filter` cycles.
    pub fn new(filter: u32) -> Step {
        Step { step: Filter::new(filter), direction: Filter::new(filter), was: false, count: 0, taken: 0 }
    }
}

impl Model for Step {
    fn outputs(&self) -> Vec<u32> {
        vec![self.taken]
    }

    fn clock(&mut self, inputs: &[u32]) {
        let rst = high(inputs, 0);
        if high(inputs, 1) {
            self.taken = self.count;
        }
        if self.step.level() && !self.was {
            self.count = self.count.wrapping_add(if self.direction.level() { 1 } else { u32::MAX });
        }
        self.was = self.step.level();
        if rst {
            (self.count, self.taken) = (0, 0);
        }
        self.step.clock(rst, high(inputs, 2));
        self.direction.clock(rst, high(inputs, 3));
    }
}

/// Model of the circuit `takt_digital_in`.
#[derive(Clone, Debug)]
pub struct DigitalIn {
    pin: Filter,
    invert: bool,
    was: bool,
    rises: u32,
    taken: [u32; 2],
}

impl DigitalIn {
    /// Input that passes levels of `hold` cycles.
    pub fn new(hold: u32, invert: bool) -> DigitalIn {
        DigitalIn { pin: Filter::new(hold), invert, was: false, rises: 0, taken: [0; 2] }
    }
}

impl Model for DigitalIn {
    fn outputs(&self) -> Vec<u32> {
        self.taken.to_vec()
    }

    fn clock(&mut self, inputs: &[u32]) {
        let rst = high(inputs, 0);
        let level = self.pin.level();
        if high(inputs, 1) {
            self.taken = [level.into(), self.rises];
        }
        if level && !self.was {
            self.rises = self.rises.wrapping_add(1);
        }
        self.was = level;
        if rst {
            (self.rises, self.taken) = (0, [0; 2]);
        }
        self.pin.clock(rst, high(inputs, 2) != self.invert);
    }
}

/// Model of the circuit `takt_hall`.
#[derive(Clone, Debug)]
pub struct Hall {
    pins: [Filter; 3],
    /// Number of the last state that was not forbidden.
    sector: Option<u32>,
    fault: bool,
    count: u32,
    errors: u32,
    /// Cycles since the last change, and between the last two.
    times: [u32; 2],
    taken: [u32; 5],
}

impl Hall {
    /// Sensors with filters that pass levels of `filter` cycles.
    pub fn new(filter: u32) -> Hall {
        Hall {
            pins: [(); 3].map(|()| Filter::new(filter)),
            sector: None,
            fault: false,
            count: 0,
            errors: 0,
            times: [STANDSTILL; 2],
            taken: [0, 0, 0, STANDSTILL, 0],
        }
    }
}

impl Model for Hall {
    fn outputs(&self) -> Vec<u32> {
        self.taken.to_vec()
    }

    fn clock(&mut self, inputs: &[u32]) {
        let rst = high(inputs, 0);
        let levels = [0, 1, 2].map(|i| u32::from(self.pins[i].level()));
        if high(inputs, 1) {
            let time = self.times[0].max(self.times[1]);
            let sector = self.sector.unwrap_or(0);
            self.taken = [sector, self.fault.into(), self.count, time, self.errors];
        }
        let now = [[1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 1, 1], [0, 0, 1], [1, 0, 1]]
            .iter()
            .zip(0..)
            .find_map(|(state, sector)| (*state == levels).then_some(sector));
        let mut times = [(self.times[0] + 1).min(STANDSTILL), self.times[1]];
        match (self.sector, now) {
            (Some(old), Some(new)) if old != new => {
                times = [1, self.times[0]];
                match (6 + new - old) % 6 {
                    1 => self.count = self.count.wrapping_add(1),
                    5 => self.count = self.count.wrapping_sub(1),
                    _ => self.errors = self.errors.wrapping_add(1),
                }
            }
            (_, None) if !self.fault => self.errors = self.errors.wrapping_add(1),
            _ => {}
        }
        self.times = times;
        self.fault = now.is_none();
        self.sector = now.or(self.sector);
        if rst {
            let (pins, fault) = (self.pins.clone(), self.fault);
            *self = Hall { pins, fault, ..Hall::new(1) };
        }
        for (i, pin) in self.pins.iter_mut().enumerate() {
            pin.clock(rst, high(inputs, 2 + i));
        }
    }
}

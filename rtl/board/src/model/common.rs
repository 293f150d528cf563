// SPDX-License-Identifier: MIT OR Apache-2.0
//! Models of the parts that every board has: the tick, and the two halves of a UART.

use super::clocked::{Model, high, word};

/// Model of `takt_tick`: the inputs are rst, run, period, lead, and the outputs tick, early, left.
#[derive(Clone, Debug, Default)]
pub struct Tick {
    runs: bool,
    ahead: u32,
    left: u32,
    tick: bool,
    early: bool,
}

impl Model for Tick {
    fn outputs(&self) -> Vec<u32> {
        vec![self.tick.into(), self.early.into(), self.left]
    }

    fn clock(&mut self, inputs: &[u32]) {
        let (rst, run, period, lead) = (high(inputs, 0), high(inputs, 1), word(inputs, 2), word(inputs, 3));
        let used = if lead < period { lead } else { 0 };
        let last = self.left == 1;
        self.tick = self.runs && last;
        self.early = self.runs && self.left == self.ahead.wrapping_add(1);
        self.left = match (self.runs, last) {
            (false, _) => used + 1,
            (true, true) => period,
            (true, false) => self.left.wrapping_sub(1),
        };
        if !self.runs || last {
            self.ahead = used;
        }
        self.runs = run && period >= 2;
        if rst {
            *self = Tick { ahead: self.ahead, ..Tick::default() };
        }
    }
}

/// Model of `takt_uart_receive`: the inputs are rst, pin, and the outputs valid, data, broken.
#[derive(Clone, Debug)]
pub struct UartReceive {
    divide: u32,
    synchroniser: [bool; 2],
    /// Cycles until the middle of the next bit, and the bit's number: 0 is the start bit, 9 the stop bit.
    next: Option<(u32, u32)>,
    data: u8,
    valid: bool,
    broken: bool,
}

impl UartReceive {
    /// A receiver with `divide` cycles for each bit.
    pub fn new(divide: u32) -> UartReceive {
        let synchroniser = [true; 2];
        UartReceive { divide, synchroniser, next: None, data: 0, valid: false, broken: false }
    }
}

impl Model for UartReceive {
    fn outputs(&self) -> Vec<u32> {
        vec![self.valid.into(), self.data.into(), self.broken.into()]
    }

    fn clock(&mut self, inputs: &[u32]) {
        let line = self.synchroniser[1];
        (self.valid, self.broken) = (false, false);
        // The start bit goes through the byte, too.
        if matches!(self.next, Some((0, 0..=8))) {
            self.data = self.data >> 1 | u8::from(line) << 7;
        }
        self.next = match self.next {
            None => (!line).then_some((self.divide / 2 - 1, 0)),
            Some((0, 0)) => (!line).then_some((self.divide - 1, 1)),
            Some((0, 9)) => {
                (self.valid, self.broken) = (line, !line);
                None
            }
            Some((0, bit)) => Some((self.divide - 1, bit + 1)),
            Some((cycles, bit)) => Some((cycles - 1, bit)),
        };
        self.synchroniser = [high(inputs, 1), self.synchroniser[0]];
        if high(inputs, 0) {
            *self = UartReceive::new(self.divide);
        }
    }
}

/// Model of `takt_uart_send`: the inputs are rst, start, data, and the outputs ready, pin.
#[derive(Clone, Debug)]
pub struct UartSend {
    divide: u32,
    /// Cycles since the start bit began, and the byte.
    sends: Option<(u32, u8)>,
}

impl UartSend {
    /// A sender with `divide` cycles for each bit.
    pub fn new(divide: u32) -> UartSend {
        UartSend { divide, sends: None }
    }
}

impl Model for UartSend {
    fn outputs(&self) -> Vec<u32> {
        let level = match self.sends {
            None => true,
            Some((at, byte)) => match at / self.divide {
                0 => false,
                bit @ 1..=8 => byte >> (bit - 1) & 1 == 1,
                _ => true,
            },
        };
        vec![self.sends.is_none().into(), level.into()]
    }

    fn clock(&mut self, inputs: &[u32]) {
        self.sends = match self.sends {
            None if high(inputs, 1) => Some((0, word(inputs, 2) as u8)),
            None => None,
            Some((at, byte)) => (at + 1 < 10 * self.divide).then_some((at + 1, byte)),
        };
        if high(inputs, 0) {
            self.sends = None;
        }
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Reader of a peripheral's keys for carriers and trips, and of parameters by name.

use super::{Peripheral, Reader, Starts};
use crate::carrier::{self, Instant};
use crate::document::{Located, Table};
use crate::kind::{Kind, Parameter, RATE};

/// The places of carriers that a peripheral has.
#[derive(Default)]
pub(super) struct Times {
    pub(super) starts: Starts,
    pub(super) latch: Option<Instant>,
    pub(super) carrier: Option<usize>,
}

impl<'a> Reader<'a> {
    /// The value of a parameter: a number, or one of its names.
    pub(super) fn parameter(&self, table: &Table<'a>, parameter: &Parameter) -> u32 {
        if parameter.names.is_empty() {
            let given = table.signed(parameter.name, parameter.least, parameter.most);
            let rate = if parameter.is_half_bit { table.number(RATE, 1e-6, 1e6) } else { None };
            return match (given, rate) {
                (Some(given), None) => given.value as u32,
                (None, Some(rate)) => self.half_bit(parameter, &rate),
                (Some(_), Some(rate)) => {
                    let text =
                        format!("`{}` already determines the rate: leave out one of the two", parameter.name);
                    self.document.mistake(&rate.place, text);
                    parameter.default
                }
                (None, None) => parameter.default,
            };
        }
        let Some(given) = table.string(parameter.name) else { return parameter.default };
        let value = parameter.names.iter().position(|name| *name == given.value);
        if value.is_none() {
            let names: Vec<String> = parameter.names.iter().map(|name| format!("\"{name}\"")).collect();
            let text =
                format!("`{}` must be one of {}, not \"{}\"", parameter.name, names.join(", "), given.value);
            self.document.mistake(&given.place, text);
        }
        value.unwrap_or_default() as u32
    }

    /// Half a bit in cycles at the highest rate that the clock makes, of at most the given one in MHz.
    fn half_bit(&self, parameter: &Parameter, rate: &Located<f64>) -> u32 {
        // A quotient that is a whole number but for rounding is that number.
        let half = (self.clock / (2.0 * rate.value) - 1e-9).ceil();
        if (parameter.least as f64..=parameter.most as f64).contains(&half) {
            return half as u32;
        }
        let made = |half: i64| self.clock / (2 * half) as f64;
        let text = format!(
            "{} MHz are {:.2} cycles of {} MHz for half a bit; expected {} to {}: {:.6} to {:.3} MHz",
            rate.value,
            self.clock / (2.0 * rate.value),
            self.clock,
            parameter.least,
            parameter.most,
            made(parameter.most),
            made(parameter.least)
        );
        self.document.mistake(&rate.place, text);
        parameter.default
    }

    /// The places of carriers at which a peripheral starts, or captures, and the carrier that it is on.
    pub(super) fn times(&self, kind: &Kind, table: &Table<'a>) -> Times {
        let (document, carriers) = (self.document, &self.carriers.all);
        let mut times = Times::default();
        let has_latch = !kind.reads.is_empty() && !kind.strobes.start && !kind.strobes.trips;
        if !kind.strobes.start && !has_latch && !kind.strobes.carrier {
            return times;
        }
        if kind.strobes.carrier {
            let given = table.need("carrier", table.string("carrier"));
            times.carrier = given.and_then(|at| carrier::find(document, carriers, &at.value, &at));
            return times;
        }
        let has_frames = kind.strobes.start && !kind.strobes.window;
        let key = match (kind.strobes.window, kind.strobes.start) {
            (true, _) => "centre",
            (false, true) => "starts",
            (false, false) => "latch",
        };
        if kind.strobes.window {
            times.starts = Starts::Never;
        }
        let given = table.string(key);
        let shift = table.number("shift", -1e6, 1e6);
        let cycles = shift.as_ref().map_or(0.0, |at| (at.value * self.clock).round());
        match given {
            Some(at) if has_frames && at.value == "publish" => times.starts = Starts::Publish,
            Some(at) if has_frames && at.value == "lead" => {}
            Some(at) if has_frames && !at.value.contains('.') => document.mistake(
                &at.place,
                format!(
                    "`starts` must be \"lead\", \"publish\", or a place of a carrier as \"main.valley\", not \"{}\"",
                    at.value
                ),
            ),
            Some(at) => {
                let instant = carrier::instant(document, carriers, &at, cycles);
                match kind.strobes.start {
                    true => times.starts = instant.map_or(times.starts, Starts::At),
                    false => times.latch = instant,
                }
                return times;
            }
            None => {}
        }
        if let Some(shift) = shift {
            let text = format!("`shift` moves a place of a carrier, and `{key}` names no place");
            document.mistake(&shift.place, text);
        }
        times
    }

    /// Finds names in `trips` that are not trips.
    pub(super) fn check_trips(&self, peripherals: &[Peripheral]) {
        let trips = peripherals.iter().filter(|peripheral| peripheral.kind.strobes.trips);
        let names: Vec<&str> = trips.map(|trip| trip.name.as_str()).collect();
        for at in self.trips.iter().filter(|at| !names.contains(&at.value.as_str())) {
            let there = match names[..] {
                [] => "the wiring has none: a peripheral of the kind \"trip\" is one".to_owned(),
                _ => format!("there are {}", names.join(", ")),
            };
            self.document.mistake(&at.place, format!("`{}` is not a trip; {there}", at.value));
        }
    }
}

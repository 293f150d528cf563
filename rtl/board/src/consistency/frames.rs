// SPDX-License-Identifier: MIT OR Apache-2.0
//! Checks of the frames of converters and encoders: their length against the starts, and against the tick that reads what they bring.

use super::{Fit, PeriodCycles};
use crate::carrier::Instant;
use crate::latency::Frame;
use crate::wiring::{Peripheral, Starts};
use std::ops::Range;

impl Fit<'_> {
    /// Compares a peripheral's frames with their starts and the ticks.
    pub(super) fn frame(&self, peripheral: &Peripheral, frame: &Frame, busy: Option<PeriodCycles>) {
        let [_, cycles] = frame.cycles;
        let takes = format!("a frame of `{}` takes {cycles} cycles: {}", peripheral.name, frame.formulas[0]);
        match peripheral.starts {
            Starts::At(instant) => self.sampled(peripheral, instant, frame, &takes),
            _ => self.led(peripheral, frame, &takes, busy),
        }
    }

    /// Place of the keys that determine a frame's length.
    fn frame_place(&self, peripheral: &Peripheral, more: &'static str) -> Range<usize> {
        self.place(peripheral, None, &["half", crate::kind::RATE, "bits", more])
    }

    /// The registers with what a frame samples are read by the program.
    fn is_read(peripheral: &Peripheral) -> bool {
        let registers = peripheral.kind.reads.iter().zip(&peripheral.reads);
        registers
            .filter(|(register, _)| Frame::has(peripheral, register.name))
            .any(|(_, port)| port.is_some())
    }

    /// Finds starts that are lost: frames and the rest after them longer than the cycles from start to start.
    fn overlaps(&self, frame: &Frame, takes: &str, every: u64) -> Option<String> {
        let [_, cycles] = frame.cycles;
        (cycles + frame.rest >= every).then(|| match frame.rest {
            0 => format!("starts of frames are lost: {takes}"),
            rest => format!("starts of frames are lost: {takes}, and its rest {rest}: {}", frame.formulas[1]),
        })
    }

    /// Compares a frame that a carrier starts with the tick after it.
    fn sampled(&self, peripheral: &Peripheral, instant: Instant, frame: &Frame, takes: &str) {
        let [_, cycles] = frame.cycles;
        let carrier = &self.wiring.carriers[instant.carrier];
        let place = self.frame_place(peripheral, "starts");
        let period = carrier.period();
        if let Some(lost) = self.overlaps(frame, takes, period.into()) {
            let mend = match frame.rest {
                0 => "a smaller `half`, or fewer `bits`".to_owned(),
                _ => format!("a smaller `half`, or a carrier of {} cycles or more", cycles + frame.rest + 1),
            };
            let text = format!("{lost}, and `{}` starts one every {period} cycles: {mend}", carrier.name);
            return self.mistakes.mistake(&place, text);
        }
        let (least, _) = self.wiring.cycles_to_tick(instant, 1);
        if Self::is_read(peripheral) && self.wiring.tick.is_some() && cycles >= least.into() {
            let text = format!(
                "`{}` is a period old at each tick: {takes}, and starts {least} cycles before the tick: `after` greater by {:.2} µs or more, or a smaller `half`",
                peripheral.kind.reads[0].name,
                self.at_least(cycles + 1 - u64::from(least))
            );
            self.mistakes.mistake(&place, text);
        }
    }

    /// Compares the length of a frame that starts before the tick, or with the outputs, with its lead and the tick.
    fn led(&self, peripheral: &Peripheral, frame: &Frame, takes: &str, busy: Option<PeriodCycles>) {
        let [_, cycles] = frame.cycles;
        let at_publish = peripheral.starts == Starts::Publish;
        let (period, lead) = (u64::from(self.wiring.period), u64::from(self.wiring.lead));
        if let Some(lost) = self.overlaps(frame, takes, period) {
            // Cycles of a frame for each cycle of half a bit.
            let halves = cycles.div_ceil(u64::from(peripheral.parameter("half").max(1)));
            let least = peripheral.kind.parameters.iter().find(|parameter| parameter.is_half_bit);
            let least = least.map_or(1, |parameter| parameter.least.unsigned_abs());
            let mend = match (period - 1).saturating_sub(frame.rest) / halves {
                fitting if fitting >= least => format!("`half = {fitting}` at most"),
                _ => format!(
                    "fewer `bits`, or `period = {}` or more",
                    self.at_least(least * halves + frame.rest + 1)
                ),
            };
            let text = format!("{lost}, and one starts every {period} cycles: {mend}");
            return self.mistakes.mistake(&self.frame_place(peripheral, "kind"), text);
        }
        if !Self::is_read(peripheral) {
            return;
        }
        let (starts, earliest) = match at_publish {
            true => {
                let worst = busy.map_or(0, |busy| busy.worst);
                (
                    format!("starts with the outputs, up to {worst} cycles after the tick"),
                    period.saturating_sub(worst),
                )
            }
            false => (format!("starts {lead} cycles before the tick"), lead),
        };
        if cycles < earliest {
            return;
        }
        let mend = match at_publish {
            true => "a smaller `half`, or a longer `period`".to_owned(),
            false => format!("`lead = {}` or more, or a smaller `half`", self.at_least(cycles + 1)),
        };
        let register = peripheral.kind.reads[0].name;
        let text = format!("`{register}` is a period old at each tick: {takes}, and {starts}: {mend}");
        let place = match self.top(&["lead"]) {
            place if place.is_empty() || at_publish => self.frame_place(peripheral, "kind"),
            place => place,
        };
        self.warnings.mistake(&place, text);
    }
}

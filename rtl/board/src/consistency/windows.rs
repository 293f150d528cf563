// SPDX-License-Identifier: MIT OR Apache-2.0
//! Checks of the windows of filters: against the carrier at whose places they are centred, the ticks, the pins, and the trip.

use super::Fit;
use crate::latency::Window;
use crate::wiring::{Peripheral, Starts};

impl Fit<'_> {
    /// Compares a filter's windows with the carrier and the tick, and its parameters with its pins.
    pub(super) fn window(&self, peripheral: &Peripheral, window: &Window) {
        self.clock_pins(peripheral);
        self.overcurrent(peripheral);
        let Starts::At(centre) = peripheral.starts else { return };
        let carrier = &self.wiring.carriers[centre.carrier];
        let (period, half) = (u64::from(carrier.period()), u64::from(peripheral.parameter("half")));
        let place = self.place(peripheral, None, &["osr", "half", crate::kind::RATE, "centre"]);
        let (osr, every) = (peripheral.parameter("osr"), window.every);
        let takes = format!("{osr} bits of `{}` take {every} cycles: 2 · half · osr", peripheral.name);
        if window.spread > 0 && 3 * every + 2 * half > period {
            let text = format!(
                "windows are cut off: {takes}, a window three times as many, and with the modulator's own clock it must end before the next begins, but `{}` has a period of {period} cycles: `osr = {}` at most",
                carrier.name,
                (period.saturating_sub(2 * half) / (6 * half)).max(1)
            );
            return self.mistakes.mistake(&place, text);
        }
        if window.spread == 0 && !period.is_multiple_of(every) {
            let fits = |osr: &u64| period.is_multiple_of(2 * half * osr);
            let mend = match (8..=256).filter(fits).min_by_key(|fitting| fitting.abs_diff(osr.into())) {
                Some(osr) => format!("`osr = {osr}`"),
                None => format!("a carrier with `half = {}`", (period.div_ceil(every) * every).div_ceil(2)),
            };
            let text = format!(
                "the period of `{}`, {period} cycles, is no multiple of the windows': {takes}: {mend}",
                carrier.name
            );
            return self.mistakes.mistake(&place, text);
        }
        let (least, _) = self.wiring.cycles_to_tick(centre, 1);
        let longest = window.delay + window.spread;
        let is_read = peripheral.reads.first().is_some_and(Option::is_some);
        if is_read && self.wiring.tick.is_some() && longest > least.into() {
            let text = format!(
                "`value` is a period old at each tick: it comes {longest} cycles after its window's centre, and the tick {least} cycles after it: `after` greater by {:.2} µs or more, or a smaller `osr`",
                self.at_least(longest - u64::from(least))
            );
            self.warnings.mistake(&place, text);
        }
    }

    /// Compares the direction of the modulator's clock with the pins.
    fn clock_pins(&self, peripheral: &Peripheral) {
        let is_in = peripheral.parameter("clock") == 1;
        let has = |name: &str| {
            let at = peripheral.kind.pins.iter().position(|pin| pin.name == name);
            at.is_some_and(|at| peripheral.pins[at].is_some())
        };
        let (needed, other, direction) =
            if is_in { ("clock_in", "clock", "in") } else { ("clock", "clock_in", "out") };
        let place = self.place(peripheral, None, &["pins"]);
        if !has(needed) {
            let text = format!(
                "with `clock = \"{direction}\"` `{}` needs the pin `{needed}`, which is not connected",
                peripheral.name
            );
            self.mistakes.mistake(&place, text);
        }
        if has(other) {
            let text = format!(
                "with `clock = \"{direction}\"` the pin `{other}` of `{}` is not used: leave it out",
                peripheral.name
            );
            self.mistakes.mistake(&place, text);
        }
    }

    /// Compares the limit with the sums for overcurrent, and with the peripherals that it trips.
    fn overcurrent(&self, peripheral: &Peripheral) {
        let [fast, limit] = ["fast", "limit"].map(|name| u64::from(peripheral.parameter(name)));
        let most = fast.pow(3);
        let is_named = self.wiring.peripherals.iter().any(|other| other.trips.contains(&peripheral.name));
        let place = self.place(peripheral, None, &["limit"]);
        match limit {
            0 if is_named => {
                let text = format!("`{}` never trips: it has no `limit`, of {most} at most", peripheral.name);
                self.mistakes.mistake(&place, text);
            }
            limit if limit > most => {
                let text = format!(
                    "`{}` never trips: `limit` is {limit}, and a sum with `fast = {fast}` reaches fast³ = {most} at most",
                    peripheral.name
                );
                self.mistakes.mistake(&place, text);
            }
            1.. if !is_named => {
                let text = format!(
                    "the trip `{}` makes nothing safe: no peripheral names it in `trips`",
                    peripheral.name
                );
                self.warnings.mistake(&place, text);
            }
            _ => {}
        }
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Checks of combinations on carriers: periods against ticks, samples and duties against the program's time.

use super::{Fit, PeriodCycles};
use crate::carrier::Carrier;
use crate::document::Table;
use crate::kind::{DIRECT, UPDATES};
use crate::latency;
use crate::wiring::Peripheral;
use std::ops::Range;

impl Fit<'_> {
    /// Place of a carrier's name.
    fn carrier_place(&self, carrier: &Carrier) -> Range<usize> {
        let find = |top: Table<'_>| {
            let all = top.table("carrier")?.tables();
            all.into_iter().find(|(name, _)| name.value == carrier.name).map(|(name, _)| name.place)
        };
        self.mistakes.top().and_then(find).unwrap_or(0..0)
    }

    /// Place in the file that defines the ticks: the key `period`, or the carrier that gives them.
    pub(super) fn tick_place(&self) -> Range<usize> {
        match &self.wiring.tick {
            Some(tick) => self.carrier_place(&self.wiring.carriers[tick.carrier]),
            None => self.top(&["period"]),
        }
    }

    /// Finds carriers whose periods do not divide the ticks.
    pub(super) fn carriers(&self) {
        for (number, carrier) in self.wiring.carriers.iter().enumerate() {
            let (period, ticks) = (carrier.period(), self.wiring.period);
            let text = match &self.wiring.tick {
                None if !ticks.is_multiple_of(period) => format!(
                    "`{}` does not divide the tick: its period is {period} cycles, and a tick comes every {ticks}: `tick = \"valley\"` gives the tick in place of `period`",
                    carrier.name
                ),
                Some(tick) if self.wiring.tick_positions(number).is_none() => {
                    let other = &self.wiring.carriers[tick.carrier];
                    format!(
                        "`{}` does not divide the tick: its period is {period} cycles, and that of `{}`, which gives the ticks, is {}: a whole part of it",
                        carrier.name,
                        other.name,
                        other.period()
                    )
                }
                _ => continue,
            };
            self.mistakes.mistake(&self.carrier_place(carrier), text);
        }
    }

    /// Compares the time at which registers are captured with the cycles in which they are copied to input ports.
    pub(super) fn latch(&self, peripheral: &Peripheral) {
        let Some(instant) = peripheral.latch else { return };
        let Some(ticks) = self.wiring.tick_positions(instant.carrier) else { return };
        let period = self.wiring.carriers[instant.carrier].period();
        let all = self.wiring.peripherals.iter();
        let copies =
            all.map(|peripheral| peripheral.reads.iter().flatten().count()).sum::<usize>() as u32 + 1;
        for tick in ticks {
            let behind = (instant.at + period - tick) % period;
            if (1..=copies).contains(&behind) {
                let text = format!(
                    "`{}` captures its registers {behind} cycles after the tick, while they are copied to input ports, up to {copies} cycles after it: a `shift` by {:.2} µs or more",
                    peripheral.name,
                    self.at_least(u64::from(copies + 1 - behind))
                );
                return self.mistakes.mistake(&self.place(peripheral, None, &["latch"]), text);
            }
        }
    }

    /// Compares a trip that waits for no clock with its filter, and with the peripherals that it trips.
    pub(super) fn direct(&self, peripheral: &Peripheral) {
        if !peripheral.is_direct() {
            return;
        }
        let filter = peripheral.parameter("filter");
        if filter != 0 {
            let text = format!(
                "`{}` takes switches off without a clock, so no filter of {filter} cycles: `filter = 0`, or no `{DIRECT}`",
                peripheral.name
            );
            self.mistakes.mistake(&self.place(peripheral, None, &["filter", DIRECT]), text);
        }
        let waits = self.wiring.peripherals.iter().filter(|other| other.trips.contains(&peripheral.name));
        for other in waits.filter(|other| !other.kind.strobes.trip) {
            let text = format!(
                "`{DIRECT}` acts on half bridges of a `pwm3`: `{}` is safe 3 cycles after the pin's edge",
                other.name
            );
            self.warnings.mistake(&self.place(peripheral, None, &[DIRECT]), text);
        }
    }

    /// Compares dead time, carrier and the times of updates of half bridges.
    pub(super) fn bridges(&self, peripheral: &Peripheral, busy: Option<PeriodCycles>) {
        let Some(carrier) = peripheral.carrier.map(|carrier| &self.wiring.carriers[carrier]) else { return };
        let [dead, minimum] = ["dead", "minimum"].map(|name| peripheral.parameter(name));
        let least = dead + minimum.max(1);
        if least > carrier.half {
            let text = format!(
                "no pulse is left: `dead` and `minimum` leave out all below {least} cycles and within {least} of the period of `{}`, {}: together {} at most",
                carrier.name,
                carrier.period(),
                carrier.half
            );
            return self.mistakes.mistake(&self.place(peripheral, None, &["dead", "minimum"]), text);
        }
        let update = UPDATES.get(peripheral.parameter("update") as usize).copied().unwrap_or_default();
        let place = self.place(peripheral, None, &["update", "carrier"]);
        let every = match update {
            "valley" | "peak" => carrier.period(),
            _ => carrier.half,
        };
        if every > self.wiring.period {
            let text = format!(
                "duties are lost: they act every {every} cycles, and the program writes them every {}: `update = \"now\"`, or a greater `every`",
                self.wiring.period
            );
            return self.mistakes.mistake(&place, text);
        }
        let Some(busy) = busy.filter(|_| self.wiring.tick.is_some()) else { return };
        let (waits, less) = latency::update(self.wiring, peripheral, Some([busy.best, busy.worst]));
        let (best, worst) = (busy.best + waits[0] + less[0], busy.worst + waits[1] - less[1]);
        if update != "now" && worst - best >= u64::from(every) {
            let text = format!(
                "an update can be missed: the duties come {} to {} cycles after the tick, so that those of some periods act {best} cycles after it, and others {worst}: another `after` of the tick, a shorter program, or `update = \"now\"`",
                busy.best, busy.worst
            );
            self.mistakes.mistake(&place, text);
        }
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Checks of combinations: parameters of peripherals, ticks and the program's periods that are each in range but do not fit each other.

mod drive;
mod frames;
mod windows;

use crate::application::Application;
use crate::document::{Document, Mistake, Table};
use crate::latency::{self, ProgramCycles};
use crate::wiring::{Peripheral, Wiring};
use std::ops::Range;
use takt_analysis::Bounds;
use takt_system::latency::Passages;

/// Bits of the shortest request of the host on the UART: eight bytes.
const REQUEST_BITS: f64 = 80.0;

/// Combinations found, each list in the order of the wiring's file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Findings {
    /// Combinations that never work.
    pub mistakes: Vec<Mistake>,
    /// Periods that always miss their tick.
    pub late: Vec<Mistake>,
    /// Combinations that lose something, or may.
    pub warnings: Vec<Mistake>,
}

/// The wiring, with a list of findings for each severity.
struct Fit<'a> {
    wiring: &'a Wiring,
    mistakes: Document<'a>,
    late: Document<'a>,
    warnings: Document<'a>,
}

/// Cycles of a period, from the tick until outputs are on the peripherals.
#[derive(Clone, Copy)]
struct PeriodCycles {
    best: u64,
    worst: u64,
}

impl Wiring {
    /// Checks the numbers of this wiring against each other, and against the periods of a program or a system. `text` is the wiring's file;
    /// `bounds` holds the bounds of each core's program, if known.
    pub fn findings<'a>(
        &self,
        file: &str,
        text: &str,
        application: impl Into<Application<'a>>,
        bounds: &[Option<Bounds>],
    ) -> Findings {
        let application = application.into();
        let document = || Document::new(file, text);
        let fit = Fit { wiring: self, mistakes: document(), late: document(), warnings: document() };
        let busy = if application.is_program() { fit.program(bounds) } else { None };
        if !application.is_program() {
            fit.system(&application, bounds);
        }
        fit.host();
        fit.carriers();
        for peripheral in &self.peripherals {
            fit.pins(peripheral);
            fit.scales(peripheral);
            fit.latch(peripheral);
            if let Some(frame) = latency::frame(peripheral) {
                fit.frame(peripheral, &frame, busy);
            }
            if let Some(window) = latency::window(peripheral) {
                fit.window(peripheral, &window);
            }
            match peripheral.kind.name {
                "pwm" => fit.pwm(peripheral),
                "pwm3" => fit.bridges(peripheral, busy),
                "trip" => fit.direct(peripheral),
                _ => {}
            }
        }
        let list = |document: Document<'_>| document.finish(None::<()>).err().unwrap_or_default();
        Findings { mistakes: list(fit.mistakes), late: list(fit.late), warnings: list(fit.warnings) }
    }
}

impl Fit<'_> {
    fn microseconds(&self, cycles: u64) -> f64 {
        cycles as f64 / self.wiring.clock
    }

    /// Shortest time of at least `cycles` cycles, in µs with two decimals.
    fn at_least(&self, cycles: u64) -> f64 {
        (self.microseconds(cycles) * 100.0).ceil() / 100.0
    }

    /// Place of the first of these keys at the file's top level.
    fn top(&self, keys: &[&str]) -> Range<usize> {
        let find = |top: Table<'_>| keys.iter().find_map(|key| top.place_of(key));
        self.mistakes.top().and_then(find).unwrap_or(0..0)
    }

    /// Place of the first of these keys of a peripheral, or of its table `within`; otherwise the place of its name.
    fn place(&self, peripheral: &Peripheral, within: Option<&'static str>, keys: &[&str]) -> Range<usize> {
        let find = || {
            let all = self.mistakes.top()?.table("peripheral")?.tables();
            let (name, table) = all.into_iter().find(|(name, _)| name.value == peripheral.name)?;
            let table = match within {
                Some(within) => table.table(within)?,
                None => table,
            };
            Some(keys.iter().find_map(|key| table.place_of(key)).unwrap_or(name.place))
        };
        find().unwrap_or(0..0)
    }

    /// Compares a program's periods with the tick.
    fn program(&self, bounds: &[Option<Bounds>]) -> Option<PeriodCycles> {
        let cycles = ProgramCycles::new(bounds.first()?.as_ref()?)?;
        let peripherals = &self.wiring.peripherals;
        let reads =
            peripherals.iter().map(|peripheral| peripheral.reads.iter().flatten().count() as u64).sum();
        let writes =
            peripherals.iter().map(|peripheral| peripheral.writes.iter().flatten().count() as u64).sum();
        let busy = cycles.to_idle(reads, writes);
        let period = u64::from(self.wiring.period);
        let place = self.tick_place();
        let figures = |cycles: u64, program: u64| {
            let copies = cycles - program;
            format!(
                "{cycles} cycles, {copies} of them for {reads} ports read and {writes} written at pins, and a tick comes every {period} cycles"
            )
        };
        let mend = match self.wiring.tick {
            None => format!("`period = {}` or more, or a shorter program", self.at_least(busy.worst + 1)),
            Some(_) => "a longer carrier, a greater `every`, or a shorter program".to_owned(),
        };
        if busy.best >= period {
            let text = format!(
                "every tick is missed, and the outputs stay safe: a period of the program takes {}: {mend}",
                figures(busy.best, cycles.period.best)
            );
            self.late.mistake(&place, text);
        } else if busy.worst >= period {
            let text = format!(
                "a tick can be missed: a period of the program takes up to {}: {mend}",
                figures(busy.worst, cycles.period.worst)
            );
            // On a carrier, the program must meet its deadline: report a mistake instead of a warning.
            let list = if self.wiring.tick.is_some() { &self.mistakes } else { &self.warnings };
            list.mistake(&place, text);
        }
        let put = cycles.to_put(reads, writes);
        Some(PeriodCycles { best: put.best, worst: put.worst })
    }

    /// Compares the periods of a system's cores with their ticks.
    fn system(&self, application: &Application<'_>, bounds: &[Option<Bounds>]) {
        let description = application.description();
        let Some(known) = bounds.iter().cloned().collect::<Option<Vec<Bounds>>>() else { return };
        let passages = Passages::new(description, &known);
        let place = self.top(&["period"]);
        for (number, (core, bounds)) in description.cores.iter().zip(&known).enumerate() {
            let period = core.period(description.tick);
            let best = bounds.sections.iter().filter(|section| !section.once);
            match best.map(|section| section.in_time.best).min() {
                Some(best) if best >= period => {
                    let text = format!(
                        "core `{}` misses every tick, and the outputs stay safe: its period takes {best} cycles at least, and its tick comes every {period}: a longer tick in the system's file, or a shorter program",
                        core.name
                    );
                    self.late.mistake(&place, text);
                }
                _ => passages.deadline(number).into_iter().for_each(|late| {
                    self.warnings.mistake(&place, format!("a tick can be missed: {late}"));
                }),
            }
        }
    }

    /// Compares the host's deadline with the time of a request on the line.
    fn host(&self) {
        let Wiring { host, baud, period, .. } = *self.wiring;
        let allowed = self.microseconds(u64::from(host) * u64::from(period));
        let request = REQUEST_BITS * 1e6 / f64::from(baud);
        if host > 0 && allowed < request {
            let text = format!(
                "no host is fast enough: {host} periods are {allowed:.2} µs, and a request takes {request:.2} µs at {baud} baud: `host = {}` or more, or a higher `baud`",
                (request / self.microseconds(period.into())).ceil()
            );
            self.mistakes.mistake(&self.top(&["host"]), text);
        }
    }

    /// Finds registers whose pin is not connected.
    fn pins(&self, peripheral: &Peripheral) {
        let kind = peripheral.kind;
        let read = kind.reads.iter().zip(peripheral.reads.iter().map(Option::is_some));
        let written = kind.writes.iter().zip(peripheral.writes.iter().map(Option::is_some));
        for (register, _) in read.chain(written).filter(|(_, is_used)| *is_used) {
            let pin = kind.pins.iter().position(|pin| Some(pin.name) == register.pin);
            if let Some(pin) = pin.filter(|pin| peripheral.pins[*pin].is_none()) {
                let text = format!(
                    "`{}` needs the pin `{}` of `{}`, which is not connected",
                    register.name, kind.pins[pin].name, peripheral.name
                );
                let place = self.place(peripheral, Some("ports"), &[register.name]);
                self.mistakes.mistake(&place, text);
            }
        }
    }

    /// Finds scales that put 1.0 beyond the register's range.
    fn scales(&self, peripheral: &Peripheral) {
        for (register, write) in peripheral.kind.writes.iter().zip(&peripheral.writes) {
            let (Some(scale), Some(most)) =
                (write.as_ref().and_then(|write| write.scale), self.most(peripheral))
            else {
                continue;
            };
            // Programs may multiply by a remainder below 1.
            let greatest = most.next_power_of_two();
            let steps = f64::from(scale).exp2();
            if steps > greatest as f64 {
                let text = format!(
                    "with a scale of {steps}, all above {:.3e} is beyond what `{}` holds, {most}, and is cut off: {greatest} at most",
                    most as f64 / steps,
                    register.name
                );
                let place = self.place(peripheral, Some("scale"), &[register.name]);
                self.mistakes.mistake(&place, text);
            }
        }
    }

    /// Compares the period and the dead time of a PWM with the tick and each other.
    fn pwm(&self, peripheral: &Peripheral) {
        let (half, dead) = (peripheral.parameter("half"), peripheral.parameter("dead"));
        let (whole, period) = (2 * u64::from(half), u64::from(self.wiring.period));
        if u64::from(dead) >= whole {
            let text = format!(
                "no pulse is longer than the dead time: `dead` is {dead} cycles, a whole period of `{}` {whole}: less than {half} leaves half of the duties",
                peripheral.name
            );
            self.mistakes.mistake(&self.place(peripheral, None, &["dead", "half", "kind"]), text);
        }
        if whole > period {
            let text = format!(
                "duties are lost: a period of `{}` takes 2 · half = {whole} cycles, and the program writes one every {period}: `half = {}` at most, or `period = {}` or more",
                peripheral.name,
                period / 2,
                self.at_least(whole)
            );
            self.warnings.mistake(&self.place(peripheral, None, &["half", "kind"]), text);
        }
    }

    /// Greatest value of a peripheral's scaled register; `None` for other peripherals.
    fn most(&self, peripheral: &Peripheral) -> Option<u64> {
        let is_signed = peripheral.parameter("signed") == 1;
        let half = |whole: u64| if is_signed { whole / 2 } else { whole };
        match peripheral.kind.name {
            "pwm" => Some(half(2 * u64::from(peripheral.parameter("half")))),
            "pwm3" => Some(half(self.wiring.carriers[peripheral.carrier?].period().into())),
            "sigma-delta" => Some(half(1 << 16)),
            "spi" => Some((1 << peripheral.parameter("bits")) - 1),
            _ => None,
        }
    }
}

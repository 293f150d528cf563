// SPDX-License-Identifier: MIT OR Apache-2.0
//! Models of the parts of a drive: carrier, three half bridges, trip.

use super::clocked::{Model, high, word};
use super::filter::Filter;
use super::outputs::clamped;

/// Model of `takt_carrier`: the input is rst, and the outputs are place and back.
#[derive(Clone, Debug)]
pub struct Carrier {
    half: u32,
    start: u32,
    /// Cycles since the valley.
    at: u32,
}

impl Carrier {
    /// A carrier that begins at a cycle of its period.
    pub fn new(half: u32, start: u32) -> Carrier {
        Carrier { half, start, at: start }
    }
}

impl Model for Carrier {
    fn outputs(&self) -> Vec<u32> {
        vec![self.at % self.half, self.at / self.half]
    }

    fn clock(&mut self, inputs: &[u32]) {
        self.at = if high(inputs, 0) { self.start } else { (self.at + 1) % (2 * self.half) };
    }
}

/// Parameters of a [`Pwm3`], like the circuit's.
#[derive(Clone, Copy, Debug)]
pub struct Bridges {
    /// Half a carrier's period in cycles.
    pub half: u32,
    /// Dead time in cycles.
    pub dead: u32,
    /// Least cycles for which a switch is on.
    pub minimum: u32,
    /// Duties act at once (0), or from valleys (1), peaks (2), or both (3) on.
    pub update: u32,
    /// Duties are signed.
    pub signed: bool,
    /// Pins of high and of low switches are active low.
    pub invert: [bool; 2],
    /// Levels at rest, without drive and while tripped: 0 off, 1 low, 2 high.
    pub rests: [u32; 2],
}

/// A half bridge: the switch that is on, and for how long.
#[derive(Clone, Copy, Debug)]
struct Phase {
    taken: u32,
    /// Cycles of the pulse before and after the peak.
    parts: [u32; 2],
    pulse: bool,
    /// 0 off, 1 low, 2 high.
    on: u32,
    lasts: u32,
}

impl Phase {
    /// Takes both switches off.
    fn clear(&mut self) {
        (self.on, self.lasts) = (0, 1);
    }
}

/// Model of the circuit `takt_pwm3`.
#[derive(Clone, Debug)]
pub struct Pwm3 {
    of: Bridges,
    begun: bool,
    stopped: bool,
    phases: [Phase; 3],
}

impl Pwm3 {
    /// Half bridges after a reset.
    pub fn new(of: Bridges) -> Pwm3 {
        let zero = if of.signed { of.half } else { 0 };
        let parts = [zero.div_ceil(2), zero / 2];
        let phase = Phase { taken: zero, parts, pulse: false, on: 0, lasts: 1 };
        Pwm3 { of, begun: false, stopped: false, phases: [phase; 3] }
    }
}

impl Bridges {
    /// Cycles of the pulse for a duty.
    fn pulse(&self, duty: u32) -> u32 {
        let most = 2 * self.half;
        let least = self.dead + self.minimum.max(1);
        match clamped(duty, if self.signed { self.half } else { 0 }, most) {
            on if on < least => 0,
            on if on > most - least => most,
            on => on,
        }
    }
}

impl Model for Pwm3 {
    fn outputs(&self) -> Vec<u32> {
        let pins = |phase: &Phase| [(2, 0), (1, 1)].map(|(on, i)| (phase.on == on) != self.of.invert[i]);
        self.phases.iter().flat_map(pins).map(u32::from).collect()
    }

    fn settle(&mut self, inputs: &[u32]) {
        if high(inputs, 3) {
            self.phases.iter_mut().for_each(Phase::clear);
        }
    }

    fn clock(&mut self, inputs: &[u32]) {
        let [rst, enable, trip, off, back, put] = [0, 1, 2, 3, 5, 6].map(|i| high(inputs, i));
        if rst {
            *self = Pwm3::new(self.of);
            return;
        }
        let (place, may) = (word(inputs, 4), enable && !trip && !self.stopped);
        let is_last = place + 1 == self.of.half;
        let loads = match self.of.update {
            0 => true,
            places => is_last && places >> u32::from(!back) & 1 == 1,
        };
        let runs = self.begun && may;
        let rest = self.of.rests[usize::from(trip)];
        for (i, phase) in self.phases.iter_mut().enumerate() {
            let [before, behind] = phase.parts;
            let is_first = place == 0;
            phase.pulse = match back {
                true => (is_first || phase.pulse) && place < behind,
                false => (!is_first && phase.pulse) || self.of.half - place <= before,
            };
            let target = if runs { 1 + u32::from(phase.pulse) } else { rest };
            let changes = match phase.on {
                0 => target != 0 && phase.lasts >= self.of.dead,
                on => target != on && !(runs && phase.lasts < self.of.minimum),
            };
            phase.lasts += 1;
            if off {
                phase.clear();
            } else if changes {
                phase.on = if phase.on == 0 || self.of.dead == 0 { target } else { 0 };
                phase.lasts = 1;
            }
            if loads {
                phase.parts = [phase.taken.div_ceil(2), phase.taken / 2];
            }
            if put {
                phase.taken = self.of.pulse(word(inputs, 7 + i));
            }
        }
        self.begun = may && (self.begun || is_last && back);
        if put {
            self.stopped = word(inputs, 10) != 0;
        }
    }
}

/// Model of the circuit `takt_trip`.
#[derive(Clone, Debug)]
pub struct Trip {
    pin: Option<Filter>,
    synchroniser: [bool; 2],
    /// Flip-flops that a direct pin sets; the last one takes switches off.
    set: Option<[bool; 3]>,
    invert: bool,
    held: bool,
    was: bool,
    trips: u32,
    taken: [u32; 2],
}

impl Trip {
    /// Trip that responds to a level once it has been stable for `filter` cycles, or, `direct`, without a clock.
    pub fn new(filter: u32, invert: bool, direct: bool) -> Trip {
        Trip {
            pin: (filter > 0 && !direct).then(|| Filter::new(filter)),
            synchroniser: [false; 2],
            set: direct.then_some([false; 3]),
            invert,
            held: false,
            was: false,
            trips: 0,
            taken: [0; 2],
        }
    }

    fn asks(&self) -> bool {
        self.pin.as_ref().map_or(self.synchroniser[1], Filter::level)
    }
}

impl Model for Trip {
    fn outputs(&self) -> Vec<u32> {
        let trip = self.asks() || self.held;
        let off = self.set.is_some_and(|[.., last]| last) && !self.held;
        [trip.into(), off.into()].into_iter().chain(self.taken).collect()
    }

    fn settle(&mut self, inputs: &[u32]) {
        if high(inputs, 4) != self.invert {
            self.set = self.set.map(|_| [true; 3]);
        }
    }

    fn clock(&mut self, inputs: &[u32]) {
        let [rst, clear, take, put] = [0, 1, 2, 3].map(|i| high(inputs, i));
        let pin = high(inputs, 4) != self.invert;
        let asks = self.asks();
        let trip = asks || self.held;
        if take {
            self.taken = [u32::from(trip) | u32::from(asks) << 1, self.trips];
        }
        self.trips = self.trips.wrapping_add((trip && !self.was).into());
        self.held = asks || self.held && !(clear || put && word(inputs, 5) != 0);
        self.was = trip;
        if rst {
            (self.held, self.was, self.trips, self.taken) = (false, false, 0, [0; 2]);
        }
        self.synchroniser = [self.set.map_or(pin, |[.., last]| last), self.synchroniser[0]];
        self.set = self.set.map(|[first, second, _]| if pin { [true; 3] } else { [false, first, second] });
        if let Some(filter) = &mut self.pin {
            filter.clock(rst, pin);
        }
    }
}

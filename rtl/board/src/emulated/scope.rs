// SPDX-License-Identifier: MIT OR Apache-2.0
//! Scope of an emulated board: `takt_scope` by whole periods, with the registers of docs/protocol.md.

use crate::application::Application;
use crate::protocol::{PAGE_WORDS, SCOPE, SCOPE_PAGE};
use crate::scope::{ARM, CAUSES, END, MOST_CHANNELS, MOST_WORDS, NOW, key};
use crate::top::recorded;
use crate::wiring::Wiring;
use takt_emu::Status;
use takt_isa::{Register, Type};
use takt_system::System;

/// Samples of a scope whose depth the wiring leaves out.
const USUAL_DEPTH: u32 = 2048;
/// Registers of the scope before those of its channels.
const CHANNELS: u16 = 32;
/// Registers of a channel.
const CHANNEL: u16 = 4;

/// Events, as bits of the trigger's mask and causes.
const STOPPED: u32 = 1;
/// Event: a missed deadline.
const MISSED: u32 = 1 << 1;
/// Event: the outputs became safe.
const SAFE: u32 = 1 << 3;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Rest,
    Armed,
    After,
    Done,
}

/// Register that is recorded.
#[derive(Clone, Copy, Debug, Default)]
struct Channel {
    /// The host's word, which names the register.
    word: u32,
    /// Value for the samples before the program's first write.
    given: Option<u32>,
    /// Samples with a value, counted from the last one back.
    have: u32,
}

/// Result of a comparison in one period.
#[derive(Clone, Copy, Debug)]
struct Tested {
    key: u32,
    /// The value is a number.
    ordered: bool,
    above: bool,
}

/// End of a period, or a stop in mid-period.
#[derive(Debug)]
struct Walk {
    values: Vec<Option<u32>>,
    /// Periods that have ended since the start.
    periods: u32,
    is_stop: bool,
}

/// Scope beside a core of an emulated board.
#[derive(Debug)]
pub(super) struct EmulatedScope {
    /// The core that is recorded.
    pub(super) core: usize,
    depth: u32,
    channels: Vec<Channel>,
    ring: Vec<u32>,
    every: u32,
    length: u32,
    trigger: u32,
    level: u32,
    state: State,
    causes: u32,
    /// The last sample is that of a stop.
    stop_sample: bool,
    /// Periods until the next sample.
    phase: u32,
    place: u32,
    count: u32,
    events: u32,
    forced: bool,
    /// Triggered, with the trigger's sample still to come.
    wants: bool,
    remaining: u32,
    trigger_place: u32,
    trigger_period: u32,
    last_period: u32,
    prior: Option<Tested>,
    walks: Vec<Walk>,
    /// The core stopped, and its stop has been seen.
    stopped: bool,
    missed: u64,
}

impl EmulatedScope {
    /// The scope of a wiring; `None` without one. Where the wiring leaves the size open, it is the largest that a board's scope has usually.
    pub(super) fn of(wiring: &Wiring, application: &Application<'_>) -> Option<EmulatedScope> {
        let (request, core) = (wiring.scope.as_ref()?, recorded(wiring, application)?);
        let channels = request.channels.unwrap_or(MOST_CHANNELS);
        let depth = request.depth.unwrap_or(USUAL_DEPTH).min(MOST_WORDS / channels);
        Some(EmulatedScope {
            core,
            depth,
            channels: vec![Channel::default(); channels as usize],
            ring: vec![0; (channels * depth) as usize],
            every: 1,
            length: 0,
            trigger: 0,
            level: 0,
            state: State::Rest,
            causes: 0,
            stop_sample: false,
            phase: 0,
            place: 0,
            count: 0,
            events: 0,
            forced: false,
            wants: false,
            remaining: 0,
            trigger_place: 0,
            trigger_period: 0,
            last_period: 0,
            prior: None,
            walks: Vec::new(),
            stopped: false,
            missed: 0,
        })
    }

    fn records(&self) -> bool {
        matches!(self.state, State::Armed | State::After)
    }

    /// Runs a system to a cycle, and takes the values of the recorded core at each end of a period.
    pub(super) fn run(&mut self, system: &mut System, until: u64) -> Result<(), takt_system::SystemFault> {
        loop {
            let before = system.periods(self.core).count;
            // A core that waits has at most one end of a period until the next tick.
            let waits = matches!(system.core(self.core).status(), Status::Waiting { .. });
            let to = if waits || !self.records() { until } else { system.now() + 1 };
            let done = system.run_until(to.min(until));
            let after = system.periods(self.core).count;
            if after != before {
                self.walk(system, after as u32, false);
            }
            let runs = matches!(system.core(self.core).status(), Status::Running | Status::Waiting { .. });
            if !runs && !self.stopped {
                self.stopped = true;
                self.walk(system, after as u32, true);
            }
            done?;
            if system.now() >= until {
                return Ok(());
            }
        }
    }

    fn walk(&mut self, system: &System, periods: u32, is_stop: bool) {
        if !self.records() {
            return;
        }
        let core = system.core(self.core);
        let value = |channel: &Channel| {
            let register = Register::new(channel.word as usize & 0x3ff);
            register.and_then(|register| core.register(register)).or(channel.given)
        };
        let values = self.channels.iter().map(value).collect();
        self.walks.push(Walk { values, periods, is_stop });
    }

    /// An event has happened.
    fn happened(&mut self, event: u32) {
        if self.state == State::Armed {
            self.events |= event & self.trigger >> 16;
        }
    }

    /// The outputs became safe.
    pub(super) fn became_safe(&mut self) {
        self.happened(SAFE);
    }

    /// Ends a base tick: decides about the samples that were taken in it.
    pub(super) fn decide(&mut self, system: Option<&System>) {
        let missed = system.map_or(0, |system| system.periods(self.core).skipped);
        if missed > self.missed {
            self.happened(MISSED);
        }
        self.missed = missed;
        for walk in std::mem::take(&mut self.walks) {
            self.sample(&walk);
        }
    }

    /// The comparison's result for a period's value.
    fn tested(&self, bits: u32) -> Tested {
        let ty = match self.trigger >> 8 & 3 {
            0 => Type::F,
            2 => Type::B,
            _ => Type::I,
        };
        let key = key(ty, bits);
        let ordered = ty != Type::F || !f32::from_bits(bits).is_nan();
        Tested { key, ordered, above: key >= self.level }
    }

    fn is_met(&self, now: Option<Tested>) -> bool {
        let Some(now) = now else { return false };
        let before = |above: bool| self.prior.is_some_and(|prior| prior.ordered && prior.above == above);
        match self.trigger & 7 {
            1 => now.ordered && now.above,
            2 => now.ordered && !now.above,
            3 => now.ordered && now.above && before(false),
            4 => now.ordered && !now.above && before(true),
            5 => now.ordered && now.key == self.level,
            6 => self.prior.is_some_and(|prior| prior.key != now.key),
            _ => false,
        }
    }

    fn sample(&mut self, walk: &Walk) {
        let on_stop = self.trigger >> 16 & STOPPED;
        let shows = self.state == State::After
            || self.state == State::Armed && (on_stop != 0 || self.events != 0 || self.forced);
        if !self.records() || walk.is_stop && !shows {
            return;
        }
        let keeps = walk.is_stop || self.phase == 0;
        let tests = (self.trigger >> 4 & 7) as usize;
        let now = walk.values.get(tests).copied().flatten().map(|bits| self.tested(bits));
        let compared = self.is_met(now) && self.count >= self.length & 0xffff;
        let seen = self.events | if walk.is_stop { on_stop } else { 0 };
        let is_hit = self.state == State::Armed && (seen != 0 || self.forced || compared);
        let period = walk.periods.wrapping_add(u32::from(walk.is_stop));
        self.prior = now;
        if !walk.is_stop {
            self.phase = if self.phase == 0 { self.every.max(1) - 1 } else { self.phase - 1 };
        }
        let place = self.place;
        if keeps {
            let first = place as usize * self.channels.len();
            for ((word, channel), value) in
                self.ring[first..].iter_mut().zip(&mut self.channels).zip(&walk.values)
            {
                *word = value.unwrap_or(0);
                channel.have = (channel.have + u32::from(value.is_some())).min(0xffff);
            }
            self.place = (place + 1) % self.depth;
            self.count = (self.count + 1).min(0xffff);
            (self.last_period, self.stop_sample) = (period, walk.is_stop);
        }
        let was_after = self.state == State::After;
        if is_hit {
            self.causes = seen | u32::from(self.forced) << 4 | u32::from(compared) << 5;
            (self.trigger_period, self.state, self.wants) = (period, State::After, true);
        }
        if self.wants {
            if keeps {
                (self.trigger_place, self.remaining, self.wants) = (place, self.length >> 16, false);
                if self.remaining == 0 {
                    self.state = State::Done;
                }
            }
        } else if was_after && keeps {
            self.remaining -= 1;
            if self.remaining == 0 {
                self.state = State::Done;
            }
        }
        if walk.is_stop {
            self.state = State::Done;
        }
    }

    /// The host starts or stops the program.
    pub(super) fn reset(&mut self) {
        if self.state == State::After {
            self.state = State::Done;
        }
        if self.state == State::Armed {
            self.clear();
        }
        self.channels.iter_mut().for_each(|channel| channel.given = None);
        self.walks.clear();
        (self.stopped, self.missed) = (false, 0);
    }

    /// Drops the samples.
    fn clear(&mut self) {
        (self.count, self.phase, self.prior) = (0, 0, None);
        self.channels.iter_mut().for_each(|channel| channel.have = 0);
    }

    /// The channel and its register at an address of the scope.
    fn channel(&self, at: u16) -> Option<(usize, u16)> {
        let at = at.checked_sub(CHANNELS)?;
        let number = usize::from(at / CHANNEL);
        (number < self.channels.len()).then_some((number, at % CHANNEL))
    }

    /// The host may write an address, counted from the scope's first one.
    pub(super) fn is_writable(&self, at: u16) -> bool {
        (1..=5).contains(&at) || self.channel(at).is_some_and(|(_, register)| register < 2)
    }

    /// Writes a register.
    pub(super) fn write(&mut self, at: u16, word: u32) {
        match at {
            1 => self.act(word),
            2 => self.every = word & 0xfff,
            3 => self.length = word,
            4 => self.trigger = word,
            5 => self.level = word,
            _ => match self.channel(at) {
                Some((number, 0)) => (self.channels[number].word, self.channels[number].given) = (word, None),
                Some((number, _)) => self.channels[number].given = Some(word),
                None => {}
            },
        }
    }

    fn act(&mut self, word: u32) {
        self.forced |= word & NOW != 0;
        if word & END != 0 && self.records() {
            self.state = State::Done;
        }
        if word & ARM != 0 {
            (self.state, self.causes, self.events) = (State::Armed, 0, 0);
            (self.forced, self.wants, self.stop_sample) = (word & NOW != 0, false, false);
            self.walks.clear();
            self.clear();
        }
    }

    /// Reads a register.
    pub(super) fn read(&self, at: u16) -> u32 {
        match at {
            0 => (self.core as u32) << 24 | (self.channels.len() as u32) << 16 | self.depth,
            1 => {
                let stop = u32::from(self.stop_sample) << 2;
                self.state as u32 | stop | self.causes << CAUSES | self.phase << 16
            }
            2 => self.every,
            3 => self.length,
            4 => self.trigger,
            5 => self.level,
            6 => self.place | self.trigger_place << 16,
            7 => self.count,
            8 => self.trigger_period,
            9 => self.last_period,
            _ => match self.channel(at) {
                Some((number, 0)) => self.channels[number].word,
                Some((number, 2)) => self.channels[number].have,
                _ => 0,
            },
        }
    }

    /// Word of the ring at an offset in a page of the image; `None` if the page is not the ring's.
    pub(super) fn word(&self, page: u32, offset: u16) -> Option<u32> {
        let page = page.checked_sub(SCOPE_PAGE)? as usize;
        Some(self.ring.get(page * PAGE_WORDS + usize::from(offset)).copied().unwrap_or(0))
    }
}

/// Offset of an address from the scope's first one; `None` outside the scope's addresses.
pub(super) fn offset(at: u16) -> Option<u16> {
    at.checked_sub(SCOPE).filter(|offset| *offset < CHANNELS + CHANNEL * MOST_CHANNELS as u16)
}

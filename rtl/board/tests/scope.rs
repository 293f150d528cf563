// SPDX-License-Identifier: MIT OR Apache-2.0
//! The scope: its circuit beside a model that keeps whole samples and compares numbers, and in the complete top level.

use crate::harness::board::refuses;
use crate::harness::{Part, RESET, compare};
use rand_pcg::Pcg64;
use rand_pcg::rand_core::{Rng as _, SeedableRng as _};
use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;
use takt_asm::{MemoryLoader, Options, assemble};
use takt_board::model::Model;
use takt_board::protocol::{ENABLE, HOLD, RESTART, RUN};
use takt_board::scope::{Recording, ScopeState, Setup};
use takt_board::simulation::Simulation;
use takt_board::{Application, Board, Host, VERILOG, Wiring};
use takt_emu::Emulator;
use takt_isa::{Program, T3};

const CYCLES: u32 = 60_000;
/// Registers of the slots' banks, and of the input ports.
const BANKS: [u32; 2] = [0, 64];
const INPUTS: u32 = 128;
/// Registers of each bank that the programs write, and numbers of input ports.
const USED: u32 = 3;
const BUNDLES: u32 = 4;
const SETTLE: u64 = 12;

/// A scope whose pins are words, with known contents at power-up.
fn bench(channels: u32, depth: u32) -> (String, String) {
    let name = format!("scope_bench_{channels}_{depth}");
    let text = format!(
        "module {name} (
    input wire clk, rst, core_rst, restart, load, input wire [1:0] load_space, input wire [9:0] load_address, input wire [31:0] load_value,
    input wire core_tick, ended, waiting, stopped, missed, tripped, drive,
    input wire [1:0] retire, input wire [9:0] register0, register1, input wire [15:0] bundle0, bundle1, input wire [31:0] value0, value1,
    input wire in_write, input wire [5:0] in_index, input wire [31:0] in_value,
    input wire bus_write, input wire [5:0] address, input wire [31:0] bus_value, input wire [16:0] at,
    output wire [31:0] read, sample
);
    takt_scope #(.SLOTS(2), .CHANNELS({channels}), .DEPTH({depth}), .INPUTS(10'd{INPUTS}), .PORTS(6), .CORE(3), .BUNDLES(1), .SETTLE({SETTLE}))
    scope (
        .clk(clk), .rst(rst), .core_rst(core_rst), .restart(restart), .load(load), .load_space(load_space), .load_address(load_address),
        .load_value(load_value), .core_tick(core_tick), .ended(ended), .waiting(waiting), .stopped(stopped), .missed(missed),
        .tripped(tripped), .drive(drive), .retire(retire), .retire_register({{register1, register0}}),
        .retire_address({{bundle1, bundle0}}), .retire_value({{value1, value0}}), .in_write(in_write), .in_index(in_index),
        .in_value(in_value), .bus_write(bus_write), .address(address), .bus_value(bus_value), .at(at), .read(read), .sample(sample)
    );
    integer i;
    initial begin
        for (i = 0; i < {}; i = i + 1) scope.ring[i] = 0;
        scope.writes1 = 0;
        scope.trigger_place = 0;
        scope.trigger_period = 0;
        scope.last_period = 0;
    end
endmodule
",
        channels << depth
    );
    (name, text)
}

/// Pins of the bench, in the order of its ports from `core_rst` on.
#[derive(Clone, Copy, Default)]
struct Pins {
    core_rst: bool,
    restart: bool,
    load: Option<(u32, u32)>,
    core_tick: bool,
    ended: bool,
    waiting: bool,
    stopped: bool,
    missed: bool,
    tripped: bool,
    drive: bool,
    /// Register, bundle and value that each slot writes.
    writes: [Option<(u32, u32, u32)>; 2],
    input: Option<(u32, u32)>,
    host: Option<(u32, u32)>,
    address: u32,
    at: u32,
}

impl Pins {
    fn words(&self) -> Vec<u32> {
        let [a, b] = self.writes.map(Option::unwrap_or_default);
        let retire = u32::from(self.writes[0].is_some()) | u32::from(self.writes[1].is_some()) << 1;
        let (load, input) = (self.load.unwrap_or_default(), self.input.unwrap_or_default());
        let (address, value) = self.host.unwrap_or((self.address, 0));
        let bits =
            [self.core_tick, self.ended, self.waiting, self.stopped, self.missed, self.tripped, self.drive];
        let mut words =
            vec![self.core_rst.into(), self.restart.into(), self.load.is_some().into(), 2, load.0, load.1];
        words.extend(bits.map(u32::from));
        words.extend([retire, a.0, b.0, a.1, b.1, a.2, b.2]);
        words.extend([self.input.is_some().into(), input.0, input.1]);
        words.extend([self.host.is_some().into(), address, value, self.at]);
        words
    }

    fn read(words: &[u32]) -> Pins {
        let bit = |at: usize| words[at] != 0;
        let write = |slot: usize| {
            (words[13] >> slot & 1 != 0).then(|| (words[14 + slot], words[16 + slot], words[18 + slot]))
        };
        Pins {
            core_rst: bit(0),
            restart: bit(1),
            load: bit(2).then(|| (words[4], words[5])),
            core_tick: bit(6),
            ended: bit(7),
            waiting: bit(8),
            stopped: bit(9),
            missed: bit(10),
            tripped: bit(11),
            drive: bit(12),
            writes: [write(0), write(1)],
            input: bit(20).then(|| (words[21], words[22])),
            host: bit(23).then(|| (words[24], words[25])),
            address: words[24],
            at: words[26],
        }
    }
}

const TAKES: [(&str, u32); 28] = [
    ("rst", 1),
    ("core_rst", 1),
    ("restart", 1),
    ("load", 1),
    ("load_space", 2),
    ("load_address", 10),
    ("load_value", 32),
    ("core_tick", 1),
    ("ended", 1),
    ("waiting", 1),
    ("stopped", 1),
    ("missed", 1),
    ("tripped", 1),
    ("drive", 1),
    ("retire", 2),
    ("register0", 10),
    ("register1", 10),
    ("bundle0", 16),
    ("bundle1", 16),
    ("value0", 32),
    ("value1", 32),
    ("in_write", 1),
    ("in_index", 6),
    ("in_value", 32),
    ("bus_write", 1),
    ("address", 6),
    ("bus_value", 32),
    ("at", 17),
];

// ---- the model

#[derive(Clone, Copy, Default)]
struct Watched {
    select: u32,
    value: u32,
    valid: bool,
    taken: (u32, bool),
    have: u32,
}

/// The values of a period on their way to a decision.
struct Walk {
    began: u64,
    words: Vec<(u32, bool)>,
    kept: bool,
    stop: bool,
}

/// A value by its type's order.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Number {
    Float(f32),
    Integer(i32),
    Bits(u32),
}

impl Number {
    fn of(ty: u32, bits: u32) -> Number {
        match ty {
            0 => Number::Float(f32::from_bits(bits)),
            1 => Number::Integer(bits as i32),
            _ => Number::Bits(bits),
        }
    }

    /// The number of a key.
    fn from_key(ty: u32, key: u32) -> Number {
        match ty {
            0 if key >> 31 == 1 => Number::of(0, key & 0x7fff_ffff),
            0 => Number::of(0, !key),
            1 => Number::of(1, key.wrapping_sub(0x8000_0000)),
            _ => Number::Bits(key),
        }
    }

    fn against(self, other: Number) -> Option<Ordering> {
        match (self, other) {
            (Number::Float(a), Number::Float(b)) => a.partial_cmp(&b),
            (Number::Integer(a), Number::Integer(b)) => Some(a.cmp(&b)),
            (Number::Bits(a), Number::Bits(b)) => Some(a.cmp(&b)),
            _ => None,
        }
    }
}

struct Scope {
    channels: usize,
    depth: usize,
    now: u64,
    watched: Vec<Watched>,
    /// Writes of the last cycle: register, bundle (none for loads and ports), value.
    late: Vec<(u32, Option<u32>, u32)>,
    every: u32,
    until: u32,
    length: u32,
    trigger: u32,
    level: u32,
    state: u32,
    begun: bool,
    periods: u32,
    /// Cycle in which the period ended whose registers are not taken yet.
    ended: Option<u64>,
    /// Cycle in which the core stopped.
    stopped: Option<u64>,
    was: (bool, bool, bool),
    walk: Option<Walk>,
    ring: Vec<u32>,
    place: usize,
    samples: u32,
    events: u32,
    forced: bool,
    wants: bool,
    remaining: u32,
    causes: u32,
    trigger_place: usize,
    trigger_period: u32,
    last_period: u32,
    stop_sample: bool,
    /// Value of the period before, and whether there was one.
    prior: Option<(u32, bool)>,
    shown: [u32; 3],
}

impl Scope {
    fn new(channels: u32, depth: u32) -> Scope {
        let (channels, depth) = (channels as usize, 1 << depth);
        Scope {
            channels,
            depth,
            now: 0,
            watched: vec![Watched::default(); channels],
            late: Vec::new(),
            every: 1,
            until: 0,
            length: 0,
            trigger: 0,
            level: 0,
            state: 0,
            begun: false,
            periods: 0,
            ended: None,
            stopped: None,
            was: (false, false, false),
            walk: None,
            ring: vec![0; channels * depth],
            place: 0,
            samples: 0,
            events: 0,
            forced: false,
            wants: false,
            remaining: 0,
            causes: 0,
            trigger_place: 0,
            trigger_period: 0,
            last_period: 0,
            stop_sample: false,
            prior: None,
            shown: [0; 3],
        }
    }

    fn records(&self) -> bool {
        self.state == 1 || self.state == 2
    }

    fn register(&self, address: u32) -> u32 {
        if address >= 32 {
            let Some(channel) = self.watched.get((address as usize - 32) / 4) else { return 0 };
            return [channel.select & 0x7fff_03ff, 0, channel.have, 0][address as usize % 4];
        }
        match address {
            0 => 1 << 28 | 3 << 24 | (self.channels as u32) << 16 | self.depth as u32,
            1 => self.until << 16 | self.causes << 4 | u32::from(self.stop_sample) << 2 | self.state,
            2 => self.every,
            3 => self.length,
            4 => self.trigger & 0x000f_0377,
            5 => self.level,
            6 => (self.trigger_place as u32) << 16 | self.place as u32,
            7 => self.samples.min(0xffff),
            8 => self.trigger_period,
            9 => self.last_period,
            _ => 0,
        }
    }

    /// The comparison holds between the period before and this one.
    fn compares(&self, bits: u32, valid: bool) -> bool {
        let (mode, ty) = (self.trigger & 7, self.trigger >> 8 & 3);
        let level = Number::from_key(ty, self.level);
        let order = |bits: u32, valid: bool| Number::of(ty, bits).against(level).filter(|_| valid);
        let now = order(bits, valid);
        let before = self.prior.and_then(|(bits, valid)| order(bits, valid));
        let high = |order: Option<Ordering>| order.is_some_and(Ordering::is_ge);
        let low = |order: Option<Ordering>| order.is_some_and(Ordering::is_lt);
        match mode {
            1 => high(now),
            2 => low(now),
            3 => low(before) && high(now),
            4 => high(before) && low(now),
            5 => now == Some(Ordering::Equal),
            6 => self.prior.is_some_and(|(old, was_valid)| {
                let same = old == bits || Number::of(ty, old) == Number::of(ty, bits);
                was_valid && valid && !same
            }),
            _ => false,
        }
    }

    fn decide(&mut self, walk: &Walk) {
        if !self.records() {
            return;
        }
        let tested = (self.trigger >> 4 & 7) as usize;
        let (bits, valid) = walk.words.get(tested).copied().unwrap_or_default();
        let compared = self.compares(bits, valid) && self.samples >= self.length & 0xffff;
        let period = self.periods + u32::from(walk.stop);
        let events = self.events | u32::from(walk.stop && self.trigger >> 16 & 1 == 1);
        if walk.kept {
            for (channel, (_, valid)) in self.watched.iter_mut().zip(&walk.words) {
                channel.have += u32::from(*valid);
            }
            self.last_period = period;
            self.stop_sample = walk.stop;
        }
        if self.state == 1 && (compared || self.forced || events != 0) {
            self.causes = events | u32::from(self.forced) << 4 | u32::from(compared) << 5;
            self.trigger_period = period;
            self.state = 2;
            self.wants = true;
        } else if self.state == 2 && !self.wants && walk.kept {
            self.remaining -= 1;
            if self.remaining == 0 {
                self.state = 3;
            }
        }
        if self.wants && walk.kept {
            self.trigger_place = self.place;
            self.remaining = self.length >> 16;
            self.wants = false;
            if self.remaining == 0 {
                self.state = 3;
            }
        }
        if walk.kept {
            self.place = (self.place + 1) % self.depth;
            self.samples += 1;
        }
        if walk.stop {
            self.state = 3;
        } else {
            self.until = if self.until == 0 { self.every.saturating_sub(1) } else { self.until - 1 };
        }
        self.prior = Some((bits, valid));
    }

    fn forget(&mut self) {
        self.samples = 0;
        self.until = 0;
        self.prior = None;
        self.watched.iter_mut().for_each(|channel| channel.have = 0);
    }

    fn edge(&mut self, rst: bool, pins: &Pins) {
        let was_state = self.state;
        let write = |at: u32| pins.host.filter(|(address, _)| *address == at).map(|(_, value)| value);
        let acts = write(1).unwrap_or(0);
        let arms = acts & 1 != 0;
        // Registers as they were before this cycle.
        let shows = self.state == 2
            || self.state == 1 && (self.trigger >> 16 & 1 == 1 || self.events != 0 || self.forced);
        let is_busy = self.walk.is_some();

        // The walk that is under way.
        if let Some(walk) = self.walk.take() {
            let age = self.now - walk.began;
            if let Some(number) = age.checked_sub(2).map(|n| n as usize).filter(|n| *n < self.channels)
                && walk.kept
            {
                self.ring[self.place * self.channels + number] = walk.words[number].0;
            }
            match age == self.channels as u64 + 4 {
                true if !arms && !pins.core_rst => self.decide(&walk),
                true => {}
                false => self.walk = Some(walk),
            }
        }

        // Samples.
        let is_input = |channel: &Watched| (channel.select & 0x3ff) >> 6 == INPUTS >> 6;
        let mut taken: Option<(bool, bool)> = None;
        if let Some(at) = self.ended {
            match self.now - at {
                1 => {
                    for channel in self.watched.iter_mut().filter(|channel| is_input(channel)) {
                        channel.taken = (channel.value, channel.valid);
                    }
                }
                age if !is_busy && (age > SETTLE || !pins.waiting) => {
                    taken = Some((false, was_state == 1 || was_state == 2));
                    self.ended = None;
                }
                _ => {}
            }
        } else if let Some(at) = self.stopped
            && !is_busy
            && self.now - at > SETTLE
        {
            self.stopped = None;
            taken = shows.then_some((true, true));
            if !shows {
                self.watched.iter_mut().for_each(|channel| channel.taken = (channel.value, channel.valid));
            }
        }
        if let Some((stop, records)) = taken {
            for channel in self.watched.iter_mut().filter(|channel| stop || !is_input(channel)) {
                channel.taken = (channel.value, channel.valid);
            }
            let words = self.watched.iter().map(|channel| channel.taken).collect();
            // A decision in this cycle cannot be: the walk before has ended.
            self.walk =
                Some(Walk { began: self.now, words, kept: records && (stop || self.until == 0), stop });
        }

        // What the core writes reaches a channel a cycle later.
        for (number, channel) in self.watched.iter_mut().enumerate() {
            let select = channel.select;
            let wanted = |bundle: Option<u32>| select >> 30 & 1 == 0 || bundle == Some(select >> 16 & 0x3fff);
            let counts = |(register, bundle, _): &&(u32, Option<u32>, u32)| {
                *register == select & 0x3ff && (*register >= INPUTS || wanted(*bundle))
            };
            let base = 32 + 4 * number as u32;
            if let Some((.., value)) = self.late.iter().find(counts) {
                (channel.value, channel.valid) = (*value, true);
            } else if let Some(value) = write(base + 1).filter(|_| !channel.valid) {
                (channel.value, channel.valid) = (value, true);
            }
            if let Some(value) = write(base) {
                (channel.select, channel.valid) = (value, false);
            }
            channel.valid &= !pins.restart && !rst;
        }
        self.late = pins
            .writes
            .iter()
            .flatten()
            .map(|(register, bundle, value)| (*register, Some(*bundle), *value))
            .collect();
        self.late.extend(pins.load.map(|(register, value)| (register, None, value)));
        self.late.extend(pins.input.map(|(index, value)| (INPUTS + index, None, value)));

        // Events.
        let (was_stopped, was_tripped, drove) = self.was;
        self.was = (pins.stopped, pins.tripped, pins.drive);
        if was_state == 1 {
            let happened = [false, pins.missed, pins.tripped && !was_tripped, drove && !pins.drive];
            let bits = happened.iter().enumerate().map(|(bit, is)| u32::from(*is) << bit).sum::<u32>();
            self.events |= bits & self.trigger >> 16 & 0xf;
        }
        if pins.ended && self.begun {
            self.periods += 1;
            self.ended = Some(self.now);
        }
        if pins.stopped && !was_stopped {
            self.stopped = Some(self.now);
        }
        self.begun |= pins.core_tick;

        // The host.
        for (at, register) in
            [(2, &mut self.every), (3, &mut self.length), (4, &mut self.trigger), (5, &mut self.level)]
        {
            if let Some(value) = write(at) {
                *register = if at == 2 { value & 0xfff } else { value };
            }
        }
        if acts & 2 != 0 {
            self.forced = true;
        }
        if acts & 4 != 0 && (was_state == 1 || was_state == 2) {
            self.state = 3;
        }
        if pins.core_rst {
            (self.begun, self.ended, self.stopped, self.periods) = (false, None, None, 0);
            self.was.0 = false;
            self.walk = None;
            match was_state {
                1 => self.forget(),
                2 => self.state = 3,
                _ => {}
            }
        }
        if arms {
            self.walk = None;
            self.forget();
            (self.state, self.causes, self.events, self.forced) = (1, 0, 0, acts & 2 != 0);
            (self.wants, self.stop_sample) = (false, false);
        }
        if rst {
            self.walk = None;
            self.forget();
            (self.begun, self.ended, self.stopped, self.periods) = (false, None, None, 0);
            self.was.0 = false;
            (self.every, self.place, self.state, self.causes, self.events) = (1, 0, 0, 0, 0);
            (self.forced, self.wants, self.stop_sample) = (false, false, false);
            self.trigger &= !0x000f_0007;
        }
        self.now += 1;
    }
}

impl Model for Scope {
    fn outputs(&self) -> Vec<u32> {
        vec![self.shown[0], self.shown[2]]
    }

    fn clock(&mut self, inputs: &[u32]) {
        let pins = Pins::read(&inputs[1..]);
        let address = pins.host.map_or(pins.address, |(address, _)| address);
        let read = self.register(address);
        let fetched = self.ring[pins.at as usize % self.ring.len()];
        self.shown = [read, fetched, self.shown[1]];
        self.edge(inputs[0] != 0, &pins);
    }
}

// ---- stimuli

/// A core that runs periods, stops and starts again, and a host that arms and reads.
struct Stimulus {
    random: Pcg64,
    channels: u32,
    depth: u32,
    /// Cycles of the core's phase that are left, and the phase: in reset, waits, has its tick, runs, has stopped.
    left: u32,
    phase: u32,
    tripped: bool,
    drive: bool,
    /// What the host does next, in cycles.
    host: Vec<(u32, u32)>,
    pause: u32,
}

/// Values at which comparisons differ, and some between.
const VALUES: [u32; 14] = [
    0,
    0x8000_0000,
    1,
    0x8000_0001,
    0x3f80_0000,
    0xbf80_0000,
    0x7f80_0000,
    0xff80_0000,
    0x7fc0_0000,
    0xffc0_0001,
    7,
    0xffff_fff9,
    0x7fff_ffff,
    0xffff_ffff,
];

impl Stimulus {
    fn bits(&mut self) -> u32 {
        self.random.next_u32()
    }

    fn one_in(&mut self, n: u32) -> bool {
        self.bits().is_multiple_of(n)
    }

    fn value(&mut self) -> u32 {
        match self.one_in(4) {
            true => self.bits(),
            false => VALUES[self.bits() as usize % VALUES.len()],
        }
    }

    /// Cycles of a period that leave time for the sample of the one before.
    fn shortest(&self) -> u32 {
        self.channels + 6
    }

    /// Registers and settings, and the command that arms.
    fn plan(&mut self) {
        let random = |stimulus: &mut Stimulus, below: u32| stimulus.bits() % below;
        self.host.push((1, 4));
        for channel in 0..self.channels {
            let register = match random(self, 3) {
                2 => INPUTS + random(self, USED),
                bank => BANKS[bank as usize] + random(self, USED),
            };
            let is_input = register >= INPUTS;
            let restricted = u32::from(!is_input && random(self, 3) == 0) << 30 | random(self, BUNDLES) << 16;
            self.host.push((32 + 4 * channel, restricted | register));
            if random(self, 2) == 0 {
                let value = self.value();
                self.host.push((33 + 4 * channel, value));
            }
        }
        let depth = 1 << self.depth;
        let before = random(self, depth);
        let after = random(self, depth);
        let ty = random(self, 3);
        let mode = random(self, 7);
        let mask = if random(self, 2) == 0 { 0 } else { random(self, 16) };
        // A host sends no key of a NaN, and that of +0 for both zeros.
        let is_key = |key: u32| ty != 0 || (0x007f_ffff..=0xff80_0000).contains(&key) && key != 0x7fff_ffff;
        let level = std::iter::repeat_with(|| self.value()).find(|key| is_key(*key)).unwrap_or(0);
        let every = if random(self, 2) == 0 { 1 } else { random(self, 4) };
        self.host.extend([(2, every), (3, after << 16 | before)]);
        let tested = random(self, self.channels);
        self.host.extend([(4, mask << 16 | ty << 8 | tested << 4 | mode), (5, level)]);
        let now = u32::from(random(self, 6) == 0) << 1;
        self.host.push((1, 1 | now));
        self.host.reverse();
    }

    fn next(&mut self, cycle: u32) -> Vec<u32> {
        let mut pins = Pins {
            address: self.bits() % 64,
            at: self.bits() % (self.channels << self.depth),
            ..Pins::default()
        };
        if cycle < RESET {
            // Every register that no reset clears has a known value.
            let all: Vec<u32> = (1..6)
                .chain((0..self.channels).flat_map(|channel| [32 + 4 * channel, 33 + 4 * channel]))
                .collect();
            let at = all[cycle as usize % all.len()];
            pins.host = Some((at, u32::from(at == 1)));
            pins.core_rst = true;
            return pins.words();
        }
        // The core.
        if self.left == 0 {
            let choice = self.bits() % 100;
            (self.phase, self.left) = match self.phase {
                0 => (3, self.shortest() + self.bits() % 8),
                1 => (2, 1),
                2 => (3, self.shortest() + self.bits() % 30),
                3 if choice < 4 => (4, self.bits() % 60),
                3 => {
                    pins.ended = true;
                    (1, if choice < 20 { self.bits() % 4 } else { self.bits() % 40 })
                }
                _ => (0, 3 + self.bits() % 8),
            };
            if self.bits().is_multiple_of(200) {
                (self.phase, self.left) = (0, 4);
            }
            pins.core_tick = self.phase == 2;
        } else {
            self.left -= 1;
        }
        pins.core_rst = self.phase == 0;
        pins.restart = self.phase == 0 && self.one_in(6);
        // After its tick the core still waits for a cycle.
        pins.waiting = matches!(self.phase, 1 | 2);
        pins.stopped = self.phase == 4;
        pins.missed = self.phase == 3 && self.one_in(60);
        self.tripped ^= self.one_in(if self.tripped { 20 } else { 300 });
        self.drive ^= self.one_in(if self.drive { 400 } else { 20 });
        (pins.tripped, pins.drive) = (self.tripped, self.drive);
        if self.phase == 0 {
            if self.one_in(2) {
                let register = BANKS[self.bits() as usize % 2] + self.bits() % USED;
                pins.load = Some((register, self.value()));
            }
        } else {
            for (slot, bank) in BANKS.into_iter().enumerate() {
                if self.one_in(if self.phase == 3 { 3 } else { 30 }) {
                    let (register, bundle) = (bank + self.bits() % USED, self.bits() % BUNDLES);
                    pins.writes[slot] = Some((register, bundle, self.value()));
                }
            }
        }
        if pins.load.is_none() && self.one_in(8) {
            pins.input = Some((self.bits() % USED, self.value()));
        }
        // The host.
        if self.host.is_empty() {
            self.plan();
            self.pause = 100 + self.bits() % 1500;
        }
        if self.pause > 0 {
            self.pause -= 1;
            if self.one_in(900) {
                pins.host = Some((1, 2));
            }
        } else if self.one_in(2) {
            pins.host = self.host.pop();
        }
        pins.words()
    }
}

fn parts() -> Vec<Part> {
    let settings = [(1, 3), (2, 5), (4, 3), (8, 4)];
    let of = |(number, (channels, depth)): (usize, (u32, u32))| {
        let mut stimulus = Stimulus {
            random: Pcg64::seed_from_u64(700 + number as u64),
            channels,
            depth,
            left: 5,
            phase: 0,
            tripped: false,
            drive: false,
            host: Vec::new(),
            pause: 0,
        };
        Part {
            name: format!("scope{channels}"),
            module: bench(channels, depth).0,
            parameters: Vec::new(),
            takes: TAKES.map(|(name, width)| (name.to_owned(), width)).to_vec(),
            drives: vec![("read".to_owned(), 32), ("sample".to_owned(), 32)],
            model: Box::new(Scope::new(channels, depth)),
            stimulus: Box::new(move |cycle| stimulus.next(cycle)),
        }
    };
    settings.into_iter().enumerate().map(of).collect()
}

fn files(change: impl Fn(&str) -> String) -> Vec<(&'static str, String)> {
    let text = VERILOG.iter().find(|(name, _)| *name == "takt_scope.v").expect("the scope").1;
    let benches: String = [(1, 3), (2, 5), (4, 3), (8, 4)].iter().map(|&(c, d)| bench(c, d).1).collect();
    vec![("takt_scope.v", change(text)), ("benches.v", benches)]
}

#[test]
fn the_circuit_is_its_model() {
    let found: Vec<String> =
        compare("scope", &files(str::to_owned), &mut parts(), CYCLES).into_iter().flatten().collect();
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// Faults: text that occurs once in the circuit, and its replacement.
const FAULTS: [(&str, &str); 14] = [
    ("(~restricts | wrote_address", "(wrote_address"),
    ("& ~(loaded & restricts)) begin", ") begin"),
    ("2'd1 & ~valid) begin", "2'd1) begin"),
    ("is_input & ~stops ? samples_inputs : samples", "samples"),
    ("(rest == REST | ~waiting)", "(rest == REST)"),
    ("ordered <= tested_holds & ~nan;", "ordered <= tested_holds;"),
    ("tested[30:0] == 31'd0 ? 32'd0 : tested", "tested[30:0] == 31'd1 ? 32'd0 : tested"),
    ("met & count >= leading", "met & count > leading"),
    ("tripped & ~was_tripped", "tripped"),
    ("if (core_rst & state == AFTER)", "if (core_rst & state == DONE)"),
    ("have <= held_valid & ~&have", "have <= ~&have"),
    ("ordered & above & prior_ordered & ~prior_above", "ordered & above & ~prior_above"),
    ("records & (stops | phase == 12'd0)", "records & (phase == 12'd0)"),
    ("if (restart) valid <= 1'b0;", ""),
];

#[test]
fn planted_faults_are_found() {
    for (number, (what, by)) in FAULTS.into_iter().enumerate() {
        let change = |text: &str| {
            assert_eq!(text.matches(what).count(), 1, "{what}");
            text.replace(what, by)
        };
        let found = compare(&format!("scope-fault{number}"), &files(change), &mut parts(), CYCLES / 2);
        assert!(found.iter().any(Option::is_some), "the fault in `{what}` was not found");
    }
}

// ---- the complete top level

/// Program whose registers change in every period; a name has several values, and the longest operation ends after the `wait`. With `bad`
/// not 0, it loads from beyond the memory; with `work`, a period takes too long.
const PROGRAM: &str = "
.input n:int, x, bad:int, work:int
.output y, k:int
.state sum, count:int, e
.reg a, s:int
.data
table:  .float 1.0, 2.0
.once
        sum = 0
        count = 0
        e = 0
        mov     y, zero
        k = 0
        wait    period
.period
period: iadd    count, count, n
        fadd    sum, sum, x
        fmul    a, sum, 2.0
        fadd    a, a, 1.0
        fadd    y, a, sum
        mov     k, count
        ld      a, table[bad]
        bz      work, ready
        .for i, 1, 900
        iadd    s, s, 1
        .endfor
ready:  fdiv    e, sum, a
        wait    period
";

/// Line of the doubling.
const DOUBLE: usize = 18;

fn application() -> Program {
    let loader = MemoryLoader::new(&[("p.s", PROGRAM)]);
    let options = Options { machine: &T3, ..Options::default() };
    assemble("p.s", &loader, &options).unwrap_or_else(|errors| panic!("{}", errors.render(false))).program
}

const DEPTH: u32 = 64;

fn started(program: &Program) -> Host<Simulation> {
    let board = Board::from_name("ulx3s-85f").expect("a board").expect("a right one");
    let text = format!(
        "clock = 50\nperiod = 16\nbaud = 10_000_000\ndeadlines = 9\n[scope]\nchannels = 8\ndepth = {DEPTH}\n"
    );
    let wiring = Wiring::read("w.toml", &text, &board).unwrap_or_else(|mistakes| panic!("{mistakes:?}"));
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("scope-top");
    let sim = Simulation::new(&board, &wiring, program, &folder).unwrap_or_else(|error| panic!("{error}"));
    Host::connect(sim, 3).unwrap_or_else(|error| panic!("{error}"))
}

/// Restarts the program, held before its first period, with these inputs.
fn held(host: &mut Host<Simulation>, program: &Program, inputs: &[(&str, u32)]) {
    host.set("control", RUN | HOLD | ENABLE | RESTART).expect("control");
    host.settle().expect("it waits");
    for (name, bits) in inputs {
        let (at, _) = Application::from(program).settable(name).expect("an input port");
        host.write(at, &[*bits]).expect("a port");
    }
}

fn wait(host: &mut Host<Simulation>) {
    for _ in 0..2000 {
        if host.scope_state().expect("a board") == ScopeState::Done {
            return;
        }
        host.line.run(2000, &[]).expect("it runs");
    }
    panic!("the scope is not done: {:?}", host.register("scope_state"));
}

fn setup(program: &Program, names: &[&str], triggers: &[&str]) -> Setup {
    let owned = |all: &[&str]| all.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
    Setup::new(&Application::from(program), &owned(names), &owned(triggers)).expect("a setup")
}

fn record(host: &mut Host<Simulation>, program: &Program, setup: &Setup) -> Recording {
    let scope = host.scope().expect("a scope");
    host.arm(&Application::from(program), &scope, setup).expect("it is armed");
    host.set("control", RUN | ENABLE).expect("control");
    wait(host);
    host.recording(&scope, setup, |_, _| ControlFlow::Continue(())).expect("a recording")
}

/// Values of registers after each period, the first at 1; of `a`, what the line [`DOUBLE`] writes.
fn emulated(program: &Program, inputs: &[(&str, u32)], periods: usize) -> Vec<BTreeMap<&'static str, u32>> {
    let mut emulator = Emulator::new(program).expect("it can be emulated");
    emulator.run_to_wait().expect("no fault");
    let register =
        |name: &str| program.named_registers().find(|port| port.name == name).expect("a register").register;
    let mut all = vec![BTreeMap::new()];
    for _ in 0..periods {
        for (name, bits) in inputs.iter().chain(&[("bad", 0), ("work", 0)]) {
            emulator.set_input_bits(register(name), *bits).expect("a port");
        }
        emulator.run_period(&[]).expect("no fault");
        let mut values: BTreeMap<&str, u32> = ["n", "x", "y", "k", "sum", "count", "a", "e"]
            .iter()
            .filter_map(|name| Some((*name, emulator.register(register(name))?)))
            .collect();
        let sum = f32::from_bits(values["sum"]);
        values.insert("a:18", (sum * 2.0).to_bits());
        all.push(values);
    }
    all
}

const STEPS: [(&str, u32); 2] = [("n", 3), ("x", 0x3fa0_0000)];

/// Triggers, periods between two samples, samples, samples before the trigger, period in which it comes.
type Case = (&'static [&'static str], u32, Option<u32>, Option<u32>, Option<u32>);

/// Recordings of a running program have the emulator's values, in the periods that triggers and settings ask for.
#[test]
fn recordings_are_what_the_emulator_computes() {
    assert!(PROGRAM.lines().nth(DOUBLE - 1).is_some_and(|line| line.contains("fmul")), "the line moved");
    let program = application();
    let mut host = started(&program);
    let scope = host.scope().expect("a scope");
    assert_eq!((scope.channels, scope.depth, scope.core, scope.has_bundles), (8, DEPTH, 0, true));
    let expected = emulated(&program, &STEPS, 600);
    let names = ["n", "x", "y", "k", "sum", "count", "a:18", "e"];
    // With a trigger: the period, counted from the start at which the scope is armed.
    let sum = |at: f32| (1..).find(|period| 1.25 * *period as f32 >= at).expect("it comes");
    let cases: [Case; 9] = [
        (&[], 1, None, None, Some(1)),
        (&["sum >= 100"], 1, None, Some(20), Some(sum(100.0))),
        // The comparison holds at once: it waits for the samples before.
        (&["sum < 1000"], 1, Some(40), Some(30), Some(31)),
        (&["sum rises 50"], 1, Some(64), Some(63), None),
        (&["sum rises 90"], 1, Some(64), Some(63), Some(sum(90.0))),
        (&["count == 300"], 3, Some(50), Some(10), Some(100)),
        (&["count > 300"], 2, Some(50), Some(10), Some(101)),
        (&["k changes"], 1, Some(5), Some(1), Some(2)),
        (&["a:18 >= 250", "miss"], 5, Some(20), Some(3), Some(sum(125.0))),
    ];
    for (triggers, every, samples, before, period) in cases {
        held(&mut host, &program, &STEPS);
        let mut setup = setup(&program, &names, triggers);
        (setup.every, setup.samples, setup.before) = (every, samples, before);
        let Some(period) = period else {
            // Too early: there are not as many samples before. Nothing else rises.
            host.arm(&Application::from(&program), &scope, &setup).expect("it is armed");
            host.set("control", RUN | ENABLE).expect("control");
            host.line.run(200 * 800, &[]).expect("it runs");
            assert_eq!(host.scope_state().expect("a board"), ScopeState::Armed, "{triggers:?}");
            continue;
        };
        let recording = record(&mut host, &program, &setup);
        let (index, triggered) = recording.trigger.expect("it was triggered");
        let context = format!("{triggers:?}: {:?}", recording.periods);
        assert_eq!(triggered, period, "{context}");
        let sample = recording.periods[index];
        assert!((period..period + every).contains(&sample), "{context}");
        assert!(recording.periods.windows(2).all(|pair| pair[1] == pair[0] + every), "{context}");
        let wanted = samples.unwrap_or(DEPTH) as usize;
        let there = before.unwrap_or(0).min((sample - 1) / every) as usize;
        assert_eq!(index, there, "{context}");
        assert_eq!(recording.periods.len(), wanted - before.unwrap_or(0) as usize + there, "{context}");
        assert!(!recording.is_stopped);
        for ((name, _), values) in recording.channels.iter().zip(&recording.values) {
            for (period, value) in recording.periods.iter().zip(values) {
                let expected = expected[*period as usize].get(name.as_str()).copied();
                assert_eq!(*value, expected, "{name} in period {period}: {context}");
            }
        }
    }
}

/// What leads to a fault, to a missed deadline and to safe outputs; recordings that the host ends; what a scope refuses.
#[test]
fn events_trigger_and_mistakes_are_refused() {
    let program = application();
    let mut host = started(&program);
    let application = Application::from(&program);
    let set = |host: &mut Host<Simulation>, name: &str, bits: u32| {
        let (at, _) = application.settable(name).expect("an input port");
        host.write(at, &[bits]).expect("a port");
    };
    let last = |recording: &Recording, channel: usize| recording.values[channel].last().copied().flatten();
    let scope = host.scope().expect("a scope");

    // A fault in mid-period: the last sample is of that period, up to the fault.
    held(&mut host, &program, &STEPS);
    let mut before = setup(&program, &["count", "sum", "e"], &["fault"]);
    before.before = Some(10);
    host.arm(&application, &scope, &before).expect("it is armed");
    host.set("control", RUN | ENABLE).expect("control");
    host.line.run(30 * 800, &[]).expect("it runs");
    set(&mut host, "bad", 1 << 20);
    wait(&mut host);
    assert!(host.status().expect("a board").fault());
    let recording = host.recording(&scope, &before, |_, _| ControlFlow::Continue(())).expect("a recording");
    let periods = host.register("periods").expect("a board");
    assert!(recording.is_stopped && recording.causes == ["the program stopped"], "{recording:?}");
    assert_eq!(recording.periods, (periods - 9..=periods + 1).collect::<Vec<_>>());
    assert_eq!(recording.trigger, Some((10, periods + 1)));
    assert_eq!(last(&recording, 0), Some(3 * (periods + 1)), "the fault's period has counted");
    let sum = |period: u32| 1.25 * period as f32;
    assert_eq!(last(&recording, 1), Some(sum(periods + 1).to_bits()));
    assert_eq!(recording.values[2][10], recording.values[2][9], "but has not divided");

    // A missed deadline; the recording goes on.
    held(&mut host, &program, &STEPS);
    let mut missed = setup(&program, &["count", "work"], &["miss", "count falls -5"]);
    (missed.samples, missed.before) = (Some(12), Some(4));
    host.arm(&application, &scope, &missed).expect("it is armed");
    host.set("control", RUN | ENABLE).expect("control");
    host.line.run(20 * 800, &[]).expect("it runs");
    assert_eq!(host.scope_state().expect("a board"), ScopeState::Armed);
    set(&mut host, "work", 1);
    wait(&mut host);
    let recording = host.recording(&scope, &missed, |_, _| ControlFlow::Continue(())).expect("a recording");
    assert_eq!(recording.causes, ["a missed deadline"]);
    assert_eq!(recording.values[1], [[Some(0); 4].as_slice(), &[Some(1); 8]].concat(), "{recording:?}");
    assert_eq!(recording.periods.len(), 12);

    // Outputs become safe.
    held(&mut host, &program, &STEPS);
    let mut safe = setup(&program, &["count"], &["safe"]);
    (safe.samples, safe.before) = (Some(8), Some(6));
    host.arm(&application, &scope, &safe).expect("it is armed");
    host.set("control", RUN | ENABLE).expect("control");
    host.line.run(20 * 800, &[]).expect("it runs");
    host.set("control", RUN).expect("control");
    wait(&mut host);
    let recording = host.recording(&scope, &safe, |_, _| ControlFlow::Continue(())).expect("a recording");
    assert_eq!(recording.causes, ["the outputs became safe"]);

    // A recording of the start, for which the scope is armed while the program is stopped.
    host.set("control", 0).expect("control");
    let mut start = setup(&program, &["count", "n"], &[]);
    start.samples = Some(5);
    host.arm(&application, &scope, &start).expect("it is armed");
    host.set("control", RUN | ENABLE | RESTART).expect("control");
    wait(&mut host);
    let recording = host.recording(&scope, &start, |_, _| ControlFlow::Continue(())).expect("a recording");
    assert_eq!(recording.periods, [1, 2, 3, 4, 5]);
    assert_eq!(recording.values, [[Some(0); 5]; 2], "the host has not set `n`");
    assert_eq!(recording.causes, ["the host"]);

    // A channel is without value until its bundle writes one; the host ends a recording.
    let never = setup(&program, &["y:12", "count"], &["count < -5"]);
    host.arm(&application, &scope, &never).expect("it is armed");
    host.line.run(20 * 800, &[]).expect("it runs");
    host.end_scope().expect("a board");
    let recording = host.recording(&scope, &never, |_, _| ControlFlow::Continue(())).expect("a recording");
    assert_eq!((recording.trigger, recording.causes.len()), (None, 0));
    assert!(
        recording.periods.len() >= 15 && recording.values[1].iter().all(Option::is_some),
        "{recording:?}"
    );
    assert!(
        recording.values[0].iter().all(Option::is_none),
        "what runs once does not run again: {recording:?}"
    );

    // The board refuses writes to what only reads.
    refuses(&mut host, 64, &[1]);
    refuses(&mut host, 70, &[1]);
    let other = setup(&program, &["sum", "count"], &[]);
    let error =
        host.recording(&scope, &other, |_, _| ControlFlow::Continue(())).expect_err("another channel");
    assert!(error.to_string().contains("another register in the place of `sum`"), "{error}");
    let mut deep = other.clone();
    deep.samples = Some(DEPTH + 1);
    let error = host.arm(&application, &scope, &deep).expect_err("too many samples");
    assert!(error.to_string().contains("65 samples are asked for; the board's scope has 64"), "{error}");
    deep.samples = Some(10);
    deep.before = Some(10);
    let error = host.arm(&application, &scope, &deep).expect_err("no sample for the trigger");
    assert!(error.to_string().contains("10 samples before the trigger leave none for it"), "{error}");
}

/// Names and triggers that are refused before a port is opened.
#[test]
fn mistakes_in_names_and_triggers() {
    let program = application();
    let application = Application::from(&program);
    let refused = |names: &[&str], triggers: &[&str]| {
        let owned = |all: &[&str]| all.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
        Setup::new(&application, &owned(names), &owned(triggers)).expect_err("a mistake")
    };
    let one = ["count"];
    for (names, triggers, says) in [
        (&["cuont"][..], &[][..], "the program has no port, register or data word `cuont`"),
        (&["table"], &[], "`table` lies in data memory"),
        (&["count:x"], &[], "expected a line of the source after the colon"),
        (&["count:14"], &[], "no operation of line 14 writes a register"),
        (
            &["n", "x", "y", "k", "sum", "count", "a", "e", "s"],
            &[],
            "9 channels are asked for; a scope has 1 to 8",
        ),
        (&one, &["sum > 1"], "the trigger compares `sum`, which is not a channel"),
        (&one, &["count > 2.5"], "`2.5` is not a level for a channel of type int: expected a whole number"),
        (&one, &["count > 1", "count < 2"], "there is one comparison"),
        (&one, &["count > 2147483647"], "no value is above 2147483647"),
        (&one, &["count"], "`count` is not a trigger"),
        (&one, &["count changes 3"], "`3` follows `changes`"),
        (&["sum"], &["sum rises nan"], "`nan` is not a level for a channel of type float"),
        (&["sum"], &["sum rises fast"], "expected a number"),
    ] {
        let text = refused(names, triggers);
        assert!(text.contains(says), "{names:?} {triggers:?}: {text}");
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Test bench: the system with a host that sends packets, and a plant.

use std::collections::VecDeque;
use std::sync::OnceLock;
use takt_asm::{MemoryLoader, Options, Search, assemble};
use takt_isa::{Program, Register};
use takt_programs::three::dynamics::nominal;
use takt_programs::three::profile::Profile;
use takt_programs::three::servo::{COUNT, Point};
use takt_programs::three::{DA, DB, DC, SERVO_PERIOD, SixValues};
use takt_programs::{LIBRARY, THREE};
use takt_system::{Description, ProgramError, System};

pub(crate) const TICK: u64 = 12_500;
/// Cycles before a tick in which the host writes: more than any link needs.
const LEAD: u64 = 64;
/// Number of words that the host sends per tick.
const WORDS: usize = 4;

/// Numbers of reports and causes in `packets.s`.
pub(crate) const ACCEPTED: u32 = 1;
pub(crate) const STARTED: u32 = 2;
pub(crate) const FINISHED: u32 = 3;
pub(crate) const REFUSED: u32 = 4;
pub(crate) const STOPPED: u32 = 5;
pub(crate) const READY: u32 = 6;
pub(crate) const CHECKED: u32 = 7;

pub(crate) const MOVE: u32 = 1;
pub(crate) const MOVEL: u32 = 2;
pub(crate) const JOG: u32 = 3;
pub(crate) const STOP: u32 = 4;
pub(crate) const RESET: u32 = 7;

/// Joint angles in the middle of the work space, rad.
pub(crate) const HOME: [f64; 6] = [0.1, 1.0, 0.1, 0.2, -1.1, 0.3];

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Report {
    pub(crate) kind: u32,
    pub(crate) sequence: u32,
    pub(crate) cause: u32,
    pub(crate) value: f32,
}

/// CRC-32 of words, bit by bit, unlike the core's algorithm.
pub(crate) fn checksum(words: &[u32]) -> u32 {
    let mut crc = u32::MAX;
    for byte in words.iter().flat_map(|word| word.to_le_bytes()) {
        crc ^= u32::from(byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 };
        }
    }
    !crc
}

pub(crate) fn packet(kind: u32, sequence: u32, payload: &[u32]) -> Vec<u32> {
    let mut words = vec![0x54 << 24 | kind << 16 | payload.len() as u32, sequence];
    words.extend(payload);
    words.push(checksum(&words));
    words
}

pub(crate) fn bits(values: &[f64]) -> Vec<u32> {
    values.iter().map(|value| (*value as f32).to_bits()).collect()
}

/// Fields of a motion's packet besides its target.
#[derive(Clone, Copy)]
pub(crate) struct MotionFields {
    pub(crate) profile: Profile,
    /// Meaning of `amount`: 0 time, 1 speed, 2 fast.
    pub(crate) how: u32,
    pub(crate) amount: f64,
    /// Flags: 1 via, 2 check.
    pub(crate) flags: u32,
}

pub(crate) const fn fast(profile: Profile) -> MotionFields {
    MotionFields { profile, how: 2, amount: 0.0, flags: 0 }
}

pub(crate) fn description() -> &'static Description {
    static ONCE: OnceLock<Description> = OnceLock::new();
    ONCE.get_or_init(|| {
        let search = Search::new(MemoryLoader::new(THREE)).library(LIBRARY);
        let load = |request: &takt_system::Request<'_>| -> Result<Program, ProgramError<String>> {
            let machine = request.machine.unwrap_or(&takt_isa::T3);
            let assembled = assemble(request.path, &search, &Options { machine, ..Options::default() });
            let assembled = assembled.map_err(|mistakes| ProgramError::Invalid(mistakes.render(false)))?;
            assert!(assembled.warnings.is_empty(), "{}", assembled.warnings.render(false));
            Ok(assembled.program)
        };
        let text = THREE.iter().find(|(name, _)| *name == "controller.toml").expect("it is carried").1;
        takt_system::read("controller.toml", text, load).unwrap_or_else(|error| panic!("{error}"))
    })
}

/// Motors with the arm's nominal dynamics: Da·(H·q̈ + G) + Db·q̇ + Dc·q̈ = u.
struct Plant {
    q: SixValues,
    v: SixValues,
    blocked: bool,
}

impl Plant {
    fn counts(&self) -> [i32; 6] {
        self.q.map(|q| (q / COUNT).round() as i32)
    }

    fn step(&mut self, u: &SixValues) {
        if self.blocked {
            self.v = [0.0; 6];
            return;
        }
        const PARTS: usize = 4;
        let h = SERVO_PERIOD / PARTS as f64;
        for _ in 0..PARTS {
            let here = nominal(&self.q);
            let b: SixValues = std::array::from_fn(|i| u[i] - DB * self.v[i] - DA * here.weight[i]);
            let m = |i: usize, j: usize| DA * here.inertia[i][j] + if i == j { DC } else { 0.0 };
            let mut a: SixValues = std::array::from_fn(|i| b[i] / m(i, i));
            let det = m(1, 1) * m(2, 2) - m(1, 2) * m(2, 1);
            a[1] = (b[1] * m(2, 2) - b[2] * m(1, 2)) / det;
            a[2] = (b[2] * m(1, 1) - b[1] * m(2, 1)) / det;
            for ((q, v), a) in self.q.iter_mut().zip(&mut self.v).zip(a) {
                *v += a * h;
                *q += *v * h;
            }
        }
    }
}

/// Observations of a kinematic period.
#[derive(Clone, Debug)]
pub(crate) struct PeriodObservation {
    /// Points sent to the dynamic core.
    pub(crate) points: [Point; 6],
    pub(crate) pose: SixValues,
    pub(crate) mode: u32,
    pub(crate) segment: u32,
}

impl PeriodObservation {
    pub(crate) fn q(&self) -> SixValues {
        self.points.map(|point| point.q)
    }
    pub(crate) fn v(&self) -> SixValues {
        self.points.map(|point| point.v)
    }
    pub(crate) fn a(&self) -> SixValues {
        self.points.map(|point| point.a)
    }
}

/// Observations of a tick: controls, encoder counts, points received, reference.
pub(crate) type TickObservation = (SixValues, [i32; 6], Option<[Point; 6]>, SixValues);

/// Registers of frequently read output ports.
struct Ports {
    u: [Register; 6],
    r: [Register; 6],
    pose: [Register; 6],
    mode: Register,
    segment: Register,
    enable: Register,
}

pub(crate) struct Bench {
    system: System,
    plant: Plant,
    next: u64,
    words: VecDeque<u32>,
    pub(crate) sequence: u32,
    quiet: u64,
    /// The host sends signs of life.
    pub(crate) alive: bool,
    pub(crate) reports: Vec<Report>,
    pub(crate) seen: Vec<PeriodObservation>,
    /// Observations of every tick.
    pub(crate) servo: Vec<TickObservation>,
    links: [usize; 3],
    ports: Ports,
}

impl Bench {
    /// Bench with the robot at [`HOME`].
    pub(crate) fn new() -> Bench {
        Bench::at(HOME)
    }

    pub(crate) fn at(joints: SixValues) -> Bench {
        let description = description();
        let link = |name: &str| {
            description.links.iter().position(|link| link.name == name).expect("the system has this link")
        };
        let links = [link("commands"), link("reports"), link("points")];
        let mut system = System::new(description).expect("the programs fit their machines");
        let plant = Plant { q: joints, v: [0.0; 6], blocked: false };
        for (i, counts) in plant.counts().iter().enumerate() {
            system.set_input(&format!("n{}", i + 1), *counts as u32).expect("an input");
        }
        let find = |core: usize, name: &str| {
            let port = description.cores[core].program.outputs.iter().find(|port| port.name == name);
            port.unwrap_or_else(|| panic!("no port {name}")).register
        };
        let six = |core: usize, name: &str| std::array::from_fn(|i| find(core, &format!("{name}{}", i + 1)));
        let ports = Ports {
            u: six(0, "u"),
            r: six(0, "r"),
            pose: ["x", "y", "z", "roll", "pitch", "yaw"].map(|name| find(1, name)),
            mode: find(1, "mode"),
            segment: find(1, "segment"),
            enable: find(0, "enable"),
        };
        let start = system.run_to_start(200_000).expect("no fault").expect("it starts");
        let mut bench = Bench {
            system,
            plant,
            next: start,
            words: VecDeque::new(),
            sequence: 0,
            quiet: 0,
            alive: true,
            reports: Vec::new(),
            seen: Vec::new(),
            servo: Vec::new(),
            links,
            ports,
        };
        bench.run(40);
        assert_eq!(bench.reports[0].kind, READY);
        bench.reports.clear();
        bench
    }

    /// Blocks or frees the joints.
    pub(crate) fn block(&mut self, blocked: bool) {
        self.plant.blocked = blocked;
    }

    /// Sends raw words without a header.
    pub(crate) fn send_words(&mut self, words: &[u32]) {
        self.words.extend(words);
    }

    /// Sends the next packet; returns its sequence number.
    pub(crate) fn send(&mut self, kind: u32, payload: &[u32]) -> u32 {
        self.sequence += 1;
        self.send_words(&packet(kind, self.sequence, payload));
        self.sequence
    }

    pub(crate) fn motion(&mut self, kind: u32, target: SixValues, how: MotionFields) -> u32 {
        let mut payload = bits(&target);
        payload.extend([how.profile as u32, how.how, (how.amount as f32).to_bits(), how.flags]);
        self.send(kind, &payload)
    }

    pub(crate) fn jog(&mut self, mode: u32, rates: SixValues) -> u32 {
        let mut payload = vec![mode];
        payload.extend(bits(&rates));
        self.send(JOG, &payload)
    }

    /// Output of the system by name.
    pub(crate) fn output(&self, name: &str) -> u32 {
        self.system.output(name).expect("an output")
    }

    /// Sets an input of the system for the coming tick.
    pub(crate) fn input(&mut self, name: &str, bits: u32) {
        self.system.set_input(name, bits).expect("an input");
    }

    /// Number of entries refused by any FIFO so far.
    pub(crate) fn overflows(&self) -> u64 {
        let links = 0..self.system.description().links.len();
        links.filter_map(|link| self.system.fifo_counts(link)).map(|counts| counts.overflows).sum()
    }

    fn word(&self, core: usize, register: Register) -> u32 {
        self.system.core(core).register(register).unwrap_or(0)
    }

    fn six(&self, core: usize, registers: &[Register; 6]) -> SixValues {
        registers.map(|register| f64::from(f32::from_bits(self.word(core, register))))
    }

    /// Runs for a number of base ticks.
    pub(crate) fn run(&mut self, ticks: u64) {
        for _ in 0..ticks {
            self.step();
        }
    }

    /// Runs until a report of this kind about a packet, and returns it.
    pub(crate) fn until(&mut self, kind: u32, sequence: u32) -> Report {
        for _ in 0..200_000 {
            let known = |report: &&Report| report.kind == kind && report.sequence == sequence;
            if let Some(report) = self.reports.iter().find(known) {
                return *report;
            }
            self.step();
        }
        panic!("no report {kind} of {sequence}: {:?}", self.reports);
    }

    fn step(&mut self) {
        if self.alive && self.words.is_empty() {
            self.quiet += 1;
            if self.quiet > 1500 {
                self.send(0, &[]);
            }
        } else {
            self.quiet = 0;
        }
        self.system.run_until(self.next - LEAD).expect("no fault");
        let counts = self.plant.counts();
        for (i, counts) in counts.iter().enumerate() {
            self.system.set_input(&format!("n{}", i + 1), *counts as u32).expect("an input");
        }
        for _ in 0..WORDS.min(self.words.len()) {
            let word = self.words.pop_front().expect("one is there");
            self.system.set_input("commands.word", word).expect("an input");
            assert!(self.system.push(self.links[0]).expect("a link"), "the queue of words is full");
        }
        // The kinematic core's points wait in the FIFO for the dynamic core's tick.
        let entries = self.system.fifo_entries(self.links[2]);
        let points = (entries.len() == 6).then(|| {
            let field = |entry: &Vec<u32>, i: usize| f64::from(f32::from_bits(entry[i]));
            std::array::from_fn(|joint| {
                let e = &entries[joint];
                Point { q: field(e, 0), v: field(e, 1), a: field(e, 2), u: field(e, 3), inertia: field(e, 4) }
            })
        });
        if let Some(points) = points {
            let pose = self.six(1, &self.ports.pose);
            let (mode, segment) = (self.word(1, self.ports.mode), self.word(1, self.ports.segment));
            self.seen.push(PeriodObservation { points, pose, mode, segment });
        }
        self.system.run_until(self.next + 2000).expect("no fault");
        let (u, r) = (self.six(0, &self.ports.u), self.six(0, &self.ports.r));
        self.servo.push((u, counts, points, r));
        if self.word(0, self.ports.enable) == 1 {
            self.plant.step(&u);
        }
        while let Some(entry) = self.system.pop(self.links[1]).expect("a link") {
            let [kind, sequence, cause, value] = entry[..] else { panic!("four fields") };
            self.reports.push(Report { kind, sequence, cause, value: f32::from_bits(value) });
            let now = self.system.now();
            self.system.run_until(now + 8).expect("no fault");
        }
        self.next += TICK;
        for core in 0..3 {
            assert_eq!(self.system.periods(core).skipped, 0, "no core misses its tick");
        }
    }

    /// Observations from the first period of a segment to the end.
    pub(crate) fn since(&self, sequence: u32) -> &[PeriodObservation] {
        let first = self.seen.iter().position(|seen| seen.segment == sequence).expect("it ran");
        &self.seen[first..]
    }

    pub(crate) fn last(&self) -> &PeriodObservation {
        self.seen.last().expect("it has run")
    }

    /// Runs until the robot is in this mode.
    pub(crate) fn until_mode(&mut self, mode: u32) {
        for _ in 0..50_000 {
            if self.last().mode == mode {
                return;
            }
            self.step();
        }
        panic!("mode {mode} does not come: {:?} {:?}", self.last(), self.reports);
    }
}

/// Largest absolute difference of six values.
pub(crate) fn apart(a: &SixValues, b: &SixValues) -> f64 {
    (0..6).map(|i| (a[i] - b[i]).abs()).fold(0.0, f64::max)
}

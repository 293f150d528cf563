// SPDX-License-Identifier: MIT OR Apache-2.0
//! The host's side of the link: packets out, reports in, time. What is beyond is a [`Robot`]: the three cores with the
//! plant ([`crate::controller`]), or a stand-in of a test.

use crate::dynamics::{JOINTS, Joints};
use crate::packet::{Cause, Command, Kind, Report, ReportError, ReportKind};
use std::collections::{BTreeMap, VecDeque};

/// s from tick to tick.
pub const TICK: f64 = 1e-4;
/// Ticks without a packet after which the host says that it is there: half of what the cores bear.
const NOP_TICKS: u64 = 1000;
/// Ticks in which a packet must be answered: 2 s.
const ANSWER_TICKS: u64 = 20_000;
/// Ticks in which a packet that is begun lacks its end, if that is to be a fault: 200 ms.
const LATE_TICKS: u64 = 2_000;
/// Ticks of silence, if that is to be a fault: 1 s.
const SILENT_TICKS: u64 = 10_000;
/// Ticks in which the cores must be ready after power-up or reset: 2 s.
const READY_TICKS: u64 = 20_000;
/// Ticks in which the robot must say why it stands after an error: 2 s. Then nobody waits for it any more.
const UNTOLD_TICKS: u64 = 20_000;

/// The robot's state of motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// It stands.
    Standing,
    /// Along the queue's segments.
    Moving,
    /// At rates.
    Jogging,
    /// To a standstill.
    Stopping,
    /// It stands after an error.
    Error,
}

impl Mode {
    /// By its number on the link.
    pub fn of(number: u32) -> Option<Mode> {
        [Mode::Standing, Mode::Moving, Mode::Jogging, Mode::Stopping, Mode::Error]
            .get(number as usize)
            .copied()
    }

    /// In a word.
    pub const fn text(self) -> &'static str {
        match self {
            Mode::Standing => "standing",
            Mode::Moving => "moving",
            Mode::Jogging => "jogging",
            Mode::Stopping => "stopping",
            Mode::Error => "stopped by an error",
        }
    }
}

/// The robot as the host sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Reference joint angles, rad.
    pub joints: Joints,
    /// Reference pose: m, rad.
    pub pose: [f64; 6],
    /// Its state of motion.
    pub mode: Mode,
    /// Sequence number of the packet of the running segment.
    pub segment: u32,
    /// Segments that wait.
    pub queued: u32,
    /// Digital outputs.
    pub outputs: u32,
    /// Analogue outputs.
    pub levels: [f32; 2],
}

/// Digital and analogue inputs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Inputs {
    /// Input n is bit n − 1.
    pub digital: u32,
    /// Of channels 1 and 2.
    pub analogue: [f32; 2],
}

/// The other end of the link.
pub trait Robot {
    /// One tick.
    ///
    /// # Errors
    /// If the cores cannot go on, in words.
    fn tick(&mut self, inputs: &Inputs) -> Result<(), String>;
    /// Words that can be sent now.
    fn room(&self) -> usize;
    /// Sends one.
    fn send(&mut self, word: u32);
    /// The fields of the reports that have come.
    fn reports(&mut self) -> Vec<[u32; 4]>;
    /// The robot as it is seen there.
    fn view(&self) -> View;
}

/// Faults of the link that can be asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkFault {
    /// A bit of the next packet is wrong.
    Corrupt,
    /// The next packet is lost, so that the one after it is out of order.
    Order,
    /// The next packet stops in its middle.
    Late,
    /// The host says nothing for a while.
    Silent,
}

impl LinkFault {
    /// All of them.
    pub const ALL: [LinkFault; 4] =
        [LinkFault::Corrupt, LinkFault::Order, LinkFault::Late, LinkFault::Silent];

    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            LinkFault::Corrupt => "corrupt",
            LinkFault::Order => "order",
            LinkFault::Late => "late",
            LinkFault::Silent => "silent",
        }
    }
}

/// Something that happens at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// A digital input, by its number from 1.
    Input(u32, bool),
    /// An analogue input, by its channel from 1.
    Analogue(u32, f32),
    /// On the link.
    Fault(LinkFault),
}

/// An error of the host or of the robot.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Problem {
    /// The controller refused it.
    #[error("refused: {}", told(.0))]
    Refused(Report),
    /// The controller has stopped the robot.
    #[error("the robot was stopped: {}", told(.0))]
    Stopped(Report),
    /// A wait was longer than it may be.
    #[error("{0}")]
    Late(String),
    /// The cores or the host's end of the link.
    #[error("{0}")]
    Broken(String),
    /// Somebody has interrupted it.
    #[error("interrupted")]
    Interrupted,
}

impl Problem {
    /// Its cause's number; 0 without one.
    pub fn cause(&self) -> u32 {
        match self {
            Problem::Refused(report) | Problem::Stopped(report) => report.cause.map_or(0, Cause::number),
            _ => 0,
        }
    }

    /// True if a program can go on after it.
    pub fn can_be_caught(&self) -> bool {
        matches!(self, Problem::Refused(_) | Problem::Stopped(_) | Problem::Late(_))
    }
}

/// A report's cause in words.
fn told(report: &Report) -> String {
    let cause = report.cause.map_or_else(|| "no cause was told".to_owned(), |cause| cause.text().to_owned());
    match report.joint() {
        Some(joint) => format!("{cause} (joint {joint})"),
        None => cause,
    }
}

/// The answer to a packet.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fate {
    Sent,
    Accepted(f32),
    Checked(f32),
    Refused(Report),
    Finished,
}

/// The host's end.
#[derive(Clone)]
pub struct Host<R> {
    robot: R,
    ticks: u64,
    sequence: u32,
    out: VecDeque<u32>,
    /// Words after which the rest waits, and until which tick.
    hold: Option<(usize, u64)>,
    /// Until when the host says nothing.
    silent: u64,
    last_sent: u64,
    fates: BTreeMap<u32, Fate>,
    stopped: Option<Report>,
    /// The tick since which the robot stands after an error without a word of it.
    untold: Option<u64>,
    ready: bool,
    inputs: Inputs,
    events: Vec<(u64, Event)>,
    faults: Vec<LinkFault>,
    outputs: (u32, [f32; 2]),
    log: Vec<(f64, News)>,
}

/// An event that is worth telling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum News {
    /// A report of the communication core.
    Report(Report),
    /// A digital output, by its number from 1.
    Output(u32, bool),
    /// An analogue output, by its channel from 1.
    Level(u32, f32),
}

/// Packets whose fate is remembered: more than can be under way.
const FATES: usize = 1024;
/// Reports that are kept until they are taken.
const LOG: usize = 100_000;

impl<R: Robot> Host<R> {
    /// The host's end of the link to a robot that has just been powered up.
    pub fn new(robot: R) -> Host<R> {
        Host {
            robot,
            ticks: 0,
            sequence: 0,
            out: VecDeque::new(),
            hold: None,
            silent: 0,
            last_sent: 0,
            fates: BTreeMap::new(),
            stopped: None,
            untold: None,
            ready: false,
            inputs: Inputs::default(),
            events: Vec::new(),
            faults: Vec::new(),
            outputs: (0, [0.0; 2]),
            log: Vec::new(),
        }
    }

    /// The robot.
    pub fn robot(&self) -> &R {
        &self.robot
    }

    /// The robot as it is seen there.
    pub fn view(&self) -> View {
        self.robot.view()
    }

    /// s since power-up.
    pub fn time(&self) -> f64 {
        self.ticks as f64 * TICK
    }

    /// The levels at its inputs.
    pub fn inputs(&self) -> Inputs {
        self.inputs
    }

    /// The error after which it stands, if it does.
    pub fn stopped(&self) -> Option<Report> {
        self.stopped
    }

    /// The news since this was last asked, with their times.
    pub fn take_news(&mut self) -> Vec<(f64, News)> {
        std::mem::take(&mut self.log)
    }

    /// Something is to happen so many s from now.
    pub fn schedule(&mut self, after: f64, event: Event) {
        let tick = self.ticks + (after.max(0.0) / TICK).round() as u64;
        self.events.push((tick, event));
        if after <= 0.0 {
            self.happen();
        }
    }

    fn happen(&mut self) {
        let now = self.ticks;
        let events = std::mem::take(&mut self.events);
        for (tick, event) in events {
            match event {
                _ if tick > now => self.events.push((tick, event)),
                Event::Input(number, on) => {
                    let bit = 1u32.checked_shl(number.wrapping_sub(1)).unwrap_or(0);
                    self.inputs.digital =
                        if on { self.inputs.digital | bit } else { self.inputs.digital & !bit };
                }
                Event::Analogue(channel, value) => {
                    if let Some(known) = self.inputs.analogue.get_mut((channel as usize).wrapping_sub(1)) {
                        *known = value;
                    }
                }
                Event::Fault(LinkFault::Silent) => self.silent = now + SILENT_TICKS,
                Event::Fault(fault) => self.faults.push(fault),
            }
        }
    }

    /// One tick of 100 µs.
    ///
    /// # Errors
    /// If the cores cannot go on.
    pub fn tick(&mut self) -> Result<(), Problem> {
        self.happen();
        if self.ready && self.out.is_empty() && self.ticks >= self.last_sent + NOP_TICKS {
            // A line that is silent stays so; a stopped robot needs no sign of life.
            if self.ticks >= self.silent && self.stopped.is_none() {
                self.send(&Command::Nop);
            }
        }
        self.pump();
        self.robot.tick(&self.inputs).map_err(Problem::Broken)?;
        self.ticks += 1;
        for fields in self.robot.reports() {
            let report =
                Report::decode(fields).map_err(|error: ReportError| Problem::Broken(error.to_string()))?;
            self.hear(report);
        }
        let View { outputs, levels, mode, .. } = self.robot.view();
        self.untold = match (mode, self.stopped) {
            (Mode::Error, None) => self.untold.or(Some(self.ticks)),
            _ => None,
        };
        for bit in 0..u32::BITS {
            if (outputs ^ self.outputs.0) >> bit & 1 != 0 {
                self.tell(News::Output(bit + 1, outputs >> bit & 1 != 0));
            }
        }
        for (channel, (now, before)) in (1..).zip(levels.into_iter().zip(self.outputs.1)) {
            if now.to_bits() != before.to_bits() {
                self.tell(News::Level(channel, now));
            }
        }
        self.outputs = (outputs, levels);
        Ok(())
    }

    fn tell(&mut self, news: News) {
        if self.log.len() < LOG {
            self.log.push((self.time(), news));
        }
    }

    /// Lets words go as far as there is room.
    fn pump(&mut self) {
        if self.ticks < self.silent {
            return;
        }
        let mut room = self.robot.room();
        while room > 0 && !self.out.is_empty() {
            if let Some((left, until)) = &mut self.hold {
                if *left == 0 && self.ticks < *until {
                    return;
                }
                if *left == 0 {
                    self.hold = None;
                } else {
                    *left -= 1;
                }
            }
            if let Some(word) = self.out.pop_front() {
                self.robot.send(word);
                self.last_sent = self.ticks;
            }
            room -= 1;
        }
    }

    fn hear(&mut self, report: Report) {
        self.tell(News::Report(report));
        let fate = match report.kind {
            ReportKind::Accepted => Fate::Accepted(report.value),
            ReportKind::Checked => Fate::Checked(report.value),
            ReportKind::Refused => Fate::Refused(report),
            ReportKind::Finished => Fate::Finished,
            ReportKind::Started => return,
            ReportKind::Ready => {
                self.ready = true;
                self.stopped = None;
                self.fates.clear();
                return;
            }
            ReportKind::Stopped => {
                if report.cause.is_some() {
                    // The first cause is the one that counts.
                    self.stopped.get_or_insert(report);
                    return;
                }
                // It was asked for, and stands now. What waited in the queue before it was dropped, without a word of it.
                let stop = report.sequence;
                self.fates.retain(|sequence, _| *sequence >= stop);
                Fate::Finished
            }
        };
        if let Some(known) = self.fates.get_mut(&report.sequence) {
            *known = fate;
        }
    }

    /// Puts a packet on the line; its sequence number.
    fn send(&mut self, command: &Command) -> u32 {
        self.sequence = self.sequence.wrapping_add(1);
        let mut words = command.encode(self.sequence);
        let fault = if self.faults.is_empty() { None } else { Some(self.faults.remove(0)) };
        match fault {
            Some(LinkFault::Corrupt) => {
                // Its sequence number would do as well; the checksum covers every bit.
                let word = words.len() - 2;
                words[word] ^= 1 << 13;
            }
            Some(LinkFault::Order) => {
                self.sequence = self.sequence.wrapping_add(1);
                words = command.encode(self.sequence);
            }
            Some(LinkFault::Late) => {
                self.hold = Some((self.out.len() + words.len() / 2, self.ticks + LATE_TICKS))
            }
            Some(LinkFault::Silent) | None => {}
        }
        self.out.extend(words);
        if command.kind() != Kind::Nop {
            self.fates.insert(self.sequence, Fate::Sent);
            while self.fates.len() > FATES {
                self.fates.pop_first();
            }
        }
        self.sequence
    }

    /// Goes on until it holds.
    ///
    /// # Errors
    /// If the robot is stopped, or the time is over.
    pub fn wait_until(
        &mut self,
        ticks: u64,
        late: impl FnOnce() -> String,
        interrupted: &dyn Fn() -> bool,
        mut holds: impl FnMut(&mut Host<R>) -> Result<bool, Problem>,
    ) -> Result<(), Problem> {
        let end = self.ticks + ticks;
        loop {
            if let Some(report) = self.stopped {
                return Err(Problem::Stopped(report));
            }
            if holds(self)? {
                return Ok(());
            }
            if self.untold.is_some_and(|since| self.ticks - since > UNTOLD_TICKS) {
                let text = "the robot stands after an error of which no report has come; `reset` ends it";
                return Err(Problem::Late(text.to_owned()));
            }
            if self.ticks >= end {
                return Err(Problem::Late(late()));
            }
            if interrupted() {
                return Err(Problem::Interrupted);
            }
            self.tick()?;
        }
    }

    /// Waits for the cores to be ready after power-up.
    ///
    /// # Errors
    /// If they are not.
    pub fn power_up(&mut self) -> Result<(), Problem> {
        let late = || "the controller did not get ready".to_owned();
        self.wait_until(READY_TICKS, late, &|| false, |host| Ok(host.ready))
    }

    /// Sends a command and waits for its answer: a time in s, if the answer has one, and the packet's sequence number.
    ///
    /// # Errors
    /// If it is refused, or the robot is stopped.
    pub fn command(&mut self, command: &Command) -> Result<(u32, f64), Problem> {
        if *command == Command::Reset {
            return self.reset();
        }
        if let Some(report) = self.stopped {
            return Err(Problem::Stopped(report));
        }
        let sequence = self.send(command);
        let late = || format!("the controller did not answer: {}", command.kind());
        let mut value = 0.0;
        self.wait_until(ANSWER_TICKS, late, &|| false, |host| {
            Ok(match host.fates.get(&sequence) {
                Some(Fate::Accepted(time) | Fate::Checked(time)) => {
                    value = f64::from(*time);
                    true
                }
                Some(Fate::Refused(report)) => return Err(Problem::Refused(*report)),
                Some(Fate::Finished) => true,
                Some(Fate::Sent) | None => false,
            })
        })?;
        Ok((sequence, value))
    }

    /// Ends the state after an error: whatever is on its way is thrown away. Until the answer comes, the robot counts as stopped.
    fn reset(&mut self) -> Result<(u32, f64), Problem> {
        self.hold = None;
        self.silent = 0;
        // A packet that was begun would swallow the new one's words.
        while self.robot.room() > 0 && !self.out.is_empty() {
            self.pump();
        }
        self.out.clear();
        self.fates.clear();
        let was_ready = std::mem::replace(&mut self.ready, false);
        let sequence = self.send(&Command::Reset);
        // Reports that were on their way are of what is over: the answer clears them.
        let end = self.ticks + READY_TICKS;
        while !self.ready {
            if self.ticks >= end {
                self.ready = was_ready;
                return Err(Problem::Late(
                    "the controller did not answer the reset: try it again".to_owned(),
                ));
            }
            self.tick()?;
        }
        Ok((sequence, 0.0))
    }

    /// Sends a command that is answered only when the queue has come to it; its sequence number.
    ///
    /// # Errors
    /// If the robot is stopped.
    pub fn post(&mut self, command: &Command) -> Result<u32, Problem> {
        if let Some(report) = self.stopped {
            return Err(Problem::Stopped(report));
        }
        let sequence = self.send(command);
        let late = || format!("the link takes no words: {}", command.kind());
        self.wait_until(ANSWER_TICKS, late, &|| false, |host| Ok(host.out.is_empty()))?;
        Ok(sequence)
    }

    /// True if all that was asked for has come to its end.
    ///
    /// # Errors
    /// If it was refused after all.
    pub fn finished(&self, sequence: u32) -> Result<bool, Problem> {
        match self.fates.get(&sequence) {
            None | Some(Fate::Finished) => Ok(true),
            Some(Fate::Refused(report)) => Err(Problem::Refused(*report)),
            Some(_) => Ok(false),
        }
    }

    /// Packets that have not been answered. What is posted is answered when the queue has come to it.
    pub fn unanswered(&self) -> usize {
        self.fates.values().filter(|fate| **fate == Fate::Sent).count()
    }

    /// True if nothing moves and nothing waits.
    pub fn stands(&self) -> bool {
        let view = self.view();
        matches!(view.mode, Mode::Standing)
            && view.queued == 0
            && self.unanswered() == 0
            && self.out.is_empty()
    }
}

/// Ticks of a time in s.
pub fn ticks(time: f64) -> u64 {
    (time / TICK).round().max(0.0) as u64
}

/// Every angle in degrees.
pub fn degrees(angles: &Joints) -> Joints {
    angles.map(f64::to_degrees)
}

/// In radians, for the link.
pub fn radians(angles: &Joints) -> [f32; JOINTS] {
    angles.map(|angle| angle.to_radians() as f32)
}

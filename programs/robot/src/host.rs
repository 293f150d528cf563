// SPDX-License-Identifier: MIT OR Apache-2.0
//! Host's side of the link: sends packets, receives reports, and keeps time. The far side is a [`Robot`]: the three cores with the plant
//! ([`crate::controller`]), or a stand-in of a test.

use crate::dynamics::{JOINTS, Joints};
use crate::packet::{Cause, Command, Kind, Report, ReportError, ReportKind};
use std::collections::{BTreeMap, VecDeque};

/// Time from tick to tick, s.
pub const TICK: f64 = 1e-4;
/// Ticks without a packet after which the host sends a sign of life: half of the cores' limit.
const NOP_TICKS: u64 = 1000;
/// Limit on the ticks until a packet's answer: 2 s.
const ANSWER_TICKS: u64 = 20_000;
/// Delay of a packet's second half for the fault `late`, in ticks: 200 ms.
const LATE_TICKS: u64 = 2_000;
/// Silence for the fault `silent`, in ticks: 1 s.
const SILENT_TICKS: u64 = 10_000;
/// Limit on the ticks until the cores are ready after power-up or reset: 2 s.
const READY_TICKS: u64 = 20_000;
/// Limit on the ticks until the robot reports the cause of an error: 2 s. Waits then end.
const UNTOLD_TICKS: u64 = 20_000;

/// State of the robot's motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Standing, ready for commands.
    Standing,
    /// Moving along the queue's segments.
    Moving,
    /// Moving at the rates of a jog.
    Jogging,
    /// Decelerating to a standstill.
    Stopping,
    /// Standing after an error.
    Error,
}

impl Mode {
    /// Mode of a number on the link.
    pub fn of(number: u32) -> Option<Mode> {
        [Mode::Standing, Mode::Moving, Mode::Jogging, Mode::Stopping, Mode::Error]
            .get(number as usize)
            .copied()
    }

    /// Description of the mode for messages.
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

/// State of the robot as the host sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Reference joint angles, rad.
    pub joints: Joints,
    /// Reference pose in m and rad.
    pub pose: [f64; 6],
    /// State of the robot's motion.
    pub mode: Mode,
    /// Sequence number of the packet of the running segment.
    pub segment: u32,
    /// Number of waiting segments.
    pub queued: u32,
    /// Digital outputs; output n is bit n − 1.
    pub outputs: u32,
    /// Analogue outputs, channels 1 and 2.
    pub levels: [f32; 2],
}

/// Digital and analogue inputs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Inputs {
    /// Digital inputs; input n is bit n − 1.
    pub digital: u32,
    /// Analogue inputs, channels 1 and 2.
    pub analogue: [f32; 2],
}

/// Far end of the link.
pub trait Robot {
    /// Advances by one tick.
    ///
    /// # Errors
    /// If the cores cannot continue; the text gives the reason.
    fn tick(&mut self, inputs: &Inputs) -> Result<(), String>;
    /// Number of words that can be sent now.
    fn room(&self) -> usize;
    /// Sends a word; the caller checks [`Robot::room`] first.
    fn send(&mut self, word: u32);
    /// Fields of the reports that have arrived.
    fn reports(&mut self) -> Vec<[u32; 4]>;
    /// State of the robot as the host sees it.
    fn view(&self) -> View;
}

/// Deliberate faults of the link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkFault {
    /// A bit of the next packet is inverted.
    Corrupt,
    /// The next packet is lost, so its successor is out of order.
    Order,
    /// The next packet is delayed in its middle.
    Late,
    /// The host is silent for a second.
    Silent,
}

impl LinkFault {
    /// All faults of the link.
    pub const ALL: [LinkFault; 4] =
        [LinkFault::Corrupt, LinkFault::Order, LinkFault::Late, LinkFault::Silent];

    /// Name of the fault in programs.
    pub const fn name(self) -> &'static str {
        match self {
            LinkFault::Corrupt => "corrupt",
            LinkFault::Order => "order",
            LinkFault::Late => "late",
            LinkFault::Silent => "silent",
        }
    }
}

/// Simulated event around the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// Change of a digital input, by its number from 1.
    Input(u32, bool),
    /// Change of an analogue input, by its channel from 1.
    Analogue(u32, f32),
    /// Fault of the link.
    Fault(LinkFault),
}

/// Error of the host or of the robot.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Problem {
    /// The controller refused a command.
    #[error("refused: {}", cause_text(.0))]
    Refused(Report),
    /// The controller stopped the robot.
    #[error("the robot was stopped: {}", cause_text(.0))]
    Stopped(Report),
    /// A wait exceeded its limit.
    #[error("{0}")]
    Late(String),
    /// The cores, or the host's end of the link, failed.
    #[error("{0}")]
    Broken(String),
    /// The user interrupted the wait.
    #[error("interrupted")]
    Interrupted,
}

impl Problem {
    /// Number of the error's cause; 0 without a cause.
    pub fn cause(&self) -> u32 {
        match self {
            Problem::Refused(report) | Problem::Stopped(report) => report.cause.map_or(0, Cause::number),
            _ => 0,
        }
    }

    /// A program can catch the error and continue.
    pub fn can_be_caught(&self) -> bool {
        matches!(self, Problem::Refused(_) | Problem::Stopped(_) | Problem::Late(_))
    }
}

/// Text of a report's cause.
fn cause_text(report: &Report) -> String {
    let cause = report.cause.map_or_else(|| "no cause was told".to_owned(), |cause| cause.text().to_owned());
    match report.joint() {
        Some(joint) => format!("{cause} (joint {joint})"),
        None => cause,
    }
}

/// State of a packet's answer.
#[derive(Clone, Copy, Debug, PartialEq)]
enum PacketState {
    Sent,
    Accepted(f32),
    Checked(f32),
    Refused(Report),
    Finished,
}

/// Host's end of the link.
#[derive(Clone)]
pub struct Host<R> {
    robot: R,
    ticks: u64,
    sequence: u32,
    out: VecDeque<u32>,
    /// Number of words to send before a pause, and the tick at which the pause ends.
    hold: Option<(usize, u64)>,
    /// Tick until which the host is silent.
    silent: u64,
    last_sent: u64,
    fates: BTreeMap<u32, PacketState>,
    stopped: Option<Report>,
    /// Tick since which the robot stands after an unreported error.
    untold: Option<u64>,
    ready: bool,
    inputs: Inputs,
    events: Vec<(u64, Event)>,
    faults: Vec<LinkFault>,
    outputs: (u32, [f32; 2]),
    log: Vec<(f64, HostEvent)>,
}

/// Change that the host reports to the session.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HostEvent {
    /// Report of the communication core.
    Report(Report),
    /// Change of a digital output, by its number from 1.
    Output(u32, bool),
    /// Change of an analogue output, by its channel from 1.
    Level(u32, f32),
}

/// Limit on the packets whose state is remembered: more than can be under way.
const FATES: usize = 1024;
/// Limit on the reports that wait to be taken.
const LOG: usize = 100_000;

impl<R: Robot> Host<R> {
    /// Host's end of the link to a robot that has just been powered up.
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

    /// Far end of the link.
    pub fn robot(&self) -> &R {
        &self.robot
    }

    /// State of the robot as the host sees it.
    pub fn view(&self) -> View {
        self.robot.view()
    }

    /// Time since power-up, s.
    pub fn time(&self) -> f64 {
        self.ticks as f64 * TICK
    }

    /// Levels at the robot's inputs.
    pub fn inputs(&self) -> Inputs {
        self.inputs
    }

    /// Error after which the robot stands, if any.
    pub fn stopped(&self) -> Option<Report> {
        self.stopped
    }

    /// News since the last call, with their times in s.
    pub fn take_news(&mut self) -> Vec<(f64, HostEvent)> {
        std::mem::take(&mut self.log)
    }

    /// Schedules an event in `after` seconds; at once for 0.
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

    /// Advances by one tick of 100 µs.
    ///
    /// # Errors
    /// If the cores cannot continue.
    pub fn tick(&mut self) -> Result<(), Problem> {
        self.happen();
        if self.ready && self.out.is_empty() && self.ticks >= self.last_sent + NOP_TICKS {
            // A silent link stays silent; a stopped robot needs no sign of life.
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
                self.send_event(HostEvent::Output(bit + 1, outputs >> bit & 1 != 0));
            }
        }
        for (channel, (now, before)) in (1..).zip(levels.into_iter().zip(self.outputs.1)) {
            if now.to_bits() != before.to_bits() {
                self.send_event(HostEvent::Level(channel, now));
            }
        }
        self.outputs = (outputs, levels);
        Ok(())
    }

    fn send_event(&mut self, news: HostEvent) {
        if self.log.len() < LOG {
            self.log.push((self.time(), news));
        }
    }

    /// Sends words as far as there is room.
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
        self.send_event(HostEvent::Report(report));
        let fate = match report.kind {
            ReportKind::Accepted => PacketState::Accepted(report.value),
            ReportKind::Checked => PacketState::Checked(report.value),
            ReportKind::Refused => PacketState::Refused(report),
            ReportKind::Finished => PacketState::Finished,
            ReportKind::Started => return,
            ReportKind::Ready => {
                self.ready = true;
                self.stopped = None;
                self.fates.clear();
                return;
            }
            ReportKind::Stopped => {
                if report.cause.is_some() {
                    // Only the first cause counts.
                    self.stopped.get_or_insert(report);
                    return;
                }
                // A requested stop has ended. The queue's packets before it were dropped without a report.
                let stop = report.sequence;
                self.fates.retain(|sequence, _| *sequence >= stop);
                PacketState::Finished
            }
        };
        if let Some(known) = self.fates.get_mut(&report.sequence) {
            *known = fate;
        }
    }

    /// Queues a packet and returns its sequence number.
    fn send(&mut self, command: &Command) -> u32 {
        self.sequence = self.sequence.wrapping_add(1);
        let mut words = command.encode(self.sequence);
        let fault = if self.faults.is_empty() { None } else { Some(self.faults.remove(0)) };
        match fault {
            Some(LinkFault::Corrupt) => {
                // Any bit will do: the checksum covers all of them.
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
            self.fates.insert(self.sequence, PacketState::Sent);
            while self.fates.len() > FATES {
                self.fates.pop_first();
            }
        }
        self.sequence
    }

    /// Advances until a condition holds, for at most `ticks` ticks.
    ///
    /// # Errors
    /// If the robot stops with an error, the time is over, or the wait is interrupted.
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
                let text = "the robot stands after an error that was not reported; `reset` ends this state";
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

    /// Waits for the cores' readiness after power-up.
    ///
    /// # Errors
    /// If they do not report within 2 s.
    pub fn power_up(&mut self) -> Result<(), Problem> {
        let late = || "the controller did not become ready".to_owned();
        self.wait_until(READY_TICKS, late, &|| false, |host| Ok(host.ready))
    }

    /// Sends a command and waits for its answer. Returns the packet's sequence number and the answer's time in s, 0 without one.
    ///
    /// # Errors
    /// If the command is refused, or the robot is stopped.
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
                Some(PacketState::Accepted(time) | PacketState::Checked(time)) => {
                    value = f64::from(*time);
                    true
                }
                Some(PacketState::Refused(report)) => return Err(Problem::Refused(*report)),
                Some(PacketState::Finished) => true,
                Some(PacketState::Sent) | None => false,
            })
        })?;
        Ok((sequence, value))
    }

    /// Ends the state after an error: drops everything under way. Until the answer comes, the robot counts as stopped.
    fn reset(&mut self) -> Result<(u32, f64), Problem> {
        self.hold = None;
        self.silent = 0;
        // A partly sent packet would swallow the words of the new one.
        while self.robot.room() > 0 && !self.out.is_empty() {
            self.pump();
        }
        self.out.clear();
        self.fates.clear();
        let was_ready = std::mem::replace(&mut self.ready, false);
        let sequence = self.send(&Command::Reset);
        // Reports under way belong to the past: the answer clears them.
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

    /// Sends a command whose answer comes only when the queue has reached it; returns its sequence number.
    ///
    /// # Errors
    /// If the robot is stopped.
    pub fn post(&mut self, command: &Command) -> Result<u32, Problem> {
        if let Some(report) = self.stopped {
            return Err(Problem::Stopped(report));
        }
        let sequence = self.send(command);
        let late = || format!("the link does not accept words: {}", command.kind());
        self.wait_until(ANSWER_TICKS, late, &|| false, |host| Ok(host.out.is_empty()))?;
        Ok(sequence)
    }

    /// The command has finished; true for an unknown sequence number.
    ///
    /// # Errors
    /// If the command was refused after all.
    pub fn finished(&self, sequence: u32) -> Result<bool, Problem> {
        match self.fates.get(&sequence) {
            None | Some(PacketState::Finished) => Ok(true),
            Some(PacketState::Refused(report)) => Err(Problem::Refused(*report)),
            Some(_) => Ok(false),
        }
    }

    /// Packets without an answer. A posted command is answered when the queue has reached it.
    pub fn unanswered(&self) -> usize {
        self.fates.values().filter(|fate| **fate == PacketState::Sent).count()
    }

    /// The robot stands, and no segment, packet or answer is under way.
    pub fn stands(&self) -> bool {
        let view = self.view();
        matches!(view.mode, Mode::Standing)
            && view.queued == 0
            && self.unanswered() == 0
            && self.out.is_empty()
    }
}

/// Number of ticks in a time in s.
pub fn ticks(time: f64) -> u64 {
    (time / TICK).round().max(0.0) as u64
}

/// Converts every angle to degrees.
pub fn degrees(angles: &Joints) -> Joints {
    angles.map(f64::to_degrees)
}

/// Converts every angle to radians, for the link.
pub fn radians(angles: &Joints) -> [f32; JOINTS] {
    angles.map(|angle| angle.to_radians() as f32)
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Execution of statements that act on the robot.

use super::execute::{Failure, Machine};
use super::value::{self, Surroundings, Value, evaluate, number_in, short};
use super::{BUILT_IN, Session};
use crate::dynamics::{JOINTS, Joints};
use crate::geometry::{joints_of, pose_of};
use crate::host::{Event, Host, Inputs, Problem, Robot, degrees, radians, ticks};
use crate::language::tree::{Action, Course, Expression, Item, Pace, Simulation};
use crate::limits;
use crate::packet::{Cause, Command, How, JogMode, Motion, Profile, Report, ReportKind};
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::source::Span;

/// Ticks between two checks of a condition in a wait.
const LOOK: u64 = 10;
/// Number of offers of a motion to a full queue, and the ticks between two offers.
const OFFERS: u32 = 1000;
const OFFER_TICKS: u64 = 100;
/// Limit on the motions whose source places are remembered.
const MOTIONS: usize = 256;
/// Limit on speeds, deg/s or mm/s. The controller has lower limits of its own.
const FASTEST: f64 = 1e5;
/// Limit on positions, mm, and angles, deg.
const FARTHEST: f64 = 1e6;

fn wrong(code: &'static str, span: Span, message: impl Into<String>) -> Failure {
    Failure::Program(Box::new(Diagnostic::error(code, span, message)))
}

/// Time in s until the communication core knows that a jog has ended: three of its periods.
const SETTLE: f64 = 0.0048;

/// Refusal of a target by the host's own check, with the controller's cause.
fn refused(cause: Cause) -> Problem {
    Problem::Refused(Report { kind: ReportKind::Refused, sequence: 0, cause: Some(cause), value: 0.0 })
}

impl<R: Robot + Clone> Session<R> {
    pub(super) fn act(&mut self, machine: &mut Machine, action: &Action, span: Span) -> Result<(), Failure> {
        match action {
            Action::Let(name, value) => {
                let value = evaluate(value, &self.environment(machine))?;
                self.name(machine, &name.text, value);
            }
            Action::Teach(name, joints) => {
                let around = self.environment(machine);
                let value = if *joints { Value::Joints(around.joints()) } else { Value::Pose(around.pose()) };
                self.name(machine, &name.text, value);
                self.say("note", format!("{} = {value}", name.text));
            }
            Action::Move { line, course, target, pace, profile } => {
                let goal = evaluate(target, &self.environment(machine))?;
                let motion = self.motion(machine, *line, *course, pace.as_ref(), *profile)?;
                self.move_to(*line, goal, target.span, motion, *course, span)?;
            }
            Action::Jog(mode, rates, time) => self.jog(machine, *mode, rates, time.as_ref(), span)?,
            Action::JogOff => self.jog_off(span)?,
            Action::Stop => self.halt()?,
            Action::Speed(joints, line) => {
                let around = self.environment(machine);
                let joints = number_in(joints, "a speed", 1e-3, FASTEST, &around)?;
                let before = self.settings.speed.unwrap_or(super::SPEEDS).1;
                let line = match line {
                    Some(line) => number_in(line, "a speed", 1e-3, FASTEST, &around)?,
                    None => before,
                };
                self.settings.speed = Some((joints, line));
            }
            Action::SpeedFast => self.settings.speed = None,
            Action::Profile(profile) => self.settings.profile = *profile,
            Action::Signal(number, on) => {
                let number = self.whole(machine, number, "a digital output's number", 32)?;
                let mask = 1u32 << (number - 1);
                self.post(&Command::Output { mask, bits: if *on { mask } else { 0 } }, span)?;
            }
            Action::Level(channel, value) => {
                let channel = self.whole(machine, channel, "an analogue output's channel", 2)?;
                let value = value::number(value, &self.environment(machine))? as f32;
                self.post(&Command::Level { channel, value }, span)?;
            }
            Action::Wait(time) => {
                let time = number_in(time, "a time", 0.0, limits::LONGEST, &self.environment(machine))?;
                self.pause(time)?;
            }
            Action::WaitDone => self.done()?,
            Action::WaitUntil(condition, time) => self.wait(machine, condition, time.as_ref())?,
            Action::Tool(point) => {
                let mut tool = [0.0; 3];
                for (known, value) in tool.iter_mut().zip(point) {
                    *known =
                        number_in(value, "a coordinate", -FARTHEST, FARTHEST, &self.environment(machine))?;
                }
                self.done()?;
                self.host.command(&Command::Tool(tool.map(|mm| (mm / 1000.0) as f32)))?;
                self.settings.tool = tool;
            }
            Action::LimitSpeed(list) => self.limit(machine, list, 0, |value| value.to_radians() as f32)?,
            Action::LimitTorque(list) => self.limit(machine, list, 1, |value| value as f32)?,
            Action::Reset => {
                self.host.command(&Command::Reset)?;
                self.jogging = None;
                self.open.clear();
            }
            Action::Where => {
                let text = self.place();
                self.say("note", text);
            }
            Action::Say(items) => {
                let mut text = String::new();
                for item in items {
                    match item {
                        Item::Text(words) => text.push_str(words),
                        Item::Value(value) => {
                            text.push_str(&evaluate(value, &self.environment(machine))?.to_string());
                        }
                    }
                }
                self.say("say", text);
            }
            Action::Simulate(what, after) => {
                let after = match after {
                    Some(time) => {
                        number_in(time, "a time", 0.0, limits::LONGEST, &self.environment(machine))?
                    }
                    None => 0.0,
                };
                let event = self.event(machine, what)?;
                self.host.schedule(after, event);
            }
        }
        Ok(())
    }

    /// Event of a simulated input or fault.
    fn event(&self, machine: &Machine, what: &Simulation) -> Result<Event, Failure> {
        Ok(match what {
            Simulation::Input(number, on) => {
                Event::Input(self.whole(machine, number, "a digital input's number", 32)?, *on)
            }
            Simulation::Analogue(channel, value) => {
                let channel = self.whole(machine, channel, "an analogue input's channel", 2)?;
                Event::Analogue(channel, value::number(value, &self.environment(machine))? as f32)
            }
            Simulation::Fault(fault) => Event::Fault(*fault),
        })
    }

    fn name(&mut self, machine: &mut Machine, name: &str, value: Value) {
        match machine.own_mut() {
            Some(own) => own.insert(name.to_owned(), value),
            None => self.values.insert(name.to_owned(), value),
        };
    }

    /// Evaluates an integer from 1 to `last`.
    fn whole(&self, machine: &Machine, of: &Expression, what: &str, last: u32) -> Result<u32, Failure> {
        let number = number_in(of, what, 1.0, f64::from(last), &self.environment(machine))?;
        if number.fract() != 0.0 {
            return Err(wrong(
                "value",
                of.span,
                format!("{what} must be a whole number, not {}", short(number)),
            ));
        }
        Ok(number as u32)
    }

    // ---- Motions.

    fn motion(
        &self,
        machine: &Machine,
        line: bool,
        course: Course,
        pace: Option<&Pace>,
        profile: Option<Profile>,
    ) -> Result<Motion, Failure> {
        let around = self.environment(machine);
        // Units of speed: mm/s along lines, else deg/s.
        let speed = |speed: f64| if line { speed / 1000.0 } else { speed.to_radians() };
        let (how, amount) = match (pace, self.settings.speed) {
            (Some(Pace::Fast), _) | (None, None) => (How::Fast, 0.0),
            (Some(Pace::In(time)), _) => {
                (How::Time, number_in(time, "a time", 1e-3, limits::LONGEST, &around)?)
            }
            (Some(Pace::At(value)), _) => {
                (How::Speed, speed(number_in(value, "a speed", 1e-3, FASTEST, &around)?))
            }
            (None, Some((joints, along))) => (How::Speed, speed(if line { along } else { joints })),
        };
        Ok(Motion {
            profile: profile.unwrap_or(self.settings.profile),
            how,
            amount: amount as f32,
            via: course == Course::Via,
            check: course == Course::Check,
        })
    }

    fn move_to(
        &mut self,
        line: bool,
        goal: Value,
        place: Span,
        motion: Motion,
        course: Course,
        span: Span,
    ) -> Result<(), Failure> {
        if self.host.stands() {
            // After a stop or a jog, the robot is not at the planned position.
            self.planned = degrees(&self.host.view().joints);
        }
        let tool = self.settings.tool;
        let (joints, pose) = match goal {
            Value::Joints(joints) => {
                let joints = completed(&joints, &self.planned);
                (Some(joints), pose_of(&joints, tool).0)
            }
            Value::Pose(pose) => {
                let pose = completed(&pose, &self.planned_pose());
                (joints_of(&pose, tool, &self.planned).ok(), pose)
            }
            other => {
                let message = format!("expected a pose or joint angles, but this is {}", other.kind());
                return Err(wrong("value", place, message));
            }
        };
        if joints.iter().flatten().chain(&pose).any(|value| value.abs() > FARTHEST) {
            let message = format!("positions and angles must not exceed {}", short(FARTHEST));
            return Err(wrong("value", place, message));
        }
        let command = match (goal, line, joints) {
            // The controller fills open components itself.
            (Value::Joints(joints), false, _) => Command::Move { joints: radians(&joints), motion },
            (_, true, _) => Command::MoveL { pose: on_link(&pose), motion },
            (_, false, Some(joints)) => Command::Move { joints: radians(&joints), motion },
            (_, false, None) => {
                let cause = match joints_of(&pose, tool, &self.planned) {
                    Err(takt_programs::arm::Failure::OutOfReach) => Cause::Unreachable,
                    _ => Cause::Singular,
                };
                return Err(refused(cause).into());
            }
        };
        let (sequence, time) = self.offer(&command)?;
        if course == Course::Check {
            self.say("check", format!("possible, in {} s", short(time)));
            return Ok(());
        }
        self.planned = joints.unwrap_or(self.planned);
        self.under_way(sequence, span);
        if course == Course::Whole { self.done() } else { Ok(()) }
    }

    /// Remembers a command whose answer comes later, with its place in the source.
    fn under_way(&mut self, sequence: u32, span: Span) {
        // Refusals stay until a wait reports them.
        self.open.retain(|open| self.host.finished(*open) != Ok(true));
        self.open.push(sequence);
        self.motions.push_back((sequence, span));
        if self.motions.len() > MOTIONS {
            self.motions.pop_front();
        }
    }

    /// Posts a command that takes effect when the queue has reached it, once there is room.
    fn post(&mut self, command: &Command, span: Span) -> Result<(), Failure> {
        // A sent motion may not be in the queue yet; a queued one counts twice, which is on the safe side.
        self.room(|host| host.view().queued as usize + host.unanswered() < limits::SIGNALS_AHEAD)?;
        let sequence = self.host.post(command)?;
        self.under_way(sequence, span);
        Ok(())
    }

    /// Waits until the queue has room.
    fn room(&mut self, there_is: impl Fn(&Host<R>) -> bool) -> Result<(), Problem> {
        let longest = ticks(limits::LONGEST);
        let interrupt = self.interrupt.clone();
        let interrupted = move || interrupt.load(std::sync::atomic::Ordering::Relaxed);
        let late = || "the queue stays full".to_owned();
        self.host.wait_until(longest, late, &interrupted, |host| Ok(there_is(host)))
    }

    /// Sends a motion once the queue has room.
    fn offer(&mut self, command: &Command) -> Result<(u32, f64), Problem> {
        self.room(|host| host.view().queued < limits::QUEUE_AHEAD)?;
        let mut offers = 0;
        loop {
            match self.host.command(command) {
                Err(Problem::Refused(report))
                    if report.cause == Some(Cause::QueueFull) && offers < OFFERS =>
                {
                    offers += 1;
                    for _ in 0..OFFER_TICKS {
                        self.host.tick()?;
                    }
                }
                answer => return answer,
            }
        }
    }

    fn jog(
        &mut self,
        machine: &Machine,
        mode: JogMode,
        rates: &[Expression],
        time: Option<&Expression>,
        span: Span,
    ) -> Result<(), Failure> {
        let around = self.environment(machine);
        let mut values = [0.0; JOINTS];
        for (i, (value, rate)) in values.iter_mut().zip(rates).enumerate() {
            let number = number_in(rate, "a rate", -FASTEST, FASTEST, &around)?;
            let turns = mode == JogMode::Joints || i >= 3;
            *value = (if turns { number.to_radians() } else { number / 1000.0 }) as f32;
        }
        let time = match time {
            Some(time) => Some(number_in(time, "a time", 0.0, limits::LONGEST, &around)?),
            None => None,
        };
        // The controller changes the mode of a jog only at a standstill.
        if self.jogging.is_some_and(|held| held != mode) {
            self.jog_off(span)?;
        }
        if self.jogging.is_none() {
            // The controller accepts a jog only with an empty queue.
            self.done()?;
        }
        self.host.command(&Command::Jog { mode, rates: values })?;
        self.jogging = Some(mode);
        if let Some(time) = time {
            self.pause(time)?;
            self.jog_off(span)?;
        }
        Ok(())
    }

    fn jog_off(&mut self, span: Span) -> Result<(), Failure> {
        if let Some(mode) = self.jogging.take() {
            let (sequence, _) = self.host.command(&Command::Jog { mode, rates: [0.0; JOINTS] })?;
            self.under_way(sequence, span);
            self.done()?;
            return self.pause(SETTLE);
        }
        self.done()
    }

    /// Stops the robot and waits until it stands.
    pub(super) fn halt(&mut self) -> Result<(), Failure> {
        self.host.command(&Command::Stop)?;
        self.jogging = None;
        self.open.clear();
        self.stands_within(limits::STOP_TIME)
    }

    /// Waits until the robot stands.
    pub(super) fn done(&mut self) -> Result<(), Failure> {
        self.stands_within(limits::LONGEST)
    }

    /// Waits until the robot stands, for at most `time` seconds.
    fn stands_within(&mut self, time: f64) -> Result<(), Failure> {
        if self.jogging.is_some() && self.host.stopped().is_none() {
            // A jog does not end by itself.
            return Err(Problem::Late("the robot jogs: `jog off` ends it".to_owned()).into());
        }
        let open = std::mem::take(&mut self.open);
        let interrupt = self.interrupt.clone();
        let interrupted = move || interrupt.load(std::sync::atomic::Ordering::Relaxed);
        let late = || format!("the robot did not come to a standstill within {} s", short(time));
        let ended = |host: &mut Host<R>| {
            for open in &open {
                if !host.finished(*open)? {
                    return Ok(false);
                }
            }
            Ok(host.stands())
        };
        Ok(self.host.wait_until(ticks(time), late, &interrupted, ended)?)
    }

    /// Lets `time` seconds pass.
    fn pause(&mut self, time: f64) -> Result<(), Failure> {
        let interrupt = self.interrupt.clone();
        let interrupted = move || interrupt.load(std::sync::atomic::Ordering::Relaxed);
        let end = self.host.time() + time;
        let over = |host: &mut Host<R>| Ok(host.time() >= end - 1e-9);
        Ok(self.host.wait_until(ticks(time) + 1, String::new, &interrupted, over)?)
    }

    fn wait(
        &mut self,
        machine: &Machine,
        condition: &Expression,
        time: Option<&Expression>,
    ) -> Result<(), Failure> {
        let time = match time {
            Some(time) => number_in(time, "a time", 0.0, limits::LONGEST, &self.environment(machine))?,
            None => limits::SIGNAL_TIME,
        };
        if self.checking && !self.holds(machine, condition)? {
            let text = format!("taken to come: {}", self.sources.text(condition.span));
            self.say("check", text);
            return Ok(());
        }
        let end = self.host.time() + time;
        loop {
            if self.holds(machine, condition)? {
                return Ok(());
            }
            if self.host.time() >= end - 1e-9 {
                let text = self.sources.text(condition.span);
                let text = format!("waited {} s without success: {text}", short(time));
                return Err(Problem::Late(text).into());
            }
            self.pause((LOOK as f64 * crate::host::TICK).min(end - self.host.time()))?;
        }
    }

    fn limit(
        &mut self,
        machine: &Machine,
        list: &[Expression],
        which: usize,
        on_link: fn(f64) -> f32,
    ) -> Result<(), Failure> {
        let mut limits = self.settings.limits;
        for ((limit, value), own) in limits[which].iter_mut().zip(list).zip(BUILT_IN[which]) {
            let value = number_in(value, "a limit", 1e-3, FARTHEST, &self.environment(machine))?;
            // A limit above the controller's own is reduced to it.
            *limit = on_link(value).min(own as f32);
        }
        self.done()?;
        let [velocities, torques] = limits;
        self.host.command(&Command::Limits { velocities, torques })?;
        self.settings.limits = limits;
        Ok(())
    }

    /// Position of the robot, as text.
    fn place(&self) -> String {
        let view = self.host.view();
        let joints = degrees(&view.joints);
        let Inputs { digital, analogue } = self.host.inputs();
        let bits = |bits: u32| -> String {
            let on: Vec<String> =
                (1..=32).filter(|bit| bits >> (bit - 1) & 1 != 0).map(|bit| bit.to_string()).collect();
            if on.is_empty() { "none".to_owned() } else { on.join(", ") }
        };
        let pair = |values: [f32; 2]| values.map(|value| short(f64::from(value))).join(", ");
        let stopped = self.host.stopped().map_or_else(String::new, |report| {
            format!("\nstopped  {}", report.cause.map_or("", Cause::text))
        });
        format!(
            "{}\n{}\ntool     {} mm\n{}, {} segments wait\ninputs   {} on; levels {}\noutputs  {} on; levels {}{stopped}",
            Value::Joints(joints),
            Value::Pose(pose_of(&joints, self.settings.tool).0),
            self.settings.tool.map(short).join(", "),
            view.mode.text(),
            view.queued,
            bits(digital),
            pair(analogue),
            bits(view.outputs),
            pair(view.levels),
        )
    }
}

/// Fills the open components of a target from the position at which the motion begins.
fn completed(target: &[f64; 6], begin: &[f64; 6]) -> [f64; 6] {
    std::array::from_fn(|i| if target[i].is_nan() { begin[i] } else { target[i] })
}

/// Converts a pose from mm and degrees to m and rad, for the link.
fn on_link(pose: &[f64; 6]) -> [f32; 6] {
    let [x, y, z, roll, pitch, yaw] = *pose;
    let joints: Joints = [roll, pitch, yaw, 0.0, 0.0, 0.0];
    let [roll, pitch, yaw, ..] = radians(&joints);
    let [x, y, z] = [x, y, z].map(|mm| (mm / 1000.0) as f32);
    [x, y, z, roll, pitch, yaw]
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Stand-in for the cores: takes packets like them, and moves at once along straight lines in time. It has no dynamics, profiles or limits.

use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};
use takt_robot::dynamics::Joints;
use takt_robot::geometry::{joints_of, pose_of};
use takt_robot::host::{Inputs, Mode, Robot, View, degrees};
use takt_robot::level::{Files, Message, Session};
use takt_robot::packet::{Cause, FRAME_WORDS, Kind, MAGIC, ReportKind, checksum};
use takt_robot::plant::HOME;

#[derive(Clone)]
struct Segment {
    sequence: u32,
    to: Joints,
    time: f64,
    via: bool,
}

/// Stand-in with shared state, so that tests can observe a robot that the session owns.
pub(crate) struct StandIn(Arc<Mutex<State>>);

#[derive(Clone)]
struct State {
    ticks: u64,
    words: Vec<u32>,
    last_word: u64,
    sequence: u32,
    joints: Joints,
    mode: Mode,
    queue: VecDeque<Segment>,
    begun: Option<(Segment, Joints, f64)>,
    rates: [f64; 6],
    outputs: u32,
    levels: [f32; 2],
    reports: Vec<[u32; 4]>,
    packets: Vec<Kind>,
    mute: bool,
}

impl StandIn {
    pub(crate) fn new() -> StandIn {
        let mut state = State {
            ticks: 0,
            words: Vec::new(),
            last_word: 0,
            sequence: 0,
            joints: HOME,
            mode: Mode::Standing,
            queue: VecDeque::new(),
            begun: None,
            rates: [0.0; 6],
            outputs: 0,
            levels: [0.0; 2],
            reports: Vec::new(),
            packets: Vec::new(),
            mute: false,
        };
        state.report(ReportKind::Ready, 0, 0, 0.0);
        StandIn(Arc::new(Mutex::new(state)))
    }

    /// Second handle to the same stand-in, for observation.
    pub(crate) fn shared(&self) -> StandIn {
        StandIn(Arc::clone(&self.0))
    }

    /// Suppresses the reports of stops from now on.
    pub(crate) fn mute(&self) {
        self.0.lock().expect("one thread").mute = true;
    }

    /// Kinds of the packets received, without NOPs.
    pub(crate) fn packets(&self) -> Vec<Kind> {
        let state = self.0.lock().expect("one thread");
        state.packets.iter().copied().filter(|kind| *kind != Kind::Nop).collect()
    }
}

/// Deep copy: a second stand-in in the same state.
impl Clone for StandIn {
    fn clone(&self) -> StandIn {
        StandIn(Arc::new(Mutex::new(self.0.lock().expect("one thread").clone())))
    }
}

impl State {
    fn report(&mut self, kind: ReportKind, sequence: u32, cause: u32, value: f64) {
        self.reports.push([kind.number(), sequence, cause, (value as f32).to_bits()]);
    }

    fn stop(&mut self, sequence: u32, cause: Cause) {
        if self.mode != Mode::Error && !self.mute {
            self.report(ReportKind::Stopped, sequence, cause.number(), 0.0);
        }
        self.mode = Mode::Error;
        self.queue.clear();
        self.begun = None;
        self.words.clear();
    }

    fn word(&mut self, word: u32) {
        self.last_word = self.ticks;
        self.words.push(word);
        let header = self.words[0];
        let kind = Kind::of(header >> 16 & 0xff);
        let Some(kind) =
            kind.filter(|kind| header == MAGIC << 24 | kind.number() << 16 | kind.words() as u32)
        else {
            return self.stop(0, Cause::Header);
        };
        if self.words.len() < kind.words() + FRAME_WORDS {
            return;
        }
        let words = std::mem::take(&mut self.words);
        let (sequence, payload) = (words[1], &words[2..words.len() - 1]);
        if checksum(&words[..words.len() - 1]) != words[words.len() - 1] {
            return self.stop(0, Cause::Crc);
        }
        self.packets.push(kind);
        if kind == Kind::Reset {
            self.sequence = sequence;
            self.mode = Mode::Standing;
            return self.report(ReportKind::Ready, sequence, 0, 0.0);
        }
        if sequence != self.sequence.wrapping_add(1) {
            return self.stop(sequence, Cause::Sequence);
        }
        self.sequence = sequence;
        if self.mode == Mode::Error {
            return self.report(ReportKind::Refused, sequence, Cause::StoppedState.number(), 0.0);
        }
        let float = |i: usize| f64::from(f32::from_bits(payload[i]));
        match kind {
            Kind::Nop | Kind::Reset => return,
            Kind::Move | Kind::MoveL => {
                let begin =
                    self.queue.back().map_or(self.begun.as_ref().map_or(self.joints, |b| b.0.to), |s| s.to);
                let target: [f64; 6] = std::array::from_fn(float);
                let to = if kind == Kind::Move {
                    std::array::from_fn(|i| if target[i].is_nan() { begin[i] } else { target[i] })
                } else {
                    let mm: [f64; 6] =
                        std::array::from_fn(|i| if i < 3 { target[i] * 1e3 } else { target[i].to_degrees() });
                    let begin = degrees(&begin);
                    assert!(pose_of(&begin, [0.0; 3]).0.iter().all(|value| value.is_finite()));
                    match joints_of(&mm, [0.0; 3], &begin) {
                        Ok(joints) => joints.map(f64::to_radians),
                        Err(_) => {
                            return self.report(
                                ReportKind::Refused,
                                sequence,
                                Cause::Unreachable.number(),
                                0.0,
                            );
                        }
                    }
                };
                let way = (0..6).map(|i| (to[i] - begin[i]).abs()).fold(0.0, f64::max);
                let time = match payload[7] {
                    0 => float(8),
                    1 if kind == Kind::Move => way / float(8),
                    _ => way,
                };
                if payload[9] & 2 != 0 {
                    return self.report(ReportKind::Checked, sequence, 0, time);
                }
                if self.queue.len() >= 8 {
                    return self.report(ReportKind::Refused, sequence, Cause::QueueFull.number(), 0.0);
                }
                self.report(ReportKind::Accepted, sequence, 0, time);
                self.queue.push_back(Segment { sequence, to, time, via: payload[9] & 1 != 0 });
                return;
            }
            Kind::Jog => {
                self.rates = std::array::from_fn(|i| float(i + 1));
                let stands = self.rates.iter().all(|rate| *rate == 0.0);
                self.mode = if stands { Mode::Standing } else { Mode::Jogging };
                if stands {
                    return self.report(ReportKind::Finished, sequence, 0, 0.0);
                }
            }
            Kind::Stop => {
                self.queue.clear();
                self.begun = None;
                self.mode = Mode::Standing;
                return self.report(ReportKind::Stopped, sequence, 0, 0.0);
            }
            Kind::Output => {
                self.outputs = self.outputs & !payload[0] | payload[1] & payload[0];
                return self.report(ReportKind::Finished, sequence, 0, 0.0);
            }
            Kind::Level => {
                self.levels[payload[0] as usize - 1] = f32::from_bits(payload[1]);
                return self.report(ReportKind::Finished, sequence, 0, 0.0);
            }
            Kind::Tool | Kind::Limits => {}
        }
        self.report(ReportKind::Accepted, sequence, 0, 0.0);
    }

    fn tick(&mut self) {
        self.ticks += 1;
        if !self.words.is_empty() && self.ticks - self.last_word > 64 * 16 {
            self.stop(0, Cause::Late);
        }
        let moves = matches!(self.mode, Mode::Moving | Mode::Jogging);
        if moves && self.ticks - self.last_word > 5000 {
            self.stop(0, Cause::Silent);
        }
        if self.mode == Mode::Jogging {
            self.joints = std::array::from_fn(|i| self.joints[i] + 1e-4 * self.rates[i]);
        }
        if let Some((segment, from, begin)) = &self.begun {
            let part = ((self.ticks as f64 * 1e-4 - begin) / segment.time.max(1e-4)).min(1.0);
            self.joints = std::array::from_fn(|i| from[i] + part * (segment.to[i] - from[i]));
            if part >= 1.0 {
                let (sequence, via) = (segment.sequence, segment.via);
                self.report(ReportKind::Finished, sequence, 0, 0.0);
                self.begun = None;
                self.mode = Mode::Standing;
                if via && self.queue.is_empty() {
                    self.stop(sequence, Cause::RanDry);
                }
            }
        }
        if self.begun.is_none()
            && let Some(segment) = self.queue.pop_front()
        {
            self.mode = Mode::Moving;
            self.report(ReportKind::Started, segment.sequence, 0, 0.0);
            self.begun = Some((segment, self.joints, self.ticks as f64 * 1e-4));
        }
    }
}

impl Robot for StandIn {
    fn tick(&mut self, _: &Inputs) -> Result<(), String> {
        self.0.lock().expect("one thread").tick();
        Ok(())
    }

    fn room(&self) -> usize {
        256
    }

    fn send(&mut self, word: u32) {
        self.0.lock().expect("one thread").word(word);
    }

    fn reports(&mut self) -> Vec<[u32; 4]> {
        std::mem::take(&mut self.0.lock().expect("one thread").reports)
    }

    fn view(&self) -> View {
        let state = self.0.lock().expect("one thread");
        View {
            joints: state.joints,
            pose: [0.0; 6],
            mode: state.mode,
            segment: state.begun.as_ref().map_or(0, |begun| begun.0.sequence),
            queued: state.queue.len() as u32,
            outputs: state.outputs,
            levels: state.levels,
        }
    }
}

/// Files in memory, by name.
#[derive(Default)]
pub(crate) struct Memory(Mutex<BTreeMap<String, String>>);

impl Files for Memory {
    fn read(&self, name: &str) -> Result<String, String> {
        let files = self.0.lock().expect("one thread");
        files.get(name).cloned().ok_or_else(|| format!("there is no file {name}"))
    }

    fn write(&self, name: &str, text: &str) -> Result<(), String> {
        self.0.lock().expect("one thread").insert(name.to_owned(), text.to_owned());
        Ok(())
    }
}

pub(crate) fn session() -> (Session<StandIn>, StandIn) {
    let robot = StandIn::new();
    let session = Session::new(robot.shared(), Arc::new(Memory::default()), Arc::new(AtomicBool::new(false)));
    (session.expect("it gets ready"), robot)
}

/// Messages as lines `kind: text`.
pub(crate) fn lines(messages: Vec<Message>) -> Vec<String> {
    messages.into_iter().map(|message| format!("{}: {}", message.kind, message.text)).collect()
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! The host's side of a board's scope: channels by the names of the source, the trigger, and the recording.

use crate::application::Application;
use crate::host::Host;
use crate::protocol::{
    CORE_DATA, CORE_REGISTERS, DRIVEN, IMAGE, Line, LinkError, PAGE_WORDS, SCOPE_PAGE, address, channel,
};
use std::ops::ControlFlow;
use takt_isa::program::Location;
use takt_isa::{Instruction, Program, Register, Type};
use thiserror::Error;

/// Most channels of a scope.
pub const MOST_CHANNELS: u32 = 8;
/// Fewest samples of a scope's ring.
pub const LEAST_DEPTH: u32 = 16;
/// Most samples of a scope's ring.
pub const MOST_DEPTH: u32 = 1 << 15;
/// Most words of a scope's ring.
pub const MOST_WORDS: u32 = 1 << 17;
/// Most periods from a sample to the next.
pub const MOST_EVERY: u32 = (1 << 12) - 1;

/// Bit of `scope_state`, written: arms.
pub(crate) const ARM: u32 = 1;
/// Bit of `scope_state`, written: triggers.
pub(crate) const NOW: u32 = 1 << 1;
/// Bit of `scope_state`, written: ends the recording.
pub(crate) const END: u32 = 1 << 2;
/// Bit of a channel's register: only the bundle in bits 29:16 counts.
const RESTRICTED: u32 = 1 << 30;
/// Place of the causes in `scope_state`.
pub(crate) const CAUSES: u32 = 4;

/// The scope of a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scope {
    /// Samples of the ring.
    pub depth: u32,
    /// Channels.
    pub channels: u32,
    /// The core that is recorded.
    pub core: usize,
    /// Channels can be restricted to a bundle.
    pub has_bundles: bool,
}

/// Register or input port that is recorded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Channel {
    /// The name as given: `x`, `core.x`, `x:57`.
    pub name: String,
    /// Type of the values.
    pub ty: Type,
    core: usize,
    register: Register,
    /// The bundle whose writes count; `None` for all.
    bundle: Option<u16>,
}

/// Event that triggers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Event {
    Stop,
    Missed,
    Trip,
    Safe,
}

/// Events: the word of a trigger, and the event in a report. The order is that of the bits in the board's registers.
const EVENTS: [(Event, &str, &str); 4] = [
    (Event::Stop, "fault", "the program stopped"),
    (Event::Missed, "miss", "a missed deadline"),
    (Event::Trip, "trip", "a trip"),
    (Event::Safe, "safe", "the outputs became safe"),
];

/// Word of a trigger by the host.
const HOST: &str = "now";

/// Comparison of a channel's value, as the board makes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Test {
    AtLeast = 1,
    Below = 2,
    Rises = 3,
    Falls = 4,
    Equals = 5,
    Changes = 6,
}

/// Comparisons in a trigger's text; longer ones come before those that they begin with. With `true`, the level is the next value above.
const TESTS: [(&str, Test, bool); 8] = [
    (">=", Test::AtLeast, false),
    ("<=", Test::Below, true),
    ("==", Test::Equals, false),
    (">", Test::AtLeast, true),
    ("<", Test::Below, false),
    (" rises ", Test::Rises, false),
    (" falls ", Test::Falls, false),
    (" changes", Test::Changes, false),
];

/// Comparison that triggers.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Comparison {
    channel: usize,
    test: Test,
    /// The level as a key.
    level: u32,
    text: String,
}

/// Channels of a recording, its triggers and its length.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Setup {
    /// The channels.
    pub channels: Vec<Channel>,
    /// Periods from a sample to the next.
    pub every: u32,
    /// Samples; `None`: as many as the board has.
    pub samples: Option<u32>,
    /// Samples before the trigger's; `None`: a quarter, or none if the host triggers.
    pub before: Option<u32>,
    comparison: Option<Comparison>,
    events: Vec<Event>,
}

/// State of a scope.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScopeState {
    /// Nothing has been recorded since power-up.
    Rest,
    /// Records, and waits for its trigger.
    Armed,
    /// Has been triggered, and records the samples that follow.
    Triggered,
    /// The recording can be read.
    Done,
}

/// Samples that a scope has recorded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recording {
    /// Name and type of each channel.
    pub channels: Vec<(String, Type)>,
    /// The period of each sample, counted from the program's start.
    pub periods: Vec<u32>,
    /// The bits of each channel's samples; `None` where the channel had no value yet.
    pub values: Vec<Vec<Option<u32>>>,
    /// Index of the trigger's sample, and the period in which it was triggered; `None` if the host ended the recording before.
    pub trigger: Option<(usize, u32)>,
    /// Causes of the trigger, in words.
    pub causes: Vec<String>,
    /// The last sample has the values that the program left when it stopped, in mid-period.
    pub is_stopped: bool,
}

/// Reason why a scope did not record.
#[derive(Debug, Error)]
pub enum ScopeError {
    /// The board did not answer.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The circuit has no scope.
    #[error(
        "the board has no scope: a table `[scope]` in its wiring, and `takt board build`, give it one (docs/board.md)"
    )]
    None,
    /// The circuit records another core.
    #[error(
        "the board's scope records core {there} of the system, counted from 0; the channels are of core {wanted}"
    )]
    OtherCore {
        /// The core that is recorded.
        there: usize,
        /// The core of the channels.
        wanted: usize,
    },
    /// More channels than the circuit has.
    #[error(
        "{wanted} channels are asked for; the board's scope has {there} (`channels` in the wiring's `[scope]`)"
    )]
    Channels {
        /// Channels that the host wanted.
        wanted: usize,
        /// Channels of the scope.
        there: u32,
    },
    /// More samples than the ring has.
    #[error(
        "{wanted} samples are asked for; the board's scope has {there} (`depth` in the wiring's `[scope]`)"
    )]
    Samples {
        /// Samples that the host wanted.
        wanted: u32,
        /// Samples of the ring.
        there: u32,
    },
    /// More samples before the trigger's than samples.
    #[error("{before} samples before the trigger leave none for it: there are {samples} in all")]
    Before {
        /// Samples before the trigger's.
        before: u32,
        /// Samples in all.
        samples: u32,
    },
    /// A channel is restricted to a line, which the circuit of a system cannot do.
    #[error(
        "`{0}`: the scope of a system records registers, not the operations of a line: leave out the line"
    )]
    Bundle(String),
    /// Nothing was recorded.
    #[error("the board's scope {0}")]
    NotDone(&'static str),
    /// The host gave up reading a recording, which the board keeps.
    #[error("the recording was not read to its end")]
    Interrupted,
    /// The board has recorded other channels.
    #[error(
        "the board's scope has recorded another register in the place of `{0}`: name the channels with which it was armed"
    )]
    OtherChannels(String),
}

/// The key of a value: keys are in the order of values, as integers without sign.
pub(crate) fn key(ty: Type, bits: u32) -> u32 {
    match ty {
        Type::B => bits,
        Type::I => bits ^ 1 << 31,
        // Both zeros have the key of +0.
        Type::F if bits << 1 == 0 => 1 << 31,
        Type::F if bits >> 31 == 1 => !bits,
        Type::F => bits | 1 << 31,
    }
}

/// Bits of a level in text.
fn level(text: &str, ty: Type) -> Result<u32, String> {
    let wrong =
        |is: &str| format!("`{text}` is not a level for a channel of type {}: expected {is}", ty.name());
    match ty {
        Type::F => match text.parse::<f32>() {
            Ok(value) if value.is_nan() => Err(wrong("a number, which NaN is not")),
            Ok(value) => Ok(value.to_bits()),
            Err(_) => Err(wrong("a number, as in `x > 1.5`")),
        },
        Type::I => text.parse().map(i32::cast_unsigned).map_err(|_| wrong("a whole number of 32 bits")),
        Type::B => match text.strip_prefix("0x") {
            Some(hex) => u32::from_str_radix(hex, 16),
            None => text.parse(),
        }
        .map_err(|_| wrong("bits, as in `x == 0x1f`")),
    }
}

/// A line, perhaps with its file.
type At<'a> = (Option<&'a str>, u32);

/// Splits a channel's name from the line whose operations count: `x`, `x:57`, `x:pi.s:57`.
fn named(text: &str) -> Result<(&str, Option<At<'_>>), String> {
    let Some((name, place)) = text.split_once(':') else { return Ok((text, None)) };
    let (file, line) = match place.rsplit_once(':') {
        Some((file, line)) => (Some(file), line),
        None => (None, place),
    };
    match line.parse() {
        Ok(line) => Ok((name, Some((file, line)))),
        Err(_) => Err(format!("`{text}`: expected a line of the source after the colon, as in `{name}:57`")),
    }
}

/// Operation that writes a register.
struct Written {
    register: Register,
    bundle: u16,
    /// Place in the source; `None` for an operation that the assembler has added, or a part of an equation: an intermediate value.
    line: Option<Location>,
}

/// All operations of a program that write registers.
fn written(program: &Program) -> Vec<Written> {
    let slots = program.machine.slots;
    let words = program.code.iter().enumerate().filter_map(|(number, word)| {
        let register = Instruction::decode(*word).ok()?.writes(&slots[number % slots.len()])?;
        let line = program.lines.get(number).copied().flatten().filter(|_| program.part(number).is_none());
        Some(Written { register, bundle: u16::try_from(number / slots.len()).ok()?, line })
    });
    words.collect()
}

/// The register that a source line writes, and the bundle whose writes count; `None` for all bundles. `register` is the one of the name: if
/// the line does not write it, the value may lie in another one.
fn written_at(
    program: &Program,
    text: &str,
    register: Register,
    (file, line): (Option<&str>, u32),
) -> Result<(Register, Option<u16>), String> {
    let is_named = |of: u32| {
        let known = program.files.get(of as usize).map_or("", String::as_str);
        file.map_or(of == 0, |file| known == file || known.ends_with(&format!("/{file}")))
    };
    let all = written(program);
    let is_here =
        |write: &Written| write.line.is_some_and(|place| place.line == line && is_named(place.file));
    let mut targets: Vec<Register> =
        all.iter().filter(|write| is_here(write)).map(|write| write.register).collect();
    targets.sort_unstable();
    targets.dedup();
    let target = match targets[..] {
        _ if targets.contains(&register) => register,
        [only] => only,
        [] => return Err(format!("`{text}`: no operation of line {line} writes a register")),
        _ => {
            let names = targets.iter().map(|target| format!("`{}`", program.register_text(*target)));
            let names = names.collect::<Vec<_>>().join(", ");
            return Err(format!("`{text}`: line {line} writes several registers: {names}"));
        }
    };
    let writes = all.iter().filter(|write| write.register == target);
    let (here, others): (Vec<_>, Vec<_>) = writes.partition(|write| is_here(write));
    match (&here[..], &others[..]) {
        (_, []) => Ok((target, None)),
        ([one], _) => Ok((target, Some(one.bundle))),
        _ => Err(format!(
            "`{text}`: line {line} writes `{}` in {} bundles, and other lines write it too; a channel has one bundle",
            program.register_text(target),
            here.len()
        )),
    }
}

impl Channel {
    /// The channel with a name: a register or port of the source (`x`, in a system `core.x`), a place (`@m12`), and the line whose
    /// operations count (`x:57`).
    ///
    /// # Errors
    /// A message about the name.
    pub fn find(application: &Application<'_>, text: &str) -> Result<Channel, String> {
        let (name, line) = named(text)?;
        let cores = &application.description().cores;
        let of = |core: usize, own: &str| -> Option<(usize, Register, Type)> {
            let program = &cores[core].program;
            if let Some(place) = own.strip_prefix('@') {
                return Some((core, program.machine.register_address(place)?, Type::F));
            }
            let all = program.host_registers().chain(&program.outputs).chain(&program.registers);
            all.clone().find(|port| port.name == own).map(|port| (core, port.register, port.ty))
        };
        let found = match name.split_once('.') {
            _ if application.is_program() => of(0, name),
            Some((core, own)) => application.description().core_named(core).and_then(|core| of(core, own)),
            None => {
                let has: Vec<_> = (0..cores.len()).filter_map(|core| of(core, name)).collect();
                if let [_, _, ..] = has[..] {
                    let names = has.iter().map(|(core, ..)| format!("`{}`", application.name(*core, name)));
                    let names = names.collect::<Vec<_>>().join(" or ");
                    return Err(format!("`{name}` is a register of several cores: {names}"));
                }
                has.first().copied()
            }
        };
        let Some((core, register, ty)) = found else {
            return Err(match application.find(name) {
                Ok(place) if place.read >= CORE_DATA => format!(
                    "`{name}` lies in data memory; a channel is a register or a port: let the program copy it to one"
                ),
                Ok(place) if place.read >= DRIVEN && place.read < IMAGE => format!(
                    "`{name}` is the host's end of a link; a channel is a register or a port of a core: `core.x`"
                ),
                Ok(_) => format!("`{name}` is not a register or a port"),
                Err(text) => text,
            });
        };
        let (register, bundle) = match line {
            None => (register, None),
            Some(line) => written_at(&cores[core].program, text, register, line)?,
        };
        Ok(Channel { name: text.to_owned(), ty, core, register, bundle })
    }

    /// The word of the board's register for the channel.
    fn word(&self) -> u32 {
        let bundle = self.bundle.map_or(0, |bundle| RESTRICTED | u32::from(bundle) << 16);
        bundle | u32::from(self.register.get())
    }
}

impl Setup {
    /// Channels by name, and triggers: `x >= 1.5`, `x < 2`, `x rises 3`, `x falls 3`, `x == 4`, `x changes` (one of these at most), `fault`,
    /// `miss`, `trip`, `safe`. Without triggers, or with `now`, the recording begins at once.
    ///
    /// # Errors
    /// A message about a name, a trigger, or the number of channels.
    pub fn new(
        application: &Application<'_>,
        names: &[String],
        triggers: &[String],
    ) -> Result<Setup, String> {
        if names.is_empty() || names.len() > MOST_CHANNELS as usize {
            return Err(format!("{} channels are asked for; a scope has 1 to {MOST_CHANNELS}", names.len()));
        }
        let channels: Vec<Channel> =
            names.iter().map(|name| Channel::find(application, name)).collect::<Result<_, _>>()?;
        if let Some(other) = channels.iter().find(|channel| channel.core != channels[0].core) {
            let text = "are registers of different cores; a scope records one";
            return Err(format!("`{}` and `{}` {text}", channels[0].name, other.name));
        }
        let mut setup =
            Setup { channels, every: 1, samples: None, before: None, comparison: None, events: Vec::new() };
        for text in triggers {
            setup.add_trigger(text)?;
        }
        Ok(setup)
    }

    fn add_trigger(&mut self, text: &str) -> Result<(), String> {
        let word = text.trim();
        if let Some((event, ..)) = EVENTS.iter().find(|(_, name, _)| *name == word) {
            self.events.push(*event);
            return Ok(());
        }
        if word == HOST {
            return Ok(());
        }
        let at = TESTS.iter().find_map(|test| Some((test, word.find(test.0)?)));
        let Some(((operator, test, is_next), at)) = at else {
            return Err(format!(
                "`{word}` is not a trigger: expected a comparison of a channel (`x >= 1.5`, `x < 2`, `x == 3`, `x rises 4`, `x falls 4`, \
                 `x changes`), or one of {}",
                EVENTS.map(|(_, name, _)| name).join(", ")
            ));
        };
        if let Some(other) = &self.comparison {
            return Err(format!("there is one comparison; `{}` and `{word}` are two", other.text));
        }
        let (name, value) = (word[..at].trim(), word[at + operator.len()..].trim());
        let Some(channel) = self.channels.iter().position(|channel| channel.name == name) else {
            return Err(format!(
                "the trigger compares `{name}`, which is not a channel: name it among the channels"
            ));
        };
        let ty = self.channels[channel].ty;
        let level = match (test, value) {
            (Test::Changes, "") => 0,
            (Test::Changes, more) => return Err(format!("`{word}`: `{more}` follows `changes`")),
            (_, value) => key(ty, level(value, ty)?),
        };
        let level = if *is_next { level.checked_add(1) } else { Some(level) };
        let level = level.ok_or_else(|| format!("`{word}`: no value is above {value}"))?;
        self.comparison = Some(Comparison { channel, test: *test, level, text: word.to_owned() });
        Ok(())
    }

    /// The host triggers: the recording begins at once.
    pub fn is_immediate(&self) -> bool {
        self.comparison.is_none() && self.events.is_empty()
    }

    /// The triggers, in words.
    pub fn triggers(&self) -> String {
        let events = EVENTS.iter().filter(|(event, ..)| self.events.contains(event));
        let events = events.map(|(_, name, _)| (*name).to_owned());
        let all: Vec<String> =
            self.comparison.iter().map(|comparison| comparison.text.clone()).chain(events).collect();
        if all.is_empty() { HOST.to_owned() } else { all.join(" or ") }
    }

    /// Samples before the trigger's, and after it.
    fn length(&self, scope: &Scope) -> Result<(u32, u32), ScopeError> {
        let samples = self.samples.unwrap_or(scope.depth);
        if samples > scope.depth {
            return Err(ScopeError::Samples { wanted: samples, there: scope.depth });
        }
        let before = self.before.unwrap_or(if self.is_immediate() { 0 } else { samples / 4 });
        match samples.checked_sub(before + 1) {
            Some(after) => Ok((before, after)),
            None => Err(ScopeError::Before { before, samples }),
        }
    }

    /// Checks that the board's scope can record this.
    ///
    /// # Errors
    /// Too many channels or samples, another core, or a line in a system.
    pub fn fits(&self, scope: &Scope) -> Result<(), ScopeError> {
        if self.channels.len() > scope.channels as usize {
            return Err(ScopeError::Channels { wanted: self.channels.len(), there: scope.channels });
        }
        if let Some(channel) = self.channels.first().filter(|channel| channel.core != scope.core) {
            return Err(ScopeError::OtherCore { there: scope.core, wanted: channel.core });
        }
        let restricted = self.channels.iter().find(|channel| channel.bundle.is_some() && !scope.has_bundles);
        if let Some(channel) = restricted {
            return Err(ScopeError::Bundle(channel.name.clone()));
        }
        self.length(scope).map(|_| ())
    }
}

impl<L: Line> Host<L> {
    /// The board's scope.
    ///
    /// # Errors
    /// [`ScopeError::None`] without one, or the board does not answer.
    pub fn scope(&mut self) -> Result<Scope, ScopeError> {
        let word = self.register("scope")?;
        if word == 0 {
            return Err(ScopeError::None);
        }
        Ok(Scope {
            depth: word & 0xffff,
            channels: word >> 16 & 0xf,
            core: (word >> 24 & 0xf) as usize,
            has_bundles: word >> 28 & 1 != 0,
        })
    }

    /// Arms the scope.
    ///
    /// # Errors
    /// If the scope cannot record this, or the board does not answer.
    pub fn arm(
        &mut self,
        application: &Application<'_>,
        scope: &Scope,
        setup: &Setup,
    ) -> Result<(), ScopeError> {
        setup.fits(scope)?;
        let (before, after) = setup.length(scope)?;
        self.set("scope_state", END)?;
        for (number, known) in setup.channels.iter().enumerate() {
            self.write(channel(number), &[known.word()])?;
        }
        let observed = self.register("observed")? != 0;
        for (number, known) in setup.channels.iter().enumerate() {
            // A value for the samples before the first write. The board ignores it once the program has written another.
            let at = application.register(known.core, known.register).filter(|_| known.bundle.is_none());
            let Some(at) = at.filter(|at| observed || *at < CORE_REGISTERS) else { continue };
            match self.read(at, 1) {
                Ok(words) => self.write(channel(number) + 1, &words)?,
                // A program that does not wait writes its registers itself.
                Err(LinkError::Busy) => {}
                Err(error) => return Err(error.into()),
            }
        }
        let mut trigger = 0;
        if let Some(comparison) = &setup.comparison {
            let ty = match setup.channels[comparison.channel].ty {
                Type::F => 0,
                Type::I => 1,
                Type::B => 2,
            };
            trigger |= comparison.test as u32 | (comparison.channel as u32) << 4 | ty << 8;
        }
        for event in &setup.events {
            trigger |= 1 << (16 + *event as u32);
        }
        let level = setup.comparison.as_ref().map_or(0, |comparison| comparison.level);
        let words = [setup.every.clamp(1, MOST_EVERY), before | after << 16, trigger, level];
        self.write(address("scope_every"), &words)?;
        let now = if setup.is_immediate() { NOW } else { 0 };
        Ok(self.set("scope_state", ARM | now)?)
    }

    /// The state of the scope.
    ///
    /// # Errors
    /// If the board does not answer.
    pub fn scope_state(&mut self) -> Result<ScopeState, LinkError> {
        Ok(match self.register("scope_state")? & 3 {
            0 => ScopeState::Rest,
            1 => ScopeState::Armed,
            2 => ScopeState::Triggered,
            _ => ScopeState::Done,
        })
    }

    /// Ends the recording, triggered or not.
    ///
    /// # Errors
    /// If the board does not answer.
    pub fn end_scope(&mut self) -> Result<(), LinkError> {
        self.set("scope_state", END)
    }

    /// Reads the recording of the channels with which the scope was armed; `passed` gets the number of words that have come, and of all, and
    /// says whether to go on.
    ///
    /// # Errors
    /// If there is no recording, or one of other channels, or the board does not answer, or `passed` breaks off.
    pub fn recording(
        &mut self,
        scope: &Scope,
        setup: &Setup,
        mut passed: impl FnMut(usize, usize) -> ControlFlow<()>,
    ) -> Result<Recording, ScopeError> {
        setup.fits(scope)?;
        match self.scope_state()? {
            ScopeState::Done => {}
            ScopeState::Rest => return Err(ScopeError::NotDone("has recorded nothing since power-up")),
            ScopeState::Armed => return Err(ScopeError::NotDone("waits for its trigger")),
            ScopeState::Triggered => return Err(ScopeError::NotDone("is still recording")),
        }
        let words = self.read(address("scope_state"), 9)?;
        let [state, every, length, trigger, level, at, samples, period, last] = words[..] else {
            return Err(ScopeError::None);
        };
        let channels = scope.channels as usize;
        let all = self.read(channel(0), 4 * channels)?;
        for (known, words) in setup.channels.iter().zip(all.chunks(4)) {
            if words[0] != known.word() {
                return Err(ScopeError::OtherChannels(known.name.clone()));
            }
        }
        let (end, trigger_at) = (at & 0xffff, at >> 16);
        let behind = |from: u32, to: u32| to.wrapping_sub(from) & (scope.depth - 1);
        let kept = samples.min(scope.depth);
        let causes = state >> CAUSES & 0x3f;
        let (count, index) = match (kept, causes) {
            (0, _) => (0, None),
            (kept, 0) => (kept, None),
            (kept, _) => {
                let after = behind(trigger_at, end.wrapping_sub(1)).min(kept - 1);
                let before = (length & 0xffff).min(kept - 1 - after);
                (before + 1 + after, Some(before as usize))
            }
        };
        let first = end.wrapping_sub(count) & (scope.depth - 1);
        let rows = self.ring(scope, first, count, &mut passed)?;
        let value = |number: usize, row: usize| {
            let have = all[4 * number + 2] as usize;
            (count as usize - 1 - row < have).then(|| rows[row * channels + number])
        };
        let values = (0..setup.channels.len())
            .map(|number| (0..count as usize).map(|row| value(number, row)).collect())
            .collect();
        let is_stopped = state >> 2 & 1 != 0;
        let every = (every & 0xfff).max(1);
        // From the last sample back: a stop comes in mid-distance.
        let until = state >> 16 & 0xfff;
        let distance = if is_stopped { every - until.min(every - 1) } else { every };
        let back = |row: u32| match count - 1 - row {
            0 => 0,
            rows => distance + (rows - 1) * every,
        };
        let periods = (0..count).map(|row| last.wrapping_sub(back(row))).collect();
        let mut words: Vec<String> = EVENTS
            .iter()
            .enumerate()
            .filter(|(bit, _)| causes >> bit & 1 != 0)
            .map(|(_, (.., text))| (*text).to_owned())
            .collect();
        if causes >> 4 & 1 != 0 {
            words.push("the host".to_owned());
        }
        if causes >> 5 != 0 {
            let own = setup.comparison.as_ref().filter(|own| {
                own.level == level && own.test as u32 | (own.channel as u32) << 4 == trigger & 0x77
            });
            words.push(own.map_or_else(|| "a comparison".to_owned(), |own| format!("`{}`", own.text)));
        }
        Ok(Recording {
            channels: setup.channels.iter().map(|channel| (channel.name.clone(), channel.ty)).collect(),
            periods,
            values,
            trigger: index.map(|index| (index, period)),
            causes: words,
            is_stopped,
        })
    }

    /// Words of the ring: `count` samples from place `first` on, which may go around its end.
    fn ring(
        &mut self,
        scope: &Scope,
        first: u32,
        count: u32,
        passed: &mut impl FnMut(usize, usize) -> ControlFlow<()>,
    ) -> Result<Vec<u32>, ScopeError> {
        let size = (scope.depth * scope.channels) as usize;
        let total = (count * scope.channels) as usize;
        let mut words = Vec::with_capacity(total);
        let (mut at, mut page) = ((first * scope.channels) as usize, None);
        while words.len() < total {
            let wanted = SCOPE_PAGE + (at / PAGE_WORDS) as u32;
            if page != Some(wanted) {
                self.set("page", wanted)?;
                page = Some(wanted);
            }
            let inside = at % PAGE_WORDS;
            let some = (total - words.len()).min(size - at).min(PAGE_WORDS - inside).min(STRETCH);
            words.extend(self.read(IMAGE + inside as u16, some)?);
            at = (at + some) % size;
            if passed(words.len(), total).is_break() {
                break;
            }
        }
        self.set("page", 0)?;
        if words.len() < total { Err(ScopeError::Interrupted) } else { Ok(words) }
    }
}

/// Words that are read between two reports.
const STRETCH: usize = 256;

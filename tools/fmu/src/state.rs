// SPDX-License-Identifier: MIT OR Apache-2.0
//! States of an instance, and their bytes. Reading trusts nothing.

use crate::instance::{Instance, Mistake, Phase};
use crate::machine::{Counts, SavedMachine};
use crate::model::{Application, Model};
use std::collections::BTreeMap;
use takt_emu::WaitingState;
use takt_isa::fp::Flags;
use takt_isa::{BundleAddress, Register};
use takt_system::{MAX_CORES, System, WaitingSystem};

/// First bytes of a serialised state: the format and its version.
const MAGIC: [u8; 8] = *b"TAKTFMU\x02";
/// Phases with a state, each with its number in a serialised state.
const PHASES: [Phase; 4] = [Phase::Instantiated, Phase::Initialising, Phase::Stepping, Phase::Terminated];

/// State of an instance.
#[derive(Clone)]
pub struct SavedState {
    phase: Phase,
    start: f64,
    periods: u64,
    /// Counts of each core.
    counts: Vec<Counts>,
    values: Vec<u32>,
    /// State of the machine; `None` before its first cycle.
    machine: Option<SavedMachine>,
}

impl SavedState {
    pub(crate) fn of(instance: &Instance) -> Result<SavedState, Mistake> {
        let is_fresh = matches!(instance.phase, Phase::Instantiated | Phase::Initialising);
        let machine = if is_fresh { None } else { instance.machine.save() };
        if !is_fresh && machine.is_none() || instance.phase == Phase::Failed {
            return Err(Mistake::Phase { call: "saving a state", phase: "after the program has stopped" });
        }
        Ok(SavedState {
            phase: instance.phase,
            start: instance.start,
            periods: instance.periods,
            counts: instance.machine.counts().to_vec(),
            values: instance.values.clone(),
            machine,
        })
    }

    pub(crate) fn restore(&self, instance: &mut Instance) -> Result<(), Mistake> {
        if self.values.len() != instance.values.len() {
            return Err(Mistake::State("it has other variables"));
        }
        match &self.machine {
            None => instance.machine.reset(),
            Some(machine) if instance.machine.restore(machine, &self.counts) => {}
            Some(_) => return Err(Mistake::State("the program has no such state")),
        }
        instance.phase = self.phase;
        instance.start = self.start;
        instance.periods = self.periods;
        instance.values.clone_from(&self.values);
        instance.send_inputs();
        Ok(())
    }

    /// Bytes of the state, for an FMU with this digest.
    ///
    /// # Errors
    /// If a core of a system does not wait.
    pub(crate) fn to_bytes(&self, digest: u128) -> Result<Vec<u8>, Mistake> {
        let mut out = Writer(MAGIC.to_vec());
        out.0.extend(digest.to_le_bytes());
        out.word(PHASES.iter().position(|phase| *phase == self.phase).unwrap_or(0) as u32);
        [self.start.to_bits(), self.periods].into_iter().for_each(|value| out.double(value));
        out.word(self.counts.len() as u32);
        let counts = self.counts.iter().flat_map(|counts| [counts.cycles, counts.missed]);
        counts.for_each(|count| out.double(count));
        out.words(&self.values);
        match &self.machine {
            None => out.word(FRESH),
            Some(SavedMachine::Program(machine)) => {
                out.word(PROGRAM);
                write_machine(&mut out, machine);
            }
            Some(SavedMachine::System(system)) => {
                out.word(SYSTEM);
                write_system(&mut out, system)?;
            }
        }
        let checksum = crc32fast::hash(&out.0);
        out.word(checksum);
        Ok(out.0)
    }

    /// State from its bytes.
    ///
    /// # Errors
    /// If they are damaged, or belong to an FMU with another digest.
    pub(crate) fn from_bytes(bytes: &[u8], digest: u128, model: &Model) -> Result<SavedState, Mistake> {
        let damaged = Mistake::State("its bytes are damaged");
        let Some((body, checksum)) = bytes.split_last_chunk::<4>() else { return Err(damaged) };
        let Some(body) = body.strip_prefix(&MAGIC) else {
            return Err(Mistake::State("its bytes are no state of an FMU of this version"));
        };
        if crc32fast::hash(&bytes[..bytes.len() - 4]) != u32::from_le_bytes(*checksum) {
            return Err(damaged);
        }
        let Some((of, body)) = body.split_first_chunk::<16>() else { return Err(damaged) };
        if u128::from_le_bytes(*of) != digest {
            return Err(Mistake::State("it belongs to another FMU"));
        }
        let mut reader = Reader(body);
        match SavedState::parse(&mut reader, model) {
            Some(state) if reader.0.is_empty() => Ok(state),
            _ => Err(damaged),
        }
    }

    fn parse(reader: &mut Reader<'_>, model: &Model) -> Option<SavedState> {
        let phase = *PHASES.get(reader.word()? as usize)?;
        let (start, periods) = (f64::from_bits(reader.double()?), reader.double()?);
        let cores = reader.word()? as usize;
        if cores > MAX_CORES {
            return None;
        }
        let mut counts = || Some(Counts { cycles: reader.double()?, missed: reader.double()? });
        let counts = (0..cores).map(|_| counts()).collect::<Option<_>>()?;
        let values = reader.words()?;
        let machine = match (reader.word()?, &model.application) {
            (FRESH, _) => None,
            (PROGRAM, Application::Program(_)) => Some(SavedMachine::Program(parse_machine(reader)?)),
            (SYSTEM, Application::System(description)) => {
                let cores = description.cores.iter().map(|_| parse_machine(reader));
                let cores = cores.collect::<Option<_>>()?;
                let transit = serde_json::from_slice(reader.bytes()?).ok()?;
                let system = System::resume(description, &WaitingSystem { cores, transit }).ok()??;
                Some(SavedMachine::System(Box::new(system)))
            }
            _ => return None,
        };
        // The machine has run from the end of the initialisation on.
        let is_fresh = matches!(phase, Phase::Instantiated | Phase::Initialising);
        (is_fresh == machine.is_none()).then_some(SavedState {
            phase,
            start,
            periods,
            counts,
            values,
            machine,
        })
    }
}

/// Kinds of a machine's state in a serialised state.
const FRESH: u32 = 0;
const PROGRAM: u32 = 1;
const SYSTEM: u32 = 2;

fn write_machine(out: &mut Writer, machine: &WaitingState) {
    out.word(machine.at.get());
    out.word(u32::from(machine.flags.bits()));
    let registers = machine.registers.iter();
    out.words(&registers.flat_map(|(register, &bits)| [u32::from(register.get()), bits]).collect::<Vec<_>>());
    out.words(&machine.memory);
    out.words(&machine.stack.iter().map(|address| address.get()).collect::<Vec<_>>());
    let loops = machine.loops.iter();
    let loops = loops.flat_map(|&(start, end, left)| [start.get(), end.get(), u32::from(left)]);
    out.words(&loops.collect::<Vec<_>>());
    out.words(&machine.turns);
}

fn write_system(out: &mut Writer, system: &System) -> Result<(), Mistake> {
    let WaitingSystem { cores, transit } = system.waiting_state().map_err(|core| {
        let name = &system.description().cores[core].name;
        Mistake::Call(format!(
            "the state has no bytes while core `{name}` is within a period, or has halted: serialise it after another step"
        ))
    })?;
    cores.iter().for_each(|core| write_machine(out, core));
    let text = serde_json::to_vec(&transit).map_err(|error| Mistake::Call(error.to_string()))?;
    out.bytes(&text);
    Ok(())
}

fn parse_machine(reader: &mut Reader<'_>) -> Option<WaitingState> {
    let at = BundleAddress::new(reader.word()?);
    let flags = Flags::from_bits(u8::try_from(reader.word()?).ok()?);
    let pair = |pair: &[u32]| Some((Register::new(pair[0] as usize)?, pair[1]));
    let registers = reader.words()?;
    let registers: BTreeMap<Register, u32> = registers.chunks_exact(2).map(pair).collect::<Option<_>>()?;
    let memory = reader.words()?;
    let stack = reader.words()?.into_iter().map(BundleAddress::new).collect();
    let one = |one: &[u32]| {
        Some((BundleAddress::new(one[0]), BundleAddress::new(one[1]), u16::try_from(one[2]).ok()?))
    };
    let loops = reader.words()?.chunks_exact(3).map(one).collect::<Option<_>>()?;
    let turns = reader.words()?;
    Some(WaitingState { at, registers, memory, flags, stack, loops, turns })
}

struct Writer(Vec<u8>);

impl Writer {
    fn word(&mut self, word: u32) {
        self.0.extend(word.to_le_bytes());
    }

    fn double(&mut self, double: u64) {
        self.0.extend(double.to_le_bytes());
    }

    /// Number of bytes, then the bytes.
    fn bytes(&mut self, bytes: &[u8]) {
        self.word(bytes.len() as u32);
        self.0.extend(bytes);
    }

    /// Number of words, then the words.
    fn words(&mut self, words: &[u32]) {
        self.word(words.len() as u32);
        words.iter().for_each(|&word| self.word(word));
    }
}

struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn word(&mut self) -> Option<u32> {
        let (word, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(u32::from_le_bytes(*word))
    }

    fn double(&mut self) -> Option<u64> {
        let (double, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(u64::from_le_bytes(*double))
    }

    fn bytes(&mut self) -> Option<&[u8]> {
        let count = self.word()? as usize;
        let bytes = self.0.get(..count)?;
        self.0 = &self.0[count..];
        Some(bytes)
    }

    fn words(&mut self) -> Option<Vec<u32>> {
        let count = self.word()? as usize;
        // Before any allocation.
        let bytes = self.0.get(..count.checked_mul(4)?)?;
        self.0 = &self.0[bytes.len()..];
        let words =
            bytes.chunks_exact(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]));
        Some(words.collect())
    }
}

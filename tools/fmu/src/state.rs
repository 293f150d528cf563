// SPDX-License-Identifier: MIT OR Apache-2.0
//! States of an instance, and their bytes. Reading trusts nothing.

use crate::instance::{Instance, Mistake, Phase};
use std::collections::BTreeMap;
use takt_emu::WaitingState;
use takt_isa::fp::Flags;
use takt_isa::{BundleAddress, Register};

/// First bytes of a serialised state: the format and its version.
const MAGIC: [u8; 8] = *b"TAKTFMU\x01";
/// Phases with a state, each with its number in a serialised state.
const PHASES: [Phase; 4] = [Phase::Instantiated, Phase::Initialising, Phase::Stepping, Phase::Terminated];

/// State of an instance.
#[derive(Clone, Debug, PartialEq)]
pub struct SavedState {
    phase: Phase,
    start: f64,
    periods: u64,
    missed: u64,
    values: Vec<u32>,
    /// State of the machine; `None` before its first cycle.
    machine: Option<WaitingState>,
}

impl SavedState {
    pub(crate) fn of(instance: &Instance) -> Result<SavedState, Mistake> {
        let is_fresh = matches!(instance.phase, Phase::Instantiated | Phase::Initialising);
        let machine = instance.emulator.waiting_state();
        if !is_fresh && machine.is_none() || instance.phase == Phase::Failed {
            return Err(Mistake::Phase { call: "saving a state", phase: "after the program has stopped" });
        }
        Ok(SavedState {
            phase: instance.phase,
            start: instance.start,
            periods: instance.periods,
            missed: instance.missed,
            values: instance.values.clone(),
            machine: machine.filter(|_| !is_fresh),
        })
    }

    pub(crate) fn restore(&self, instance: &mut Instance) -> Result<(), Mistake> {
        if self.values.len() != instance.values.len() {
            return Err(Mistake::State("it has other variables"));
        }
        match &self.machine {
            None => instance.emulator.reset(),
            Some(machine) if instance.emulator.resume(machine) => {}
            Some(_) => return Err(Mistake::State("the program has no such state")),
        }
        instance.phase = self.phase;
        instance.start = self.start;
        instance.periods = self.periods;
        instance.missed = self.missed;
        instance.values.clone_from(&self.values);
        instance.send_inputs();
        Ok(())
    }

    /// Bytes of the state, for an FMU with this digest.
    pub(crate) fn to_bytes(&self, digest: u128) -> Vec<u8> {
        let mut out = Writer(MAGIC.to_vec());
        out.0.extend(digest.to_le_bytes());
        out.word(PHASES.iter().position(|phase| *phase == self.phase).unwrap_or(0) as u32);
        [self.start.to_bits(), self.periods, self.missed].into_iter().for_each(|value| out.double(value));
        out.words(&self.values);
        out.word(u32::from(self.machine.is_some()));
        if let Some(machine) = &self.machine {
            out.word(machine.at.get());
            out.word(u32::from(machine.flags.bits()));
            let registers = machine.registers.iter();
            out.words(
                &registers
                    .flat_map(|(register, &bits)| [u32::from(register.get()), bits])
                    .collect::<Vec<_>>(),
            );
            out.words(&machine.memory);
            out.words(&machine.stack.iter().map(|address| address.get()).collect::<Vec<_>>());
            let loops = machine.loops.iter();
            let loops = loops.flat_map(|&(start, end, left)| [start.get(), end.get(), u32::from(left)]);
            out.words(&loops.collect::<Vec<_>>());
            out.words(&machine.turns);
        }
        let checksum = crc32fast::hash(&out.0);
        out.word(checksum);
        out.0
    }

    /// State from its bytes.
    ///
    /// # Errors
    /// If they are damaged, or belong to an FMU with another digest.
    pub(crate) fn from_bytes(bytes: &[u8], digest: u128) -> Result<SavedState, Mistake> {
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
        match SavedState::parse(&mut reader) {
            Some(state) if reader.0.is_empty() => Ok(state),
            _ => Err(damaged),
        }
    }

    fn parse(reader: &mut Reader<'_>) -> Option<SavedState> {
        let phase = *PHASES.get(reader.word()? as usize)?;
        let (start, periods, missed) = (f64::from_bits(reader.double()?), reader.double()?, reader.double()?);
        let values = reader.words()?;
        let machine = match reader.word()? {
            0 => None,
            1 => Some(Self::parse_machine(reader)?),
            _ => return None,
        };
        // The machine has run from the end of the initialisation on.
        let is_fresh = matches!(phase, Phase::Instantiated | Phase::Initialising);
        (is_fresh == machine.is_none()).then_some(SavedState {
            phase,
            start,
            periods,
            missed,
            values,
            machine,
        })
    }

    fn parse_machine(reader: &mut Reader<'_>) -> Option<WaitingState> {
        let at = BundleAddress::new(reader.word()?);
        let flags = Flags::from_bits(u8::try_from(reader.word()?).ok()?);
        let pair = |pair: &[u32]| Some((Register::new(pair[0] as usize)?, pair[1]));
        let registers = reader.words()?;
        let registers: BTreeMap<Register, u32> =
            registers.chunks_exact(2).map(pair).collect::<Option<_>>()?;
        let memory = reader.words()?;
        let stack = reader.words()?.into_iter().map(BundleAddress::new).collect();
        let one = |one: &[u32]| {
            Some((BundleAddress::new(one[0]), BundleAddress::new(one[1]), u16::try_from(one[2]).ok()?))
        };
        let loops = reader.words()?.chunks_exact(3).map(one).collect::<Option<_>>()?;
        let turns = reader.words()?;
        Some(WaitingState { at, registers, memory, flags, stack, loops, turns })
    }
}

struct Writer(Vec<u8>);

impl Writer {
    fn word(&mut self, word: u32) {
        self.0.extend(word.to_le_bytes());
    }

    fn double(&mut self, double: u64) {
        self.0.extend(double.to_le_bytes());
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

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Shadow: an emulator in step with a remote machine, and their comparison.

use super::extent::Extent;
use super::{Activity, State};
use crate::value;
use std::fmt::Write as _;
use takt_emu::{Emulator, Fault, FaultKind, MachineState, PeriodError};
use takt_isa::program::Port;
use takt_isa::timing::Cycle;
use takt_isa::{Program, Register, Type};

/// Cycle limit of a period on the emulator, far above any realistic period.
const PERIOD: Cycle = 1 << 26;

/// Event that stopped the emulator.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum End {
    Halted,
    Fault(Fault),
}

impl From<PeriodError> for End {
    fn from(error: PeriodError) -> End {
        match error {
            PeriodError::Fault(fault) => End::Fault(fault),
            // `Port` cannot occur: ports are not set by name.
            PeriodError::Halted | PeriodError::Port(_) => End::Halted,
        }
    }
}

pub(super) struct Shadow {
    emulator: Emulator,
    /// The emulator's state was copied from the machine, and so has no return stack.
    placed: bool,
}

impl Shadow {
    /// A shadow that starts from the machine's state.
    pub(super) fn placed(base: &Emulator, seen: &MachineState) -> Shadow {
        let mut emulator = base.clone();
        emulator.restore(seen);
        Shadow { emulator, placed: true }
    }

    /// A shadow that has run from reset to the first `wait`, and the event that stopped it, if any.
    pub(super) fn started(base: &Emulator, inputs: &[(Register, u32)]) -> (Shadow, Option<End>) {
        let mut shadow = Shadow { emulator: base.clone(), placed: false };
        shadow.set(inputs);
        let ran = shadow.emulator.run_to_wait().map_err(End::Fault);
        let end = match ran {
            Ok(takt_emu::Stop::Halted) => Some(End::Halted),
            Ok(_) => None,
            Err(end) => Some(end),
        };
        (shadow, end)
    }

    fn set(&mut self, inputs: &[(Register, u32)]) {
        for (port, bits) in inputs {
            // Cannot fail: the ports belong to the program.
            let _ = self.emulator.set_input_bits(*port, *bits);
        }
        self.emulator.set_cycle_limit(self.emulator.now() + PERIOD);
    }

    /// Runs one period; returns the event that stopped it, if any.
    pub(super) fn period(&mut self, inputs: &[(Register, u32)]) -> Option<End> {
        self.set(inputs);
        self.emulator.run_period(&[]).err().map(End::from)
    }

    /// Value of a register after all writebacks; `None` if it has never been written.
    pub(super) fn register(&self, register: Register) -> Option<u32> {
        let in_flight = self.emulator.in_flight().find(|retire| retire.register == Some(register));
        in_flight.map(|retire| retire.value).or_else(|| self.emulator.register(register))
    }

    /// Difference in the outcome of the period, in words.
    pub(super) fn ended(&self, state: &State, end: Option<&End>, program: &Program) -> Option<String> {
        let board = match (&state.activity, end) {
            (Activity::Held, None) | (Activity::Halted, Some(End::Halted)) => return None,
            (Activity::Faulted(address, _), Some(End::Fault(fault))) if fault.address == *address => {
                return None;
            }
            (Activity::Faulted(address, reason), _) => {
                format!("the board stops with a fault in {}: {reason}", program.bundle_text(*address))
            }
            (Activity::Halted, _) => format!("the board halts in {}", program.bundle_text(state.issued)),
            _ => "the board waits".to_owned(),
        };
        Some(match end {
            None => format!("{board}; the emulator waits"),
            Some(End::Halted) => format!("{board}; the emulator halts"),
            Some(End::Fault(fault)) => {
                let unknown = match fault.kind {
                    FaultKind::StackUnderflow if self.placed => {
                        " (the return stack of a board that was running is not known to it; `goto start` starts both)"
                    }
                    _ => "",
                };
                format!("{board}; the emulator: {}{unknown}", fault.show(program))
            }
        })
    }

    /// First difference at an output port. Ports that were never written are not compared.
    pub(super) fn outputs(
        &self,
        outputs: &[u32],
        inputs: &[(Register, u32)],
        program: &Program,
    ) -> Option<String> {
        let expected = |port: &Port| self.emulator.output_bits(port.register);
        let mut pairs = program.outputs.iter().zip(outputs);
        let (port, bits) = pairs.find(|(port, bits)| expected(port).is_some_and(|other| other != **bits))?;
        let mut text = format!("output port `{}` {}", port.name, both(port.ty, *bits, expected(port)?));
        for (i, (register, bits)) in inputs.iter().enumerate() {
            let input = program.host_registers().find(|port| port.register == *register)?;
            let before = if i == 0 { "; inputs: " } else { ", " };
            let _ = write!(text, "{before}{} = {}", input.name, value::text(input.ty, *bits));
        }
        Some(text)
    }

    /// First difference in a register or data word that the program writes.
    pub(super) fn values(&self, seen: &MachineState, extent: &Extent, program: &Program) -> Option<String> {
        let memory = self.emulator.memory();
        first(
            seen,
            program,
            &extent.written,
            |register| self.register(register),
            &extent.written_words,
            memory,
        )
    }
}

/// First register or data word that the program does not write and that differs from its loaded value.
pub(super) fn loaded(base: &Emulator, seen: &MachineState, extent: &Extent) -> Option<String> {
    let registers = extent.registers.iter().copied();
    let registers: Vec<Register> =
        registers.filter(|register| extent.written.binary_search(register).is_err()).collect();
    let words = extent.words.iter().copied();
    let words: Vec<u32> = words.filter(|word| extent.written_words.binary_search(word).is_err()).collect();
    let loaded = |register| base.register(register);
    let text = first(seen, base.program(), &registers, loaded, &words, base.memory())?;
    Some(format!("{text}, and the program does not write it"))
}

/// First of these registers and data words that differs from the emulator's.
fn first(
    seen: &MachineState,
    program: &Program,
    registers: &[Register],
    expected: impl Fn(Register) -> Option<u32>,
    words: &[u32],
    memory: &[u32],
) -> Option<String> {
    for &register in registers {
        let (Some(&bits), Some(other)) = (seen.registers.get(&register), expected(register)) else {
            continue;
        };
        if bits != other {
            let (name, ty) = register_name(program, register);
            return Some(format!("{name} {}", both(ty, bits, other)));
        }
    }
    let pair = |word: u32| Some((*seen.memory.get(word as usize)?, *memory.get(word as usize)?));
    let differs = |word: &u32| pair(*word).is_some_and(|(bits, other)| bits != other);
    let word = words.iter().copied().find(differs)?;
    let (bits, other) = pair(word)?;
    Some(format!("{} {}", program.data_text(word), both(Type::F, bits, other)))
}

fn both(ty: Type, bits: u32, other: u32) -> String {
    format!("is {} on the board, {} in the emulator", value::text(ty, bits), value::text(ty, other))
}

/// Name, place and type of a register.
fn register_name(program: &Program, register: Register) -> (String, Type) {
    let mut named = program.named_registers();
    let place = program.machine.register_name(register).unwrap_or_default();
    match named.find(|port| port.register == register) {
        Some(port) => (format!("`{}` (register {place})", port.name), port.ty),
        None => (format!("register {place}"), Type::F),
    }
}

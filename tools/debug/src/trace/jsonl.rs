// SPDX-License-Identifier: MIT OR Apache-2.0
//! Retire log as JSON lines: one object per completed operation and per event of a period.

use super::signal::{Signal, Source};
use super::{CompletedCycle, Writer};
use crate::value;
use serde::Serialize;
use serde_json::Value;
use std::io::{self, Write};
use takt_emu::{Event, Retire};
use takt_isa::timing::Cycle;
use takt_isa::{BundleAddress, Program, Register, Type};

pub(super) struct JsonLines<'w> {
    target: Box<dyn Write + 'w>,
    /// Registers whose writes are logged; empty for all.
    registers: Vec<Register>,
    /// Also log operations that write no register.
    rest: bool,
}

impl<'w> JsonLines<'w> {
    pub(super) fn new(program: &Program, signals: Vec<Signal>, target: Box<dyn Write + 'w>) -> JsonLines<'w> {
        let named: Vec<Register> = signals
            .iter()
            .filter_map(|signal| match signal.source {
                Source::Register(register) => Some(register),
                _ => None,
            })
            .collect();
        let ports = program.named_registers().count();
        // If all named registers are selected, also log unnamed registers.
        let rest = named.len() == ports;
        JsonLines { target, registers: if rest { Vec::new() } else { named }, rest }
    }

    fn retire(&self, program: &Program, retire: &Retire) -> Option<LogLine> {
        let wanted = retire.register.is_some_and(|register| self.registers.contains(&register));
        if !self.rest && !wanted {
            return None;
        }
        let row = retire.op.row();
        let machine = program.machine;
        Some(LogLine {
            issued: Some(retire.issued),
            bundle: Some(retire.address),
            slot: Some(machine.slot(retire.slot).name),
            op: Some(row.mnemonic),
            source: program.operation_place(retire.address, retire.slot),
            register: retire.register.map(|register| program.register_text(register)),
            bits: (retire.register.is_some() || retire.memory.is_some())
                .then(|| format!("0x{:08x}", retire.value)),
            value: retire.register.and_then(|_| match row.result_type() {
                Type::B => None,
                ty => Some(value::json(ty, retire.value)),
            }),
            memory: retire.memory,
            flags: (!retire.flags.is_empty()).then(|| retire.flags.to_string()),
            ..LogLine::of(retire.cycle, "retire")
        })
    }
}

/// A line of the log, with keys in order; keys that do not apply are omitted.
#[derive(Default, Serialize)]
struct LogLine {
    cycle: Cycle,
    event: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    issued: Option<Cycle>,
    #[serde(skip_serializing_if = "Option::is_none")]
    bundle: Option<BundleAddress>,
    #[serde(skip_serializing_if = "Option::is_none")]
    slot: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    op: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    source: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    register: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    bits: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    value: Option<Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    memory: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    flags: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    text: Option<String>,
}

impl LogLine {
    fn of(cycle: Cycle, event: &'static str) -> LogLine {
        LogLine { cycle, event, ..LogLine::default() }
    }
}

impl Writer for JsonLines<'_> {
    fn cycle(&mut self, _: Cycle, passed: CompletedCycle<'_>) -> io::Result<()> {
        // Systems are traced as waveforms only.
        let CompletedCycle::Core(record, emulator) = passed else { return Ok(()) };
        let program = emulator.program();
        for event in &record.events {
            let line = match event {
                Event::Retire(retire) => self.retire(program, retire),
                Event::Issue { .. } | Event::PortWrite(_) => None,
                Event::Tick { cycle } => Some(LogLine::of(*cycle, "tick")),
                Event::DeadlineMissed { cycle } => Some(LogLine::of(*cycle, "missed")),
                Event::TickLost { cycle } => Some(LogLine::of(*cycle, "lost")),
                Event::Publish { cycle, address } => {
                    Some(LogLine { bundle: Some(*address), ..LogLine::of(*cycle, "publish") })
                }
                Event::Wait { cycle, address } => {
                    Some(LogLine { bundle: Some(*address), ..LogLine::of(*cycle, "wait") })
                }
                Event::Halt { cycle, address } => {
                    Some(LogLine { bundle: Some(*address), ..LogLine::of(*cycle, "halt") })
                }
                Event::Fault(fault) => Some(LogLine {
                    bundle: Some(fault.address),
                    text: Some(fault.show(program).to_string()),
                    ..LogLine::of(fault.cycle, "fault")
                }),
            };
            if let Some(line) = line {
                serde_json::to_writer(&mut self.target, &line)?;
                self.target.write_all(b"\n")?;
            }
        }
        Ok(())
    }

    fn finish(mut self: Box<Self>, _: Cycle) -> io::Result<()> {
        self.target.flush()
    }
}

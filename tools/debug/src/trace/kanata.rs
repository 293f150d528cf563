// SPDX-License-Identifier: MIT OR Apache-2.0
//! Writer of Kanata 0004, the log format of the pipeline viewer Konata. Each operation is a row, with these stages:
//!
//! | stage | cycles |
//! |---|---|
//! | `Fr` `Op` `De` `Un` `Dr` `Wp` | while the bundle waits: front end, operand, destination, unit, drain, write port |
//! | `Is` | issue |
//! | `Ex` | between issue and writeback |
//! | `Wb` | writeback |
//!
//! Arrows lead from an operation to those that wait for its result or receive it by forwarding.

use super::{CompletedCycle, Writer};
use std::collections::{BTreeMap, HashMap};
use std::fmt::Write as _;
use std::io::{self, Write};
use takt_emu::{Emulator, Event};
use takt_isa::timing::{Cause, Cycle};
use takt_isa::{BundleAddress, Function, Instruction, Program, Register, SlotIndex};

/// Names of the stall stages, in the order of [`Cause::KINDS`]. (A bundle that waits for the tick has already issued.)
const WAITING: [&str; 7] = ["Fr", "Op", "De", "Un", "Dr", "Wp", "Ti"];

pub(super) struct Kanata<'w> {
    target: Box<dyn Write + 'w>,
    /// Cycle up to which the file has been written.
    at: Cycle,
    /// Lines queued for later cycles.
    ahead: BTreeMap<Cycle, String>,
    next_id: u64,
    retired: u64,
    /// Bundle that waits to issue: rows with their slots, and the current stage with its first cycle.
    front: Option<Front>,
    /// Last writer of each register: row, and cycle of the writeback.
    writers: HashMap<Register, (u64, Cycle)>,
}

struct Front {
    address: BundleAddress,
    rows: Vec<(u64, SlotIndex, Option<Instruction>)>,
    stage: &'static str,
    since: Cycle,
}

impl<'w> Kanata<'w> {
    pub(super) fn new(emulator: &Emulator, mut target: Box<dyn Write + 'w>) -> io::Result<Kanata<'w>> {
        let at = emulator.now();
        writeln!(target, "Kanata\t0004\nC=\t{at}")?;
        Ok(Kanata {
            target,
            at,
            ahead: BTreeMap::new(),
            next_id: 0,
            retired: 0,
            front: None,
            writers: HashMap::new(),
        })
    }

    /// Queues a line for a cycle.
    fn line(&mut self, cycle: Cycle, line: std::fmt::Arguments<'_>) {
        // Writing to a String cannot fail.
        let _ = writeln!(self.ahead.entry(cycle).or_default(), "{line}");
    }

    /// Writes all lines of cycles before `cycle`.
    fn flush_before(&mut self, cycle: Cycle) -> io::Result<()> {
        while let Some(entry) = self.ahead.first_entry().filter(|entry| *entry.key() < cycle) {
            let (next, lines) = entry.remove_entry();
            if next > self.at {
                writeln!(self.target, "C\t{}", next - self.at)?;
                self.at = next;
            }
            self.target.write_all(lines.as_bytes())?;
        }
        Ok(())
    }

    /// Begins the rows of a bundle that waits to issue, starting in `cycle`.
    fn enter(
        &mut self,
        program: &Program,
        address: BundleAddress,
        cycle: Cycle,
        stage: &'static str,
    ) -> Front {
        let machine = program.machine;
        let instructions = match program.bundle(address) {
            Some(Ok(instructions)) => instructions,
            _ => Vec::new(),
        };
        let mut operations: Vec<(SlotIndex, Option<Instruction>)> = SlotIndex::all()
            .zip(instructions)
            .filter(|(_, instruction)| instruction.op.row().function != Function::Idle)
            .map(|(slot, instruction)| (slot, Some(instruction)))
            .collect();
        if operations.is_empty() {
            operations.push((SlotIndex::FIRST, None));
        }
        let label = match program.nearest_label(address) {
            Some((label, 0)) => format!("{label}: "),
            _ => String::new(),
        };
        let mut rows = Vec::new();
        for (slot, instruction) in operations {
            let id = self.next_id;
            self.next_id += 1;
            let operation = |instruction: &Instruction| program.operation_text(slot, instruction);
            let text = instruction.as_ref().map_or("nop".to_owned(), operation);
            self.line(cycle, format_args!("I\t{id}\t{id}\t0"));
            self.line(
                cycle,
                format_args!("L\t{id}\t0\t{address} {}: {label}{text}", machine.slot(slot).name),
            );
            if let Some(place) = program.operation_place(address, slot) {
                self.line(cycle, format_args!("L\t{id}\t1\t{place}"));
            }
            self.line(cycle, format_args!("S\t{id}\t0\t{stage}"));
            rows.push((id, slot, instruction));
        }
        Front { address, rows, stage, since: cycle }
    }

    fn issue(&mut self, program: &Program, front: Front, cycle: Cycle) {
        for (id, slot, instruction) in &front.rows {
            let slot = program.machine.slot(*slot);
            let reads = instruction.as_ref().map_or(&[][..], Instruction::reads);
            for register in reads {
                if let Some(&(producer, ready)) = self.writers.get(register)
                    && ready >= front.since
                {
                    self.line(cycle, format_args!("W\t{id}\t{producer}\t0"));
                }
            }
            let unit = instruction.as_ref().and_then(|instruction| slot.unit(instruction.op.row().function));
            let dest = instruction.as_ref().and_then(|instruction| instruction.writes(slot));
            let latency = unit.filter(|_| dest.is_some()).map_or(0, |unit| unit.latency);
            let writeback = cycle + Cycle::from(latency);
            let mut stage = "Is";
            if latency > 1 {
                self.line(cycle + 1, format_args!("E\t{id}\t0\t{stage}\nS\t{id}\t0\tEx"));
                stage = "Ex";
            }
            if latency > 0 {
                self.line(writeback, format_args!("E\t{id}\t0\t{stage}\nS\t{id}\t0\tWb"));
                stage = "Wb";
            }
            let retired = self.retired;
            self.retired += 1;
            self.line(writeback + 1, format_args!("E\t{id}\t0\t{stage}\nR\t{id}\t{retired}\t0"));
        }
        for (id, slot, instruction) in front.rows {
            let slot = program.machine.slot(slot);
            let Some(instruction) = instruction else { continue };
            if let (Some(dest), Some(unit)) =
                (instruction.writes(slot), slot.unit(instruction.op.row().function))
            {
                self.writers.insert(dest, (id, cycle + Cycle::from(unit.latency)));
            }
        }
    }
}

impl Writer for Kanata<'_> {
    fn cycle(&mut self, cycle: Cycle, passed: CompletedCycle<'_>) -> io::Result<()> {
        // Systems are traced as waveforms only.
        let CompletedCycle::Core(record, emulator) = passed else { return Ok(()) };
        let program = emulator.program();
        let stage = match (record.issued, record.stall) {
            (Some(address), _) => Some((address, "Is")),
            (None, Some((address, cause))) if cause != Cause::Wait => Some((address, WAITING[cause.kind()])),
            _ => None,
        };
        if let Some((address, stage)) = stage {
            let front = match self.front.take() {
                Some(mut front) if front.address == address => {
                    if front.stage != stage {
                        for (id, ..) in &front.rows {
                            let ended = front.stage;
                            self.line(cycle, format_args!("E\t{id}\t0\t{ended}\nS\t{id}\t0\t{stage}"));
                        }
                        front.stage = stage;
                    }
                    front
                }
                _ => self.enter(program, address, cycle, stage),
            };
            if record.issued.is_some() {
                self.issue(program, front, cycle);
            } else {
                self.front = Some(front);
            }
        }
        // A bundle that never issues is logged as flushed.
        if record.events.iter().any(|event| matches!(event, Event::Fault(_)))
            && let Some(front) = self.front.take()
        {
            for (id, ..) in front.rows {
                let stage = front.stage;
                self.line(cycle, format_args!("E\t{id}\t0\t{stage}\nR\t{id}\t0\t1"));
            }
        }
        self.flush_before(cycle)
    }

    fn finish(mut self: Box<Self>, _: Cycle) -> io::Result<()> {
        self.flush_before(Cycle::MAX)?;
        self.target.flush()
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Picture of the machine: what its slots, units and banks do at the debugger's position.

use crate::Playground;
use serde_json::{Value, json};
use takt_emu::Status;
use takt_isa::program::{Space, Symbol};
use takt_isa::timing::Cycle;
use takt_isa::{BundleAddress, Effect, Instruction, Machine, Register, SlotIndex};

/// Index of a register's bank in the order of [`Machine::banks`].
fn bank(machine: &Machine, register: Register) -> Option<usize> {
    machine.banks().position(|bank| bank.contains(register))
}

impl Playground {
    /// The program's machine as its row in the specification, and the activity in the cycle in which the next bundle issues if nothing
    /// delays it: its operations with the operands that they read, from a bank or forwarded, and the operations in flight with their
    /// stages (from 0, the cycle of issue).
    pub(crate) fn activity(&mut self) -> Result<Value, String> {
        let console = self.console.as_mut().ok_or("there is no program to step through")?;
        let session = console.session_mut();
        let (address, issue) = session.next_issue();
        let (cycle, stall) = (session.cycle(), session.stall());
        let session = &*session;
        let program = session.program();
        let machine = program.machine;
        let issue = issue.unwrap_or(cycle);
        let is_written_in = |register: Register, at: Cycle| {
            let mut results = session.emulator().in_flight();
            results.any(|retire| retire.register == Some(register) && retire.cycle == at)
        };
        let bundle = program.bundle(address).and_then(Result::ok).unwrap_or_default();
        let operation = |(slot, instruction): (SlotIndex, &Instruction)| {
            let row = machine.slot(slot);
            let unit = row.unit_index(instruction.op.row().function)?;
            let reads = instruction.reads().iter().map(|register| {
                json!({
                    "bank": bank(machine, *register), "text": program.register_text(*register),
                    "forwarded": is_written_in(*register, issue),
                })
            });
            Some(json!({
                "unit": unit, "text": program.operation_text(slot, instruction), "reads": reads.collect::<Vec<_>>(),
                "writes": instruction.writes(row).map(|register| program.register_text(register)),
            }))
        };
        let operations: Vec<Option<Value>> = SlotIndex::all().zip(&bundle).map(operation).collect();
        let flight = session.emulator().in_flight().filter(|retire| retire.cycle >= cycle).map(|retire| {
            let name = retire.register.map(|register| program.register_text(register));
            json!({
                "slot": retire.slot, "unit": machine.slot(retire.slot).unit_index(retire.op.row().function),
                "stage": cycle.saturating_sub(retire.issued), "left": retire.cycle - cycle,
                "bank": retire.register.and_then(|register| bank(machine, register)), "writes": name,
                "text": format!("{} {}", retire.op.row().mnemonic, name.as_deref().unwrap_or_default()).trim(),
            })
        });
        Ok(json!({
            "machine": machine, "address": address, "cycle": cycle, "place": program.bundle_text(address),
            "waits": matches!(session.emulator().status(), Status::Waiting { .. }),
            "cause": stall.map(|cause| program.cause_text(cause)),
            "operations": operations, "flight": flight.collect::<Vec<_>>(),
        }))
    }

    /// The addresses of what runs once, from the first to behind the last, and of the bundles that publish; every bundle of the program with
    /// the labels before it, and of each operation slot, unit, text and place in the source.
    pub(crate) fn bundles(&self) -> Result<Value, String> {
        let program = &self.loaded()?.assembled.program;
        let bundle = |address| {
            let bundle = program.bundle(address).and_then(Result::ok).unwrap_or_default();
            let operation = |(slot, instruction): (SlotIndex, &Instruction)| {
                let unit = program.machine.slot(slot).unit(instruction.op.row().function)?;
                Some(json!({
                    "unit": unit.name, "text": program.operation_text(slot, instruction),
                    "place": program.operation_place(address, slot),
                }))
            };
            let is_here = |symbol: &&Symbol| symbol.space == Space::Code && symbol.address == address.get();
            let labels = program.symbols.iter().filter(is_here).map(|symbol| &symbol.name);
            json!({
                "address": address, "labels": labels.collect::<Vec<_>>(),
                "operations": SlotIndex::all().zip(&bundle).map(operation).collect::<Vec<_>>(),
            })
        };
        let slots = program.machine.slots.iter().map(|slot| slot.name);
        let once = program.sections.iter().find(|section| section.name == "once");
        let publishes = |address: &BundleAddress| {
            let bundle = program.bundle(*address).and_then(Result::ok).unwrap_or_default();
            bundle.iter().any(|one| one.op.row().effect == Effect::Publish)
        };
        Ok(json!({
            "slots": slots.collect::<Vec<_>>(), "once": once.map(|section| [section.start, section.end]),
            "published": program.addresses().filter(publishes).collect::<Vec<_>>(), "bundles": program.addresses().map(bundle).collect::<Vec<_>>(),
        }))
    }
}

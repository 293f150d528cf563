// SPDX-License-Identifier: MIT OR Apache-2.0
//! Generator of the source operands: copies of the register banks, forwarding, hazard detection (rule 2).

use super::ecc;
use crate::plan::names::net;
use crate::plan::{ControlBit, Plan, SlotPlan, Stage};
use crate::verilog::{Expr, Instance, Module, concat, decimal, gated, no};
use takt_isa::Effect;

pub(super) fn write(plan: &Plan, m: &mut Module) {
    m.banner("operands: banks, forwarding, hazards");
    m.comment(
        "Rule 2 (read after write): a bundle stalls while a register that it reads is pending. Each source has its own copy of every \
         bank, forwards results that the copies do not have yet from the buses, and reports a stall for the bundle in read (_r_waits) and \
         for the one in issue (_i_waits).",
    );
    m.blank();
    m.regs([net::STICKY]);
    m.wires([net::STICKY_NOW]);
    for (number, (slot, operand)) in plan.sources().enumerate() {
        m.blank();
        source(plan, slot, operand, number as u32, m);
    }
}

/// Generates one operand of a slot; `number` counts the sources of all slots.
fn source(plan: &Plan, slot: &SlotPlan, operand: usize, number: u32, m: &mut Module) {
    // The first operand's register also takes an immediate or the status register.
    let constant = match operand {
        0 if slot.has_effect(Effect::Immediate) => slot.immediate(Stage::Read).into(),
        _ => decimal(32, 0_u32),
    };
    let reads_flags = ControlBit::Effect(Effect::ReadFlags);
    let (reads_status, status) = match operand {
        0 if slot.has(reads_flags) => {
            let reads = slot.bit(Stage::Issue, reads_flags);
            let flags = gated(3, reads.clone(), net::STICKY_NOW);
            (reads, concat([decimal(2, 0_u32), flags, decimal(27, 0_u32)]))
        }
        _ => (no(), decimal(32, 0_u32)),
    };
    m.wires([slot.operand(operand)]);
    m.wires([Stage::Read, Stage::Issue].map(|stage| slot.source_waits(stage, operand)));
    let source = Instance::new("takt_source", slot.source(operand))
        .parameter("SLOTS", plan.slots.len() as u32)
        .parameter("DEPTH", plan.depth)
        .parameter("LATE", plan.late)
        .parameter("INDEX", plan.index)
        .parameter_as("LATCHED", &net::LATCHED)
        .parameter("INPUTS", plan.input_bits)
        .same([net::CLK, net::ADVANCE])
        .port("m_bank", slot.source_bank(Stage::Match, operand))
        .port("m_index", slot.source_index(Stage::Match, operand))
        .port("m_place", plan.place(Stage::Match).at(number))
        .same([plan.in_flight(), plan.in_flight_index(), plan.writes(), plan.late(), plan.late_index()])
        .same(
            [Stage::Read, Stage::Issue]
                .into_iter()
                .flat_map(|stage| [plan.writes_at(stage), plan.early_at(stage), plan.dest_at(stage)]),
        )
        .same([plan.result(), plan.was_result()])
        .port("input_write", net::INPUT1)
        .port("input_write_place", net::INPUT1_PLACE)
        .port("input_now", net::INPUT1_NOW)
        .port("input_write_index", plan.input1_index())
        .port("input_write_value", net::INPUT1_VALUE)
        .port("input_next_value", net::INPUT2_VALUE)
        .port("r_constant", constant)
        .port("i_reads_status", reads_status)
        .port("i_status", status)
        .port("r_waits", slot.source_waits(Stage::Read, operand))
        .port("i_waits", slot.source_waits(Stage::Issue, operand))
        .port("operand", slot.operand(operand));
    // What error correction alone needs. The scrubber takes words of the first sources' copies.
    let [copies, sound, wrong] = [slot.copies(operand), slot.sound(operand), slot.source_wrong(operand)];
    let source = if plan.ecc {
        let copies = if (number as usize) < ecc::REPAIRING { copies } else { m.discarded(&copies) };
        m.wires([wrong.clone()]);
        let source = source.parameter("ECC", 1).same([net::SCRUBS]).port("copies", copies);
        let source = source.port("scrub_index", plan.scrub_address().low(plan.index));
        source.port("sound", sound).port("wrong", wrong)
    } else {
        let source = source.port("scrubs", no()).port("scrub_index", decimal(plan.index, 0_u32));
        let [copies, sound, wrong] = [&copies, &sound, &wrong].map(|net| m.discarded(net));
        source.port("copies", copies).port("sound", sound).port("wrong", wrong)
    };
    m.instance(source);
}

/// Stall signals of all sources, for the bundle in a stage.
pub(super) fn waits(plan: &Plan, stage: Stage) -> Vec<Expr> {
    plan.sources().map(|(slot, operand)| slot.source_waits(stage, operand).into()).collect()
}

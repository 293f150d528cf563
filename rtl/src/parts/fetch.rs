// SPDX-License-Identifier: MIT OR Apache-2.0
//! Generator of the fetch and decode stages: program memories and decoders.

use crate::plan::names::{LETTERS, net};
use crate::plan::{Plan, SlotPlan, Stage};
use crate::verilog::{Expr, Instance, Module, decimal, set, when};
use takt_isa::Effect;

pub(super) fn write(plan: &Plan, m: &mut Module) {
    m.banner("fetch and decode");
    m.comment(format!("Row: code_depth {}; a memory and a decoder for each slot.", plan.machine.code_depth));
    m.blank();
    m.wires([net::ADVANCE, net::ISSUE, net::FLUSH, net::BLOCK, net::REFUSED, net::M_VALID, net::F_OUTSIDE]);
    m.wires([plan.fetch()]);
    m.reg(net::D_OUTSIDE, "its address is beyond the program memory");
    m.clocked(vec![when(net::ADVANCE, vec![set(net::D_OUTSIDE, net::F_OUTSIDE)])]);
    for slot in &plan.slots {
        m.blank();
        memory(plan, slot, m);
        decoder(plan, slot, m);
    }
}

fn memory(plan: &Plan, slot: &SlotPlan, m: &mut Module) {
    let loads = net::LOADS
        & Expr::from(net::LOADS_SPACE).is(decimal(2, 0_u32))
        & Expr::from(net::LOADS_SLOT).is(decimal(3, slot.number));
    let memory = |module: &str| {
        Instance::new(module, slot.program())
            .parameter("DEPTH", plan.machine.code_depth)
            .parameter("ADDRESS", plan.code_bits)
            .parameter("LOW", slot.slot.low_zeros())
            .port("clk", net::CLK)
            .port("write", loads)
            .port("write_address", net::LOADS_ADDRESS.low(plan.code_bits))
            .port("write_word", net::LOADS_VALUE)
            .port("read", net::FLUSH | net::ADVANCE)
            .port("read_address", plan.fetch())
    };
    if plan.ecc {
        m.wires([slot.word()]);
        m.wires([
            slot.word_one_wrong(),
            slot.word_two_wrong(),
            slot.scrub_one_wrong(),
            slot.scrub_two_wrong(),
        ]);
        m.instance(
            memory("takt_ecc_program")
                .same([net::ADVANCE])
                .port("word", slot.word())
                .port("one_wrong", slot.word_one_wrong())
                .port("two_wrong", slot.word_two_wrong())
                .port("scrub_address", plan.scrub_address().low(plan.code_bits))
                .port("scrubbed", slot.scrubbed())
                .port("scrub_one_wrong", slot.scrub_one_wrong())
                .port("scrub_two_wrong", slot.scrub_two_wrong()),
        );
        return;
    }
    m.wires([slot.fetched()]);
    m.regs([slot.word()]);
    m.instance(memory("takt_program").port("word", slot.fetched()));
    m.clocked(vec![when(net::ADVANCE, vec![set(slot.word(), slot.fetched())])]);
}

fn decoder(plan: &Plan, slot: &SlotPlan, m: &mut Module) {
    let stage = Stage::Decode;
    m.wires([slot.control(stage)]);
    m.wires([slot.illegal(stage)]);
    m.wires([slot.dest(stage)]);
    let mut decoder = Instance::new(plan.decoder(slot), slot.decode()).port("word", slot.word());
    for (operand, letter) in LETTERS.iter().enumerate().take(slot.sources) {
        m.wires([slot.source_bank(stage, operand)]);
        m.wires([slot.source_index(stage, operand)]);
        decoder = decoder
            .port(format!("{letter}_bank"), slot.source_bank(stage, operand))
            .port(format!("{letter}_index"), slot.source_index(stage, operand));
    }
    if slot.constant_bits() > 0 {
        m.wires([slot.constant(stage)]);
        decoder = decoder.port("constant", slot.constant(stage));
    }
    if slot.has_effect(Effect::Immediate) {
        m.wires([slot.immediate(stage)]);
        decoder = decoder.port("immediate", slot.immediate(stage));
    }
    m.instance(
        decoder
            .port("dest", slot.dest(stage))
            .port("control", slot.control(stage))
            .port("illegal", slot.illegal(stage)),
    );
}

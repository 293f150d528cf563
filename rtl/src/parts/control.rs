// SPDX-License-Identifier: MIT OR Apache-2.0
//! Generator of the pipeline registers that carry a bundle's control bits from decode to issue.

use crate::plan::names::net;
use crate::plan::{ControlBit, Plan, SlotPlan, Stage};
use crate::verilog::{Expr, Instance, Module, any, choose, concat, decimal, no, number, set, when};
use takt_isa::Effect;

/// Declares the positions of the control bits as parameters.
pub(super) fn parameters(plan: &Plan, m: &mut Module) {
    m.banner("control bits of each slot, from its decoder");
    m.comment(
        "unit_<name>: the operation goes to this unit; result_<latency>: it writes a register, with this latency; code: the unit's own \
         operation code, from the header of its file; the others: effects in the table of instructions.",
    );
    m.blank();
    for slot in &plan.slots {
        for control in &slot.controls {
            m.parameter(slot.parameter(control.bit), control.low);
        }
    }
}

pub(super) fn write(plan: &Plan, m: &mut Module) {
    m.banner("from decode to issue");
    m.comment("Pipeline registers, which move with advance. Stages: d_ decode, m_ match, r_ read, i_ issue.");
    m.blank();
    places(plan, m);
    for slot in &plan.slots {
        m.blank();
        stages(slot, m);
    }
}

/// Selects the buffer of each source that reads a latched input port.
fn places(plan: &Plan, m: &mut Module) {
    let (bits, [decode, matched]) =
        (plan.input_bits, [Stage::Decode, Stage::Match].map(|stage| plan.place(stage)));
    let indices: Vec<_> =
        plan.sources().map(|(slot, operand)| slot.source_index(Stage::Decode, operand).low(bits)).collect();
    m.comment(
        "docs/timing.md, latched ports: a double buffer for each port, swapped at the end of a period.",
    );
    m.wires([net::INPUTS_OPEN, net::INPUTS_TAKEN, net::INPUT1_PLACE]);
    m.wires([decode.clone()]);
    m.instance(
        Instance::new("takt_double_buffer", "inputs")
            .parameter_as("PORTS", &net::LATCHED)
            .parameter("INDEX", bits)
            .parameter("WRITES", 1)
            .parameter("READS", decode.width())
            .same([net::CLK])
            .port("flip", net::INPUTS_TAKEN | net::RST)
            .port("open", net::INPUTS_OPEN | net::RST)
            .port("drop", no())
            .port("write", net::INPUT1)
            .port("write_index", plan.input1_index().low(bits))
            .port("write_place", net::INPUT1_PLACE)
            .port("read_index", concat(indices))
            .port("read_place", decode.clone()),
    );
    let direct = Expr::from(&net::LATCHED).is(number(0));
    m.define(net::INPUT1_NOW, net::INPUT1 & (direct | net::INPUTS_OPEN | net::RST));
    m.regs([matched.clone()]);
    m.clocked(vec![when(net::ADVANCE, vec![set(matched, decode)])]);
}

fn stages(slot: &SlotPlan, m: &mut Module) {
    use Stage::{Decode, Issue, Match, Read};
    let constant = slot.constant_bits() > 0;
    let address = slot.address_bits() > 0;
    let immediate = slot.has_effect(Effect::Immediate);
    m.regs([Match, Read, Issue].map(|stage| slot.control(stage)));
    m.regs([Match, Read, Issue].map(|stage| slot.illegal(stage)));
    m.regs([Match, Read, Issue].map(|stage| slot.dest(stage)));
    for operand in 0..slot.sources {
        m.regs([slot.source_bank(Match, operand)]);
        m.regs([slot.source_index(Match, operand)]);
    }
    if constant {
        m.regs([slot.constant(Match)]);
    }
    if address {
        m.regs([Read, Issue].map(|stage| slot.constant(stage)));
    }
    if immediate {
        m.regs([slot.immediate(Match)]);
        m.regs([slot.immediate(Read)]);
    }
    let mut body = vec![
        set(slot.control(Match), slot.control(Decode)),
        set(slot.illegal(Match), slot.illegal(Decode) | net::D_OUTSIDE),
        set(slot.dest(Match), slot.dest(Decode)),
    ];
    for operand in 0..slot.sources {
        body.push(set(slot.source_bank(Match, operand), slot.source_bank(Decode, operand)));
        body.push(set(slot.source_index(Match, operand), slot.source_index(Decode, operand)));
    }
    let nothing = decimal(slot.width(), 0_u32);
    body.extend([
        set(slot.control(Read), choose(net::M_VALID, slot.control(Match), nothing))
            .remark("a bubble has no control bit set"),
        set(slot.control(Issue), slot.control(Read)),
        set(slot.illegal(Read), slot.illegal(Match)),
        set(slot.illegal(Issue), slot.illegal(Read)),
        set(slot.dest(Read), slot.dest(Match)),
        set(slot.dest(Issue), slot.dest(Read)),
    ]);
    if constant {
        body.push(set(slot.constant(Match), slot.constant(Decode)));
    }
    if address {
        body.extend([
            set(slot.constant(Read), slot.constant(Match).low(slot.constant(Read).width())),
            set(slot.constant(Issue), slot.constant(Read)),
        ]);
    }
    if immediate {
        body.extend([
            set(slot.immediate(Match), slot.immediate(Decode)),
            set(
                slot.immediate(Read),
                choose(slot.immediate(Match), slot.constant(Match), decimal(32, 0_u32)),
            ),
        ]);
    }
    m.clocked(vec![when(net::ADVANCE, body)]);
    for stage in [Match, Read, Issue] {
        let results = slot.latencies.iter().map(|&latency| slot.bit(stage, ControlBit::Result(latency)));
        m.define(slot.writes_at(stage), any(results));
    }
    for stage in [Read, Issue] {
        m.define(slot.early_at(stage), slot.bit(stage, ControlBit::Result(2)));
    }
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Generator of the execute stage: sequencer, data memory, units.

use crate::circuit::Circuit;
use crate::plan::names::{LETTERS, net};
use crate::plan::{ControlBit, Plan, SlotPlan, Stage};
use crate::verilog::{Expr, Instance, Module, any, choose, concat, decimal, gated, set};
use takt_isa::{Effect, Field, Function};

pub(super) fn write(plan: &Plan, m: &mut Module) {
    m.banner("execute: the sequencer and the data memory");
    let machine = plan.machine;
    m.comment(format!(
        "docs/timing.md, Branches, wait and tick, Faults. Row: refill {}, resolve {}, stack_depth {}, loop_depth {}; data_depth {}; the sequencer is in \
         slot `{}`, the data memory in {}.",
        machine.refill,
        machine.resolve,
        machine.stack_depth,
        machine.loop_depth,
        machine.data_depth,
        plan.control().name(),
        plan.memory().map(|slot| format!("slot `{}`", slot.name())).collect::<Vec<_>>().join(" and ")
    ));
    m.blank();
    m.wires([net::X_ISSUED]);
    m.wires([net::X_ADDRESS]);
    m.wires([plan.x_address_fault()]);
    sequencer(plan, m);
    m.blank();
    memory(plan, m);

    m.banner("units");
    m.comment(
        "At most one unit drives its slot's bus in a cycle (rule 6); the bus is the OR of all results, those of idle units being 0: \
         most units clear them, whose registers' reset costs no logic; the others have a gate. An \
         operation that issues in cycle c is on its unit's inputs in c + 1, and its result is on the bus in c + latency.",
    );
    m.blank();
    m.regs([net::LOADED_VALUE]);
    m.clocked(vec![set(net::LOADED_VALUE, net::LOADS_VALUE.low(32))]);
    for slot in &plan.slots {
        m.blank();
        units(plan, slot, m);
    }
}

fn sequencer(plan: &Plan, m: &mut Module) {
    let slot = plan.control();
    let mut sequencer = Instance::new("takt_sequencer", "sequencer")
        .parameter("PROGRAM", plan.code_bits)
        .parameter("STACK", plan.machine.stack_depth)
        .parameter("LOOPS", plan.machine.loop_depth)
        .parameter("REFILL", plan.machine.refill)
        .parameter("RESOLVE", plan.machine.resolve)
        .parameter("SLOT", plan.control_slot as u32)
        .parameter("SLOTS", plan.slots.len() as u32)
        .same([net::CLK, net::RST, net::ADVANCE, net::ISSUE, net::REFUSED, plan.i_illegal()]);
    for effect in [
        Effect::Jump,
        Effect::BranchZero,
        Effect::BranchNonzero,
        Effect::Call,
        Effect::Return,
        Effect::Loop,
        Effect::Publish,
        Effect::Wait,
        Effect::Halt,
    ] {
        let bit = ControlBit::Effect(effect);
        sequencer = sequencer.port(format!("{}_{bit}", Stage::Issue), slot.bit(Stage::Issue, bit));
    }
    m.instance(
        sequencer
            .port("r_target", slot.constant(Stage::Read))
            .port("i_target", slot.constant(Stage::Issue))
            .port("x_operand", slot.operand(0))
            .same([plan.x_address_fault()])
            .port("tick", net::TICKS)
            .same([net::FLUSH, plan.fetch(), net::F_OUTSIDE, net::BLOCK, net::I_ADDRESS])
            .same([net::X_ISSUED, net::X_ADDRESS, net::WAITING])
            .port("open", net::INPUTS_OPEN)
            .port("ends", net::INPUTS_TAKEN)
            .same([net::ENDED, net::PUBLISHED])
            .port("missed", net::TICK_MISSED)
            .port("lost", net::TICK_LOST)
            .same([net::DEADLINE_MISSED, net::HALTED, net::FAULT, net::FAULT_KIND, net::FAULT_SLOT])
            .same([net::FAULT_ADDRESS]),
    );
    m.regs([net::WAS_ISSUED]);
    m.regs([net::WAS_ADDRESS]);
    m.clocked(vec![set(net::WAS_ISSUED, net::X_ISSUED), set(net::WAS_ADDRESS, net::X_ADDRESS)]);
    m.assign(net::ISSUED, net::WAS_ISSUED & !net::FAULT);
    m.assign(net::ISSUED_ADDRESS, net::WAS_ADDRESS);
}

fn memory(plan: &Plan, m: &mut Module) {
    let issues = |slot: &SlotPlan, effect| {
        net::ISSUE & !net::FAULT & slot.bit(Stage::Issue, ControlBit::Effect(effect))
    };
    // Offset of a load or store. A store's high bits are in the field where other words have their destination (isa/src/shape.rs).
    let offset = |slot: &SlotPlan| {
        let (constant, low) = (slot.constant(Stage::Issue), Field::OffsetLow.bits().width);
        let of_load = constant.slice(Field::Offset.bits().width - 1, low);
        let high = if slot.has(ControlBit::Effect(Effect::Store)) {
            let is_store = slot.bit(Stage::Issue, ControlBit::Effect(Effect::Store));
            choose(is_store, slot.dest(Stage::Issue).low(Field::OffsetHigh.bits().width), of_load)
        } else {
            of_load
        };
        concat([constant.low(low), high])
    };
    let Some(storing) = plan.memory().next() else { return };
    m.regs([plan.x_load(), net::X_STORE]);
    m.regs([plan.x_offset()]);
    m.clocked(vec![
        set(plan.x_load(), concat(plan.memory().map(|slot| issues(slot, Effect::Load)).collect::<Vec<_>>())),
        set(net::X_STORE, issues(storing, Effect::Store)),
        set(plan.x_offset(), concat(plan.memory().map(offset).collect::<Vec<_>>())),
    ]);
    let unit = storing.slot.unit(Function::Load);
    m.wires([plan.load_valid(), plan.port_fault()]);
    m.wires([plan.load_result()]);
    m.wires([plan.memory_address()]);
    let memory = Instance::new("takt_memory", "memory")
        .parameter("LATENCY", unit.map_or(0, |unit| unit.latency))
        .parameter("DEPTH", plan.machine.data_depth)
        .parameter("ADDRESS", plan.data_bits)
        .parameter("PORTS", plan.ports())
        .same([net::CLK])
        .port("load_write", net::LOAD_DATA)
        .port("load_value", net::LOADS_VALUE.low(32))
        .same([plan.x_load(), net::X_STORE])
        .port("offset", plan.x_offset())
        .port("a", concat(plan.memory().map(|slot| slot.operand(0)).collect::<Vec<_>>()))
        .port("b", storing.operand(1))
        .port("cancel", net::FAULT)
        .port("fault", plan.port_fault())
        .port("out_valid", plan.load_valid())
        .port("result", plan.load_result())
        .port("address", plan.memory_address())
        .port("value", net::STORED_VALUE);
    let of_loader = net::LOADS_ADDRESS.low(plan.data_bits);
    if plan.ecc {
        m.wires([plan.data_one_wrong(), plan.data_two_wrong()]);
        m.wires([net::DATA_WRITES]);
        m.instance(
            memory
                .parameter("ECC", 1)
                .port("rst", net::RST | net::SCRUBS)
                .port(
                    "load_address",
                    choose(net::SCRUBS & !net::LOADS, plan.scrub_address().low(plan.data_bits), of_loader),
                )
                .port("write", net::DATA_WRITES)
                .port("one_wrong", plan.data_one_wrong())
                .port("two_wrong", plan.data_two_wrong())
                .port("corrected", net::DATA_CORRECTED),
        );
        m.assign(net::STORED, net::DATA_WRITES & !net::REPAIRED);
    } else {
        // What error correction alone needs.
        let [one_wrong, two_wrong, corrected] =
            [&plan.data_one_wrong(), &plan.data_two_wrong(), &net::DATA_CORRECTED]
                .map(|net| m.discarded(net));
        m.instance(
            memory
                .same([net::RST])
                .port("load_address", of_loader)
                .port("write", net::STORED)
                .port("one_wrong", one_wrong)
                .port("two_wrong", two_wrong)
                .port("corrected", corrected),
        );
    }
    m.unused(plan.load_unused(), plan.load_valid(), None);
    let at_fault =
        |slot: &SlotPlan| plan.port_of(slot).map_or(decimal(1, 0_u32), |port| plan.port_fault().at(port));
    m.assign(plan.x_address_fault(), plan.each(at_fault));
    let mut address = vec![Expr::from(plan.memory_address())];
    address.extend((plan.data_bits < 16).then(|| decimal(16 - plan.data_bits, 0_u32)));
    m.assign(net::STORED_ADDRESS, concat(address));
}

/// Generates a slot's units and its result bus, which one of them, the data memory or the loader drives.
fn units(plan: &Plan, slot: &SlotPlan, m: &mut Module) {
    let units: Vec<_> = slot.circuits.iter().map(|circuit| &circuit.unit).collect();
    let mut body = Vec::new();
    m.regs(units.iter().map(|unit| slot.unit_starts(unit)));
    for unit in &units {
        let goes = net::ISSUE & slot.bit(Stage::Issue, ControlBit::Unit(unit.name));
        body.push(set(slot.unit_starts(unit), goes));
    }
    if slot.has(ControlBit::Code) {
        m.regs([slot.code()]);
        let place = slot.parameter(ControlBit::Code);
        body.push(set(slot.code(), slot.control(Stage::Issue).part(place, slot.code_bits())));
    }
    if !body.is_empty() {
        m.clocked(body);
    }
    let (mut results, mut flags) = (Vec::new(), Vec::new());
    for circuit in &slot.circuits {
        let unit = &circuit.unit;
        m.comment(format!("Row: `{}`, latency {}, interval {}.", unit.name, unit.latency, unit.interval));
        m.wires([slot.unit_valid(unit)]);
        m.wires([slot.unit_result(unit)]);
        m.wires([slot.unit_flags(unit)]);
        m.instance(instance(slot, circuit));
        if circuit.clears {
            m.unused(slot.unit_unused(unit), slot.unit_valid(unit), None);
            results.push(slot.unit_result(unit).into());
            flags.push(slot.unit_flags(unit).into());
        } else {
            results.push(gated(32, slot.unit_valid(unit), slot.unit_result(unit)));
            flags.push(gated(3, slot.unit_valid(unit), slot.unit_flags(unit)));
        }
    }
    if let Some(port) = plan.port_of(slot) {
        results.push(plan.load_result().part(32 * port, 32));
    }
    results.push(gated(32, slot.loaded(), net::LOADED_VALUE));
    m.regs([slot.loaded()]);
    m.clocked(vec![set(slot.loaded(), slot.load())]);
    m.assign(slot.result(), any(results));
    m.assign(slot.flags(), if flags.is_empty() { decimal(3, 0_u32) } else { any(flags) });
}

fn instance(slot: &SlotPlan, circuit: &Circuit) -> Instance {
    let unit = &circuit.unit;
    let mut instance = Instance::new(unit.rtl, slot.unit(unit));
    for (name, value) in circuit.parameters() {
        instance = instance.parameter(name, value);
    }
    instance = instance.same([net::CLK]).port("in_valid", slot.unit_starts(unit));
    if circuit.op_bits > 0 {
        instance = instance.port("op", slot.code().low(circuit.op_bits));
    }
    for (operand, letter) in LETTERS.iter().enumerate().take(circuit.operands) {
        // A unit may have more operand ports than the slot's operations have sources.
        instance = if operand < slot.sources {
            instance.port(*letter, slot.operand(operand))
        } else {
            instance.port(*letter, decimal(32, 0_u32))
        };
    }
    instance
        .port("out_valid", slot.unit_valid(unit))
        .port("result", slot.unit_result(unit))
        .port("flags", slot.unit_flags(unit))
}

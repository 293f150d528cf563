// SPDX-License-Identifier: MIT OR Apache-2.0
//! Generator of the ports on which writebacks are visible from outside: output ports and, for verification, retire ports.

use crate::plan::names::net;
use crate::plan::{Plan, SlotPlan};
use crate::verilog::{Expr, Instance, Module, Net, concat, decimal};
use takt_isa::Bank;

/// A result is written back, not a word that the scrubber repairs.
fn program(plan: &Plan, slot: &SlotPlan) -> Expr {
    if plan.ecc { slot.writes() & !net::REPAIRED } else { slot.writes().into() }
}

pub(super) fn write(plan: &Plan, m: &mut Module) {
    m.banner("output and retire ports");
    m.comment(format!(
        "Row: outputs_per_bank {}: the last registers of each bank, recognised by ones in all bits of the index above the port's number.",
        plan.machine.outputs_per_bank
    ));
    m.blank();
    for slot in &plan.slots {
        let bank = slot.slot.bank;
        let log = bank.depth.trailing_zeros();
        let port = slot.in_flight_index().slice(log - 1, plan.port_bits).every_bit();
        m.assign(plan.output_write(&bank), program(plan, slot) & port);
        m.assign(plan.output_index(&bank), slot.in_flight_index().low(plan.port_bits));
        m.assign(plan.output_value(&bank), slot.result());
    }
    let of_banks = |of: &dyn Fn(&Plan, &Bank) -> Net| plan.each(|slot| of(plan, &slot.slot.bank));
    m.instance(
        Instance::new("takt_outputs", "outputs")
            .parameter_as("LATCHED", &net::LATCHED)
            .parameter("BANKS", plan.slots.len() as u32)
            .parameter("INDEX", plan.port_bits)
            .parameter_as("READ_DELAY", &net::READ_DELAY)
            .same([net::CLK, net::RST])
            .port("publish", net::PUBLISHED)
            .port("write", of_banks(&Plan::output_write))
            .port("index", of_banks(&Plan::output_index))
            .port("value", of_banks(&Plan::output_value))
            .port("number", plan.read_output())
            .port("shown", net::READ_VALUE),
    );
    m.assign(plan.retire(), plan.each(|slot| program(plan, slot) & !net::RST));
    m.assign(plan.retire_address(), plan.each(SlotPlan::retire_address));
    let register = |slot: &SlotPlan| {
        let index = concat([slot.in_flight_index().low(plan.index), decimal(10 - plan.index, 0_u32)]);
        decimal(10, slot.slot.bank.base) | index
    };
    m.assign(plan.retire_register(), plan.each(register));
    m.assign(plan.retire_value(), Expr::from(plan.result()));
    m.assign(plan.retire_flags(), plan.each(SlotPlan::flags));
}

// SPDX-License-Identifier: MIT OR Apache-2.0
//! Generator of the input registers: loader, input ports and tick are registered once before use.

use crate::plan::Plan;
use crate::plan::names::net;
use crate::verilog::{Expr, Module, choose, concat, decimal, set};

pub(super) fn write(plan: &Plan, m: &mut Module) {
    m.banner("loader and input ports");
    m.comment(format!(
        "Row: inputs `{}`, at {}: {} ports. Their bank is made as deep as the deepest one, {} registers, so that indices have one width.",
        plan.machine.inputs.name,
        plan.machine.inputs.base,
        plan.machine.inputs.depth,
        1 << plan.index
    ));
    m.blank();
    m.regs([net::LOADS]);
    m.regs([net::LOADS_SPACE]);
    m.regs([net::LOADS_SLOT]);
    m.regs([net::LOADS_ADDRESS]);
    m.regs([net::LOADS_VALUE]);
    m.regs([net::INPUT1]);
    m.regs([plan.input1_index()]);
    m.regs([net::INPUT1_VALUE, net::INPUT2_VALUE]);
    m.regs([net::TICKS]);
    // Index of an input port: the low bits of its address, because its bank is as deep as the deepest.
    let base = u32::from(plan.machine.inputs.base) & ((1 << plan.index) - 1);
    let missing = plan.index - plan.input_bits;
    let index = match missing {
        0 => Expr::from(plan.input_index()),
        _ => concat([plan.input_index().into(), decimal(missing, base >> plan.input_bits)]),
    };
    let (loads, [space, slot, address, value]) = if plan.ecc {
        let either = [
            (net::REPAIR_SPACE, net::LOAD_SPACE),
            (net::REPAIR_SLOT, net::LOAD_SLOT),
            (net::REPAIR_ADDRESS, net::LOAD_ADDRESS),
            (net::REPAIR_VALUE, net::LOAD_VALUE),
        ]
        .map(|(repair, input)| choose(net::REPAIRS, repair, input));
        (net::REPAIRS | (net::LOAD & net::RST), either)
    } else {
        let loader = [net::LOAD_SPACE, net::LOAD_SLOT, net::LOAD_ADDRESS, net::LOAD_VALUE];
        (net::LOAD & net::RST, loader.map(Expr::from))
    };
    m.clocked(vec![
        set(net::LOADS, loads),
        set(net::LOADS_SPACE, space),
        set(net::LOADS_SLOT, slot),
        set(net::LOADS_ADDRESS, address),
        set(net::LOADS_VALUE, value),
        set(net::INPUT1, net::INPUT_WRITE),
        set(plan.input1_index(), index),
        set(net::INPUT1_VALUE, net::INPUT_VALUE),
        set(net::INPUT2_VALUE, net::INPUT1_VALUE),
        set(net::TICKS, net::TICK & !net::RST),
    ]);
    let space = |space: u32| net::LOADS & Expr::from(net::LOADS_SPACE).is(decimal(2, space));
    m.define(net::LOAD_DATA, space(1));
    m.define(net::LOAD_REGISTER, space(2));
    for slot in &plan.slots {
        let bank = slot.slot.bank;
        let log = bank.depth.trailing_zeros();
        let within = net::LOADS_ADDRESS.slice(15, log).is(decimal(16 - log, bank.base >> log));
        // A repair is dropped if its write were in the cycle in which the first bundle after the tick reads.
        let writes = if plan.ecc {
            !(net::SCRUBS & net::TICK) & net::LOAD_REGISTER
        } else {
            net::LOAD_REGISTER.into()
        };
        m.define(slot.load(), writes & within);
    }
}

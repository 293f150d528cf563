// SPDX-License-Identifier: MIT OR Apache-2.0
//! Generator of the result buses and of the scoreboard's shift registers, which hold the register and the time of every result in flight.

use crate::plan::names::net;
use crate::plan::{ControlBit, LateUnit, Plan, SlotPlan, Stage};
use crate::verilog::{Expr, Instance, Module, Net, any, concat, decimal, gated, no, set};

pub(super) fn write(plan: &Plan, m: &mut Module) {
    m.banner("results in flight, and the buses");
    m.comment(
        "The scoreboard, which rules 2 to 6 check: a shift register for each slot has its results in flight, place j those with j cycles to \
         their writeback. Trackers of iterative units, whose results enter the last place, have those with more cycles.",
    );
    m.blank();
    m.wires([net::I_ADDRESS]);
    for slot in &plan.slots {
        m.blank();
        for late in &slot.late {
            late_unit(slot, late, m);
        }
        places(plan, slot, m);
    }
    m.blank();
    together(plan, m);
}

/// Generates the tracker of an iterative unit, whose latency exceeds the length of the slot's shift register.
fn late_unit(slot: &SlotPlan, late: &LateUnit, m: &mut Module) {
    m.comment(format!(
        "Row: `{}` in slot `{}`, latency {}, interval {}: {} cycles in the tracker, then in the slot's {} places.",
        late.unit.name,
        slot.name(),
        late.unit.latency,
        late.unit.interval,
        late.beyond,
        slot.depth
    ));
    m.wires([slot.late_at(late)]);
    m.wires([slot.late_in_flight(late), slot.late_last(late), slot.late_busy(late)]);
    m.wires([slot.late_index(late)]);
    m.wires([slot.late_address(late)]);
    m.unused(slot.late_unused(late), slot.late_at(late), Some("of which some bits are"));
    let starts = slot.bit(Stage::Issue, ControlBit::Unit(late.unit.name));
    m.instance(
        Instance::new("takt_long_latency", slot.late_instance(late))
            .parameter("LATENCY", late.unit.latency)
            .parameter("INTERVAL", late.unit.interval)
            .parameter("DEPTH", slot.depth)
            .parameter("INDEX", slot.dest(Stage::Issue).width())
            .same([net::CLK, net::RST])
            .port("cancel", net::FAULT)
            .port("insert", net::ISSUE & starts)
            .port("insert_index", slot.dest(Stage::Issue))
            .port("insert_address", net::I_ADDRESS)
            .port("at", slot.late_at(late))
            .port("in_flight", slot.late_in_flight(late))
            .port("index", slot.late_index(late))
            .port("address", slot.late_address(late))
            .port("last", slot.late_last(late))
            .port("busy", slot.late_busy(late)),
    );
}

/// Generates the shift register of a slot.
fn places(plan: &Plan, slot: &SlotPlan, m: &mut Module) {
    // At most one iterative unit's result enters the last place in a cycle, since they share the write port (rule 6).
    let select = |what: &dyn Fn(&LateUnit) -> Net, width: u32| match slot.late.as_slice() {
        [] => decimal(width, 0_u32),
        [one] => what(one).into(),
        several => any(several.iter().map(|late| gated(width, slot.late_last(late), what(late)))),
    };
    let index = slot.dest(Stage::Issue).width();
    let latencies: Vec<_> = slot.latencies.iter().map(u32::to_string).collect();
    m.comment(format!(
        "Row: slot `{}`, bank `{}`: results of latency {}; {} places.",
        slot.name(),
        slot.slot.bank.name,
        latencies.join(", "),
        slot.depth
    ));
    let insert = (1..=slot.depth).map(|latency| {
        let bit = ControlBit::Result(latency);
        if slot.has(bit) { net::ISSUE & slot.bit(Stage::Issue, bit) } else { no() }
    });
    m.wires([slot.in_flight()]);
    m.wires([slot.writes()]);
    m.wires([slot.in_flight_index()]);
    m.wires([slot.retire_address()]);
    m.instance(
        Instance::new("takt_in_flight", slot.results())
            .parameter("DEPTH", slot.depth)
            .parameter("INDEX", index)
            .same([net::CLK])
            .port("rst", if plan.ecc { net::RST | slot.load() } else { net::RST.into() })
            .port("cancel", net::FAULT)
            .port("load", slot.load())
            .port("load_index", net::LOADS_ADDRESS.low(index))
            .port("insert", concat(insert))
            .port("insert_index", slot.dest(Stage::Issue))
            .port("insert_address", net::I_ADDRESS)
            .port("late", any(slot.late.iter().map(|late| slot.late_last(late))))
            .port("late_index", select(&|late| slot.late_index(late), index))
            .port("late_address", select(&|late| slot.late_address(late), 16))
            .port("writes", slot.writes())
            .port("valid", slot.in_flight())
            .port("index", slot.in_flight_index())
            .port("address", slot.retire_address()),
    );
    m.wires([slot.result()]);
    m.regs([slot.was_result()]);
    m.clocked(vec![set(slot.was_result(), slot.result())]);
    m.wires([slot.flags()]);
}

/// Concatenates the state of all slots, for the comparisons of every source operand.
fn together(plan: &Plan, m: &mut Module) {
    m.comment(format!(
        "All slots together, slot 0 in the lowest bits, each padded to {} places.",
        plan.depth
    ));
    let padded = |net: fn(&SlotPlan) -> Net, width: u32| {
        let slots = plan.slots.iter().flat_map(move |slot| {
            let missing = (plan.depth - slot.depth) * width;
            let padding = (missing > 0).then(|| decimal(missing, 0_u32));
            [Some(Expr::from(net(slot))), padding].into_iter().flatten()
        });
        Expr::Concat(slots.collect::<Vec<_>>().into_iter().rev().collect())
    };
    m.define(plan.in_flight(), padded(SlotPlan::in_flight, 1));
    m.define(plan.in_flight_index(), padded(SlotPlan::in_flight_index, plan.index));
    let lates = |net: fn(&SlotPlan, &LateUnit) -> Net, width: u32| {
        let places = plan.slots.iter().flat_map(|slot| (0..plan.late as usize).map(move |k| (slot, k)));
        let all: Vec<Expr> = places
            .map(|(slot, k)| slot.late.get(k).map_or(decimal(width, 0_u32), |late| net(slot, late).into()))
            .collect();
        concat(all)
    };
    m.define(plan.late(), lates(SlotPlan::late_in_flight, 1));
    m.define(plan.late_index(), lates(SlotPlan::late_index, plan.index));
    for stage in [Stage::Read, Stage::Issue] {
        m.define(plan.writes_at(stage), plan.each(|slot| slot.writes_at(stage)));
        m.define(plan.early_at(stage), plan.each(|slot| slot.early_at(stage)));
        m.define(plan.dest_at(stage), plan.each(|slot| slot.dest(stage)));
    }
    m.define(plan.result(), plan.each(SlotPlan::result));
    m.define(plan.was_result(), plan.each(SlotPlan::was_result));
    m.define(plan.writes(), plan.each(SlotPlan::writes));
    m.define(net::NEW_FLAGS, any(plan.slots.iter().map(|slot| gated(3, slot.writes(), slot.flags()))));
}

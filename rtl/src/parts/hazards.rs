// SPDX-License-Identifier: MIT OR Apache-2.0
//! Generator of the remaining hazard detection (destinations, units, write ports, drain) and of the decision to issue.
//!
//! Each rule is evaluated one cycle ahead, to shorten the critical path, for both cases: for the bundle in read, in case it moves to issue,
//! and for the bundle in issue, in case it stays there.

use super::operands;
use crate::plan::names::net;
use crate::plan::{ControlBit, Plan, SlotPlan, Stage};
use crate::verilog::{Expr, Instance, Module, any};

pub(super) fn write(plan: &Plan, m: &mut Module) {
    m.banner("destinations");
    m.comment("Rule 3 (write after write): a bundle stalls while a register that it writes is pending.");
    for slot in &plan.slots {
        m.blank();
        destination(plan, slot, m);
    }
    m.banner("units, write ports, drain: stalls in the next cycle, for the bundle in read and for the one in issue");
    m.comment(
        "Rule 4 (structural), _busy: an iterative unit accepts no operation yet. Rule 6 (structural), _port: a result in flight has its \
         writeback in the same cycle as this one would. Rule 5, _drain: a result is in flight.",
    );
    m.blank();
    for slot in &plan.slots {
        for (stage, busy) in [Stage::Read, Stage::Issue].map(|stage| (stage, unit_busy(slot, stage))) {
            m.define(slot.unit_busy(stage), busy);
        }
        for stage in [Stage::Read, Stage::Issue] {
            m.define(slot.port_taken(stage), port_taken(slot, stage));
        }
    }
    drain(plan, m);
    issue(plan, m);
}

/// Rule 3 (write after write): detects hazards of a slot's destination.
fn destination(plan: &Plan, slot: &SlotPlan, m: &mut Module) {
    use Stage::{Issue, Match, Read};
    // Outputs of takt_hazard that only sources need, for forwarding.
    let unused = [
        ("r_copy", "copy"),
        ("r_past", "past"),
        ("r_taken", "taken"),
        ("i_taken", "i_taken"),
        ("next_now", "next"),
        ("next_past", "next_past"),
    ];
    let waits = [Read, Issue].map(|stage| slot.dest_waits(stage));
    m.wires(waits.into_iter().chain(unused.map(|(_, name)| slot.dest_unused(name))));
    let late = |net: crate::verilog::Net, width: u32| {
        let width = width * plan.late;
        net.slice((slot.number + 1) * width - 1, slot.number * width)
    };
    let mut hazard = Instance::new("takt_hazard", slot.dest_instance())
        .parameter("SLOTS", 1)
        .parameter("DEPTH", slot.depth)
        .parameter("LATE", plan.late)
        .parameter("INDEX", plan.index)
        .same([net::CLK, net::ADVANCE]);
    for stage in [Match, Read, Issue] {
        hazard = hazard
            .port(format!("{stage}_bank"), slot.writes_at(stage))
            .port(format!("{stage}_index"), slot.dest(stage));
    }
    hazard = hazard
        .port("in_flight", slot.in_flight())
        .port("in_flight_index", slot.in_flight_index())
        .port("late", late(plan.late(), 1))
        .port("late_index", late(plan.late_index(), plan.index));
    for stage in [Read, Issue] {
        hazard = hazard
            .port(format!("{stage}_writes"), slot.writes_at(stage))
            .port(format!("{stage}_early"), slot.early_at(stage))
            .port(format!("{stage}_dest"), slot.dest(stage));
    }
    hazard = hazard.port("r_waits", slot.dest_waits(Read)).port("i_waits", slot.dest_waits(Issue));
    for (port, name) in unused {
        hazard = hazard.port(port, slot.dest_unused(name));
    }
    m.instance(hazard);
}

/// Rule 4 (structural): the unit accepts no operation yet.
fn unit_busy(slot: &SlotPlan, stage: Stage) -> Expr {
    any(slot.late.iter().map(|late| {
        let uses = |stage| slot.bit(stage, ControlBit::Unit(late.unit.name));
        match stage {
            // The bundle in issue may occupy the unit first.
            Stage::Read => uses(stage) & (uses(Stage::Issue) | slot.late_busy(late)),
            _ => uses(stage) & slot.late_busy(late),
        }
    }))
}

/// Rule 6 (structural): the write port is booked for the same cycle.
fn port_taken(slot: &SlotPlan, stage: Stage) -> Expr {
    let taken = slot.latencies.iter().filter_map(|&latency| {
        let mut taken = slot.booked(latency + 1);
        let next = ControlBit::Result(latency + 1);
        if stage == Stage::Read && slot.has(next) {
            taken.push(slot.bit(Stage::Issue, next));
        }
        (!taken.is_empty()).then(|| slot.bit(stage, ControlBit::Result(latency)) & any(taken))
    });
    any(taken)
}

/// Rule 5 (drain): a result will still be in flight.
fn drain(plan: &Plan, m: &mut Module) {
    let pending = plan.slots.iter().flat_map(|slot| {
        let late = slot.late.iter().map(|late| Expr::from(slot.late_in_flight(late)));
        late.chain([slot.in_flight().slice(slot.depth - 1, 2).any_bit()])
    });
    m.define(net::PENDING, any(pending));
    let drains = |stage| {
        let slots = plan.slots.iter().filter(|slot| slot.has(ControlBit::Drains));
        any(slots.map(|slot| slot.bit(stage, ControlBit::Drains)))
    };
    let writes = Expr::from(plan.writes_at(Stage::Issue)).any_bit();
    m.define(net::R_DRAIN, drains(Stage::Read) & (net::PENDING | writes));
    m.define(net::I_DRAIN, drains(Stage::Issue) & net::PENDING);
}

/// Combines the rules and instantiates takt_issue, which decides whether a bundle issues and whether the stages advance.
fn issue(plan: &Plan, m: &mut Module) {
    m.comment("Rules 2, 3, 4, 6 and 5, in this order. takt_issue enforces rule 1: no bundle is in issue before it is delivered.");
    for (stage, ready, drain) in
        [(Stage::Read, net::R_READY, net::R_DRAIN), (Stage::Issue, net::I_READY, net::I_DRAIN)]
    {
        let mut waits = operands::waits(plan, stage);
        waits.extend(plan.slots.iter().map(|slot| slot.dest_waits(stage).into()));
        waits.extend(
            plan.slots.iter().flat_map(|slot| [slot.unit_busy(stage).into(), slot.port_taken(stage).into()]),
        );
        waits.push(drain.into());
        m.define(ready, !any(waits));
    }
    m.define(net::R_ILLEGAL, any(plan.slots.iter().map(|slot| slot.illegal(Stage::Read))));
    m.define(plan.i_illegal(), plan.each(|slot| slot.illegal(Stage::Issue)));
    m.instance(
        Instance::new("takt_issue", "issuing")
            .same([net::CLK, net::RST, net::FLUSH, net::BLOCK, net::R_READY, net::I_READY, net::R_ILLEGAL])
            .port("i_illegal", Expr::from(plan.i_illegal()).any_bit())
            .same([net::M_VALID, net::ISSUE, net::ADVANCE, net::REFUSED]),
    );
}

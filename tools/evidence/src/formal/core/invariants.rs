// SPDX-License-Identifier: MIT OR Apache-2.0
//! Invariants that join a core's registers to the reference of its rules ([`super::rules`]), so that the properties follow by induction
//! over one cycle.
//!
//! They say what each register of the core means in terms of the reference. All are proved together with the properties: each may assume
//! all of them in the cycle before.

use super::decoded::{Decoded, EFFECTS};
use super::rules::{
    Reference, STAGES, any, booked, busy, longest, pending, places, register, sure_register, taken,
};
use std::fmt::Write as _;
use takt_rtl::plan::names::net;
use takt_rtl::plan::{ControlBit, LateUnit, Plan, SlotPlan, Stage};

/// Adds the invariants to a reference.
pub(super) fn add(plan: &Plan, of: &mut Reference) {
    front_end(plan, of);
    for slot in &plan.slots {
        decoded(slot, of);
        flight(plan, slot, of);
        sure(plan, slot, of);
        for late in &slot.late {
            tracker(plan, slot, late, of);
        }
        if places(slot) > slot.depth {
            beyond(slot, of);
        }
    }
    for (slot, operand) in plan.sources() {
        source(plan, slot, operand, of);
        hazard(plan, Address::Source(slot, operand), of);
    }
    for slot in &plan.slots {
        hazard(plan, Address::Destination(slot), of);
    }
    waits(plan, of);
}

/// Net of the sequencer, of takt_issue.
pub(super) fn inner(of: &mut Reference, instance: &str, name: &str) -> String {
    of.seen(&format!("{instance}.{name}"), "")
}

/// Valid bits, flush and the branches under way, by the cycles until a bundle is delivered.
fn front_end(plan: &Plan, of: &mut Reference) {
    let valid = |of: &mut Reference, stage: &str| inner(of, "issuing", &format!("{stage}_valid"));
    let [f, d, m, r, i] = ["f", "d", "m", "r", "i"].map(|stage| valid(of, stage));
    let [zero, nonzero, wait, halt, refused, remembered] =
        ["x_if_zero", "x_if_nonzero", "x_wait", "x_halt", "x_refused", "remembered"]
            .map(|name| inner(of, "sequencer", name));
    let refill = plan.machine.refill;
    // Until the flush, any stage may be valid.
    let _ = writeln!(of.text, "    wire f_filled = f_runs & ~(f_squash & f_left >= 4'd{});", refill - 1);
    of.never(
        "f_left",
        &format!("f_runs & (f_left > 4'd{refill} | (~f_squash & f_left > 4'd{}))", plan.machine.resolve),
    );
    of.equal(
        "flush",
        "f_runs",
        &net::FLUSH.to_string(),
        &format!("f_squash & (f_left == 4'd{})", refill - 1),
    );
    // The stages fill one after the other, and the rest of the time all are valid.
    for (stage, at) in [(&f, 2), (&d, 3), (&m, 4), (&r, 5), (&i, 6)] {
        let filled = format!("~f_squash | (f_left <= 4'd{})", refill - at);
        of.equal("valid", "f_filled", stage, &filled);
    }
    of.equal("x_if_zero", "f_runs", &zero, &format!("f_if_zero | (f_squash & f_left == 4'd{refill})"));
    of.equal(
        "x_if_nonzero",
        "f_runs",
        &nonzero,
        &format!("f_if_nonzero | (f_squash & f_left == 4'd{refill})"),
    );
    let undecided = format!("~f_squash & f_left == 4'd{}", plan.machine.resolve);
    of.equal("a branch is under way", "f_runs", "f_if_zero | f_if_nonzero", &undecided);
    of.never("one kind of branch is under way", "f_runs & f_if_zero & f_if_nonzero");
    of.equal("advance", "f_runs", &net::ADVANCE.to_string(), &format!("~{i} | {}", net::ISSUE));
    of.equal("halted", "f_live", &format!("{halt} | {}", net::HALTED), "f_halted");
    of.equal("refused", "f_live", &refused, "f_refused & ~f_refuses");
    let waiting = format!("{} | ({wait} & ~{remembered})", net::WAITING);
    of.equal("waiting", "f_live", &waiting, "f_waiting");
    of.equal("remembered", "f_runs", &format!("{remembered} & ~{wait}"), "f_remembered");
    of.never(
        "a wait is under way",
        &format!("f_runs & {wait} & ({} | ~f_squash | f_left != 4'd{refill})", net::WAITING),
    );
    of.never("a tick is remembered while the machine waits", "f_runs & f_waiting & f_remembered");
    of.never("a fault stays", &format!("~{} & f_over & ~{}", net::RST, net::FAULT));
    of.never("nothing issues after a fault", &format!("~{} & f_over & {}", net::RST, net::ISSUE));
}

/// Condition: the stage has a bundle, and it is legal.
pub(super) fn has(of: &mut Reference, stage: Stage) -> String {
    let valid = inner(of, "issuing", &format!("{stage}_valid"));
    format!("{valid} & f_{stage}_legal")
}

/// Condition: a legal bundle is in read, and may come to issue: an illegal one there never leaves it.
pub(super) fn in_read(of: &mut Reference) -> String {
    let issue_valid = inner(of, "issuing", "i_valid");
    format!("f_filled & {} & (~{issue_valid} | f_i_legal)", has(of, Stage::Read))
}

/// The decoder's outputs, and the pipeline registers that follow them, are what the tables say.
fn decoded(slot: &SlotPlan, of: &mut Reference) {
    for stage in STAGES {
        let valid = inner(of, "issuing", &format!("{stage}_valid"));
        let own = Decoded { slot, stage };
        // A word from outside of the program memory is illegal.
        let illegal = format!("~{} | f_{stage}_outside", own.legal());
        of.equal("illegal", &format!("f_runs & {valid}"), &slot.illegal(stage).to_string(), &illegal);
        let when = format!("f_runs & {}", has(of, stage));
        for (number, &latency) in slot.latencies.iter().enumerate() {
            let bit = slot.bit(stage, ControlBit::Result(latency)).to_string();
            of.equal("result", &when, &bit, &format!("{}[{number}]", own.result()));
        }
        for circuit in &slot.circuits {
            let bit = slot.bit(stage, ControlBit::Unit(circuit.unit.name)).to_string();
            of.equal("unit", &when, &bit, &own.uses(&circuit.unit));
        }
        if slot.code_bits() > 0 {
            let code = format!(
                "{}[{} +: {}]",
                slot.control(stage),
                slot.parameter(ControlBit::Code),
                slot.code_bits()
            );
            of.equal("code", &when, &code, &own.code());
        }
        of.equal("drains", &when, &slot.bit(stage, ControlBit::Drains).to_string(), &own.drains());
        for effect in EFFECTS.into_iter().filter(|&effect| slot.has(ControlBit::Effect(effect))) {
            of.equal(
                "effect",
                &when,
                &slot.bit(stage, ControlBit::Effect(effect)).to_string(),
                &own.effect(effect),
            );
        }
        of.equal("destination", &when, &slot.dest(stage).to_string(), &own.dest());
        if slot.constant_bits() > 0 && stage == Stage::Match || slot.address_bits() > 0 {
            let bits = slot.constant(stage).width();
            of.equal(
                "constant",
                &when,
                &slot.constant(stage).to_string(),
                &format!("{}[{}:0]", own.word(), bits - 1),
            );
        }
    }
    // Bubbles have no control bit set.
    for (stage, from, to) in [(Stage::Read, 2, 3), (Stage::Issue, 1, 2)] {
        of.never(
            "bubble",
            &format!(
                "f_runs & f_squash & f_left >= 4'd{from} & f_left <= 4'd{to} & (|{})",
                slot.control(stage)
            ),
        );
    }
}

/// Results that no fault cancels any more are those of the shift register that issued three cycles ago or before.
fn sure(plan: &Plan, slot: &SlotPlan, of: &mut Reference) {
    let (name, rst, fault) = (slot.name(), net::RST, net::FAULT);
    let range = format!("[{}:0]", slot.depth - 1);
    let mut inner = |register: &str| of.seen(&format!("{}.{register}", slot.results()), &range);
    let (fresh, recent) = (inner("fresh"), inner("recent"));
    let (valid, index) = (slot.in_flight(), slot.in_flight_index());
    for place in 0..slot.depth.min(places(slot)) {
        let stays = format!("{valid}[{place}] & ~{fresh}[{place}] & ~{recent}[{place}]");
        let own = format!("{index}[{} +: {}]", place * plan.index, plan.index);
        of.equal("sure", &format!("~{rst}"), &stays, &format!("f_{name}_sure[{place}]"));
        of.equal(
            "sure",
            &format!("~{rst} & f_{name}_sure[{place}]"),
            &own,
            &sure_register(plan, slot, place),
        );
        for (vector, age) in [(&fresh, 1), (&recent, 2)] {
            let issued = slot.latencies.iter().position(|&latency| latency == place + age);
            let issued = issued.map_or("1'b0".to_owned(), |number| format!("f_{name}_new{age}[{number}]"));
            of.equal("fresh", &format!("~{rst} & ~{fault}"), &format!("{vector}[{place}]"), &issued);
            of.never("fresh", &format!("~{rst} & ~{fault} & {vector}[{place}] & ~{valid}[{place}]"));
            of.equal("fresh", &format!("~{rst} & ~{fault} & {issued}"), &own, &format!("f_{name}_dest{age}"));
        }
    }
    for place in places(slot)..slot.depth {
        of.never("no result", &format!("~{rst} & {valid}[{place}]"));
    }
    for place in 0..places(slot) {
        let new = slot.latencies.iter().position(|&latency| latency == place + 1);
        let new = new.map_or("1'b0".to_owned(), |number| format!("f_{name}_new1[{number}]"));
        let now = format!("f_{name}_sure_now[{place}]");
        of.equal("booked", "f_live", &booked(slot, place), &format!("{now} | {new}"));
        let own = format!("f_{name}_sure_register_now[{} +: {}]", place * plan.index, plan.index);
        of.equal("booked", &format!("f_live & {now}"), &register(plan, slot, place), &own);
        of.equal(
            "booked",
            &format!("f_live & {new}"),
            &register(plan, slot, place),
            &format!("f_{name}_dest1"),
        );
        of.never("booked", &format!("f_live & {now} & {new}"));
    }
}

/// The shift register of results in flight has the reference's places, the nearest ones; no register has two results in flight.
fn flight(plan: &Plan, slot: &SlotPlan, of: &mut Reference) {
    let (valid, index) = (slot.in_flight(), slot.in_flight_index());
    for place in 0..slot.depth {
        of.equal("place", "f_runs", &format!("{valid}[{place}]"), &booked(slot, place));
        if place < places(slot) {
            let own = format!("{index}[{} +: {}]", place * plan.index, plan.index);
            of.equal(
                "register",
                &format!("f_runs & {}", booked(slot, place)),
                &own,
                &register(plan, slot, place),
            );
        }
    }
    let depth = u32::from(slot.slot.bank.depth);
    for place in (0..places(slot)).filter(|_| depth < 1 << plan.index) {
        of.never(
            "register",
            &format!(
                "f_runs & {} & ({} >= {}'d{depth})",
                booked(slot, place),
                register(plan, slot, place),
                plan.index
            ),
        );
    }
    for low in 0..places(slot) {
        for high in low + 1..places(slot) {
            of.never(
                "one result for a register",
                &format!(
                    "f_runs & {} & {} & ({} == {})",
                    booked(slot, low),
                    booked(slot, high),
                    register(plan, slot, low),
                    register(plan, slot, high)
                ),
            );
        }
    }
}

/// Ages of a tracker.
fn ages(late: &LateUnit) -> u32 {
    late.beyond.max(late.unit.interval - 1)
}

/// Net: the age of a unit's operation, one-hot.
pub(super) fn age(slot: &SlotPlan, late: &LateUnit, of: &mut Reference) -> String {
    of.seen(&format!("{}.age", slot.late_instance(late)), &format!("[{}:1]", ages(late)))
}

/// A tracker has at most one operation, in the reference's place for its age.
fn tracker(plan: &Plan, slot: &SlotPlan, late: &LateUnit, of: &mut Reference) {
    let age = age(slot, late, of);
    let working = of.seen(&format!("{}.working", slot.late_instance(late)), "");
    let (latency, interval) = (late.unit.latency, late.unit.interval);
    of.never("one operation", &format!("f_runs & ({age} & ({age} - 1'b1)) != 0"));
    of.equal(
        "in flight",
        "f_runs",
        &slot.late_in_flight(late).to_string(),
        &format!("|{age}[{}:1]", late.beyond),
    );
    of.equal("working", "f_runs", &working, &format!("|{age}[{}:1]", interval - 1));
    let left = (1..interval).map(|k| format!("({{6{{{age}[{k}]}}}} & 6'd{})", interval - k));
    of.equal("busy", "f_runs", &any(left), &busy(slot, late));
    for k in 1..=late.beyond {
        let own = slot.late_index(late).to_string();
        if k >= 3 {
            of.equal(
                "sure",
                &format!("~{} & {age}[{k}]", net::RST),
                &own,
                &sure_register(plan, slot, latency - k),
            );
        } else {
            let name = slot.name();
            of.equal(
                "tracked",
                &format!("~{} & ~{} & {age}[{k}]", net::RST, net::FAULT),
                &own,
                &format!("f_{name}_dest{k}"),
            );
        }
        of.equal("tracked", &format!("f_runs & {age}[{k}]"), &own, &register(plan, slot, latency - k));
    }
}

/// The reference's places beyond the shift register are the trackers' operations, each that of one of them.
fn beyond(slot: &SlotPlan, of: &mut Reference) {
    for place in slot.depth..places(slot) {
        let tracked: Vec<String> = slot
            .late
            .iter()
            .filter(|late| late.unit.latency > place)
            .map(|late| format!("{}[{}]", age(slot, late, of), late.unit.latency - place))
            .collect();
        of.equal("beyond", "f_runs", &booked(slot, place), &any(tracked.clone()));
        let old = slot.late.iter().filter(|late| late.unit.latency >= place + 3);
        let old = any(old
            .map(|late| format!("{}[{}]", age(slot, late, of), late.unit.latency - place))
            .collect::<Vec<_>>());
        of.equal("sure", &format!("~{}", net::RST), &format!("f_{}_sure[{place}]", slot.name()), &old);
        for (number, first) in tracked.iter().enumerate() {
            for second in &tracked[number + 1..] {
                of.never("one tracker", &format!("f_runs & {first} & {second}"));
            }
        }
    }
}

/// Address that a takt_hazard looks after.
#[derive(Clone, Copy)]
enum Address<'p> {
    Source(&'p SlotPlan, usize),
    Destination(&'p SlotPlan),
}

impl Address<'_> {
    fn instance(self) -> String {
        match self {
            Address::Source(slot, operand) => format!("{}.hazard", slot.source(operand)),
            Address::Destination(slot) => slot.dest_instance(),
        }
    }

    /// Slots whose banks the address can be in.
    fn width(self, plan: &Plan) -> usize {
        match self {
            Address::Source(..) => plan.slots.len(),
            Address::Destination(_) => 1,
        }
    }

    /// Condition: a result for the address of the bundle in a stage is in flight, in one of the places that each slot has.
    fn flies(self, plan: &Plan, stage: Stage, places: impl Fn(&SlotPlan) -> Vec<u32>) -> String {
        match self {
            Address::Source(slot, operand) => pending(plan, &Decoded { slot, stage }, operand, places),
            Address::Destination(slot) => taken(plan, &Decoded { slot, stage }, places(slot)),
        }
    }

    /// Condition: a result for the address of the bundle in read is still to be computed by the bundle in issue, with one of the latencies.
    fn computed(self, plan: &Plan, of: &mut Reference, latencies: impl Fn(u32) -> bool) -> String {
        let valid = inner(of, "issuing", "i_valid");
        any(plan.slots.iter().map(|producer| {
            let issuing = Decoded { slot: producer, stage: Stage::Issue };
            let results = producer.latencies.iter().enumerate().filter(|(_, latency)| latencies(**latency));
            let writes = any(results.map(|(number, _)| format!("{}[{number}]", issuing.result())));
            let (bank, index) = match self {
                Address::Source(slot, operand) => {
                    let reading = Decoded { slot, stage: Stage::Read };
                    (format!("{}[{}]", reading.bank(operand), producer.number), reading.index(operand))
                }
                Address::Destination(slot) => {
                    let writing = Decoded { slot, stage: Stage::Read };
                    let is_own = slot.number == producer.number;
                    (if is_own { writing.writes() } else { "1'b0".to_owned() }, writing.dest())
                }
            };
            format!("({bank} & {valid} & {writes} & ({} == {index}))", issuing.dest())
        }))
    }
}

/// State of a takt_hazard: where in flight the result for its address is.
fn hazard(plan: &Plan, address: Address<'_>, of: &mut Reference) {
    let instance = address.instance();
    let range = format!("[{}:0]", address.width(plan) - 1);
    let wide = |of: &mut Reference, name: &str| of.seen(&format!("{instance}.{name}"), &range);
    let (near, far) = (wide(of, "r_near"), wide(of, "r_far"));
    let [from_issue, r_at1, r_at0, r_on_issue, early, late, i_later, i_at1] = [
        "r_from_issue",
        "r_at1",
        "r_at0",
        "r_on_issue",
        "r_on_issue_early",
        "r_on_issue_late",
        "i_later",
        "i_at1",
    ]
    .map(|name| inner(of, &instance, name));
    let read = in_read(of);
    let issue = format!("f_filled & {}", has(of, Stage::Issue));
    let from = |first: u32| move |slot: &SlotPlan| (first..places(slot)).collect::<Vec<_>>();
    let only = |place: u32| move |_: &SlotPlan| vec![place];
    of.equal(
        "r_later",
        &read,
        &format!("(|{near}) | (|{far}) | {from_issue}"),
        &address.flies(plan, Stage::Read, from(2)),
    );
    of.equal("r_at1", &read, &r_at1, &address.flies(plan, Stage::Read, only(1)));
    of.equal("r_at0", &read, &r_at0, &address.flies(plan, Stage::Read, only(0)));
    let all = address.computed(plan, of, |_| true);
    of.equal("r_on_issue", &read, &r_on_issue, &all);
    let soon = address.computed(plan, of, |latency| latency == 2);
    of.equal("r_on_issue_early", &read, &early, &soon);
    let later = address.computed(plan, of, |latency| latency != 2);
    of.equal("r_on_issue_late", &read, &late, &later);
    of.equal("i_later", &issue, &i_later, &address.flies(plan, Stage::Issue, from(2)));
    of.equal("i_at1", &issue, &i_at1, &address.flies(plan, Stage::Issue, only(1)));
}

/// Bank and index of a source in each stage.
fn source(plan: &Plan, slot: &SlotPlan, operand: usize, of: &mut Reference) {
    let instance = slot.source(operand);
    let (banks, last) = (plan.slots.len(), plan.index - 1);
    for stage in STAGES {
        let own = Decoded { slot, stage };
        let (bank, index) = match stage {
            Stage::Match => {
                (slot.source_bank(stage, operand).to_string(), slot.source_index(stage, operand).to_string())
            }
            _ => (
                of.seen(&format!("{instance}.{stage}_bank"), &format!("[{banks}:0]")),
                of.seen(&format!("{instance}.{stage}_index"), &format!("[{last}:0]")),
            ),
        };
        let when = format!("f_runs & {}", has(of, stage));
        of.equal("bank", &when, &bank, &own.bank(operand));
        of.equal("index", &when, &index, &own.index(operand));
    }
}

/// Results in flight and busy units are gone when as many cycles have passed since the last issue.
fn waits(plan: &Plan, of: &mut Reference) {
    for slot in &plan.slots {
        for place in 0..places(slot) {
            of.never(
                "quiet",
                &format!("f_runs & {} & (f_quiet > 6'd{})", booked(slot, place), places(slot) - 1 - place),
            );
        }
        for late in &slot.late {
            let u = busy(slot, late);
            of.never(
                "quiet",
                &format!(
                    "f_runs & ({u} != 6'd0) & ({{1'b0, f_quiet}} + {{1'b0, {u}}} > 7'd{})",
                    late.unit.interval - 1
                ),
            );
        }
    }
    of.never("f_waits", "f_runs & f_waits > f_quiet");
    of.never("f_waits", "f_runs & (f_waits != 6'd0) & ~f_i_legal");
    of.never("f_waits", &format!("f_runs & f_waits > 6'd{}", longest(plan)));
}

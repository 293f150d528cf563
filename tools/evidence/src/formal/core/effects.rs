// SPDX-License-Identifier: MIT OR Apache-2.0
//! Effects of a bundle that issues: its operations enter their units, its loads and stores the data memory, its results the ports, each in
//! its cycle, and nothing else does.

use super::decoded::{Decoded, EFFECTS};
use super::invariants::inner;
use super::memory::delivers;
use super::rules::{Reference, any, booked, register};
use std::fmt::Write as _;
use takt_isa::Effect;
use takt_rtl::plan::names::net;
use takt_rtl::plan::{Plan, SlotPlan, Stage};

/// Adds the properties to a reference.
pub(super) fn add(plan: &Plan, of: &mut Reference) {
    for slot in &plan.slots {
        units(slot, of);
        bus(plan, slot, of);
        outputs(plan, slot, of);
    }
    sequencer(plan, of);
}

fn issued(slot: &SlotPlan) -> Decoded<'_> {
    Decoded { slot, stage: Stage::Issue }
}

/// An operation enters its unit in the cycle after its issue.
fn units(slot: &SlotPlan, of: &mut Reference) {
    let (name, clk) = (slot.name(), net::CLK);
    for circuit in &slot.circuits {
        let own = format!("f_x_{name}_{}", circuit.unit.name);
        let _ = writeln!(
            of.text,
            "    reg {own};\n    always @(posedge {clk}) {own} <= f_issues & {};",
            issued(slot).uses(&circuit.unit)
        );
        let says = format!(
            "`{name}`: an operation enters `{}` in the cycle after its issue, and no other does",
            circuit.unit.name
        );
        of.promise(says, "f_live", &slot.unit_starts(&circuit.unit).to_string(), &own);
        if circuit.op_bits > 0 {
            let _ = writeln!(
                of.text,
                "    reg [{last}:0] {own}_code;\n    always @(posedge {clk}) {own}_code <= {}[{last}:0];",
                issued(slot).code(),
                last = circuit.op_bits - 1
            );
            let code = format!("{}[{}:0]", slot.code(), circuit.op_bits - 1);
            of.promise(
                format!("`{name}`: an operation enters `{}` with its code", circuit.unit.name),
                &format!("f_live & {own}"),
                &code,
                &format!("{own}_code"),
            );
        }
    }
}

/// A slot's bus has the result and the flags of the unit that delivers one, of the data memory or of the loader. Some units are known to
/// have zeros on their outputs in other cycles.
fn bus(plan: &Plan, slot: &SlotPlan, of: &mut Reference) {
    let (mut results, mut flags) = (Vec::new(), vec!["3'd0".to_owned()]);
    for circuit in &slot.circuits {
        let unit = &circuit.unit;
        let (valid, result, raised) = (slot.unit_valid(unit), slot.unit_result(unit), slot.unit_flags(unit));
        results.push(format!("({{32{{{valid}}}}} & {result})"));
        flags.push(format!("({{3{{{valid}}}}} & {raised})"));
        if circuit.clears {
            of.assumed.push(format!("({valid} | ({result} == 32'd0 & {raised} == 3'd0))"));
        }
    }
    results.extend(
        plan.port_of(slot).map(|port| {
            format!("({{32{{{}}}}} & {}[{} +: 32])", delivers(port), plan.load_result(), 32 * port)
        }),
    );
    results.push(format!("({{32{{{}}}}} & {})", slot.loaded(), net::LOADED_VALUE));
    let name = slot.name();
    let always = "1'b1";
    of.promise(
        format!("`{name}`: the bus has the results of its units, no others"),
        always,
        &slot.result().to_string(),
        &any(results),
    );
    of.promise(
        format!("`{name}`: a result has the flags of its unit"),
        always,
        &slot.flags().to_string(),
        &any(flags),
    );
}

/// A result for an output port is on the port in the cycle of its writeback.
fn outputs(plan: &Plan, slot: &SlotPlan, of: &mut Reference) {
    let bank = &slot.slot.bank;
    let first = bank.depth - plan.machine.outputs_per_bank;
    let write = plan.output_write(bank).to_string();
    let wanted = format!("{} & ({} >= {}'d{first})", booked(slot, 0), register(plan, slot, 0), plan.index);
    of.promise(
        format!(
            "`{}`: an output port is written in the cycle of the writeback, and in no other",
            slot.name()
        ),
        "f_live",
        &write,
        &wanted,
    );
    let index = format!("{}'d{first} + {}", plan.index, plan.output_index(bank));
    of.promise(
        format!("`{}`: a result for an output port goes to its port", slot.name()),
        &format!("f_live & {write}"),
        &index,
        &register(plan, slot, 0),
    );
    of.promise(
        format!("`{}`: an output port shows the result", slot.name()),
        &format!("f_live & {write}"),
        &plan.output_value(bank).to_string(),
        &slot.result().to_string(),
    );
}

/// What the sequencer reports of bundles that have issued, and does with those at fault.
fn sequencer(plan: &Plan, of: &mut Reference) {
    reports(plan, of);
    unreported(plan, of);
    redirections(plan, of);
    stops(plan, of);
}

/// Signals that report what has issued.
fn reports(plan: &Plan, of: &mut Reference) {
    let control = issued(plan.control());
    let ends = of.seen("sequencer.i_ends", "");
    let (wait, publish) = (control.effect(Effect::Wait), control.effect(Effect::Publish));
    let _ = writeln!(
        of.text,
        "
    // Issues of the last cycle, and of the one before.
    reg f_issued1, f_issued2, f_ended1, f_ended2, f_published1, f_published2;
    always @(posedge {clk}) begin
        {{f_issued1, f_ended1, f_published1}} <= {{f_issues, f_issues & {wait} & ~{ends}, f_issues & {publish} & ~{ends}}};
        {{f_issued2, f_ended2, f_published2}} <= {{f_issued1, f_ended1, f_published1}};
        if ({rst}) {{f_issued1, f_ended1, f_published1, f_issued2, f_ended2, f_published2}} <= 6'd0;
    end",
        clk = net::CLK,
        rst = net::RST
    );
    let signals = [
        (net::ISSUED, "f_issued2", "bundle"),
        (net::ENDED, "f_ended2", "`wait`"),
        (net::PUBLISHED, "f_published2 | f_ended2", "`publish` or `wait`"),
    ];
    for (signal, own, what) in signals {
        of.promise(
            format!("`{signal}` reports a {what} two cycles after its issue, and no other"),
            "f_live",
            &signal.to_string(),
            own,
        );
    }
    for (name, own) in [
        ("x_wait", "f_ended1"),
        ("was_wait", "f_ended2"),
        ("x_publish", "f_published1"),
        ("was_publish", "f_published2"),
    ] {
        let register = inner(of, "sequencer", name);
        of.equal(name, "f_live", &register, own);
    }
    of.equal("issued", "f_live", &net::X_ISSUED.to_string(), "f_issued1");
    of.equal("issued", "f_live", &net::WAS_ISSUED.to_string(), "f_issued2");
}

/// The sequencer's slot stores, too.
fn stores(plan: &Plan) -> bool {
    plan.memory().next().is_some_and(|slot| slot.number as usize == plan.control_slot)
}

/// Bundles at fault and after a fault, of which nothing is reported.
fn unreported(plan: &Plan, of: &mut Reference) {
    // A store in another slot than that at fault may take effect.
    let reports =
        [net::ISSUED, net::ENDED, net::PUBLISHED].into_iter().chain(stores(plan).then_some(net::STORED));
    of.promise(
        "no bundle at fault is reported, stores, publishes or ends a period, and none after it",
        &format!("~{} & {}", net::RST, net::FAULT),
        &any(reports.map(|signal| signal.to_string())),
        "1'b0",
    );
    of.never("nothing issues with an illegal bundle", &format!("~{} & f_refused & f_issued1", net::RST));
    of.never("only what issues stores", &format!("~{} & f_x_port0_stores & ~f_issued1", net::RST));
}

/// Operations in execute that redirect, or are at fault if they end a loop. An access in the sequencer's slot is none of them.
fn redirections(plan: &Plan, of: &mut Reference) {
    let control = issued(plan.control());
    let accesses =
        plan.port_of(plan.control()).map(|port| format!("(f_x_port{port}_stores | f_x_port{port}_loads)"));
    for (name, effect) in [("x_call", Effect::Call), ("x_return", Effect::Return), ("x_loop", Effect::Loop)] {
        let (register, own) = (inner(of, "sequencer", name), format!("f_{name}"));
        let _ = writeln!(
            of.text,
            "    reg {own};\n    always @(posedge {}) {own} <= f_issues & {};",
            net::CLK,
            control.effect(effect)
        );
        of.equal(name, "f_live", &register, &own);
    }
    let ends = of.seen("sequencer.i_ends", "");
    let nested = inner(of, "sequencer", "x_nested");
    let redirecting = EFFECTS.into_iter().filter(|effect| effect.redirects());
    let redirects = any(redirecting.map(|effect| control.effect(effect)));
    let _ = writeln!(
        of.text,
        "    reg f_nested;\n    always @(posedge {}) f_nested <= f_issues & {ends} & {redirects};",
        net::CLK
    );
    of.equal("x_nested", "f_live", &nested, "f_nested");
    for (accesses, own) in accesses.iter().flat_map(|accesses| {
        ["f_x_call", "f_x_return", "f_x_loop", "f_nested", "f_ended1"].map(|own| (accesses, own))
    }) {
        of.never("one operation of a slot", &format!("f_live & {own} & {accesses}"));
    }
}

/// Signals that say that the core stands still: as they are when a fault is reported, they stay.
fn stops(plan: &Plan, of: &mut Reference) {
    let (clk, rst, fault) = (net::CLK, net::RST, net::FAULT);
    let ends = of.seen("sequencer.i_ends", "");
    let _ = writeln!(
        of.text,
        "
    // Stops, as they were in the cycle before, and a halt in execute.
    reg f_was_waiting, f_was_halted, f_x_halt;
    always @(posedge {clk}) begin
        f_was_waiting <= {};
        f_was_halted  <= {};
        f_x_halt      <= f_issues & {} & ~{ends};
    end",
        net::WAITING,
        net::HALTED,
        issued(plan.control()).effect(Effect::Halt)
    );
    let register = inner(of, "sequencer", "x_halt");
    of.equal("x_halt", "f_live", &register, "f_x_halt");
    of.never(
        "a halt or a wait by itself",
        "f_live & (f_x_halt | f_ended1) & (f_nested | f_x_call | f_x_return | f_x_loop | f_x_refused)",
    );
    for (what, signal) in [("waits", net::WAITING), ("halts", net::HALTED)] {
        of.promise(
            format!("no bundle at fault {what}, and none after it"),
            &format!("~{rst} & {fault}"),
            &format!("{signal} & ~f_was_{signal}"),
            "1'b0",
        );
    }
}

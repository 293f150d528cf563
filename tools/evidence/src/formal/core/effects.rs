// SPDX-License-Identifier: MIT OR Apache-2.0
//! Effects of a bundle that issues: its operations enter their units, its loads and stores the data memory, its results the ports, each in
//! its cycle, and nothing else does.

use super::decoded::{Decoded, EFFECTS};
use super::invariants::inner;
use super::rules::{Reference, any, booked, register};
use std::fmt::Write as _;
use takt_isa::Effect;
use takt_isa::shape::Field;
use takt_rtl::plan::names::net;
use takt_rtl::plan::{Plan, SlotPlan, Stage};

/// Adds the properties to a reference.
pub(super) fn add(plan: &Plan, of: &mut Reference) {
    for slot in &plan.slots {
        units(slot, of);
        bus(plan, slot, of);
        outputs(plan, slot, of);
    }
    memory(plan, of);
    reports(plan, of);
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
    results.extend(plan.port_of(slot).map(|port| format!("{}[{} +: 32]", plan.load_result(), 32 * port)));
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

/// Loads and stores, whose addresses are the sum of the unsigned offset and the signed register.
fn memory(plan: &Plan, of: &mut Reference) {
    let clk = net::CLK;
    let field = |slot: &SlotPlan, field: Field| {
        let bits = field.bits();
        format!("{}[{} +: {}]", issued(slot).word(), bits.low, bits.width)
    };
    let mut faults = vec!["1'b0".to_owned(); plan.slots.len()];
    for (port, slot) in plan.memory().enumerate() {
        let (loads, stores) = (issued(slot).effect(Effect::Load), issued(slot).effect(Effect::Store));
        let offset = format!(
            "({stores} ? {{{}, {}}} : {})",
            field(slot, Field::OffsetHigh),
            field(slot, Field::OffsetLow),
            field(slot, Field::Offset)
        );
        let (base, own) = (slot.operand(0), format!("f_x_port{port}"));
        let _ = writeln!(
            of.text,
            "
    reg {own}_loads, {own}_stores;
    reg [15:0] {own}_offset;
    wire [33:0] {own}_address = {{18'd0, {own}_offset}} + {{{{2{{{base}[31]}}}}, {base}}};
    wire {own}_fault = ({own}_loads | {own}_stores) & ({own}_address[33] | {own}_address >= 34'd{depth});
    always @(posedge {clk}) begin
        {own}_loads  <= f_issues & {loads};
        {own}_stores <= f_issues & {stores};
        {own}_offset <= {offset};
    end",
            depth = plan.machine.data_depth
        );
        of.promise(
            format!("port {port} of the data memory loads in the cycle after an issue, and in no other"),
            "f_live",
            &format!("{}[{port}]", plan.x_load()),
            &format!("{own}_loads"),
        );
        let offset = format!("{}[{} +: 16]", plan.x_offset(), 16 * port);
        of.equal(
            "x_offset",
            &format!("f_live & ({own}_loads | {own}_stores)"),
            &offset,
            &format!("{own}_offset"),
        );
        faults[slot.number as usize] = format!("{own}_fault");
    }
    faults.reverse();
    of.promise(
        "an address outside of the data memory is a fault, and no other is",
        "f_live",
        &plan.x_address_fault().to_string(),
        &format!("{{{}}}", faults.join(", ")),
    );
    let value = plan.memory().next().map(|slot| slot.operand(1).to_string()).unwrap_or_default();
    let _ = writeln!(
        of.text,
        "    reg f_stored;
    reg [33:0] f_stored_address;
    reg [31:0] f_stored_value;
    always @(posedge {clk}) begin
        f_stored         <= f_x_port0_stores & ~{};
        f_stored_address <= f_x_port0_address;
        f_stored_value   <= {value};
    end",
        any(faults)
    );
    of.equal("x_store", "f_live", &net::X_STORE.to_string(), "f_x_port0_stores");
    of.promise(
        "a word is stored two cycles after the issue, and in no other cycle",
        "f_live",
        &net::STORED.to_string(),
        "f_stored",
    );
    of.promise(
        "a word is stored at its address",
        "f_live & f_stored",
        &format!("{{18'd0, {}}}", net::STORED_ADDRESS),
        "f_stored_address",
    );
    of.promise(
        "a word is stored with its value",
        "f_live & f_stored",
        &net::STORED_VALUE.to_string(),
        "f_stored_value",
    );
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
    after_fault(plan, of);
    // A store in another slot than that at fault may take effect.
    let store = plan.memory().next().is_some_and(|slot| slot.number as usize == plan.control_slot);
    let reports = [net::ISSUED, net::ENDED, net::PUBLISHED].into_iter().chain(store.then_some(net::STORED));
    of.promise(
        "no bundle at fault is reported, stores, publishes or ends a period, and none after it",
        &format!("~{} & {}", net::RST, net::FAULT),
        &any(reports.map(|signal| signal.to_string())),
        "1'b0",
    );
    for (name, effect) in [("x_call", Effect::Call), ("x_return", Effect::Return), ("x_loop", Effect::Loop)] {
        let (register, own) = (inner(of, "sequencer", name), format!("f_{name}"));
        let _ = writeln!(
            of.text,
            "    reg {own};\n    always @(posedge {}) {own} <= f_issues & {};",
            net::CLK,
            control.effect(effect)
        );
        of.equal(name, "f_live", &register, &own);
        if store {
            of.never(name, &format!("f_live & {own} & (f_x_port0_stores | f_x_port0_loads)"));
        }
    }
    of.never("nothing issues with an illegal bundle", &format!("~{} & f_refused & f_issued1", net::RST));
    of.never("only what issues stores", &format!("~{} & f_x_port0_stores & ~f_issued1", net::RST));
    let nested = inner(of, "sequencer", "x_nested");
    let redirecting = EFFECTS.into_iter().filter(|effect| effect.redirects());
    let redirects = any(redirecting.map(|effect| control.effect(effect)));
    let _ = writeln!(
        of.text,
        "    reg f_nested;\n    always @(posedge {}) f_nested <= f_issues & {ends} & {redirects};",
        net::CLK
    );
    of.equal("x_nested", "f_live", &nested, "f_nested");
    if store {
        of.never("x_nested", "f_live & f_nested & (f_x_port0_stores | f_x_port0_loads)");
    }
    of.equal("issued", "f_live", &net::X_ISSUED.to_string(), "f_issued1");
    of.equal("issued", "f_live", &net::WAS_ISSUED.to_string(), "f_issued2");
}

/// Signals that stay as they are when a fault is reported.
fn after_fault(plan: &Plan, of: &mut Reference) {
    let (clk, rst, fault) = (net::CLK, net::RST, net::FAULT);
    let _ = writeln!(
        of.text,
        "
    // Stops, as they were in the cycle before.
    reg f_was_waiting, f_was_halted;
    always @(posedge {clk}) begin f_was_waiting <= {}; f_was_halted <= {}; end",
        net::WAITING,
        net::HALTED
    );
    let ends = of.seen("sequencer.i_ends", "");
    let _ = writeln!(
        of.text,
        "    reg f_x_halt;\n    always @(posedge {clk}) f_x_halt <= f_issues & {} & ~{ends};",
        issued(plan.control()).effect(Effect::Halt)
    );
    let register = inner(of, "sequencer", "x_halt");
    of.equal("x_halt", "f_live", &register, "f_x_halt");
    of.never(
        "a halt by itself",
        "f_live & f_x_halt & (f_nested | f_x_call | f_x_return | f_x_loop | f_x_refused)",
    );
    let waits = format!("{} & ~f_was_waiting", net::WAITING);
    of.promise("no bundle after a fault waits", &format!("~{rst} & f_over"), &waits, "1'b0");
    let halts = format!("{} & ~f_was_halted", net::HALTED);
    of.promise("no bundle at fault halts, and none after it", &format!("~{rst} & {fault}"), &halts, "1'b0");
}

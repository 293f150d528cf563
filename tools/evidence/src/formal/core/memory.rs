// SPDX-License-Identifier: MIT OR Apache-2.0
//! The data memory: loads and stores enter it with their addresses, and a load delivers the last value that was stored at its address.
//!
//! The reference has one word, an arbitrary one, and so stands for all; the circuit's memory is reduced to the same word (`word.v`). A
//! store takes effect on the reference's word in the cycle after its issue, a cycle before it is on the pins of the memory's array.

use super::decoded::Decoded;
use super::rules::{Reference, any};
use std::fmt::Write as _;
use takt_isa::Effect;
use takt_isa::shape::Field;
use takt_rtl::plan::names::net;
use takt_rtl::plan::{Plan, SlotPlan, Stage};

/// Adds the word, the properties and their invariants to a reference.
pub(super) fn add(plan: &Plan, of: &mut Reference) {
    for (port, slot) in plan.memory().enumerate() {
        accesses(plan, port, slot, of);
    }
    faults(plan, of);
    stores(plan, of);
    word(plan, of);
    for port in 0..plan.ports() {
        loads(plan, port, of);
    }
}

/// Net of the reference: a load that issued four cycles ago delivers its word on a port.
pub(super) fn delivers(port: u32) -> String {
    format!("f_port{port}_loads4")
}

/// Condition: an address of any port is outside of the memory.
fn outside(plan: &Plan) -> String {
    any((0..plan.ports()).map(|port| format!("f_x_port{port}_fault")))
}

/// Loads and stores in execute, whose addresses are the sum of the unsigned offset and the signed register.
fn accesses(plan: &Plan, port: usize, slot: &SlotPlan, of: &mut Reference) {
    let issued = Decoded { slot, stage: Stage::Issue };
    let field = |field: Field| {
        let bits = field.bits();
        format!("{}[{} +: {}]", issued.word(), bits.low, bits.width)
    };
    let (loads, stores) = (issued.effect(Effect::Load), issued.effect(Effect::Store));
    let offset = format!(
        "({stores} ? {{{}, {}}} : {})",
        field(Field::OffsetHigh),
        field(Field::OffsetLow),
        field(Field::Offset)
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
        clk = net::CLK,
        depth = plan.machine.data_depth
    );
    of.promise(
        format!("port {port} of the data memory loads in the cycle after an issue, and in no other"),
        &format!("~{}", net::RST),
        &format!("{}[{port}]", plan.x_load()),
        &format!("{own}_loads & ~f_over"),
    );
    let offset = format!("{}[{} +: 16]", plan.x_offset(), 16 * port);
    of.equal(
        "x_offset",
        &format!("f_runs & ({own}_loads | {own}_stores)"),
        &offset,
        &format!("{own}_offset"),
    );
    of.never("one access of a slot", &format!("{own}_loads & {own}_stores"));
}

/// Addresses outside of the memory.
fn faults(plan: &Plan, of: &mut Reference) {
    let mut faults: Vec<String> = plan
        .slots
        .iter()
        .map(|slot| plan.port_of(slot).map_or("1'b0".to_owned(), |port| format!("f_x_port{port}_fault")))
        .collect();
    faults.reverse();
    of.promise(
        "an address outside of the data memory is a fault, and no other is",
        "f_runs",
        &plan.x_address_fault().to_string(),
        &format!("{{{}}}", faults.join(", ")),
    );
}

/// Stores, all of port 0.
fn stores(plan: &Plan, of: &mut Reference) {
    let value = plan.memory().next().map(|slot| slot.operand(1).to_string()).unwrap_or_default();
    let rst = net::RST;
    let _ = writeln!(
        of.text,
        "    reg f_stored;
    reg [33:0] f_stored_address;
    reg [31:0] f_stored_value;
    wire f_stores = f_x_port0_stores & ~{fault} & ~{rst} & ~{};
    always @(posedge {clk}) begin
        f_stored         <= f_stores;
        f_stored_address <= f_x_port0_address;
        f_stored_value   <= {value};
    end",
        outside(plan),
        clk = net::CLK,
        fault = net::FAULT,
    );
    of.equal("x_store", &format!("~{rst}"), &net::X_STORE.to_string(), "f_x_port0_stores & ~f_over");
    of.promise(
        "a word is stored two cycles after the issue, and in no other cycle",
        &format!("~{rst}"),
        &net::STORED.to_string(),
        "f_stored",
    );
    of.promise(
        "a word is stored at its address",
        &format!("~{rst} & f_stored"),
        &format!("{{18'd0, {}}}", net::STORED_ADDRESS),
        "f_stored_address",
    );
    of.promise(
        "a word is stored with its value",
        &format!("~{rst} & f_stored"),
        &net::STORED_VALUE.to_string(),
        "f_stored_value",
    );
}

/// Array of the data memory in the circuit.
fn array(plan: &Plan) -> String {
    format!("memory.{}", if plan.ports() == 1 { "g_one" } else { "g_two" })
}

/// The word that the reference looks at.
fn word(plan: &Plan, of: &mut Reference) {
    let words = format!("{}.words", array(plan));
    of.word(&words, "f_probe_data");
    let held = of.seen(&format!("{words}.word"), "[31:0]");
    let _ = writeln!(
        of.text,
        "
    // An arbitrary word of the data memory, as the bundle in execute finds it, and as the one before did; after a reset, what is there.
    wire [{last}:0] f_probe_data;
    reg  [31:0] f_word_data, f_was_word_data;
    always @(posedge {clk}) begin
        if (f_stores & (f_x_port0_address == {{{upper}'d0, f_probe_data}})) f_word_data <= {value};
        if ({rst}) f_word_data <= {held};
        f_was_word_data <= f_word_data;
    end",
        last = plan.data_bits - 1,
        upper = 34 - plan.data_bits,
        clk = net::CLK,
        rst = net::RST,
        value = plan.memory().next().map(|slot| slot.operand(1).to_string()).unwrap_or_default(),
    );
    of.equal("words", &format!("~{}", net::RST), &held, "f_was_word_data");
    of.equal(
        "f_word_data",
        &format!("~{}", net::RST),
        "f_word_data",
        &format!(
            "f_stored & (f_stored_address == {{{}'d0, f_probe_data}}) ? f_stored_value : f_was_word_data",
            34 - plan.data_bits
        ),
    );
}

/// Loads of a port. `loads2` to `loads4`: one issued so many cycles ago; `hits2` to `hits4`: one of the word that is looked at.
fn loads(plan: &Plan, port: u32, of: &mut Reference) {
    let (own, clk, rst) = (format!("f_port{port}"), net::CLK, net::RST);
    let _ = writeln!(
        of.text,
        "    reg {own}_loads2, {own}_loads3, {own}_loads4, {own}_hits2, {own}_hits3, {own}_hits4;
    reg [31:0] {own}_wanted3, {own}_wanted4;
    always @(posedge {clk}) begin
        {own}_loads2  <= f_x_port{port}_loads & ~f_over & ~f_x_port{port}_fault & ~{rst};
        {own}_hits2  <= f_x_port{port}_address == {{{upper}'d0, f_probe_data}};
        {{{own}_loads3, {own}_hits3, {own}_wanted3}} <= {{{own}_loads2, {own}_hits2, f_was_word_data}};
        {{{own}_loads4, {own}_hits4, {own}_wanted4}} <= {{{own}_loads3, {own}_hits3, {own}_wanted3}};
    end",
        upper = 34 - plan.data_bits,
    );
    let (always, value) = ("1'b1", format!("{}[{} +: 32]", plan.load_result(), 32 * port));
    of.promise(
        format!("port {port} of the data memory delivers four cycles after the issue of a load, and in no other cycle"),
        always,
        &format!("{}[{port}]", plan.load_valid()),
        &delivers(port),
    );
    of.promise(
        format!("port {port} of the data memory has 0 where no load delivers"),
        &format!("~{}", delivers(port)),
        &value,
        "32'd0",
    );
    of.promise(
        format!("port {port} of the data memory delivers the last value stored at the address of the load"),
        &format!("~{rst} & {} & {own}_hits4", delivers(port)),
        &value,
        &format!("{own}_wanted4"),
    );
    for (name, age) in [("loading", 2), ("delivers", 3)] {
        let register = of.seen(&format!("memory.{name}"), &format!("[{}:0]", plan.ports() - 1));
        of.equal(name, always, &format!("{register}[{port}]"), &format!("{own}_loads{age}"));
    }
    let array = array(plan);
    let address = if port == 0 {
        plan.memory_address().to_string()
    } else {
        of.seen(&format!("{array}.other"), &format!("[{}:0]", plan.data_bits - 1))
    };
    let read = of.seen(&format!("{array}.read"), "[31:0]");
    let read = if port == 0 {
        read
    } else {
        let same = of.seen(&format!("{array}.same"), "");
        let second = of.seen(&format!("{array}.second"), "[31:0]");
        format!("({same} ? {read} : {second})")
    };
    of.equal(
        "address",
        &format!("~{rst} & {own}_loads2"),
        &format!("{address} == f_probe_data"),
        &format!("{own}_hits2"),
    );
    of.equal("read", &format!("~{rst} & {own}_loads3 & {own}_hits3"), &read, &format!("{own}_wanted3"));
    if port == 0 {
        of.never("one access of a port", &format!("{own}_loads2 & f_stored"));
    }
}
